//! Runs [`cofix_fuzz::truth`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::truth(bytes));
