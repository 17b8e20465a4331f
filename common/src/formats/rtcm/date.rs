//! The date that an ephemeris states, and what follows for a stream whose other messages lack the week.
//!
//! GPS and QZSS number weeks modulo 1024 (DF076), Galileo modulo 4096 (DF289), BeiDou modulo 8192 (DF489), GLONASS counts days over four years
//! (DF129) and the four years from 1996 (DF134).

use crate::gnss::SatelliteId;
use crate::time::{GpsTime, SECONDS_PER_DAY, SECONDS_PER_WEEK};

/// A week as sent is that of the transmission, or, of other encoders, that of the reference time. So within this of a week's end the reference
/// time may lie in the week after or before the one sent, s. Ephemerides are sent for less time before and after their reference.
const NEXT_TO_WEEKS_END_S: f64 = 6.0 * 3_600.0;
/// The same for GLONASS' days.
const NEXT_TO_DAYS_END_S: f64 = 3_600.0;
/// The GPS week of the first edition of RTCM 3, February 2004: no stream is older.
pub const FIRST_WEEK: i64 = 1_255;
/// GLONASS' days begin in Moscow.
const MOSCOW_AHEAD_S: f64 = 3.0 * 3_600.0;
/// Nearer than this to where the stream is (s), an ephemeris moves it at once; farther away it takes two that agree.
const STEP_S: f64 = 6.0 * 3_600.0;
/// Where observations go on, ephemerides' reference times are not farther ahead of them than this, s.
const SENT_AHEAD_S: f64 = 3.0 * 3_600.0;
/// Two ephemerides that agree on a date are not farther apart, s.
const AGREEMENT_S: f64 = 86_400.0;

/// A satellite's reference time as its message states it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Claim {
    /// Who states it.
    pub(super) satellite: SatelliteId,
    /// One of the instants that it may be: it repeats.
    pub(super) as_sent: GpsTime,
    /// After how many days the number of the week, or of the day, repeats; `None` of a date that is whole.
    pub(super) repeats_days: Option<i64>,
    /// What was sent beside the time.
    pub(super) unit: Unit,
}

/// What is counted in a date.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    /// Weeks of GPS time, or of a time seconds from it.
    Week,
    /// Days in Moscow.
    Day,
}

impl Claim {
    /// The reference time with the number completed so that it comes nearest to an instant.
    fn completed(&self, near: GpsTime) -> GpsTime {
        let Some(period) = self.repeats_days else { return self.as_sent };
        let period_s = period as f64 * SECONDS_PER_DAY;
        let completed = self.as_sent + ((near - self.as_sent) / period_s).round() * period_s;
        if completed.week() < FIRST_WEEK { completed + period_s } else { completed }
    }

    /// What the reference time may be, likeliest first.
    pub(super) fn candidates(&self, near: GpsTime) -> impl Iterator<Item = GpsTime> {
        let as_sent = self.completed(near);
        let tow_s = as_sent.tow_s();
        let (since_s, unit_s, next_to_s) = match self.unit {
            Unit::Week => (tow_s, SECONDS_PER_WEEK, NEXT_TO_WEEKS_END_S),
            Unit::Day => ((tow_s + MOSCOW_AHEAD_S) % SECONDS_PER_DAY, SECONDS_PER_DAY, NEXT_TO_DAYS_END_S),
        };
        let shift_s = match since_s {
            since_s if since_s < next_to_s => Some(unit_s),
            since_s if since_s > unit_s - next_to_s => Some(-unit_s),
            _ => None,
        };
        std::iter::once(as_sent).chain(shift_s.map(|shift_s| as_sent + shift_s))
    }

    /// The candidate within half a week, or half a day, of an instant, or else the likeliest.
    fn likeliest(&self, near: GpsTime) -> GpsTime {
        let half_s = match self.unit {
            Unit::Week => SECONDS_PER_WEEK / 2.0,
            Unit::Day => SECONDS_PER_DAY / 2.0,
        };
        let is_near = |time: &GpsTime| (*time - near).abs() <= half_s;
        self.candidates(near).find(is_near).unwrap_or_else(|| self.completed(near))
    }
}

