//! The challenges' ground truths.

use super::columns::fields;
use crate::accuracy::{Truth, TruthError, TruthPoint};
use crate::formats::integer::integer;
use crate::formats::lines::{Line, each_line};
use crate::formats::text::content;
use crate::frames::{EcefVector, Enu, Geodetic, LocalFrame};
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;

/// The heights of 2021 are this much too high, m (the organisers' note on the data).
const HEIGHT_OFFSET_2021_M: f64 = 61.0;
/// All rows have one quality.
const QUALITY: u8 = 1;
/// Largest speed of a car, m/s.
const MAX_SPEED_MPS: f64 = 200.0;

/// Names of the columns of a generation: time, latitude, longitude, height, speed, course.
struct Generation {
    names: [&'static str; 6],
    height_offset_m: f64,
    unix_time: bool,
}

const GENERATIONS: [Generation; 2] = [
    Generation {
        names: [
            "millisSinceGpsEpoch",
            "latDeg",
            "lngDeg",
            "heightAboveWgs84EllipsoidM",
            "speedMps",
            "courseDegree",
        ],
        height_offset_m: HEIGHT_OFFSET_2021_M,
        unix_time: false,
    },
    Generation {
        names: [
            "UnixTimeMillis",
            "LatitudeDegrees",
            "LongitudeDegrees",
            "AltitudeMeters",
            "SpeedMps",
            "BearingDegrees",
        ],
        height_offset_m: 0.0,
        unix_time: true,
    },
];

/// Whether a table's first line names most of the columns of a challenge's ground truth.
pub fn is_ground_truth(bytes: &[u8]) -> bool {
    let header = content(bytes).split(|byte| *byte == b'\n').next().unwrap_or_default();
    let header = fields(header);
    let found =
        |generation: &Generation| generation.names.iter().filter(|name| header.contains(name)).count();
    GENERATIONS.iter().any(|generation| 2 * found(generation) > generation.names.len())
}

/// Reads a `ground_truth.csv` of 2021 or since 2022. Heights of 2021 are corrected by the documented 61 m and still good to
/// some metres only; a missing height (2022) counts as zero. Every row has quality 1.
///
/// # Errors
/// [`TruthError`] when a column is missing or no row is usable.
pub fn ground_truth(bytes: &[u8]) -> Result<(Truth, Skips), TruthError> {
    let mut skips = Skips::default();
    let mut reader = Reader { header: None, points: Vec::new(), rows: 0 };
    each_line(bytes, |line: Line<'_>| match line.counted(&mut skips) {
        Some(text) => reader.line(line.number, &fields(text), &mut skips),
        None => Ok(()),
    })?;
    let Reader { header, points, rows } = reader;
    if header.is_none() {
        Header::find(&[])?;
    }
    if points.is_empty() {
        return Err(TruthError::Empty { rows, skips: skips.to_string() });
    }
    Ok((Truth::from_points(points, QUALITY), skips))
}

struct Reader {
    header: Option<Header>,
    points: Vec<(GpsTime, TruthPoint)>,
    rows: usize,
}

struct Header {
    generation: &'static Generation,
    columns: [usize; 6],
}

impl Header {
    fn find(header: &[&str]) -> Result<Self, TruthError> {
        let missing = |generation: &Generation| {
            generation.names.into_iter().filter(|name| !header.contains(name)).count()
        };
        let [first, second] = &GENERATIONS;
        let generation = if missing(second) < missing(first) { second } else { first };
        if let Some(column) = generation.names.into_iter().find(|name| !header.contains(name)) {
            return Err(TruthError::Column { column, expected: generation.names.join(", ") });
        }
        let position = |name: &str| header.iter().position(|found| *found == name).unwrap_or(usize::MAX);
        Ok(Self { generation, columns: generation.names.map(position) })
    }

    fn point(&self, fields: &[&str]) -> Option<(GpsTime, TruthPoint)> {
        let [time, latitude, longitude, height, speed, course] =
            self.columns.map(|at| fields.get(at).copied().unwrap_or_default());
        let number = |text: &str, limit: f64| text.parse::<f64>().ok().filter(|value| value.abs() <= limit);
        let millis = integer(time)?;
        let height_m = if height.is_empty() { 0.0 } else { number(height, 1e5)? };
        let geodetic = Geodetic::from_degrees(
            number(latitude, 90.0)?,
            number(longitude, 360.0)?,
            height_m - self.generation.height_offset_m,
        );
        let position = geodetic.geodetic_to_ecef();
        let speed_mps = number(speed, MAX_SPEED_MPS).unwrap_or(0.0);
        let (sin, cos) = number(course, 360.0).unwrap_or(0.0).to_radians().sin_cos();
        let velocity: EcefVector = LocalFrame::at(position).vector_enu_to_ecef(Enu {
            east: speed_mps * sin,
            north: speed_mps * cos,
            up: 0.0,
        });
        Some((self.time(millis)?, TruthPoint { position, velocity }))
    }

    fn time(&self, millis: i64) -> Option<GpsTime> {
        if self.generation.unix_time {
            return GpsTime::from_unix_millis(millis);
        }
        let nanos = millis.checked_mul(1_000_000).filter(|nanos| (0..i64::MAX / 2).contains(nanos))?;
        Some(GpsTime::from_nanos(nanos))
    }
}

impl Reader {
    fn line(&mut self, number: u64, fields: &[&str], skips: &mut Skips) -> Result<(), TruthError> {
        if fields.iter().all(|field| field.is_empty()) {
            return Ok(());
        }
        let Some(header) = &self.header else {
            self.header = Some(Header::find(fields)?);
            return Ok(());
        };
        self.rows += 1;
        match header.point(fields) {
            Some(point) => self.points.push(point),
            None => skips.add(Reason::TruthRowUnusable, || format!("line {number}")),
        }
        Ok(())
    }
}
