//! Seconds that GPS time is ahead of UTC.

use super::{Calendar, GpsTime};

/// Year and month on whose first day the difference became that many seconds (IERS Bulletin C, up to 2017).
const STEPS: [(i32, u32, i64); 18] = [
    (1981, 7, 1),
    (1982, 7, 2),
    (1983, 7, 3),
    (1985, 7, 4),
    (1988, 1, 5),
    (1990, 1, 6),
    (1991, 1, 7),
    (1992, 7, 8),
    (1993, 7, 9),
    (1994, 7, 10),
    (1996, 1, 11),
    (1997, 7, 12),
    (1999, 1, 13),
    (2006, 1, 14),
    (2009, 1, 15),
    (2012, 7, 16),
    (2015, 7, 17),
    (2017, 1, 18),
];

/// Seconds that GPS time is ahead of UTC on a date in UTC, read as if it were GPS time. After the last step known here
/// (2017, 18 s) that one holds.
pub fn leap_seconds_at(utc: GpsTime) -> i64 {
    let Calendar { year, month, .. } = utc.calendar();
    let passed = STEPS.partition_point(|(y, m, _)| (*y, *m) <= (year, month));
    passed.checked_sub(1).and_then(|last| STEPS.get(last)).map_or(0, |(_, _, seconds)| *seconds)
}

/// First year and month for which the table may lack a step: Bulletin C 70 of July 2025 excludes one before.
const KNOWN_UNTIL: (i32, u32) = (2026, 7);
/// Around a step both numbers are right, s.
const NEAR_A_STEP_S: f64 = 86_400.0;

/// Seconds that GPS time is ahead of UTC on a date in UTC, where a file states a number. The table decides as far as it is known to
/// be whole; later the file may know of a step more, in either direction.
pub(crate) fn leap_seconds_by(stated: Option<i64>, utc: GpsTime) -> i64 {
    let table = leap_seconds_at(utc);
    let Calendar { year, month, .. } = utc.calendar();
    stated.filter(|s| (year, month) >= KNOWN_UNTIL && (s - table).abs() <= 1).unwrap_or(table)
}

/// What holds in place of a number that a file states and that cannot be on a date; `None` when it can.
pub(crate) fn corrected_leap_seconds(stated: i64, utc: GpsTime) -> Option<i64> {
    let can_be = |at: GpsTime| leap_seconds_by(Some(stated), at) == stated;
    let is_right = can_be(utc) || can_be(utc - NEAR_A_STEP_S) || can_be(utc + NEAR_A_STEP_S);
    (!is_right).then(|| leap_seconds_at(utc))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_hold_from_their_day_on() {
        let at = |text: &str| leap_seconds_at(text.parse().unwrap());
        assert_eq!(at("1981-06-30T23:59:59"), 0);
        assert_eq!(at("2005-04-02T00:00:00"), 13);
        assert_eq!(at("2016-12-31T23:59:59"), 17);
        assert_eq!(at("2017-01-01T00:00:00"), 18);
        assert_eq!(at("2026-01-01T00:00:00"), 18);
    }

    #[test]
    fn what_a_file_states_counts_only_where_the_table_may_end() {
        for (stated, date, by, correction) in [
            (None, "2020-06-24T00:00:00", 18, None),
            (Some(18), "2020-06-24T00:00:00", 18, None),
            (Some(17), "2020-06-24T00:00:00", 18, Some(18)),
            (Some(0), "2020-06-24T00:00:00", 18, Some(18)),
            (Some(19), "2020-06-24T00:00:00", 18, Some(18)),
            (Some(18), "2010-06-24T00:00:00", 15, Some(15)),
            // On the day of a step both are right.
            (Some(17), "2016-12-31T12:00:00", 17, None),
            (Some(18), "2016-12-31T12:00:00", 17, None),
            (Some(16), "2016-12-31T12:00:00", 17, Some(17)),
            // A step that the table cannot know.
            (Some(19), "2031-01-01T00:00:00", 19, None),
            (Some(17), "2031-01-01T00:00:00", 17, None),
            (Some(20), "2031-01-01T00:00:00", 18, Some(18)),
        ] {
            let utc = date.parse().unwrap();
            assert_eq!(leap_seconds_by(stated, utc), by, "{stated:?} {date}");
            assert_eq!(
                stated.and_then(|stated| corrected_leap_seconds(stated, utc)),
                correction,
                "{stated:?} {date}"
            );
        }
    }
}
