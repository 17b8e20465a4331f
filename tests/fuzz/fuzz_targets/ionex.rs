//! Runs [`cofix_fuzz::ionex`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::ionex(bytes));
