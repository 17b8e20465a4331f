//! GPS time as one integer: nanoseconds since 1980-01-06 00:00:00 GPST.
//!
//! GPS time has no leap seconds. A nanosecond is 0.3 m for a signal but only 4 µm for a satellite's position,
//! and pseudoranges are not computed from these time tags, so the resolution is sufficient.

mod leap_seconds;

use std::fmt;
use std::ops::{Add, Sub};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

pub use leap_seconds::leap_seconds_at;
pub(crate) use leap_seconds::{corrected_leap_seconds, leap_seconds_by, leap_seconds_of};

/// Seconds in a GPS week.
pub const SECONDS_PER_WEEK: f64 = 604_800.0;
/// Seconds per day without a leap second.
pub const SECONDS_PER_DAY: f64 = WHOLE_SECONDS_PER_DAY as f64;
/// Period of the week number in GPS messages (IS-GPS-200, 20.3.3.3.1.1); careless receivers are wrong by one or two periods.
pub const WEEKS_PER_ROLLOVER: i64 = 1_024;
/// BeiDou time is 14 s behind GPS time (BDS-SIS-ICD, 3.3).
pub const BEIDOU_BEHIND_GPS_S: f64 = 14.0;
/// BeiDou week 0 is GPS week 1356.
pub const BEIDOU_WEEK_OFFSET: i64 = 1356;

const NANOS_PER_SECOND: i64 = 1_000_000_000;
const WHOLE_SECONDS_PER_DAY: i64 = 86_400;
/// Days from 1970-01-01 to 1980-01-06.
const UNIX_TO_GPS_DAYS: i64 = 3_657;

/// An instant in GPS time.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, Default)]
pub struct GpsTime {
    nanos: i64,
}

/// Error for a text that is not a GPS calendar time.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{text}' is not a GPS time; write YYYY-MM-DDThh:mm:ss, for example 2020-08-13T14:33:00{hint}")]
pub struct GpsTimeError {
    text: String,
    hint: &'static str,
}

/// A calendar date and time of day in GPS time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calendar {
    /// Year, full (2020).
    pub year: i32,
    /// Month, 1-12.
    pub month: u32,
    /// Day of month, 1-31.
    pub day: u32,
    /// Hour, 0-23.
    pub hour: u32,
    /// Minute, 0-59.
    pub minute: u32,
    /// Second with fraction, s.
    pub second: f64,
}

impl Calendar {
    /// Day of the year, from 1.
    pub fn day_of_year(&self) -> u32 {
        let day =
            |month: u32, day: u32| days_from_civil(i64::from(self.year), i64::from(month), i64::from(day));
        u32::try_from(1 + day(self.month, self.day) - day(1, 1)).unwrap_or(1)
    }
}

impl GpsTime {
    /// Time from nanoseconds since 1980-01-06 00:00:00 GPST.
    pub const fn from_nanos(nanos: i64) -> Self {
        Self { nanos }
    }

    /// Nanoseconds since 1980-01-06 00:00:00 GPST.
    pub const fn nanos(self) -> i64 {
        self.nanos
    }

    /// Time from a full GPS week (no rollover) and the time of week in seconds, which may lie outside the week.
    pub fn from_week_tow(week: i64, tow_s: f64) -> Self {
        let whole = tow_s.floor();
        let fraction = ((tow_s - whole) * NANOS_PER_SECOND as f64).round();
        #[allow(clippy::cast_possible_truncation)] // saturates on absurd input, checked at the parsers
        let seconds = (week.saturating_mul(7 * WHOLE_SECONDS_PER_DAY)).saturating_add(whole as i64);
        #[allow(clippy::cast_possible_truncation)]
        let nanos = seconds.saturating_mul(NANOS_PER_SECOND).saturating_add(fraction as i64);
        Self { nanos }
    }

    /// Time from a BeiDou week and time of week, both in BeiDou time.
    pub fn from_beidou_week_tow(week: i64, tow_s: f64) -> Self {
        Self::from_week_tow(week + BEIDOU_WEEK_OFFSET, tow_s + BEIDOU_BEHIND_GPS_S)
    }

    /// Time from a calendar in GPS time. `None` if a field is outside its range.
    pub fn from_calendar(calendar: Calendar) -> Option<Self> {
        let Calendar { year, month, day, hour, minute, second } = calendar;
        let valid = (1980..=2261).contains(&year)
            && (1..=12).contains(&month)
            && (1..=days_in_month(year, month)).contains(&day)
            && hour < 24
            && minute < 60
            && (0.0..61.0).contains(&second);
        if !valid {
            return None;
        }
        let days = days_from_civil(i64::from(year), i64::from(month), i64::from(day)) - UNIX_TO_GPS_DAYS;
        let seconds = days * WHOLE_SECONDS_PER_DAY + i64::from(hour) * 3_600 + i64::from(minute) * 60;
        #[allow(clippy::cast_possible_truncation)] // second < 61
        let fraction = (second * NANOS_PER_SECOND as f64).round() as i64;
        Some(Self { nanos: seconds * NANOS_PER_SECOND + fraction })
    }

