//! Runs [`cofix_fuzz::gzip`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::gzip(bytes));
