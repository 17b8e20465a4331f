//! Satellite clocks of RINEX clock files, between their records.

use std::collections::BTreeMap;

use super::clock_file::{ClockFile, ClockRecord};
use crate::gnss::SatelliteId;
use crate::time::GpsTime;

/// Interpolation bridges this many intervals of the file (two missing records) …
const MAX_GAP_INTERVALS: f64 = 3.0;
/// … and at most this time, s. A rubidium clock strays by a few centimetres in a quarter of an hour.
const MAX_GAP_S: f64 = 900.0;
/// Times are in nanoseconds; a gap may exceed its limit by this, s.
const TOLERANCE_S: f64 = 1e-3;

/// Clock offset and drift at an instant, without the periodic relativistic term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ClockState {
    /// Offset, s.
    pub(super) offset_s: f64,
    /// Drift, s/s.
    pub(super) drift_sps: f64,
}

/// The clocks of all satellites.
#[derive(Clone, Debug, Default)]
pub(super) struct Clocks {
    satellites: BTreeMap<SatelliteId, Vec<Run>>,
    span: Option<(GpsTime, GpsTime)>,
}

/// Records between any two neighbours of which it is interpolated.
#[derive(Clone, Debug, Default)]
struct Run(Vec<Node>);

#[derive(Clone, Copy, Debug)]
struct Node {
    time: GpsTime,
    offset_s: f64,
}

impl Clocks {
    /// Adds files. Where they overlap, the one that begins first holds, and of those the one named first.
    pub(super) fn add(&mut self, mut files: Vec<ClockFile>) {
        files.sort_by_key(|file| file.records.first().map(|record| record.time));
        for file in files {
            let limit_s = (MAX_GAP_INTERVALS * file.interval_s).min(MAX_GAP_S);
            for record in &file.records {
                self.push(record, limit_s);
            }
        }
    }

    fn push(&mut self, record: &ClockRecord, limit_s: f64) {
        let (first, last) = self.span.unwrap_or((record.time, record.time));
        self.span = Some((first.min(record.time), last.max(record.time)));
        let runs = self.satellites.entry(record.satellite).or_default();
        if runs.iter().any(|run| run.covers(record.time)) {
            return;
        }
        let node = Node { time: record.time, offset_s: record.clock_s };
        match runs.iter_mut().rev().find(|run| run.continues(record.time, limit_s)) {
            Some(run) => run.0.push(node),
            None => runs.push(Run(vec![node])),
        }
    }

    /// The clock of a satellite, linear between neighbouring records; `None` outside the records and in gaps of more than three
    /// intervals or 15 minutes.
    pub(super) fn state(&self, satellite: SatelliteId, time: GpsTime) -> Option<ClockState> {
        self.satellites.get(&satellite)?.iter().find_map(|run| run.state(time))
    }

    /// First and last record of any satellite.
    pub(super) const fn span(&self) -> Option<(GpsTime, GpsTime)> {
        self.span
    }
}

impl Run {
    fn last(&self) -> Option<GpsTime> {
        self.0.last().map(|node| node.time)
    }

    fn covers(&self, time: GpsTime) -> bool {
        self.0.first().is_some_and(|node| node.time <= time) && self.last().is_some_and(|last| time <= last)
    }

    fn continues(&self, time: GpsTime, limit_s: f64) -> bool {
        self.last().is_some_and(|last| last < time && time - last <= limit_s + TOLERANCE_S)
    }

    fn state(&self, time: GpsTime) -> Option<ClockState> {
        if !self.covers(time) {
            return None;
        }
        // The node at or after `time`, but never the first: at its own time the second one serves.
        let right = self.0.partition_point(|node| node.time < time).max(1);
        let (a, b) = (self.0.get(right - 1)?, self.0.get(right)?);
        let drift_sps = (b.offset_s - a.offset_s) / (b.time - a.time);
        Some(ClockState { offset_s: a.offset_s + drift_sps * (time - a.time), drift_sps })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skips::Skips;

    fn file(start: GpsTime, interval_s: f64, at: &[(u32, f64)]) -> ClockFile {
        let satellite: SatelliteId = "G01".parse().unwrap();
        let records = at
            .iter()
            .map(|(n, clock_s)| ClockRecord {
                satellite,
                time: start + interval_s * f64::from(*n),
                clock_s: *clock_s,
            })
            .collect();
        ClockFile { interval_s, records, skips: Skips::default() }
    }

    fn offset(clocks: &Clocks, time: GpsTime) -> Option<f64> {
        clocks.state("G01".parse().unwrap(), time).map(|state| state.offset_s)
    }

    #[test]
    fn clocks_are_linear_between_records_and_end_with_them() {
        let start = GpsTime::from_week_tow(2_000, 0.0);
        let mut clocks = Clocks::default();
        clocks.add(vec![file(start, 30.0, &[(0, 1e-6), (1, 4e-6), (2, 4e-6)])]);
        assert_eq!(offset(&clocks, start), Some(1e-6));
        assert!((offset(&clocks, start + 10.0).unwrap() - 2e-6).abs() < 1e-18);
        assert_eq!(offset(&clocks, start + 60.0), Some(4e-6));
        let drift = clocks.state("G01".parse().unwrap(), start + 10.0).unwrap().drift_sps;
        assert!((drift - 1e-7).abs() < 1e-18);
        assert_eq!(offset(&clocks, start - 1e-9), None);
        assert_eq!(offset(&clocks, start + 60.000_000_001), None);
        assert_eq!(clocks.state("G02".parse().unwrap(), start), None);
        assert_eq!(clocks.span(), Some((start, start + 60.0)));
    }

    #[test]
    fn gaps_are_bridged_up_to_three_intervals() {
        let start = GpsTime::from_week_tow(2_000, 0.0);
        let mut clocks = Clocks::default();
        clocks.add(vec![file(start, 30.0, &[(0, 0.0), (3, 3e-6), (7, 0.0), (8, 0.0)])]);
        assert!((offset(&clocks, start + 30.0).unwrap() - 1e-6).abs() < 1e-18);
        assert_eq!(offset(&clocks, start + 100.0), None);
        assert_eq!(offset(&clocks, start + 211.0), Some(0.0));
        let mut slow = Clocks::default();
        slow.add(vec![file(start, 600.0, &[(0, 0.0), (1, 0.0), (3, 0.0)])]);
        assert_eq!(offset(&slow, start + 300.0), Some(0.0));
        assert_eq!(offset(&slow, start + 700.0), None, "20 minutes are too long");
    }

    #[test]
    fn days_join_and_the_earlier_file_holds() {
        let start = GpsTime::from_week_tow(2_000, 0.0);
        let first = file(start, 30.0, &[(0, 1e-6), (1, 1e-6)]);
        let second = file(start + 30.0, 30.0, &[(0, 9e-6), (1, 3e-6)]);
        let mut clocks = Clocks::default();
        clocks.add(vec![second, first]);
        assert_eq!(offset(&clocks, start + 30.0), Some(1e-6));
        assert!((offset(&clocks, start + 45.0).unwrap() - 2e-6).abs() < 1e-18);
    }
}
