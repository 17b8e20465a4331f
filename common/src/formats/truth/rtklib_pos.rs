//! Solution files of RTKLIB (`.pos`): RTKLIB manual 2.4.2, appendix B.1.
//!
//! Positions in degrees, in degrees, minutes and seconds, or as Earth-fixed coordinates; velocities where the file has them. Times are
//! GPST, UTC or JST, as week and seconds or as calendar time. Baselines to a base station are no positions and are refused.

use crate::accuracy::{Truth, TruthError, TruthPosition};
use crate::formats::text::{lines, shorten};
use crate::frames::{Ecef, EcefVector, Enu, Geodetic, LocalFrame};
use crate::skips::{Reason, Skips};
use crate::time::{Calendar, GpsTime, leap_seconds_at};

/// JST is ahead of UTC, s.
const JST_AHEAD_OF_UTC_S: f64 = 9.0 * 3_600.0;
/// Columns that a solution must have, for messages.
const EXPECTED: &str = "a line '%  GPST  latitude(deg) longitude(deg) height(m) Q ...' or one with x-ecef(m), y-ecef(m), z-ecef(m)";
/// Largest height and speed that are believed, m and m/s.
const MAX_HEIGHT_M: f64 = 1e7;
const MAX_SPEED_MPS: f64 = 1e5;

/// Whether a file is a solution of RTKLIB: the line that names its columns comes before its first row.
pub fn is_solution(bytes: &[u8]) -> bool {
    comments(bytes).any(|line| Layout::of(line).is_some())
}

/// Reads a whole solution. Rows of quality 0 are counted as the others; which qualities count is the caller's to say.
///
/// # Errors
/// [`TruthError`] when the line that names the columns is missing or names a baseline, or no row is usable.
pub fn read(bytes: &[u8]) -> Result<(Truth, Skips), TruthError> {
    let layout = comments(bytes).find_map(Layout::of);
    let layout = layout
        .ok_or_else(|| TruthError::Column { column: "latitude(deg)", expected: EXPECTED.to_owned() })?;
    let mut skips = Skips::default();
    if comments(bytes).any(|line| line.windows(b"/geodetic".len()).any(|part| part == b"/geodetic")) {
        skips.add(Reason::HeightsAboveGeoid, || "set RTKLIB's out-height to ellipsoidal".to_owned());
    }
    let mut rows = 0;
    let mut positions = Vec::new();
    for (number, line) in lines(bytes) {
        let line = String::from_utf8_lossy(line);
        let words: Vec<&str> = line.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty()).collect();
        if words.is_empty() || line.starts_with('%') {
            continue;
        }
        rows += 1;
        match layout.row(&words) {
            Some(row) => positions.push(row),
            None => {
                skips.add(Reason::TruthRowUnreadable, || {
                    format!("line {number}: '{}'", shorten(line.as_bytes()))
                });
            }
        }
    }
    Truth::from_positions(positions, rows, skips)
}

/// Lines that begin with a percent sign, up to the first that does not.
fn comments(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    lines(bytes)
        .map(|(_, line)| crate::formats::text::without_mark(line))
        .skip_while(|line| crate::formats::text::is_blank(line))
        .map_while(|line| line.strip_prefix(b"%"))
}

/// The clock of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Clock {
    Gpst,
    Utc,
    Jst,
}

/// Forms of positions.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Coordinates {
    Degrees,
    /// Degrees, minutes and seconds of latitude and longitude, a word each.
    Sexagesimal,
    Ecef,
}

/// Places of a row's words.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Layout {
    clock: Clock,
    coordinates: Coordinates,
    /// Words from the quality to the first velocity, if there are velocities.
    quality_to_velocity: Option<usize>,
}

