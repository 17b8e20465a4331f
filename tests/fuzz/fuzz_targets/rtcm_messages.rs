//! Runs [`cofix_fuzz::rtcm_messages`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::rtcm_messages(bytes));
