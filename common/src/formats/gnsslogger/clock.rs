//! The phone's clock as GPS time.

use super::options::BiasReference;
use super::pseudorange::ReceiveTime;
use super::raw::ClockFields;
use crate::time::{GpsTime, WEEKS_PER_ROLLOVER};

/// Phones log raw measurements since 2016; the clocks of these years are believed (2010 to 2100), as GPS nanoseconds.
pub(super) const PLAUSIBLE_NS: std::ops::Range<i64> = 946_684_800_000_000_000..3_787_000_000_000_000_000;
/// A clock that was never set shows the first day of GPS time.
const FIRST_DAY_NS: i64 = 86_400_000_000_000;
pub(super) const WEEK_NS: i64 = 7 * FIRST_DAY_NS;

/// The bias in force.
#[derive(Clone, Copy, Debug)]
struct Bias {
    full_ns: i64,
    part_ns: f64,
}

/// The clock of an epoch.
#[derive(Clone, Copy, Debug)]
pub(super) struct EpochClock {
    /// The fields of the epoch's lines.
    pub(super) fields: ClockFields,
    /// Time of the epoch (without a measurement's own offset).
    pub(super) time: ReceiveTime,
    /// The clock does not continue that of the epoch before, nor do carrier phases: the count of discontinuities changed, or
    /// the clock went back, which without a restart it may not.
    pub(super) discontinuous: bool,
    bias: Bias,
}

impl EpochClock {
    /// The clock by a line, following that of the epoch before. `None` on overflow, which only damaged numbers cause.
    pub(super) fn new(fields: ClockFields, before: Option<&Self>, reference: BiasReference) -> Option<Self> {
        let own = Bias { full_ns: fields.full_bias_ns, part_ns: fields.bias_ns };
        // A line without the count says nothing about it.
        let count_before = before.and_then(|b| b.fields.discontinuities);
        let fields = ClockFields { discontinuities: fields.discontinuities.or(count_before), ..fields };
        let went_back = before.is_some_and(|b| fields.time_ns < b.fields.time_ns);
        let discontinuous = went_back || (count_before.is_some() && count_before != fields.discontinuities);
        let bias = match (reference, before) {
            (BiasReference::FirstEpoch, Some(before)) if !discontinuous => before.bias,
            _ => own,
        };
        let whole_ns = fields.time_ns.checked_sub(bias.full_ns)?;
        let time = ReceiveTime { whole_ns, fraction_ns: -bias.part_ns };
        Some(Self { fields, time, discontinuous, bias })
    }
}

/// Describes an impossible clock, and its time with one or two rollovers of the week added where that is possible.
pub(super) fn describe_clock(clock: ClockFields) -> String {
    let said = format!("TimeNanos {}, FullBiasNanos {}", clock.time_ns, clock.full_bias_ns);
    let time_ns = clock.time_ns.saturating_sub(clock.full_bias_ns);
    let rolled_over = [1, 2].into_iter().find_map(|times: i64| {
        let weeks = times * WEEKS_PER_ROLLOVER;
        let time_ns = time_ns.checked_add(weeks * WEEK_NS).filter(|_| time_ns >= FIRST_DAY_NS)?;
        PLAUSIBLE_NS.contains(&time_ns).then(|| (weeks, GpsTime::from_nanos(time_ns)))
    });
    let time = GpsTime::from_nanos(time_ns);
    match rolled_over {
        Some((weeks, later)) => format!(
            "{said}, which is {time}; its week is probably {weeks} too low, {later} right: shift_weeks = {weeks}, or \
             --shift-weeks {weeks}"
        ),
        None => said,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(time_ns: i64, full_bias_ns: i64, count: i64) -> ClockFields {
        ClockFields {
            time_ns,
            full_bias_ns,
            bias_ns: 0.25,
            bias_uncertainty_ns: None,
            discontinuities: Some(count),
            leap_seconds: None,
        }
    }

    #[test]
    fn the_first_bias_holds_until_the_clock_is_discontinuous() {
        let next = |fields, before: Option<&EpochClock>| {
            EpochClock::new(fields, before, BiasReference::FirstEpoch).unwrap()
        };
        let first = next(fields(0, -1_000_000, 5), None);
        let second = next(fields(1_000, -1_000_300, 5), Some(&first));
        assert_eq!(second.time, ReceiveTime { whole_ns: 1_001_000, fraction_ns: -0.25 });
        let third = next(fields(2_000, -1_000_700, 6), Some(&second));
        assert!(third.discontinuous && !second.discontinuous);
        assert_eq!(third.time.whole_ns, 1_002_700);
        let each =
            EpochClock::new(fields(1_000, -1_000_300, 5), Some(&first), BiasReference::EachEpoch).unwrap();
        assert_eq!(each.time.whole_ns, 1_001_300);
        assert!(EpochClock::new(fields(i64::MAX, -2, 0), None, BiasReference::EachEpoch).is_none());
        let silent = ClockFields { discontinuities: None, ..fields(3_000, -1_000_900, 6) };
        let fourth = next(silent, Some(&third));
        let fifth = next(fields(4_000, -1_000_900, 6), Some(&fourth));
        assert!(!fourth.discontinuous && !fifth.discontinuous);
        assert_eq!(fifth.time.whole_ns, 1_004_700);
        // The receiver restarts: its clock and its count begin anew.
        let restarted = next(fields(10, -1_005_700, 6), Some(&fifth));
        assert!(restarted.discontinuous);
        assert_eq!(restarted.time.whole_ns, 1_005_710);
    }
}
