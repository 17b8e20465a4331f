//! Positions of NMEA 0183 sentences, as survey receivers and phones log them.
//!
//! Position, height and quality are those of GGA (any talker). The height above the ellipsoid is the altitude plus the geoid's
//! separation. The date is that of RMC or ZDA. Velocities follow from the positions: GGA has none, and RMC none upwards.

use crate::accuracy::{Truth, TruthError, TruthPosition};
use crate::formats::text::{lines, shorten};
use crate::frames::Geodetic;
use crate::skips::{Reason, Skips};
use crate::time::{Calendar, GpsTime, leap_seconds_at};

const SECONDS_PER_DAY: f64 = 86_400.0;
/// Lines that are read to recognise a file.
const LINES_TO_RECOGNISE: usize = 100;
/// Largest height that is believed, m.
const MAX_HEIGHT_M: f64 = 1e7;

/// Whether a file is NMEA text: one of its first lines is a sentence of positions or of the date.
pub fn is_nmea(bytes: &[u8]) -> bool {
    let sentences =
        lines(bytes).take(LINES_TO_RECOGNISE).filter_map(|(_, line)| Sentence::of(line).ok().flatten());
    sentences.into_iter().any(|sentence| matches!(sentence.kind(), "GGA" | "RMC" | "ZDA"))
}

/// Whether a date stands anywhere in a file.
pub fn has_date(bytes: &[u8]) -> bool {
    lines(bytes)
        .any(|(_, line)| Sentence::of(line).ok().flatten().is_some_and(|sentence| sentence.date().is_some()))
}

/// Reads a whole file. `near` is an instant at most half a day from its beginning; it counts where no sentence has a date.
///
/// Qualities are told in RTKLIB's numbers: 1 fixed (GGA 4), 2 float (5), 4 differential (2), 5 single (1) and estimated (6),
/// 6 precise point positioning (3). GGA without a fix (0) is no row.
///
/// # Errors
/// [`TruthError`] when no sentence has a usable position.
pub fn read(bytes: &[u8], near: GpsTime) -> Result<(Truth, Skips), TruthError> {
    let mut skips = Skips::default();
    let mut rows = 0;
    let mut fixes = Vec::new();
    let mut day = Day::default();
    for (number, line) in lines(bytes) {
        let sentence = match Sentence::of(line) {
            Ok(Some(sentence)) => sentence,
            Ok(None) => continue,
            Err(reason) => {
                skips.add(reason, || format!("line {number}: '{}'", shorten(line)));
                continue;
            }
        };
        if let Some((midnight_utc, time_of_day_s)) = sentence.date() {
            day.is_dated(midnight_utc, time_of_day_s);
        }
        if sentence.kind() != "GGA" || sentence.word(6) == "0" {
            continue;
        }
        rows += 1;
        match sentence.fix(&mut skips) {
            Some(fix) => fixes.push((day.instant(fix.time_of_day_s), fix)),
            None => skips.add(Reason::TruthRowUnreadable, || format!("line {number}: '{}'", shorten(line))),
        }
    }
    let midnight_utc = day.first_midnight_utc(near - leap_seconds_at(near) as f64);
    let positions = fixes.into_iter().map(|(instant, fix)| fix.to_position(&instant, midnight_utc)).collect();
    Truth::from_positions(positions, rows, skips)
}

/// The days that pass while a file is read. Sentences before the first date count their days backwards from it.
#[derive(Default)]
struct Day {
    /// Midnights since the first sentence with a time.
    midnights: i64,
    first_time_of_day_s: Option<f64>,
    last_time_of_day_s: Option<f64>,
    /// Midnight before the first sentence, UTC, by the first date.
    dated_utc: Option<GpsTime>,
}

/// A time of day of a day counted from the file's first sentence.
struct Instant {
    midnights: i64,
    time_of_day_s: f64,
}

impl Day {
    /// Takes the next time of day. A step back by more than half a day is midnight.
    fn instant(&mut self, time_of_day_s: f64) -> Instant {
        if let Some(last) = self.last_time_of_day_s {
            let step_s = time_of_day_s - last;
            self.midnights +=
                i64::from(step_s < -SECONDS_PER_DAY / 2.0) - i64::from(step_s > SECONDS_PER_DAY / 2.0);
        }
        self.first_time_of_day_s.get_or_insert(time_of_day_s);
        self.last_time_of_day_s = Some(time_of_day_s);
        Instant { midnights: self.midnights, time_of_day_s }
    }

    /// Takes a date; of several the first counts.
    fn is_dated(&mut self, midnight_utc: GpsTime, time_of_day_s: f64) {
        let Instant { midnights, .. } = self.instant(time_of_day_s);
        self.dated_utc.get_or_insert(midnight_utc - midnights as f64 * SECONDS_PER_DAY);
    }

    /// Midnight before the first sentence, UTC. Without a date it is that which brings the first time of day nearest to an instant.
    fn first_midnight_utc(&self, near_utc: GpsTime) -> GpsTime {
        self.dated_utc.unwrap_or_else(|| {
            let since_midnight_s = near_utc.tow_s().rem_euclid(SECONDS_PER_DAY);
            let ahead_s = since_midnight_s - self.first_time_of_day_s.unwrap_or(since_midnight_s);
            near_utc - since_midnight_s + (ahead_s / SECONDS_PER_DAY).round() * SECONDS_PER_DAY
        })
    }
}

/// Time, place and quality of GGA.
struct Fix {
    time_of_day_s: f64,
    place: Geodetic,
    quality: u8,
}

