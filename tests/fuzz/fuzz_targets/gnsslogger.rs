//! Runs [`cofix_fuzz::gnsslogger`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::gnsslogger(bytes));
