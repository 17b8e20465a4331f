//! Runs [`cofix_fuzz::rtcm_stream`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::rtcm_stream(bytes));