    /// GPS time of milliseconds since 1970-01-01 UTC; `None` before 2006 and after 2200, outside the range of phones.
    pub(crate) fn from_unix_millis(millis: i64) -> Option<Self> {
        const FIRST: i64 = 1_136_073_600_000;
        const LAST: i64 = 7_258_118_400_000;
        if !(FIRST..=LAST).contains(&millis) {
            return None;
        }
        let utc_millis = millis - UNIX_TO_GPS_DAYS * WHOLE_SECONDS_PER_DAY * 1_000;
        let utc = Self { nanos: utc_millis * (NANOS_PER_SECOND / 1_000) };
        Some(Self { nanos: utc.nanos + leap_seconds_at(utc) * NANOS_PER_SECOND })
    }

    /// Calendar in GPS time.
    pub fn calendar(self) -> Calendar {
        let seconds = self.nanos.div_euclid(NANOS_PER_SECOND);
        let nanos = self.nanos.rem_euclid(NANOS_PER_SECOND);
        let (year, month, day) =
            civil_from_days(seconds.div_euclid(WHOLE_SECONDS_PER_DAY) + UNIX_TO_GPS_DAYS);
        let of_day = seconds.rem_euclid(WHOLE_SECONDS_PER_DAY);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // of_day is in [0, 86400)
        Calendar {
            year: year as i32,
            month: month as u32,
            day: day as u32,
            hour: (of_day / 3_600) as u32,
            minute: (of_day / 60 % 60) as u32,
            second: (of_day % 60) as f64 + nanos as f64 * 1e-9,
        }
    }

    /// Full GPS week number, without rollover.
    pub const fn week(self) -> i64 {
        self.nanos.div_euclid(7 * WHOLE_SECONDS_PER_DAY * NANOS_PER_SECOND)
    }

    /// Weeks to add to this time, a multiple of 1,024 and not 0, to come within ten days of `other`: the week number has then
    /// probably not been corrected for rollover. `None` if there is no such multiple.
    pub fn rollover_weeks_to(self, other: Self) -> Option<i64> {
        const NEAR_S: f64 = 10.0 * 86_400.0;
        let rollover_s = WEEKS_PER_ROLLOVER as f64 * SECONDS_PER_WEEK;
        let difference_s = other - self;
        let times = (difference_s / rollover_s).round();
        #[allow(clippy::cast_possible_truncation)] // 64 bits of nanoseconds have room for 30 rollovers
        let weeks = times as i64 * WEEKS_PER_ROLLOVER;
        (weeks != 0 && (difference_s - times * rollover_s).abs() <= NEAR_S).then_some(weeks)
    }

    /// Text for the end of a sentence if this time differs from that of the orbits by a multiple of 1,024 weeks; else empty.
    pub fn rollover_hint(self, orbits: Self) -> String {
        let hint = |weeks: i64| {
            let (by, way) = (weeks.abs(), if weeks > 0 { "low" } else { "high" });
            format!(
                "; the recording's week is probably {by} too {way}: shift_weeks = {weeks}, or --shift-weeks {weeks}"
            )
        };
        self.rollover_weeks_to(orbits).map_or(String::new(), hint)
    }

    /// Seconds into the GPS week, in [0, 604800).
    pub fn tow_s(self) -> f64 {
        let nanos = self.nanos.rem_euclid(7 * WHOLE_SECONDS_PER_DAY * NANOS_PER_SECOND);
        let whole = nanos / NANOS_PER_SECOND;
        whole as f64 + (nanos % NANOS_PER_SECOND) as f64 * 1e-9
    }

    /// Nanoseconds since 1970-01-01 of the same calendar reading. GPS time is shown as if it were UTC: the clock of
    /// a viewer then shows GPS time, 18 s ahead of UTC since 2017.
    pub const fn as_unix_calendar_nanos(self) -> i64 {
        self.nanos.saturating_add(UNIX_TO_GPS_DAYS * WHOLE_SECONDS_PER_DAY * NANOS_PER_SECOND)
    }

    /// Seconds from `earlier` to `self`, negative if `self` is the earlier one.
    pub fn seconds_since(self, earlier: Self) -> f64 {
        let difference = self.nanos.saturating_sub(earlier.nanos);
        (difference / NANOS_PER_SECOND) as f64 + (difference % NANOS_PER_SECOND) as f64 * 1e-9
    }
}

