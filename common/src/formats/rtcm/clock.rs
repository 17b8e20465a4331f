//! Epoch times of messages, which lack the week (or even the day), to GPS time.

use crate::formats::bits::{Bits, TooShort};
use crate::formats::moscow::{self, MILLIS_PER_DAY};
use crate::gnss::Constellation;
use crate::time::{BEIDOU_BEHIND_GPS_S, GpsTime};

const MILLIS_PER_WEEK: i64 = 7 * MILLIS_PER_DAY;
/// DF416: the day is not known.
const UNKNOWN_DAY: u32 = 7;
/// DF416 of receivers that do not know the day and do not say so; it is Sunday's, too.
const DAY_OF_DEFAULT: u32 = 0;
/// A message this near to the one before tells that the stream was not interrupted, s.
const FRESH_S: f64 = 3_600.0;

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
    /// Of a multiple signal message, at its place.
    pub(super) fn of_msm(bits: &mut Bits<'_>, constellation: Constellation) -> Result<Self, TooShort> {
        Ok(match constellation {
            Constellation::Glonass => Self::Glonass { day: bits.unsigned(3)?, millis: bits.unsigned(27)? },
            _ => Self::OfWeek(bits.unsigned(30)?),
        })
    }

    /// Of a message 1001 to 1004 or 1009 to 1012, at its place. Of GLONASS the day is not sent.
    pub(super) fn of_legacy(bits: &mut Bits<'_>, constellation: Constellation) -> Result<Self, TooShort> {
        Ok(match constellation {
            Constellation::Glonass => Self::Glonass { day: UNKNOWN_DAY, millis: bits.unsigned(27)? },
            _ => Self::OfWeek(bits.unsigned(30)?),
        })
    }

    /// Whether it has a day of the week that is none of those that receivers send for want of one.
    pub(super) const fn has_day(self) -> bool {
        matches!(self, Self::Glonass { day, .. } if day != UNKNOWN_DAY && day != DAY_OF_DEFAULT)
    }

    /// Whether the number can be a time.
    const fn is_possible(self) -> bool {
        match self {
            Self::OfWeek(millis) => (millis as i64) < MILLIS_PER_WEEK,
            Self::Glonass { day, millis } => day <= 7 && (millis as i64) < MILLIS_PER_DAY + 1_000,
        }
    }
}

/// What a sent time means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Resolved {
    /// The instant.
    pub(super) time: GpsTime,
    /// Whether GLONASS' day of the week says another day and is not believed.
    pub(super) contradicts_day: bool,
}

/// Where on the time axis a stream is.
#[derive(Clone, Copy, Debug)]
pub(super) struct StreamClock {
    /// An instant near the next message's.
    near: GpsTime,
    /// GPS − UTC, s.
    leap_seconds: u8,
    /// Whether that instant is the stream's own time.
    is_running: bool,
    /// Whether GLONASS' days of the week have been right: some receivers send 0 on every day.
    are_days_right: bool,
}

impl StreamClock {
    /// A clock that somebody has set near the stream's beginning; GPS − UTC in seconds.
    pub(super) const fn near(near: GpsTime, leap_seconds: u8) -> Self {
        Self { near, leap_seconds, is_running: false, are_days_right: false }
    }

    /// An instant near the next message's.
    pub(super) const fn now(&self) -> GpsTime {
        self.near
    }

    /// Whether the stream itself has told the time.
    pub(super) const fn is_running(&self) -> bool {
        self.is_running
    }

    /// The stream is at this instant.
    pub(super) const fn set(&mut self, time: GpsTime) {
        self.near = time;
        self.is_running = true;
    }

    /// An ephemeris was sent near this instant.
    pub(super) const fn move_near(&mut self, time: GpsTime) {
        self.near = time;
    }

    /// The same clock at another instant.
    pub(super) const fn at(&self, near: GpsTime) -> Self {
        Self { near, ..*self }
    }

    /// The instant nearest to the stream's that a sent time can mean; `None` for a number that is no time.
    pub(super) fn resolve(&self, constellation: Constellation, sent: SentTime) -> Option<Resolved> {
        if !sent.is_possible() {
            return None;
        }
        let certain = |time| Resolved { time, contradicts_day: false };
        match sent {
            SentTime::OfWeek(millis) => {
                let millis = i64::from(millis) + behind_gps_millis(constellation);
                self.nearest(millis, MILLIS_PER_WEEK).map(certain)
            }
            SentTime::Glonass { day, millis } => {
                let by_time = self.nearest(self.moscow_to_gps(i64::from(millis)), MILLIS_PER_DAY)?;
                if day == UNKNOWN_DAY {
                    return Some(certain(by_time));
                }
                let of_week = i64::from(day) * MILLIS_PER_DAY + i64::from(millis);
                let by_day = self.nearest(self.moscow_to_gps(of_week), MILLIS_PER_WEEK)?;
                if by_day == by_time || self.believes_day(day, by_time, by_day) {
                    return Some(certain(by_day));
                }
                Some(Resolved { time: by_time, contradicts_day: true })
            }
        }
    }

    /// Whether a day of the week is believed although another day is nearer. Once the stream's time is known, only after an
    /// interruption, of a stream whose days were right before it.
    fn believes_day(&self, day: u32, by_time: GpsTime, by_day: GpsTime) -> bool {
        if self.is_running {
            let is_fresh = (by_time - self.near).abs() <= FRESH_S;
            // The same time of another day.
            let is_later_day = by_time < self.near && by_day > self.near;
            return self.are_days_right && (!is_fresh || is_later_day);
        }
        day != DAY_OF_DEFAULT
    }

