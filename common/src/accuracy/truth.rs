//! A reference trajectory and its interpolation.

use serde::Deserialize;

use crate::formats::text::content;
use crate::frames::{Ecef, EcefVector, Enu, Geodetic, LocalFrame};
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;

/// A reference trajectory in order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    rows: Vec<TruthRow>,
    interval_s: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct TruthRow {
    time_gps: GpsTime,
    point: TruthPoint,
    quality: u8,
}

/// True position and velocity of the phone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruthPoint {
    /// Position, m.
    pub position: Ecef,
    /// Velocity, m/s.
    pub velocity: EcefVector,
}

/// Error for an unusable truth file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TruthError {
    /// A column is missing in the header.
    #[error("not a truth table: column '{column}' is missing; the header must name {expected}")]
    Column {
        /// The missing column.
        column: &'static str,
        /// All columns.
        expected: String,
    },
    /// No row is readable.
    #[error("no usable row among {rows}; {skips}")]
    Empty {
        /// Number of rows.
        rows: usize,
        /// Reasons for skipping them.
        skips: String,
    },
}

/// Maximum difference of a stated velocity from the positions' central difference, m/s. Hard braking over a second
/// stays below it.
const VELOCITY_TOLERANCE_MPS: f64 = 3.0;

/// The columns of a truth table.
pub const TRUTH_COLUMNS: [&str; 9] = [
    "gps_week",
    "gps_tow_s",
    "latitude_deg",
    "longitude_deg",
    "ellipsoidal_height_m",
    "velocity_north_mps",
    "velocity_east_mps",
    "velocity_up_mps",
    "quality",
];

/// A row of the table.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(crate) struct TableRow {
    pub(crate) gps_week: i64,
    pub(crate) gps_tow_s: f64,
    pub(crate) latitude_deg: f64,
    pub(crate) longitude_deg: f64,
    pub(crate) ellipsoidal_height_m: f64,
    pub(crate) velocity_north_mps: f64,
    pub(crate) velocity_east_mps: f64,
    pub(crate) velocity_up_mps: f64,
    pub(crate) quality: u8,
}

/// A position with an optional velocity.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TruthPosition {
    pub(crate) time_gps: GpsTime,
    pub(crate) position: Ecef,
    pub(crate) velocity: Option<EcefVector>,
    pub(crate) quality: u8,
}

/// Maximum time between neighbours for a velocity from positions, s.
const LONGEST_STEP_S: f64 = 2.5;

/// Velocity at a position from both neighbours, or from a single near one.
fn velocity_of(positions: &[TruthPosition], index: usize) -> Option<EcefVector> {
    let row = positions.get(index)?;
    let near = |other: &&TruthPosition| {
        let step_s = (other.time_gps - row.time_gps).abs();
        step_s > 0.0 && step_s <= LONGEST_STEP_S
    };
    let before = index.checked_sub(1).and_then(|at| positions.get(at)).filter(near);
    let after = positions.get(index + 1).filter(near);
    let (first, last) = (before.unwrap_or(row), after.unwrap_or(row));
    let span_s = last.time_gps - first.time_gps;
    (span_s > 0.0).then(|| EcefVector((last.position - first.position).0 / span_s))
}

impl TableRow {
    fn to_truth(self) -> Option<TruthRow> {
        let plausible = (0..10_000).contains(&self.gps_week)
            && (0.0..=604_800.0).contains(&self.gps_tow_s)
            && self.latitude_deg.abs() <= 90.0
            && self.longitude_deg.abs() <= 360.0
            && self.ellipsoidal_height_m.abs() <= 1e7
            && [self.velocity_north_mps, self.velocity_east_mps, self.velocity_up_mps]
                .iter()
                .all(|v| v.abs() <= 1e5);
        if !plausible {
            return None;
        }
        let position =
            Geodetic::from_degrees(self.latitude_deg, self.longitude_deg, self.ellipsoidal_height_m)
                .geodetic_to_ecef();
        let velocity = LocalFrame::at(position).vector_enu_to_ecef(Enu {
            east: self.velocity_east_mps,
            north: self.velocity_north_mps,
            up: self.velocity_up_mps,
        });
        Some(TruthRow {
            time_gps: GpsTime::from_week_tow(self.gps_week, self.gps_tow_s),
            point: TruthPoint { position, velocity },
            quality: self.quality,
        })
    }
}

