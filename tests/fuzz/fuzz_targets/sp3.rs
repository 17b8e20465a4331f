//! Runs [`cofix_fuzz::sp3`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::sp3(bytes));