/// What the dates of ephemerides are to a stream. One satellite alone, whose week may be wrong, moves nothing by more than hours.
#[derive(Clone, Debug, Default)]
pub(super) struct Dates {
    /// The last date that contradicts, and who stated it.
    contradiction: Option<(SatelliteId, GpsTime)>,
    /// Weeks that the ephemerides are ahead of the stream, whose observations have told another week by the instant that the caller gave.
    weeks_ahead: i64,
}

/// The outcome for one ephemeris.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Dated {
    /// Its reference time on the stream's time axis.
    pub(super) toe: GpsTime,
    /// Where the stream is by it, if that is news.
    pub(super) now: Option<GpsTime>,
    /// Weeks that ephemerides are found to be ahead of the stream, if that is news.
    pub(super) weeks_ahead: Option<i64>,
}

impl Dates {
    /// Of a stream whose observations have told the time of the week: it stays where it is, and goes on with the ephemerides only where the
    /// observations have ended.
    pub(super) fn beside_observations(&mut self, claim: &Claim, now: GpsTime) -> Dated {
        let toe = claim.likeliest(now);
        let ahead_s = toe - now;
        #[allow(clippy::cast_possible_truncation)] // GPS time has 15 000 weeks
        let weeks = (ahead_s / SECONDS_PER_WEEK).round() as i64;
        let mut dated = Dated { toe, now: None, weeks_ahead: None };
        if weeks == self.weeks_ahead {
            self.contradiction = None;
            dated.now = (ahead_s > SENT_AHEAD_S && ahead_s <= STEP_S).then_some(toe);
        } else if !self.is_confirmed(claim.satellite, toe) {
            return dated;
        } else {
            self.weeks_ahead = weeks;
            dated.weeks_ahead = Some(weeks);
        }
        dated.toe = toe + -(weeks as f64 * SECONDS_PER_WEEK);
        dated
    }

    /// Of a stream of ephemerides only, which moves along with them.
    pub(super) fn alone(&mut self, claim: &Claim, now: GpsTime) -> Dated {
        let toe = claim.likeliest(now);
        let is_step = (toe - now).abs() <= STEP_S;
        let is_believed = is_step || self.is_confirmed(claim.satellite, toe);
        if is_believed {
            self.contradiction = None;
        }
        Dated { toe, now: is_believed.then_some(toe), weeks_ahead: None }
    }