impl Fix {
    /// With its date, by the midnight before the file's first sentence.
    fn to_position(&self, instant: &Instant, first_midnight_utc: GpsTime) -> TruthPosition {
        let utc = first_midnight_utc + instant.midnights as f64 * SECONDS_PER_DAY + instant.time_of_day_s;
        TruthPosition {
            time_gps: utc + leap_seconds_at(utc) as f64,
            position: self.place.geodetic_to_ecef(),
            velocity: None,
            quality: self.quality,
        }
    }
}

/// A sentence whose checksum, if it has one, is right.
struct Sentence<'a> {
    words: Vec<&'a str>,
}

impl<'a> Sentence<'a> {
    /// `None` for a line that is no sentence of a talker.
    ///
    /// # Errors
    /// The reason to count a damaged sentence under.
    fn of(line: &'a [u8]) -> Result<Option<Self>, Reason> {
        let start = line.iter().position(|byte| *byte == b'$');
        let Some(text) = start.and_then(|at| line.get(at + 1..)) else { return Ok(None) };
        let Ok(text) = std::str::from_utf8(text) else { return Ok(None) };
        let (text, checksum) = match text.trim_end().split_once('*') {
            Some((text, checksum)) => (text, Some(checksum)),
            None => (text.trim_end(), None),
        };
        let is_right = |stated: &str| {
            let sum = text.bytes().fold(0, |sum, byte| sum ^ byte);
            u8::from_str_radix(stated, 16) == Ok(sum)
        };
        if checksum.is_some_and(|stated| !is_right(stated)) {
            return Err(Reason::NmeaSentenceWrongChecksum);
        }
        let words: Vec<&str> = text.split(',').map(str::trim).collect();
        let is_talkers = words.first().is_some_and(|name| name.len() == 5 && !name.starts_with('P'));
        Ok(is_talkers.then_some(Self { words }))
    }

    /// GGA, RMC and so on.
    fn kind(&self) -> &str {
        self.words.first().and_then(|name| name.get(2..)).unwrap_or_default()
    }

    fn word(&self, at: usize) -> &str {
        self.words.get(at).copied().unwrap_or_default()
    }

    fn number(&self, at: usize) -> Option<f64> {
        self.word(at).parse().ok().filter(|value: &f64| value.is_finite())
    }

    /// `hhmmss.sss` as seconds of the day.
    fn time_of_day_s(&self) -> Option<f64> {
        let text = self.word(1);
        let part = |range: std::ops::Range<usize>| text.get(range)?.parse::<u32>().ok();
        let (hour, minute) = (part(0..2)?, part(2..4)?);
        let second = text.get(4..)?.parse::<f64>().ok()?;
        let is_time = hour < 24 && minute < 60 && (0.0..61.0).contains(&second);
        is_time.then(|| f64::from(hour * 3_600 + minute * 60) + second)
    }

    /// Of RMC and ZDA: the day's midnight by UTC, and the time of day.
    fn date(&self) -> Option<(GpsTime, f64)> {
        let small = |text: &str| text.parse::<u32>().ok();
        let (day, month, year) = match self.kind() {
            "RMC" => {
                let date = self.word(9);
                let two = |range: std::ops::Range<usize>| date.get(range).and_then(small);
                (two(0..2)?, two(2..4)?, 2_000 + two(4..6).filter(|_| date.len() == 6)?)
            }
            "ZDA" => (small(self.word(2))?, small(self.word(3))?, small(self.word(4))?),
            _ => return None,
        };
        let year = i32::try_from(year).ok()?;
        let midnight =
            GpsTime::from_calendar(Calendar { year, month, day, hour: 0, minute: 0, second: 0.0 })?;
        Some((midnight, self.time_of_day_s()?))
    }

    fn fix(&self, skips: &mut Skips) -> Option<Fix> {
        let latitude_deg = self.angle_deg(2, 2, "N", "S").filter(|angle| angle.abs() <= 90.0)?;
        let longitude_deg = self.angle_deg(4, 3, "E", "W").filter(|angle| angle.abs() <= 180.0)?;
        let separation_m = self.number(11).unwrap_or_else(|| {
            skips.add(Reason::HeightsAboveGeoid, || {
                format!("GGA at {} has no separation of the geoid", self.word(1))
            });
            0.0
        });
        let height_m = self.number(9)? + separation_m;
        let quality = match self.word(6) {
            "4" => 1,
            "5" => 2,
            "2" => 4,
            "1" | "6" => 5,
            "3" => 6,
            _ => return None,
        };
        let time_of_day_s = self.time_of_day_s()?;
        let is_height = height_m.abs() <= MAX_HEIGHT_M;
        is_height.then(|| Fix {
            time_of_day_s,
            place: Geodetic::from_degrees(latitude_deg, longitude_deg, height_m),
            quality,
        })
    }

    /// `ddmm.mmmm` and its hemisphere, with `digits` of degrees.
    fn angle_deg(&self, at: usize, digits: usize, positive: &str, negative: &str) -> Option<f64> {
        let text = self.word(at);
        let degrees: f64 = text.get(..digits)?.parse().ok()?;
        let minutes: f64 = text.get(digits..)?.parse().ok().filter(|m| (0.0..60.0).contains(m))?;
        let angle = degrees + minutes / 60.0;
        match self.word(at + 1) {
            side if side == positive => Some(angle),
            side if side == negative => Some(-angle),
            _ => None,
        }
    }
}
