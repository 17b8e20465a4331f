//! Runs [`cofix_fuzz::compact_rinex`].

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cofix_fuzz::compact_rinex(bytes));