impl Truth {
    /// Reads a table with the columns `gps_week, gps_tow_s, latitude_deg, longitude_deg, ellipsoidal_height_m,
    /// velocity_north_mps, velocity_east_mps, velocity_up_mps, quality`, in any order. Unreadable rows are
    /// counted and skipped; rows are sorted by time, and of two rows at one time the first is used.
    ///
    /// # Errors
    /// [`TruthError`] if a column is missing or no row is usable.
    pub fn parse_csv(bytes: &[u8]) -> Result<(Self, Skips), TruthError> {
        let mut reader =
            csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(content(bytes));
        let header = reader.byte_headers().cloned().unwrap_or_default();
        if let Some(column) = TRUTH_COLUMNS.into_iter().find(|c| !header.iter().any(|h| h == c.as_bytes())) {
            return Err(TruthError::Column { column, expected: TRUTH_COLUMNS.join(", ") });
        }
        Self::from_table(
            reader.deserialize().map(|row| row.map_err(|error| error.to_string())),
            Skips::default(),
        )
    }

    /// Makes a truth from the rows of a table or their errors; `skips` are the counts so far.
    pub(crate) fn from_table(
        table: impl IntoIterator<Item = Result<TableRow, String>>,
        mut skips: Skips,
    ) -> Result<(Self, Skips), TruthError> {
        let mut rows = Vec::new();
        let mut seen = 0;
        for row in table {
            seen += 1;
            match row.map(TableRow::to_truth) {
                Ok(Some(row)) => rows.push(row),
                Ok(None) => skips.add(Reason::TruthRowOutOfRange, || format!("row {seen}")),
                Err(error) => skips.add(Reason::TruthRowUnreadable, || format!("row {seen}: {error}")),
            }
        }
        let truth = Self::from_rows(rows, &mut skips);
        if truth.rows.is_empty() {
            return Err(TruthError::Empty { rows: seen, skips: skips.to_string() });
        }
        Ok((truth, skips))
    }

    /// Makes a truth from positions with optional velocities. Missing velocities are computed from the neighbours, and a position without
    /// velocity and neighbours is left out. `rows` is the number of rows read, `skips` are the counts so far.
    pub(crate) fn from_positions(
        mut positions: Vec<TruthPosition>,
        rows: usize,
        mut skips: Skips,
    ) -> Result<(Self, Skips), TruthError> {
        positions.sort_by_key(|row| row.time_gps);
        let points = (0..positions.len()).filter_map(|index| {
            let row = positions.get(index)?;
            let velocity = row.velocity.or_else(|| velocity_of(&positions, index));
            if velocity.is_none() {
                skips.add(Reason::TruthRowWithoutVelocity, || row.time_gps.to_string());
            }
            let point = TruthPoint { position: row.position, velocity: velocity? };
            Some(TruthRow { time_gps: row.time_gps, point, quality: row.quality })
        });
        let points = points.collect();
        let truth = Self::from_rows(points, &mut skips);
        if truth.rows.is_empty() {
            return Err(TruthError::Empty { rows, skips: skips.to_string() });
        }
        Ok((truth, skips))
    }

    /// A truth from points of one quality.
    pub fn from_points(points: impl IntoIterator<Item = (GpsTime, TruthPoint)>, quality: u8) -> Self {
        let rows =
            points.into_iter().map(|(time_gps, point)| TruthRow { time_gps, point, quality }).collect();
        Self::from_rows(rows, &mut Skips::default())
    }

