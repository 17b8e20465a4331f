//! Recordings of the fusion hub: a summary in text, and the Rerun viewer.

mod error;
pub mod integrity;
pub mod open;
mod read;
pub mod summary;

/// The Rerun release whose viewer fits our recordings.
pub const RERUN_VERSION: &str = "0.36.3";
