//! What every parser must do with any bytes, as functions that panic when it does not.
//!
//! `cargo fuzz` runs each of them guided by coverage, and `cargo test` runs them on the seeds and on mutations of the seeds,
//! whose number is bounded and whose randomness is seeded. Seeds are in `seeds/<target>/`; they were written by hand or by our own writers.
//!
//! ```text
//! cargo install cargo-fuzz --locked
//! cargo fuzz run --fuzz-dir tests/fuzz --sanitizer none --no-default-features --features libfuzzer \
//!     navigation tests/fuzz/corpus/navigation tests/fuzz/seeds/navigation -- -max_total_time=60
//! ```
//!
//! No nightly compiler is needed. The targets `stream` and `ntrip` need `--features libfuzzer,agent`.

#![allow(clippy::missing_panics_doc)] // panics are how it says what is wrong

#[cfg(feature = "agent")]
mod casters;
mod checks;
#[path = "../../../common/tests/file_records/mod.rs"]
mod file_records;
mod files;
mod messages;
pub mod mutation;
mod navbits;
mod portions;
mod products;
mod round_trip;
mod streams;

pub use files::{gzip, navigation, sp3, truth};
pub use messages::{rtcm_messages, wire};
pub use navbits::navbits;
pub use products::{biases, clocks, ionex};
pub use streams::{challenge_table, compact_rinex, gnsslogger, observations, rtcm_stream, spare_log};

#[cfg(feature = "agent")]
pub use casters::ntrip;
#[cfg(feature = "agent")]
pub use streams::stream;

/// A function to run on bytes, and its name.
pub type Target = (&'static str, fn(&[u8]));

/// All of them.
pub const TARGETS: &[Target] = &[
    ("observations", observations),
    ("compact_rinex", compact_rinex),
    ("navigation", navigation),
    ("sp3", sp3),
    ("clocks", clocks),
    ("biases", biases),
    ("ionex", ionex),
    ("gnsslogger", gnsslogger),
    ("navbits", navbits),
    ("rtcm_stream", rtcm_stream),
    ("rtcm_messages", rtcm_messages),
    ("challenge_table", challenge_table),
    ("spare_log", spare_log),
    ("truth", truth),
    ("gzip", gzip),
    ("wire", wire),
    #[cfg(feature = "agent")]
    ("stream", stream),
    #[cfg(feature = "agent")]
    ("ntrip", ntrip),
];