    /// Whether another satellite, or this one with another reference time, has said so just before.
    fn is_confirmed(&mut self, satellite: SatelliteId, toe: GpsTime) -> bool {
        let is_confirmed = self.contradiction.is_some_and(|(other, before)| {
            (other != satellite || before != toe) && (before - toe).abs() <= AGREEMENT_S
        });
        self.contradiction = if is_confirmed { None } else { Some((satellite, toe)) };
        is_confirmed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DAY_S: f64 = 86_400.0;

    fn claim(satellite: &str, week: i64, tow_s: f64) -> Claim {
        Claim {
            satellite: satellite.parse().unwrap(),
            as_sent: GpsTime::from_week_tow(week % 1024, tow_s),
            repeats_days: Some(7 * 1024),
            unit: Unit::Week,
        }
    }

    #[test]
    fn weeks_are_those_sent_but_next_to_their_end() {
        for (now, sent, expected) in [
            // In the middle of a week the number sent is right, however far away.
            ((2111, 300_000.0), (2111, 302_400.0), (2111, 302_400.0)),
            ((2112, 302_399.0), (2111, 302_400.0), (2111, 302_400.0)),
            ((2119, 302_399.0), (2111, 302_400.0), (2111, 302_400.0)),
            // Next to its end it may be that of the transmission.
            ((2111, 604_790.0), (2111, 7_200.0), (2112, 7_200.0)),
            ((2111, 604_790.0), (2112, 7_200.0), (2112, 7_200.0)),
            ((2112, 10.0), (2112, 597_600.0), (2111, 597_600.0)),
            ((2112, 10.0), (2111, 597_600.0), (2111, 597_600.0)),
            // The number repeats after 1024 weeks.
            ((1024 + 300, 100.0), (300, 7_200.0), (1024 + 300, 7_200.0)),
            // Before 2004 there was no RTCM 3.
            ((500, 100.0), (300, 7_200.0), (1024 + 300, 7_200.0)),
        ] {
            let now = GpsTime::from_week_tow(now.0, now.1);
            let toe = Dates::default().beside_observations(&claim("G05", sent.0, sent.1), now).toe;
            assert_eq!(toe, GpsTime::from_week_tow(expected.0, expected.1), "{now}: {sent:?}");
        }
    }

    /// GLONASS' day is that of the transmission, too.
    #[test]
    fn days_are_those_sent_but_next_to_their_end() {
        let midnight: GpsTime = "2020-06-28T21:00:18".parse().unwrap();
        for (now_s, sent_s, expected_s) in [
            (-1_800.0, 0.0, 0.0),
            (-1_800.0, -DAY_S, 0.0),
            (900.0, DAY_S - 900.0, -900.0),
            (900.0, -900.0, -900.0),
            (5.0 * DAY_S, -DAY_S, -DAY_S),
            (-1_800.0, 43_200.0 - DAY_S, 43_200.0 - DAY_S),
        ] {
            let satellite = "R01".parse().unwrap();
            let claim = Claim { satellite, as_sent: midnight + sent_s, repeats_days: None, unit: Unit::Day };
            let toe = Dates::default().alone(&claim, midnight + now_s).toe;
            assert_eq!(toe - midnight, expected_s, "{now_s} {sent_s}");
        }
    }

    #[test]
    fn one_satellite_does_not_move_a_stream_by_days_and_two_do() {
        let start = GpsTime::from_week_tow(2111, 100_000.0);
        let (mut dates, mut now) = (Dates::default(), start);
        let mut hear = |satellite: &str, week: i64, tow_s: f64| {
            let dated = dates.alone(&claim(satellite, week, tow_s), now);
            now = dated.now.unwrap_or(now);
            now - start
        };
        assert_eq!(hear("G01", 2111, 107_200.0), 7_200.0);
        assert_eq!(hear("G02", 2119, 107_200.0), 7_200.0, "another week");
        assert_eq!(hear("G02", 2119, 107_200.0), 7_200.0, "the same again");
        assert_eq!(hear("G03", 2111, 107_200.0), 7_200.0);
        assert_eq!(hear("G02", 2119, 107_200.0), 7_200.0, "and later");
        assert_eq!(hear("G04", 2111, 107_184.0), 7_184.0);
        // Nothing came for four days.
        assert_eq!(hear("G01", 2111, 107_200.0 + 4.0 * DAY_S), 7_184.0);
        assert_eq!(hear("G02", 2111, 107_200.0 + 4.0 * DAY_S), 7_200.0 + 4.0 * DAY_S);
    }

    #[test]
    fn ephemerides_of_other_weeks_than_the_observations_go_along_when_two_agree() {
        let now = GpsTime::from_week_tow(2111, 100_000.0);
        let mut dates = Dates::default();
        let mut hear = |satellite: &str, week: i64| {
            let dated = dates.beside_observations(&claim(satellite, week, 100_800.0), now);
            (dated.toe.week(), dated.weeks_ahead)
        };
        assert_eq!(hear("G01", 2108), (2108, None));
        assert_eq!(hear("G01", 2108), (2108, None), "the same again");
        assert_eq!(hear("G02", 2111), (2111, None));
        assert_eq!(hear("G01", 2108), (2108, None));
        assert_eq!(hear("G03", 2108), (2111, Some(-3)));
        assert_eq!(hear("G04", 2108), (2111, None));
        assert_eq!(hear("G02", 2111), (2111, None), "it alone says otherwise now");
        assert_eq!(hear("G04", 2108), (2111, None));
    }
}
