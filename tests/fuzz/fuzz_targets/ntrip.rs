//! Runs [`cofix_fuzz::ntrip`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::ntrip(bytes));
