//! Runs [`cofix_fuzz::stream`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::stream(bytes));
