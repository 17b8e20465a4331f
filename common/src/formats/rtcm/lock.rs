//! Lock-time indicators to loss of lock.

use std::collections::BTreeMap;

use crate::formats::lost_locks::{LostLocks, SignalKey};
use crate::time::GpsTime;

/// The highest indicator of DF407 that has a meaning.
const LAST_EXTENDED: u32 = 704;
/// DF013: the highest indicator says at least this, s.
const LAST_WHOLE_SECONDS: f64 = 937.0;

/// How long a phase has been tracked without interruption: at least `least_ms` and less than `below_ms`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LockTime {
    least_ms: f64,
    below_ms: f64,
}

impl LockTime {
    /// From DF402 (MSM4, MSM5), 0-15: doubling from 32 ms.
    pub(super) fn coarse(indicator: u32) -> Self {
        let least = |i: u32| match i {
            0 => 0.0,
            16.. => f64::INFINITY,
            i => f64::from(1_u32 << (i + 4)),
        };
        Self { least_ms: least(indicator), below_ms: least(indicator + 1) }
    }

    /// From DF013 and its kind (legacy messages), 0-127: whole seconds first, of which the steps double from 24 on.
    pub(super) fn whole_seconds(indicator: u32) -> Self {
        let least_s = |i: u32| match i {
            0..24 => f64::from(i),
            24..48 => f64::from(2 * i - 24),
            48..72 => f64::from(4 * i - 120),
            72..96 => f64::from(8 * i - 408),
            96..120 => f64::from(16 * i - 1_176),
            120..127 => f64::from(32 * i - 3_096),
            127 => LAST_WHOLE_SECONDS,
            _ => f64::INFINITY,
        };
        Self { least_ms: least_s(indicator) * 1e3, below_ms: least_s(indicator + 1) * 1e3 }
    }

    /// From DF407 (MSM6, MSM7), 0-704: whole milliseconds first, coarser by a factor of two every 32 steps from 64 on.
    /// Reserved indicators count as no lock.
    pub(super) fn fine(indicator: u32) -> Self {
        let least = |i: u32| match i {
            0..64 => f64::from(i),
            64..=LAST_EXTENDED => {
                let k = i / 32 - 1;
                f64::from(1_u32 << k) * f64::from(i - 32 * k)
            }
            _ => f64::INFINITY,
        };
        let indicator = if indicator > LAST_EXTENDED { 0 } else { indicator };
        Self { least_ms: least(indicator), below_ms: least(indicator + 1) }
    }
}

/// The lock times that were seen last.
#[derive(Clone, Debug, Default)]
pub(super) struct LockTimes {
    last: BTreeMap<SignalKey, (GpsTime, LockTime)>,
    lost: LostLocks,
}

impl LockTimes {
    /// Takes a lock time, and says for an observation with a phase whether the lock was certainly lost since the signal's
    /// last one with a phase: the time has become shorter, or is shorter than it would be had the lock held.
    pub(super) fn lost(&mut self, signal: SignalKey, time: GpsTime, lock: LockTime, has_phase: bool) -> bool {
        // A first lock time is held against itself.
        let last = self.last.entry(signal).or_insert((time, lock));
        let (before, held) = std::mem::replace(last, (time, lock));
        let held_ms = held.least_ms + (time - before) * 1e3;
        let is_lost = lock.least_ms < held.least_ms || lock.below_ms <= held_ms;
        self.lost.observe(signal, is_lost, has_phase)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::{Constellation, SatelliteId, SignalCode};

    #[test]
    fn indicators_follow_the_tables() {
        let bounds = |lock: LockTime| (lock.least_ms, lock.below_ms);
        assert_eq!(bounds(LockTime::coarse(0)), (0.0, 32.0));
        assert_eq!(bounds(LockTime::coarse(1)), (32.0, 64.0));
        assert_eq!(bounds(LockTime::coarse(15)), (524_288.0, f64::INFINITY));
        // RTCM 10403.3, table of DF407
        for (indicator, least) in [
            (0, 0.0),
            (63, 63.0),
            (64, 64.0),
            (95, 126.0),
            (96, 128.0),
            (128, 256.0),
            (351, 32_256.0),
            (704, 67_108_864.0),
        ] {
            assert_eq!(LockTime::fine(indicator).least_ms, least, "{indicator}");
        }
        assert_eq!(bounds(LockTime::fine(1_000)), (0.0, 1.0));
        // RTCM 10403.3, table of DF013
        for (indicator, least_s, below_s) in [
            (0, 0.0, 1.0),
            (23, 23.0, 24.0),
            (24, 24.0, 26.0),
            (47, 70.0, 72.0),
            (48, 72.0, 76.0),
            (72, 168.0, 176.0),
            (96, 360.0, 376.0),
            (119, 728.0, 744.0),
            (120, 744.0, 776.0),
            (126, 936.0, 937.0),
            (127, 937.0, f64::INFINITY),
        ] {
            let expected = (least_s * 1e3, below_s * 1e3);
            assert_eq!(bounds(LockTime::whole_seconds(indicator)), expected, "{indicator}");
        }
        for indicator in 0..LAST_EXTENDED {
            assert!(LockTime::fine(indicator).least_ms < LockTime::fine(indicator).below_ms);
        }
    }

    #[test]
    fn a_lock_that_is_too_young_was_lost() {
        let of = (SatelliteId::new(Constellation::Gps, 7), SignalCode::new(b'1', b'C'));
        let start = GpsTime::from_week_tow(2118, 0.0);
        let mut locks = LockTimes::default();
        let mut lost = |seconds: f64, indicator: u32| {
            locks.lost(of, start + seconds, LockTime::coarse(indicator), indicator != 9)
        };
        assert!(!lost(0.0, 0), "nothing to compare with");
        assert!(lost(1.0, 0), "below 32 ms after a second");
        assert!(!lost(2.0, 5), "at least 512 ms, fits");
        assert!(lost(3.0, 5), "below 1024 ms, but must have been 1512");
        assert!(!lost(4.0, 6));
        assert!(!lost(5.0, 6));
        assert!(lost(6.0, 5), "shorter");
        assert!(!lost(605.0, 9), "grown by too little, but without a phase");
        assert!(lost(606.0, 15), "told with the next phase");
        assert!(!lost(900.0, 15), "long enough for any gap that it can express");
    }
}