impl Add<f64> for GpsTime {
    type Output = Self;
    /// Adds seconds, rounded to the nanosecond.
    #[allow(clippy::suspicious_arithmetic_impl)] // seconds become nanoseconds
    fn add(self, seconds: f64) -> Self {
        #[allow(clippy::cast_possible_truncation)] // saturates
        let nanos = (seconds * NANOS_PER_SECOND as f64).round() as i64;
        Self { nanos: self.nanos.saturating_add(nanos) }
    }
}

impl Sub<f64> for GpsTime {
    type Output = Self;
    fn sub(self, seconds: f64) -> Self {
        self + (-seconds)
    }
}

impl Sub for GpsTime {
    type Output = f64;
    /// Difference in seconds.
    fn sub(self, earlier: Self) -> f64 {
        self.seconds_since(earlier)
    }
}

impl GpsTime {
    /// `YYYY-MM-DDThh:mm:ss.sss`, truncated to the millisecond, for fields named as GPS time.
    pub fn iso(self) -> String {
        Iso(self).to_string()
    }
}

/// A time without its time scale.
struct Iso(GpsTime);

impl fmt::Display for Iso {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(GpsTime { nanos: all }) = *self;
        let seconds = all.div_euclid(NANOS_PER_SECOND);
        let nanos = all.rem_euclid(NANOS_PER_SECOND);
        let c = GpsTime::from_nanos(seconds.saturating_mul(NANOS_PER_SECOND)).calendar();
        write!(
            f,
            "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:03}",
            c.year,
            c.month,
            c.day,
            c.hour,
            c.minute,
            of_minute(seconds),
            nanos / 1_000_000
        )
    }
}

/// With its time scale: `2020-08-13T14:33:00.000 GPS`.
impl fmt::Display for GpsTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} GPS", Iso(*self))
    }
}

impl fmt::Debug for GpsTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl FromStr for GpsTime {
    type Err = GpsTimeError;

    /// Reads `YYYY-MM-DDThh:mm:ss[.fraction]` (with `T` or a space) in GPS time, optionally followed by `GPS`.
    fn from_str(text: &str) -> Result<Self, GpsTimeError> {
        let calendar = text.trim().strip_suffix("GPS").unwrap_or(text);
        parse_calendar(calendar)
            .and_then(Self::from_calendar)
            .ok_or_else(|| GpsTimeError { text: text.to_owned(), hint: scale_hint(text) })
    }
}

/// Text on a time in another scale.
fn scale_hint(text: &str) -> &'static str {
    let text = text.trim_end();
    let offset = text.rsplit_once(['T', ' ']).is_some_and(|(_, clock)| clock.contains(['+', '-']));
    if text.ends_with(['Z', 'z']) || text.ends_with("UTC") || offset {
        ", in GPS time without a zone (18 s more than UTC since 2017)"
    } else {
        ""
    }
}

fn of_minute(seconds: i64) -> i64 {
    seconds.rem_euclid(60)
}

fn parse_calendar(text: &str) -> Option<Calendar> {
    let (date, clock) = text.trim().split_once(['T', ' '])?;
    let mut date = date.split('-');
    let (year, month, day) = (date.next()?, date.next()?, date.next()?);
    let mut clock = clock.split(':');
    let (hour, minute, second) = (clock.next()?, clock.next()?, clock.next()?);
    if date.next().is_some() || clock.next().is_some() {
        return None;
    }
    Some(Calendar {
        year: year.parse().ok()?,
        month: month.parse().ok()?,
        day: day.parse().ok()?,
        hour: hour.parse().ok()?,
        minute: minute.parse().ok()?,
        second: second.parse().ok()?,
    })
}

