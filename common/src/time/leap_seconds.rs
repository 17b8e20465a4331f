//! Difference between GPS time and UTC.

use super::{GpsTime, NANOS_PER_SECOND, UNIX_TO_GPS_DAYS, WHOLE_SECONDS_PER_DAY, days_from_civil};

/// Year, month and the difference in seconds from its first day on (IERS Bulletin C, up to 2017).
const STEPS: [(i64, i64, i64); 18] = [
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

/// The same table by instants of UTC, read as if it were GPS time: nanoseconds, and the difference from then on.
const STEPS_BY_NANOS: [(i64, i64); STEPS.len()] = steps_by_nanos();
/// First instant of UTC for which the table may lack a step: Bulletin C 70 of July 2025 excludes a step before July 2026.
const KNOWN_UNTIL_NANOS: i64 = first_of_month(2026, 7);

const fn steps_by_nanos() -> [(i64, i64); STEPS.len()] {
    let mut by_nanos = [(0, 0); STEPS.len()];
    let mut index = 0;
    while index < STEPS.len() {
        let (year, month, seconds) = STEPS[index];
        by_nanos[index] = (first_of_month(year, month), seconds);
        index += 1;
    }
    by_nanos
}

const fn first_of_month(year: i64, month: i64) -> i64 {
    (days_from_civil(year, month, 1) - UNIX_TO_GPS_DAYS) * WHOLE_SECONDS_PER_DAY * NANOS_PER_SECOND
}

/// Seconds by which GPS time is ahead of UTC on a date in UTC, read as if it were GPS time. After the last known step
/// (2017) the difference stays 18 s.
pub fn leap_seconds_at(utc: GpsTime) -> i64 {
    let passed = STEPS_BY_NANOS.partition_point(|(from, _)| *from <= utc.nanos);
    passed.checked_sub(1).and_then(|last| STEPS_BY_NANOS.get(last)).map_or(0, |(_, seconds)| *seconds)
}

/// An instant in UTC, read as if it were GPS time. The leap second itself repeats the second before it.
fn to_utc(time: GpsTime) -> GpsTime {
    // In the seconds between a step in GPS time and in UTC the result is a second early, but on the correct side of the step.
    GpsTime::from_nanos(time.nanos.saturating_sub(leap_seconds_at(time) * NANOS_PER_SECOND))
}

/// Seconds by which GPS time is ahead of UTC at an instant, given a number stated by a phone, which is treated like one of a file.
pub(crate) fn leap_seconds_of(stated: Option<i64>, time: GpsTime) -> i64 {
    leap_seconds_by(stated, to_utc(time))
}

/// Time around a step within which both numbers are accepted, s.
const NEAR_A_STEP_S: f64 = 86_400.0;

/// Seconds by which GPS time is ahead of UTC on a date in UTC, given a number stated by a file. The table decides as far as it is complete;
/// later the file may contain a further step, in either direction.
pub(crate) fn leap_seconds_by(stated: Option<i64>, utc: GpsTime) -> i64 {
    let table = leap_seconds_at(utc);
    let can_be = |stated: i64| utc.nanos >= KNOWN_UNTIL_NANOS && (table - 1..=table + 1).contains(&stated);
    stated.filter(|stated| can_be(*stated)).unwrap_or(table)
}

/// The correct number in place of an impossible one stated by a file; `None` if the stated number is possible.
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
    fn steps_are_where_the_bulletins_say_in_gps_time() {
        let at = |text: &str| leap_seconds_of(None, text.parse().unwrap());
        assert_eq!((at("2008-12-31T23:59:59"), at("2009-01-01T00:00:15")), (14, 15));
        assert_eq!((at("2012-07-01T00:00:15"), at("2012-07-01T00:00:16")), (15, 16));
        assert_eq!((at("2015-07-01T00:00:16"), at("2015-07-01T00:00:17")), (16, 17));
        assert_eq!((at("2017-01-01T00:00:17"), at("2017-01-01T00:00:18")), (17, 18));
    }

    #[test]
    fn what_a_phone_states_counts_only_where_the_table_may_end() {
        let (known, later) = ("2023-11-07T00:00:00".parse().unwrap(), "2031-01-01T00:00:00".parse().unwrap());
        for (stated, by_table, by_phone) in
            [(None, 18, 18), (Some(19), 18, 19), (Some(17), 18, 17), (Some(-5), 18, 18)]
        {
            assert_eq!(
                (leap_seconds_of(stated, known), leap_seconds_of(stated, later)),
                (by_table, by_phone)
            );
        }
        assert_eq!(leap_seconds_of(Some(i64::MIN), GpsTime::from_nanos(i64::MIN)), 0);
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
            // On the day of a step both are correct.
            (Some(17), "2016-12-31T12:00:00", 17, None),
            (Some(18), "2016-12-31T12:00:00", 17, None),
            (Some(16), "2016-12-31T12:00:00", 17, Some(17)),
            // A step later than the table.
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
