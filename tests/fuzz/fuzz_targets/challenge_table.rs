//! Runs [`cofix_fuzz::challenge_table`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::challenge_table(bytes));
