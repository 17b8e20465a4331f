//! GLONASS time: Moscow time, three hours ahead of UTC, with its leap seconds (GLONASS ICD, L1 and L2, edition 5.1,
//! 3.3.3), and days counted over four years (4.4).

use crate::time::GpsTime;

pub(crate) const MILLIS_PER_DAY: i64 = 86_400_000;
const AHEAD_OF_UTC_MILLIS: i64 = 3 * 3_600_000;
const NANOS_PER_MILLI: i128 = 1_000_000;
/// The years 1980-2099 have no exception of the rule that every fourth has a leap day.
pub(crate) const DAYS_OF_FOUR_YEARS: u32 = 1_461;
/// GPS time begins on 6 January of a leap year.
const DAYS_TO_GPS: i64 = 5;
/// From 1980 to 1992, four years before number 1 of the four years.
const FOUR_YEARS_TO_1992: i64 = 3;

/// Milliseconds of a day or a week in Moscow as milliseconds of GPS time, which may lie outside.
pub(crate) const fn to_gps_millis(millis: i64, leap_seconds: i64) -> i64 {
    millis - AHEAD_OF_UTC_MILLIS + leap_seconds * 1_000
}

/// GPS time of milliseconds of a day in Moscow, whose number (1 = 1 January) is that in the four years from a leap year on. Of all
/// such days it is the one nearest to `near`; `None` of a number that is no day.
pub(crate) fn of_four_years(day: u32, millis: i64, leap_seconds: i64, near: GpsTime) -> Option<GpsTime> {
    if !(1..=DAYS_OF_FOUR_YEARS).contains(&day) {
        return None;
    }
    let days = i64::from(day) - 1 - DAYS_TO_GPS;
    let since_gps = to_gps_millis(days * MILLIS_PER_DAY + millis, leap_seconds);
    nearest(since_gps, i64::from(DAYS_OF_FOUR_YEARS) * MILLIS_PER_DAY, near)
}

/// The same by the number of the four years too, 1 from 1996 on (N_4).
pub(crate) fn of_date(four_years: u32, day: u32, millis: i64, leap_seconds: i64) -> Option<GpsTime> {
    if four_years == 0 || !(1..=DAYS_OF_FOUR_YEARS).contains(&day) {
        return None;
    }
    let days_before = (i64::from(four_years) + FOUR_YEARS_TO_1992) * i64::from(DAYS_OF_FOUR_YEARS);
    let days = days_before + i64::from(day) - 1 - DAYS_TO_GPS;
    let millis = to_gps_millis(days * MILLIS_PER_DAY + millis, leap_seconds);
    millis.checked_mul(1_000_000).map(GpsTime::from_nanos)
}

/// The instant nearest to `near` that is `millis` after a multiple of `period` milliseconds.
pub(crate) fn nearest(millis: i64, period: i64, near: GpsTime) -> Option<GpsTime> {
    let near = i128::from(near.nanos());
    let (nanos, period) = (i128::from(millis) * NANOS_PER_MILLI, i128::from(period) * NANOS_PER_MILLI);
    let periods = (near - nanos + period / 2).div_euclid(period);
    i64::try_from(nanos + periods * period).ok().map(GpsTime::from_nanos)
}
