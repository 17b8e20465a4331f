//! Epoch times of messages, which lack the week (or even the day), to GPS time.

use crate::gnss::Constellation;
use crate::moscow::{self, MILLIS_PER_DAY};
use crate::time::{BEIDOU_BEHIND_GPS_S, GpsTime};

const MILLIS_PER_WEEK: i64 = 7 * MILLIS_PER_DAY;

/// The epoch time of a message as it is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SentTime {
    /// Milliseconds of the system's own week (DF004, DF248, DF427, DF428).
    OfWeek(u32),
    /// GLONASS: day of the week, 0 = Sunday, 7 = unknown (DF416), and milliseconds of the day in Moscow time (DF034).
    Glonass {
        /// Day of the week.
        day: u32,
        /// Milliseconds of the day; one second more in a leap second.
        millis: u32,
    },
}

impl SentTime {
    /// Whether the number can be a time.
    const fn is_possible(self) -> bool {
        match self {
            Self::OfWeek(millis) => (millis as i64) < MILLIS_PER_WEEK,
            Self::Glonass { day, millis } => day <= 7 && (millis as i64) < MILLIS_PER_DAY + 1_000,
        }
    }
}

/// Where on the time axis a stream is.
#[derive(Clone, Copy, Debug)]
pub(super) struct StreamClock {
    /// An instant near the next message's.
    pub(super) near: GpsTime,
    /// GPS − UTC, s.
    pub(super) leap_seconds: u8,
}

impl StreamClock {
    /// The instant nearest to the stream's that a sent time can mean; `None` for a number that is no time.
    pub(super) fn resolve(&self, constellation: Constellation, sent: SentTime) -> Option<GpsTime> {
        if !sent.is_possible() {
            return None;
        }
        let (millis, period) = match sent {
            SentTime::OfWeek(millis) => {
                (i64::from(millis) + behind_gps_millis(constellation), MILLIS_PER_WEEK)
            }
            SentTime::Glonass { day: 7, millis } => (self.moscow_to_gps(i64::from(millis)), MILLIS_PER_DAY),
            SentTime::Glonass { day, millis } => {
                (self.moscow_to_gps(i64::from(day) * MILLIS_PER_DAY + i64::from(millis)), MILLIS_PER_WEEK)
            }
        };
        self.nearest(millis, period)
    }

    /// GPS time of milliseconds of a day in Moscow. The day is number `day` (1 = 1 January) of the four years that begin with a leap
    /// year (N_T of the GLONASS ICD, 4.4), unless that is more than `limit_s` from the stream's own time; else the nearest.
    pub(super) fn resolve_moscow(&self, day: Option<u32>, millis: i64, limit_s: f64) -> Option<GpsTime> {
        let of_four_years =
            day.and_then(|day| moscow::of_four_years(day, millis, self.leap_seconds.into(), self.near));
        of_four_years
            .filter(|time| (*time - self.near).abs() <= limit_s)
            .or_else(|| self.nearest(self.moscow_to_gps(millis), MILLIS_PER_DAY))
    }

    /// The instant nearest to the stream's that is `millis` after a multiple of `period`.
    fn nearest(&self, millis: i64, period: i64) -> Option<GpsTime> {
        moscow::nearest(millis, period, self.near)
    }

    fn moscow_to_gps(&self, millis: i64) -> i64 {
        moscow::to_gps_millis(millis, self.leap_seconds.into())
    }
}