fn days_in_month(year: i32, month: u32) -> u32 {
    match month {
        2 if year % 4 == 0 && (year % 100 != 0 || year % 400 == 0) => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

/// Days since 1970-01-01 of a Gregorian date; years are counted from March, so that a leap day is the last day of its year.
const fn days_from_civil(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let of_era = year.rem_euclid(400);
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468
}

fn civil_from_days(days: i64) -> (i64, i64, i64) {
    let shifted = days + 719_468;
    let era = shifted.div_euclid(146_097);
    let day_of_era = shifted.rem_euclid(146_097);
    let year_of_era = (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    (year, month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calendar(year: i32, month: u32, day: u32, hour: u32, minute: u32, second: f64) -> GpsTime {
        GpsTime::from_calendar(Calendar { year, month, day, hour, minute, second }).unwrap()
    }

    #[test]
    fn days_of_the_year_are_counted_from_the_first_of_january() {
        for (year, month, day, expected) in
            [(1980, 1, 6, 6), (2020, 2, 29, 60), (2023, 12, 31, 365), (2024, 12, 31, 366), (2100, 3, 1, 60)]
        {
            let time = calendar(year, month, day, 23, 59, 59.0);
            assert_eq!(time.calendar().day_of_year(), expected, "{time}");
        }
    }

    #[test]
    fn unix_time_becomes_gps_time() {
        let at = |millis| GpsTime::from_unix_millis(millis).unwrap().to_string();
        assert_eq!(at(1_699_400_594_000), "2023-11-07T23:43:32.000 GPS");
        assert_eq!(at(1_483_228_799_000), "2017-01-01T00:00:16.000 GPS"); // 2016-12-31 23:59:59 UTC
        assert_eq!(at(1_483_228_800_000), "2017-01-01T00:00:18.000 GPS");
        assert_eq!(GpsTime::from_unix_millis(0), None);
        assert_eq!(GpsTime::from_unix_millis(i64::MAX), None);
    }

    #[test]
    fn weeks_that_were_not_rolled_over_are_recognised() {
        let weeks =
            |from: &str, to: &str| from.parse::<GpsTime>().unwrap().rollover_weeks_to(to.parse().unwrap());
        assert_eq!(weeks("2000-11-09T12:10:00", "2020-06-25T12:10:00"), Some(1_024));
        assert_eq!(weeks("2000-11-09T12:10:00", "2020-06-20T00:00:00"), Some(1_024));
        assert_eq!(weeks("2020-06-25T12:10:00", "2000-11-09T12:10:00"), Some(-1_024));
        assert_eq!(weeks("1981-03-26T12:10:00", "2020-06-25T12:10:00"), Some(2_048));
        assert_eq!(weeks("2020-06-25T12:10:00", "2020-06-25T12:10:00"), None);
        assert_eq!(weeks("2000-11-09T12:10:00", "2020-08-25T12:10:00"), None);
        let hint = |from: &str| {
            from.parse::<GpsTime>().unwrap().rollover_hint("2020-06-25T12:10:00".parse().unwrap())
        };
        assert!(hint("2000-11-09T12:10:00").contains("1024 too low: shift_weeks = 1024"));
        assert!(hint("2040-02-09T12:10:00").contains("1024 too high: shift_weeks = -1024"));
        assert_eq!(hint("2020-06-25T12:10:00"), "");
    }

    #[test]
    fn known_dates_have_their_week_and_second() {
        assert_eq!(calendar(1980, 1, 6, 0, 0, 0.0).nanos(), 0);
        let time = calendar(2020, 8, 13, 14, 19, 1.999_759);
        assert_eq!(time.week(), 2118);
        assert!((time.tow_s() - 397_141.999_759).abs() < 1e-9);
        assert_eq!(time, GpsTime::from_week_tow(2118, 397_141.999_759));
    }

    #[test]
    fn calendar_round_trips_over_leap_years() {
        for day in 0..60_000_i64 {
            let time = GpsTime::from_nanos((day * 86_400 + 12_345) * 1_000_000_000);
            assert_eq!(GpsTime::from_calendar(time.calendar()), Some(time), "{time}");
        }
    }

    #[test]
    fn text_is_read_and_written() {
        let time: GpsTime = "2020-08-13T14:33:00".parse().unwrap();
        assert_eq!(time.to_string(), "2020-08-13T14:33:00.000 GPS");
        assert_eq!((time.to_string().parse(), time.iso().parse()), (Ok(time), Ok(time)));
        for other_scale in ["2020-08-13T14:33:00Z", "2020-08-13 14:33:00 UTC", "2020-08-13T14:33:00+08:00"] {
            let error = other_scale.parse::<GpsTime>().unwrap_err().to_string();
            assert!(error.contains("in GPS time without a zone"), "{error}");
        }
        assert!("2020-02-30T00:00:00".parse::<GpsTime>().is_err());
        assert!("yesterday".parse::<GpsTime>().unwrap_err().to_string().contains("yesterday"));
    }

    #[test]
    fn the_ends_of_time_can_be_written() {
        for nanos in [i64::MIN, i64::MIN + 1, i64::MAX] {
            assert!(!GpsTime::from_nanos(nanos).to_string().is_empty());
        }
    }

    #[test]
    fn beidou_time_is_fourteen_seconds_behind() {
        assert_eq!(GpsTime::from_beidou_week_tow(762, 100.0), GpsTime::from_week_tow(2118, 114.0));
    }

    #[test]
    fn differences_keep_the_nanosecond_over_weeks() {
        let start = GpsTime::from_week_tow(2118, 0.0);
        assert_eq!((start + 604_800.000_000_001) - start, 604_800.000_000_001);
    }
}