    fn from_rows(mut rows: Vec<TruthRow>, skips: &mut Skips) -> Self {
        rows.sort_by_key(|row| row.time_gps);
        rows.dedup_by(|next, kept| {
            let duplicate = next.time_gps == kept.time_gps;
            if duplicate {
                skips.add(Reason::TruthRowDuplicated, || format!("{}", next.time_gps));
            }
            duplicate
        });
        let mut steps: Vec<f64> =
            rows.windows(2).filter_map(|w| Some(w.last()?.time_gps - w.first()?.time_gps)).collect();
        steps.sort_by(f64::total_cmp);
        let interval_s = steps.get(steps.len() / 2).copied().unwrap_or(1.0);
        let mut truth = Self { rows, interval_s };
        truth.check_velocities(skips);
        truth
    }

    /// Replaces stated velocities that contradict the positions, for example with swapped columns or another unit, because
    /// interpolation depends on them.
    fn check_velocities(&mut self, skips: &mut Skips) {
        let differences: Vec<Option<EcefVector>> =
            (0..self.rows.len()).map(|index| self.central_difference(index)).collect();
        for (row, difference) in self.rows.iter_mut().zip(differences) {
            let Some(from_positions) = difference else { continue };
            let contradiction_mps = (row.point.velocity.0 - from_positions.0).norm();
            if contradiction_mps > VELOCITY_TOLERANCE_MPS {
                skips.add(Reason::VelocityContradictsPositions, || {
                    format!("{} by {contradiction_mps:.1} m/s; are its columns swapped?", row.time_gps)
                });
                row.point.velocity = from_positions;
            }
        }
    }

    /// Velocity at a row from its two neighbours, if both are one interval away.
    fn central_difference(&self, index: usize) -> Option<EcefVector> {
        let before = self.rows.get(index.checked_sub(1)?)?;
        let after = self.rows.get(index + 1)?;
        let span_s = after.time_gps - before.time_gps;
        (span_s <= 2.5 * self.interval_s)
            .then(|| EcefVector((after.point.position - before.point.position).0 / span_s))
    }

    /// Median spacing of the rows, s.
    pub const fn interval_s(&self) -> f64 {
        self.interval_s
    }

    /// Times of the rows with a quality in `qualities`, in order.
    pub fn times<'a>(&'a self, qualities: &'a [u8]) -> impl Iterator<Item = GpsTime> + 'a {
        self.rows.iter().filter(|row| qualities.contains(&row.quality)).map(|row| row.time_gps)
    }

    /// First and last instant.
    pub fn span(&self) -> Option<(GpsTime, GpsTime)> {
        Some((self.rows.first()?.time_gps, self.rows.last()?.time_gps))
    }

    /// Truth at an instant: cubic Hermite interpolation between two rows of counted quality one interval apart,
    /// or extrapolation with the velocity of a row within a tenth of an interval. `None` elsewhere.
    pub fn at(&self, time: GpsTime, qualities: &[u8]) -> Option<TruthPoint> {
        let after = self.rows.partition_point(|row| row.time_gps <= time);
        let counted = |row: &&TruthRow| qualities.contains(&row.quality);
        let before = after.checked_sub(1).and_then(|i| self.rows.get(i)).filter(counted);
        let next = self.rows.get(after).filter(counted);
        if let (Some(a), Some(b)) = (before, next)
            && b.time_gps - a.time_gps <= 1.5 * self.interval_s
        {
            return Some(hermite(a, b, time));
        }
        [before, next].into_iter().flatten().find_map(|row| {
            let dt = time - row.time_gps;
            (dt.abs() <= 0.1 * self.interval_s).then(|| TruthPoint {
                position: row.point.position + EcefVector(row.point.velocity.0 * dt),
                velocity: row.point.velocity,
            })
        })
    }
}

