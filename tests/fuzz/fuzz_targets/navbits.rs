//! Runs [`cofix_fuzz::navbits`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::navbits(bytes));
