//! Time of reception of an epoch: its time tag less the offset of the receiver's clock.
//!
//! A receiver tags an epoch by its own clock, and the offset of that clock is in all pseudoranges of the epoch. The satellites' positions
//! do not depend on it, since they are computed for tag − P/c; the receiver's position is that at tag − offset. At 15 m/s an offset of 0.4 s
//! that stays in the time is an error of 6 m.

use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;

/// Maximum offset that is believed, s. Receivers keep their clocks within a millisecond of GPS time, and simple ones within half a second.
const LARGEST_OFFSET_S: f64 = 1.0;
/// Minimum time between two epochs as a part of the time between their tags. It bounds the effect of a change of the offset, so that the
/// times of a phone always increase.
const LEAST_STEP: f64 = 0.5;

/// Times of reception of one phone's epochs.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ReceiveTimes {
    /// Last known offset of the receiver's clock, s; 0 until one is known. Between two solutions a phone's clock drifts by microseconds and
    /// is stepped by milliseconds, so the last known offset is nearer to the truth than none.
    offset_s: f64,
    last: Option<TimedEpoch>,
}

#[derive(Clone, Copy, Debug)]
struct TimedEpoch {
    tag_gps: GpsTime,
    time_gps: GpsTime,
}

impl ReceiveTimes {
    /// Time of reception of the epoch tagged `tag_gps`. `clock_m` is the receiver's clock by this epoch's solution (m), if it has one that
    /// may be relied on; otherwise the last known offset is used.
    pub fn next(&mut self, tag_gps: GpsTime, clock_m: Option<f64>, skips: &mut Skips) -> GpsTime {
        if let Some(offset_s) = clock_m.map(|clock_m| clock_m / SPEED_OF_LIGHT_MPS) {
            if offset_s.abs() <= LARGEST_OFFSET_S {
                self.offset_s = offset_s;
            } else {
                skips.add(Reason::ReceiverClockImpossible, || format!("{offset_s:.3} s at {tag_gps}"));
            }
        }
        let time_gps = self.after_the_last(tag_gps, tag_gps - self.offset_s, skips);
        self.last = Some(TimedEpoch { tag_gps, time_gps });
        time_gps
    }

    /// The time `time_gps`, or a later one if it is too near the previous epoch.
    fn after_the_last(&self, tag_gps: GpsTime, time_gps: GpsTime, skips: &mut Skips) -> GpsTime {
        // Tags that go back are a recording that starts anew.
        let Some(last) = self.last.filter(|last| last.tag_gps < tag_gps) else { return time_gps };
        let earliest = last.time_gps + LEAST_STEP * (tag_gps - last.tag_gps);
        if time_gps < earliest {
            skips.add(Reason::EpochTimeLimited, || {
                format!("tag {tag_gps}, clock {:.6} s, the epoch before at {}", self.offset_s, last.time_gps)
            });
        }
        time_gps.max(earliest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: f64 = 1_000.0;

    fn at(second: f64) -> GpsTime {
        GpsTime::from_week_tow(2409, START + second)
    }

    /// Seconds after the start of the epochs with the given tags (s) and offsets (s), and the counts.
    fn times(epochs: &[(f64, Option<f64>)]) -> (Vec<f64>, Skips) {
        let (mut times, mut skips) = (ReceiveTimes::default(), Skips::default());
        let mut next = |(tag_s, offset_s): &(f64, Option<f64>)| {
            let clock_m = offset_s.map(|offset_s| offset_s * SPEED_OF_LIGHT_MPS);
            times.next(at(*tag_s), clock_m, &mut skips) - at(0.0)
        };
        (epochs.iter().map(&mut next).collect(), skips)
    }

    #[test]
    fn the_offset_is_taken_off_the_tag_and_holds_without_a_solution() {
        let (times, skips) = times(&[(0.0, None), (1.0, Some(0.25)), (2.0, None), (3.0, Some(-0.02))]);
        assert_eq!(times, [0.0, 0.75, 1.75, 3.02]);
        assert!(skips.is_empty(), "{skips}");
    }

    #[test]
    fn an_impossible_offset_is_counted_and_changes_nothing() {
        let (times, skips) = times(&[(0.0, Some(1.001)), (1.0, Some(0.25)), (2.0, Some(-1.5))]);
        assert_eq!(times, [0.0, 0.75, 1.75]);
        assert_eq!(skips.count(Reason::ReceiverClockImpossible), 2);
    }

    #[test]
    fn times_increase_by_half_a_step_until_the_offset_is_reached() {
        let epochs: Vec<_> = (0..6).map(|k| (0.25 * f64::from(k), (k > 0).then_some(0.5))).collect();
        let (times, skips) = times(&epochs);
        assert_eq!(times, [0.0, 0.125, 0.25, 0.375, 0.5, 0.75]);
        assert_eq!(skips.count(Reason::EpochTimeLimited), 3);
    }

    #[test]
    fn tags_that_go_back_start_anew() {
        let (times, skips) = times(&[(10.0, Some(0.25)), (2.0, Some(0.25))]);
        assert_eq!(times, [9.75, 1.75]);
        assert!(skips.is_empty(), "{skips}");
    }
}