impl Layout {
    /// From the comment line that names the columns.
    fn of(comment: &[u8]) -> Option<Self> {
        let text = String::from_utf8_lossy(comment);
        let names: Vec<&str> = text.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty()).collect();
        let clock = match *names.first()? {
            "GPST" => Clock::Gpst,
            "UTC" => Clock::Utc,
            "JST" => Clock::Jst,
            _ => return None,
        };
        let coordinates = match *names.get(1)? {
            "latitude(deg)" => Coordinates::Degrees,
            "latitude(d'\")" => Coordinates::Sexagesimal,
            "x-ecef(m)" => Coordinates::Ecef,
            _ => return None,
        };
        let quality = names.iter().position(|name| *name == "Q")?;
        let velocity = names.iter().position(|name| matches!(*name, "vn(m/s)" | "vx(m/s)"));
        Some(Self {
            clock,
            coordinates,
            quality_to_velocity: velocity.and_then(|at| at.checked_sub(quality)),
        })
    }

    fn row(&self, words: &[&str]) -> Option<TruthPosition> {
        let (date, rest) = words.split_at_checked(2)?;
        let time_gps = self.time(date)?;
        let place_words = if self.coordinates == Coordinates::Sexagesimal { 7 } else { 3 };
        let (place, rest) = rest.split_at_checked(place_words)?;
        let place: Option<Vec<f64>> = place.iter().map(|word| number(word)).collect();
        let position = self.position(&place?)?;
        let velocity = self.quality_to_velocity.map(|at| {
            let of = |k: usize| number(rest.get(at + k)?).filter(|speed| speed.abs() <= MAX_SPEED_MPS);
            Some(self.velocity(position, [of(0)?, of(1)?, of(2)?]))
        });
        // A row that ends before its velocity is damaged.
        let velocity = velocity.map_or(Some(None), |velocity| velocity.map(Some))?;
        Some(TruthPosition { time_gps, position, velocity, quality: rest.first()?.parse().ok()? })
    }

    fn time(&self, words: &[&str]) -> Option<GpsTime> {
        let [first, second] = words else { return None };
        let own = if let Some(calendar) = calendar(first, second) {
            GpsTime::from_calendar(calendar)?
        } else {
            let (week, tow_s) = (first.parse().ok()?, number(second)?);
            let is_time = (0..10_000).contains(&week) && (0.0..=604_800.0).contains(&tow_s);
            is_time.then(|| GpsTime::from_week_tow(week, tow_s))?
        };
        Some(match self.clock {
            Clock::Gpst => own,
            Clock::Utc => own + leap_seconds_at(own) as f64,
            Clock::Jst => {
                let utc = own - JST_AHEAD_OF_UTC_S;
                utc + leap_seconds_at(utc) as f64
            }
        })
    }

    fn position(&self, place: &[f64]) -> Option<Ecef> {
        let position = match *place {
            [x, y, z] if self.coordinates == Coordinates::Ecef => Ecef::new(x, y, z),
            [latitude_deg, longitude_deg, height_m] => on_earth(latitude_deg, longitude_deg, height_m)?,
            [d, m, s, longitude_d, longitude_m, longitude_s, height_m] => {
                on_earth(degrees(d, m, s), degrees(longitude_d, longitude_m, longitude_s), height_m)?
            }
            _ => return None,
        };
        let from_centre_m = position.0.norm();
        (6.3e6..=6.4e6 + MAX_HEIGHT_M).contains(&from_centre_m).then_some(position)
    }

    /// Velocities are north, east, up beside latitudes, and Earth-fixed beside Earth-fixed coordinates.
    fn velocity(&self, position: Ecef, [a, b, c]: [f64; 3]) -> EcefVector {
        match self.coordinates {
            Coordinates::Ecef => EcefVector::new(a, b, c),
            _ => LocalFrame::at(position).vector_enu_to_ecef(Enu { east: b, north: a, up: c }),
        }
    }
}

fn number(word: &str) -> Option<f64> {
    word.parse().ok().filter(|value: &f64| value.is_finite())
}

/// Degrees from degrees, minutes and seconds; the sign is that of the degrees, of −0 too.
fn degrees(degrees: f64, minutes: f64, seconds: f64) -> f64 {
    (degrees.abs() + minutes / 60.0 + seconds / 3_600.0).copysign(degrees)
}

fn on_earth(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> Option<Ecef> {
    let is_place =
        latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 360.0 && height_m.abs() <= MAX_HEIGHT_M;
    is_place.then(|| Geodetic::from_degrees(latitude_deg, longitude_deg, height_m).geodetic_to_ecef())
}

/// `2020/08/13` and `14:19:00.000`.
fn calendar(date: &str, time: &str) -> Option<Calendar> {
    let mut date = date.split('/');
    let mut time = time.split(':');
    let calendar = Calendar {
        year: date.next()?.parse().ok()?,
        month: date.next()?.parse().ok()?,
        day: date.next()?.parse().ok()?,
        hour: time.next()?.parse().ok()?,
        minute: time.next()?.parse().ok()?,
        second: number(time.next()?)?,
    };
    (date.next().is_none() && time.next().is_none()).then_some(calendar)
}
