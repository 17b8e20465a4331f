//! Helpers that the hub's unit tests share.

use std::path::Path;

use cofix_common::integrity::{RaimReport, Verdict};
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;

/// A message without observations and solutions, with this verdict.
pub(crate) fn judged(phone: &str, time_gps: GpsTime, verdict: Verdict) -> EpochMessage {
    EpochMessage {
        phone: phone.to_owned(),
        sequence: 0,
        time_gps,
        observations: Vec::new(),
        changes_since_gps: None,
        wls: None,
        local: None,
        local_integrity: None,
        raim: RaimReport::of(verdict),
    }
}

/// An unchecked message without observations and solutions, of this number in its run.
pub(crate) fn numbered(phone: &str, sequence: u64, time_gps: GpsTime) -> EpochMessage {
    EpochMessage { sequence, ..judged(phone, time_gps, Verdict::CannotBeChecked) }
}

/// The names of what is in a folder, in order.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
