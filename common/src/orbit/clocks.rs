//! Interpolation of satellite clocks from RINEX clock files.

use std::collections::BTreeMap;

use super::records::{ClockFile, ClockRecord};
use crate::gnss::SatelliteId;
use crate::time::GpsTime;

/// Maximum gap of the interpolation in intervals of the file (two missing records).
const MAX_GAP_INTERVALS: f64 = 3.0;
/// Maximum gap of the interpolation, s. A rubidium clock varies by a few centimetres in a quarter of an hour.
const MAX_GAP_S: f64 = 900.0;
/// Tolerance of the maximum gap, s, because times are in nanoseconds.
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
    /// Clocks by satellite, in order of time.
    satellites: BTreeMap<SatelliteId, Vec<Node>>,
    span: Option<(GpsTime, GpsTime)>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    time: GpsTime,
    offset_s: f64,
    /// Maximum time from the previous node, s.
    max_gap_s: f64,
}

impl Clocks {
    /// Adds files. Where they overlap, the one with the earliest start is used, and of those the first.
    pub(super) fn add(&mut self, mut files: Vec<ClockFile>) {
        files.sort_by_key(|file| file.records.first().map(|record| record.time));
        for file in files {
            let max_gap_s = (MAX_GAP_INTERVALS * file.interval_s).min(MAX_GAP_S);
            for ClockRecord { satellite, time, clock_s } in file.records {
                let (first, last) = self.span.unwrap_or((time, time));
                self.span = Some((first.min(time), last.max(time)));
                let nodes = self.satellites.entry(satellite).or_default();
                if nodes.last().is_none_or(|last| last.time < time) {
                    nodes.push(Node { time, offset_s: clock_s, max_gap_s });
                }
            }
        }
    }

    /// Clock of a satellite, linear between neighbouring records; `None` outside the records and in gaps of more than three
    /// intervals or 15 minutes.
    pub(super) fn state(&self, satellite: SatelliteId, time: GpsTime) -> Option<ClockState> {
        let nodes = self.satellites.get(&satellite)?;
        let right = nodes.partition_point(|node| node.time < time);
        let at = |index: usize| between(nodes.get(index.checked_sub(1)?)?, nodes.get(index)?);
        let (node, drift_sps) = match nodes.get(right)? {
            // At a record without a usable interval before it, the interval after it is used.
            node if node.time == time => (node, at(right).or_else(|| at(right + 1))?),
            node => (node, at(right)?),
        };
        let offset_s = node.offset_s + drift_sps * (time - node.time);
        Some(ClockState { offset_s, drift_sps })
    }

    /// First and last record of all satellites.
    pub(super) const fn span(&self) -> Option<(GpsTime, GpsTime)> {
        self.span
    }
}

/// Drift between neighbours, s/s; `None` if they are too far apart.
fn between(a: &Node, b: &Node) -> Option<f64> {
    let gap_s = b.time - a.time;
    (gap_s <= b.max_gap_s + TOLERANCE_S).then(|| (b.offset_s - a.offset_s) / gap_s)
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