fn hermite(a: &TruthRow, b: &TruthRow, time: GpsTime) -> TruthPoint {
    let h = b.time_gps - a.time_gps;
    let s = (time - a.time_gps) / h;
    let (s2, s3) = (s * s, s * s * s);
    let step = b.point.position.0 - a.point.position.0;
    let (va, vb) = (a.point.velocity.0, b.point.velocity.0);
    let displacement = step * (3.0 * s2 - 2.0 * s3) + va * (h * (s3 - 2.0 * s2 + s)) + vb * (h * (s3 - s2));
    let velocity =
        step * ((6.0 * s - 6.0 * s2) / h) + va * (3.0 * s2 - 4.0 * s + 1.0) + vb * (3.0 * s2 - 2.0 * s);
    TruthPoint { position: a.point.position + EcefVector(displacement), velocity: EcefVector(velocity) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "gps_week,gps_tow_s,latitude_deg,longitude_deg,ellipsoidal_height_m,velocity_north_mps,\
                          velocity_east_mps,velocity_up_mps,quality\n";

    fn table(rows: &str) -> Result<(Truth, Skips), TruthError> {
        Truth::parse_csv(format!("{HEADER}{rows}").as_bytes())
    }

    #[test]
    fn rows_are_read_and_bad_ones_counted() {
        let (truth, skips) = table(
            "2118,10,30,114,20,0,1,0,1\n2118,11,30,x,20,0,1,0,1\n2118,12,30,114,nan,0,1,0,1\n2118,13,30,114,20,0,1,0,0\n",
        )
        .unwrap();
        assert_eq!(truth.times(&[1]).count(), 1);
        assert_eq!(truth.times(&[0, 1]).count(), 2);
        assert_eq!(
            (skips.count(Reason::TruthRowUnreadable), skips.count(Reason::TruthRowOutOfRange)),
            (1, 1)
        );
    }

    #[test]
    fn wrong_files_say_what_is_missing() {
        assert!(matches!(
            Truth::parse_csv(b"a,b\n1,2\n"),
            Err(TruthError::Column { column: "gps_week", .. })
        ));
        assert!(matches!(table(""), Err(TruthError::Empty { rows: 0, .. })));
        assert!(Truth::parse_csv(&[0xff, 0xfe, 0, 1]).is_err());
    }

    #[test]
    fn swapped_velocity_columns_are_noticed_and_not_followed() {
        // A velocity of 16 m/s north, written in the east column.
        let row = |i: i32| format!("2118,{i},{},114,20,0,16,0,1", 30.0 + f64::from(i) * 1.4432e-4);
        let rows = (0..5).map(row).collect::<Vec<_>>().join("\n");
        let (truth, skips) = table(&rows).unwrap();
        assert_eq!(skips.count(Reason::VelocityContradictsPositions), 3);
        let middle = truth.at(GpsTime::from_week_tow(2118, 2.0), &[1]).unwrap();
        let velocity = LocalFrame::at(middle.position).vector_ecef_to_enu(middle.velocity);
        assert!((velocity.north - 16.0).abs() < 0.01 && velocity.east.abs() < 0.01, "{velocity:?}");
    }

    #[test]
    fn interpolation_follows_uniform_acceleration() {
        let start = GpsTime::from_week_tow(2118, 100.0);
        let at = |t: f64| TruthPoint {
            position: Ecef::new(6.4e6 + t * t, 2.0 * t, 0.0),
            velocity: EcefVector::new(2.0 * t, 2.0, 0.0),
        };
        let truth = Truth::from_points((0..4).map(|i| (start + f64::from(i), at(f64::from(i)))), 1);
        let point = truth.at(start + 1.3, &[1]).unwrap();
        assert!(point.position.distance_m(at(1.3).position) < 1e-6);
        assert!((point.velocity.0 - at(1.3).velocity.0).norm() < 1e-6);
        assert!(truth.at(start + 3.05, &[1]).is_some(), "a twentieth of a second past the end");
        assert!(truth.at(start + 3.5, &[1]).is_none());
        assert!(truth.at(start + 1.0, &[2]).is_none());
    }
}
