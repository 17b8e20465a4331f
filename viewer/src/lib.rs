//! Looking at what a fusion hub recorded: a summary in text, and the Rerun viewer.

pub mod open;
mod read;
pub mod summary;

/// The application id of recordings that are ours.
pub const APPLICATION_ID: &str = "cofix";
/// The timeline of our recordings: GPS time, shown as if it were UTC.
pub const TIMELINE: &str = "gps_time";
/// How the text in place of the accuracy table begins when a session did not come to its end.
pub const INCOMPLETE: &str = "Incomplete";
/// The Rerun release whose viewer fits our recordings.
pub const RERUN_VERSION: &str = "0.36.3";
