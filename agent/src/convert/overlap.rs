//! Recordings that overlap in time: the first of two records of the same time counts.

use std::path::Path;

use cofix_common::formats::decode::Record;
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;

/// A recording against those before it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Overlap {
    /// The last epoch of the recordings before it.
    before: Option<GpsTime>,
    /// Whether the last epoch lies in the overlap.
    is_inside: bool,
}

impl Overlap {
    /// At the beginning of a recording.
    pub(super) const fn new(before: Option<GpsTime>) -> Self {
        Self { before, is_inside: false }
    }

    /// Why a record is left out, if it is. An event goes with the epoch before it.
    pub(super) fn leaves_out(&mut self, record: &Record) -> Option<Reason> {
        let before = self.before?;
        match record {
            Record::Epoch(epoch) => {
                self.is_inside = epoch.time_gps <= before;
                self.is_inside.then_some(Reason::EpochOfFilesBefore)
            }
            Record::Event(event) => (self.is_inside || event.time_gps.is_some_and(|time| time <= before))
                .then_some(Reason::EventOfFilesBefore),
            Record::Ephemeris(_) | Record::Glonass(_) => None,
        }
    }
}

/// A description of the record, for messages.
pub(super) fn describe(record: &Record, file: &Path) -> String {
    let (what, time) = match record {
        Record::Epoch(epoch) => ("epoch".to_owned(), Some(epoch.time_gps)),
        Record::Event(event) => (event.kind.to_string(), event.time_gps),
        Record::Ephemeris(_) | Record::Glonass(_) => ("ephemeris".to_owned(), None),
    };
    let at = time.map(|time| format!(" at {time}")).unwrap_or_default();
    format!("{what}{at} of {}", file.display())
}