fn behind_gps_millis(constellation: Constellation) -> i64 {
    #[allow(clippy::cast_possible_truncation)] // 14 s
    let beidou = (BEIDOU_BEHIND_GPS_S * 1e3) as i64;
    if constellation == Constellation::Beidou { beidou } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Constellation::{Beidou, Galileo, Glonass, Gps};

    fn clock(near: &str) -> StreamClock {
        StreamClock { near: near.parse().unwrap(), leap_seconds: 18 }
    }

    fn resolved(near: &str, constellation: Constellation, sent: SentTime) -> String {
        clock(near).resolve(constellation, sent).unwrap().iso()
    }

    #[test]
    fn the_week_is_the_nearest() {
        // Thursday 2020-08-13 14:19:53 is second 397193 of the week.
        let thursday = SentTime::OfWeek(397_193_000);
        for near in ["2020-08-10T03:00:00", "2020-08-13T14:19:54", "2020-08-16T23:00:00"] {
            assert_eq!(resolved(near, Gps, thursday), "2020-08-13T14:19:53.000");
            assert_eq!(resolved(near, Galileo, thursday), "2020-08-13T14:19:53.000");
        }
        let last_of_week = SentTime::OfWeek(604_799_500);
        assert_eq!(resolved("2020-08-16T00:00:00", Gps, last_of_week), "2020-08-15T23:59:59.500");
        assert_eq!(resolved("2020-08-15T23:59:59.5", Gps, SentTime::OfWeek(0)), "2020-08-16T00:00:00.000");
    }

    #[test]
    fn beidou_is_fourteen_seconds_behind_across_the_week_too() {
        let near = "2020-08-13T14:19:53";
        assert_eq!(resolved(near, Beidou, SentTime::OfWeek(397_179_000)), "2020-08-13T14:19:53.000");
        let near = "2020-08-16T00:00:05";
        assert_eq!(resolved(near, Beidou, SentTime::OfWeek(604_791_000)), "2020-08-16T00:00:05.000");
    }

    #[test]
    fn glonass_is_moscow_time_without_leap_seconds() {
        // 14:19:53 GPST is 14:19:35 UTC, 17:19:35 in Moscow, on a Thursday (day 4).
        let millis = ((17 * 60 + 19) * 60 + 35) * 1_000;
        let near = "2020-08-12T20:00:00";
        assert_eq!(resolved(near, Glonass, SentTime::Glonass { day: 4, millis }), "2020-08-13T14:19:53.000");
        let near = "2020-08-13T20:00:00";
        assert_eq!(resolved(near, Glonass, SentTime::Glonass { day: 7, millis }), "2020-08-13T14:19:53.000");
        // 00:00:00 on Sunday in Moscow is Saturday 21:00:18 GPST.
        let midnight = SentTime::Glonass { day: 0, millis: 0 };
        assert_eq!(resolved("2020-08-16T00:00:00", Glonass, midnight), "2020-08-15T21:00:18.000");
    }

    #[test]
    fn days_of_four_years_count_from_a_leap_year() {
        // 13 August 2020 is day 226 of the leap year 2020; 14 August 2023 is day 366 + 365 + 365 + 226.
        let millis = ((17 * 60 + 19) * 60 + 35) * 1_000;
        for (near, day, expected) in [
            ("2020-08-11T20:00:00", Some(226), "2020-08-13T14:19:53.000"),
            ("2023-08-16T20:00:00", Some(1_322), "2023-08-14T14:19:53.000"),
            ("2020-08-11T20:00:00", None, "2020-08-11T14:19:53.000"),
            ("2020-08-11T20:00:00", Some(0), "2020-08-11T14:19:53.000"),
            ("2020-08-11T20:00:00", Some(1_462), "2020-08-11T14:19:53.000"),
            // A day too far off to be believed.
            ("2020-08-03T20:00:00", Some(226), "2020-08-03T14:19:53.000"),
        ] {
            let time = clock(near).resolve_moscow(day, millis, 4.0 * 86_400.0).unwrap();
            assert_eq!(time.iso(), expected, "{near} {day:?}");
        }
    }

    #[test]
    fn impossible_times_are_refused() {
        let clock = clock("2020-08-13T14:19:53");
        assert_eq!(clock.resolve(Gps, SentTime::OfWeek(604_800_000)), None);
        assert_eq!(clock.resolve(Glonass, SentTime::Glonass { day: 3, millis: 86_401_000 }), None);
        let end = StreamClock { near: GpsTime::from_nanos(i64::MAX), leap_seconds: 18 };
        assert!(end.resolve(Gps, SentTime::OfWeek(0)).is_none_or(|t| t > GpsTime::default()));
    }
}
