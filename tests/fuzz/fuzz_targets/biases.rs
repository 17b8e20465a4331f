//! Runs [`cofix_fuzz::biases`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::biases(bytes));
