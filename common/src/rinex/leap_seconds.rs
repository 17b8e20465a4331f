//! Seconds that GPS time is ahead of UTC.

use super::{columns, integer};
use crate::time::{Calendar, GpsTime};

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
/// (2017, 18 s) that one holds; a file's own header knows more.
pub fn leap_seconds_at(utc: GpsTime) -> i64 {
    let Calendar { year, month, .. } = utc.calendar();
    let passed = STEPS.partition_point(|(y, m, _)| (*y, *m) <= (year, month));
    passed.checked_sub(1).and_then(|last| STEPS.get(last)).map_or(0, |(_, _, seconds)| *seconds)
}

/// Reads a LEAP SECONDS line as seconds that GPS time is ahead of UTC. The line may count them for BeiDou time instead.
pub(super) fn header_line(line: &[u8]) -> Option<i64> {
    let seconds = integer(columns(line, 0, 6)).filter(|s| (0..=100).contains(s))?;
    Some(if columns(line, 24, 27) == b"BDS" { seconds + 14 } else { seconds })
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
}
