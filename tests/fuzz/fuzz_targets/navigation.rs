//! Runs [`cofix_fuzz::navigation`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::navigation(bytes));
