//! Runs [`cofix_fuzz::observations`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::observations(bytes));
