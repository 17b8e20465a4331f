//! Leap seconds.

use crate::time::GpsTime;

/// First UTC instants (as GPS seconds) from which GPS time is ahead by 15, 16, 17, 18 s: 2009-01-01, 2012-07-01,
/// 2015-07-01, 2017-01-01 (IERS Bulletin C). GPS time was 14 s ahead from 2006 on.
const STEPS: [(i64, i64); 4] =
    [(914_803_215, 15), (1_025_136_016, 16), (1_119_744_017, 17), (1_167_264_018, 18)];

/// Seconds that GPS time is ahead of UTC. Phones have logged raw measurements since 2016 only; before 2006 this is wrong.
pub(super) fn leap_seconds(time_gps: GpsTime) -> i64 {
    let seconds = time_gps.nanos().div_euclid(1_000_000_000);
    STEPS.iter().rev().find(|(from, _)| seconds >= *from).map_or(14, |(_, leap)| *leap)
}

/// Of the phone's own number and the table the phone's when it is at most 1 s off, as after a leap second that the table
/// does not know yet.
pub(super) fn trusted_leap_seconds(time_gps: GpsTime, phone: Option<i64>) -> i64 {
    let table = leap_seconds(time_gps);
    phone.filter(|leap| (table..=table + 1).contains(leap)).unwrap_or(table)
}

/// GPS time of a number of milliseconds since 1970-01-01 UTC; `None` before 2006 and after 2200.
pub(super) fn from_unix_millis(millis: i64) -> Option<GpsTime> {
    const UNIX_TO_GPS_MILLIS: i64 = 315_964_800_000;
    const FIRST: i64 = 1_136_073_600_000;
    const LAST: i64 = 7_258_118_400_000;
    if !(FIRST..=LAST).contains(&millis) {
        return None;
    }
    let utc_millis = millis - UNIX_TO_GPS_MILLIS;
    let leap = STEPS.iter().rev().find(|(from, leap)| utc_millis >= (from - leap) * 1_000);
    Some(GpsTime::from_nanos((utc_millis + leap.map_or(14, |(_, leap)| *leap) * 1_000) * 1_000_000))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_where_the_bulletins_say() {
        let at = |text: &str| leap_seconds(text.parse().unwrap());
        assert_eq!((at("2008-12-31T23:59:59"), at("2009-01-01T00:00:15")), (14, 15));
        assert_eq!((at("2012-07-01T00:00:15"), at("2012-07-01T00:00:16")), (15, 16));
        assert_eq!((at("2015-07-01T00:00:16"), at("2015-07-01T00:00:17")), (16, 17));
        assert_eq!((at("2017-01-01T00:00:17"), at("2017-01-01T00:00:18")), (17, 18));
    }

    #[test]
    fn unix_time_becomes_gps_time() {
        let at = |millis| from_unix_millis(millis).unwrap().to_string();
        assert_eq!(at(1_699_400_594_000), "2023-11-07T23:43:32.000 GPS");
        assert_eq!(at(1_483_228_799_000), "2017-01-01T00:00:16.000 GPS"); // 2016-12-31 23:59:59 UTC
        assert_eq!(at(1_483_228_800_000), "2017-01-01T00:00:18.000 GPS");
        assert_eq!(from_unix_millis(0), None);
        assert_eq!(from_unix_millis(i64::MAX), None);
    }

    #[test]
    fn a_phone_may_know_a_new_leap_second_but_not_an_old_one() {
        let now = "2023-11-07T00:00:00".parse().unwrap();
        assert_eq!(trusted_leap_seconds(now, None), 18);
        assert_eq!(trusted_leap_seconds(now, Some(19)), 19);
        assert_eq!(trusted_leap_seconds(now, Some(17)), 18);
        assert_eq!(trusted_leap_seconds(now, Some(-5)), 18);
    }
}
