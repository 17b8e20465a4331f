//! Runs [`cofix_fuzz::clocks`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::clocks(bytes));
