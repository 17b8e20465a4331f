//! Runs [`cofix_fuzz::spare_log`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::spare_log(bytes));
