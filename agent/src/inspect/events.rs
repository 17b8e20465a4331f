//! Events between epochs: how many of which kind, and the first ones.

use std::collections::BTreeMap;

use cofix_common::gnss::Event;
use cofix_common::time::GpsTime;
use serde::Serialize;

use super::LISTED;

/// An event.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EventReport {
    /// Its kind.
    pub kind: String,
    /// Its time, GPS time, where it is stated.
    pub at_gps: Option<String>,
    /// The epoch before it, GPS time.
    pub after_gps: Option<String>,
    /// Lines that belong to it,
    pub lines: usize,
    /// and the first of them, its blanks drawn together.
    pub first_line: Option<String>,
    /// Repaired cycle slips.
    pub slips: usize,
}

/// Events of a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Events {
    /// How many.
    pub count: u64,
    /// How many of each kind.
    pub by_kind: BTreeMap<String, u64>,
    /// The first ones.
    pub first: Vec<EventReport>,
}

impl Events {
    pub(super) fn add(&mut self, event: &Event, after: Option<GpsTime>) {
        self.count += 1;
        *self.by_kind.entry(event.kind.to_string()).or_default() += 1;
        if self.first.len() < LISTED {
            self.first.push(EventReport {
                kind: event.kind.to_string(),
                at_gps: event.time_gps.map(GpsTime::iso),
                after_gps: after.map(GpsTime::iso),
                lines: event.lines.len(),
                first_line: event
                    .lines
                    .first()
                    .map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")),
                slips: event.slips.len(),
            });
        }
    }
}