    /// Learns from a GLONASS message whose time was admitted, before the clock is set by it.
    pub(super) fn learn_day(&mut self, sent: SentTime, resolved: Resolved) {
        if let SentTime::Glonass { day, .. } = sent
            && day != UNKNOWN_DAY
            && self.is_running
        {
            let is_proof = day != DAY_OF_DEFAULT || self.are_days_right;
            self.are_days_right = is_proof && !resolved.contradicts_day;
        }
    }

    /// GPS time of milliseconds of a day in Moscow by its date: number of the day (1 = 1 January) in the four years that begin with a leap
    /// year (N_T of the GLONASS ICD, 4.4), and number of the four years from 1996 on (N_4). Without that they are the nearest ones.
    pub(super) fn of_date(&self, day: u32, four_years: Option<u32>, millis: i64) -> Option<GpsTime> {
        let leap_seconds = self.leap_seconds.into();
        match four_years {
            Some(four_years) => moscow::of_date(four_years, day, millis, leap_seconds),
            None => moscow::of_four_years(day, millis, leap_seconds, self.near),
        }
    }

    /// GPS time of milliseconds of the nearest day in Moscow.
    pub(super) fn of_nearest_day(&self, millis: i64) -> Option<GpsTime> {
        self.nearest(self.moscow_to_gps(millis), MILLIS_PER_DAY)
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
        StreamClock::near(near.parse().unwrap(), 18)
    }

    fn resolved(near: &str, constellation: Constellation, sent: SentTime) -> String {
        clock(near).resolve(constellation, sent).unwrap().time.iso()
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
        // 13 August 2020 is day 226 of the leap year 2020; 14 August 2023 is day 366 + 365 + 365 + 226. 2020 begins the seventh four years from 1996.
        let millis = ((17 * 60 + 19) * 60 + 35) * 1_000;
        for (near, day, four_years, expected) in [
            ("2020-08-11T20:00:00", 226, None, Some("2020-08-13T14:19:53.000")),
            ("2023-08-16T20:00:00", 1_322, None, Some("2023-08-14T14:19:53.000")),
            ("2023-08-16T20:00:00", 226, Some(7), Some("2020-08-13T14:19:53.000")),
            ("2020-08-11T20:00:00", 1, Some(1), Some("1996-01-01T14:19:53.000")),
            ("2020-08-11T20:00:00", 0, None, None),
            ("2020-08-11T20:00:00", 1_462, Some(7), None),
        ] {
            let time = clock(near).of_date(day, four_years, millis).map(GpsTime::iso);
            assert_eq!(time.as_deref(), expected, "{near} {day:?}");
        }
        let nearest = clock("2020-08-11T20:00:00").of_nearest_day(millis).unwrap();
        assert_eq!(nearest.iso(), "2020-08-11T14:19:53.000");
    }

    /// Some receivers send Sunday, or the same day, for ever.
    #[test]
    fn days_of_the_week_are_believed_where_they_agree() {
        // 17:19:35 in Moscow, on a Thursday (day 4).
        let sent = |day| SentTime::Glonass { day, millis: ((17 * 60 + 19) * 60 + 35) * 1_000 };
        let mut running = clock("2020-08-13T14:19:52");
        running.set("2020-08-13T14:19:52".parse().unwrap());
        let resolved = |clock: &StreamClock, day| {
            let resolved = clock.resolve(Glonass, sent(day)).unwrap();
            (resolved.time.iso(), resolved.contradicts_day)
        };
        let right = "2020-08-13T14:19:53.000".to_owned();
        for day in 0..=7 {
            assert_eq!(resolved(&running, day), (right.clone(), ![4, 7].contains(&day)), "day {day}");
        }
        // After a day of silence the day counts, if it was right before.
        let later = |clock: &StreamClock| clock.at("2020-08-12T02:00:00".parse().unwrap());
        assert_eq!(resolved(&later(&running), 4).0, "2020-08-11T14:19:53.000");
        running.learn_day(sent(4), running.resolve(Glonass, sent(4)).unwrap());
        assert_eq!(resolved(&later(&running), 4).0, right);
        running.learn_day(sent(5), running.resolve(Glonass, sent(5)).unwrap());
        assert_eq!(resolved(&later(&running), 4).0, "2020-08-11T14:19:53.000");
        // Before the stream has told the time, any day but the one of those that do not know it.
        let before = clock("2020-08-12T02:00:00");
        assert_eq!(resolved(&before, 4), (right, false));
        assert_eq!(resolved(&before, 0), ("2020-08-11T14:19:53.000".to_owned(), true));
    }

    #[test]
    fn impossible_times_are_refused() {
        let clock = clock("2020-08-13T14:19:53");
        assert_eq!(clock.resolve(Gps, SentTime::OfWeek(604_800_000)), None);
        assert_eq!(clock.resolve(Glonass, SentTime::Glonass { day: 3, millis: 86_401_000 }), None);
        let end = StreamClock::near(GpsTime::from_nanos(i64::MAX), 18);
        assert!(end.resolve(Gps, SentTime::OfWeek(0)).is_none_or(|t| t.time > GpsTime::default()));
    }
}
