//! Constraints as bounded rows of a joint state.
//!
//! All rows are homogeneous, cᵀX with no constant term: velocities are linear, and a distance is |d| = uᵀd with the
//! unit vector u that it is linearised at. The turn of the up vector with the phone's position is left out of the rows; it
//! is one part in 6.4 million per metre.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{DMatrix, DVector, Matrix3, SymmetricEigen, Vector3};

use super::options::DistanceModel;
use super::truncation::Interval;
use crate::filter::STATES_PER_PHONE;
use crate::frames::{Ecef, EcefVector, Enu, LocalFrame};

/// Most nonzero elements of a row: two vectors.
const NONZEROS: usize = 6;
/// Phones closer than this have no direction from one to the other, m.
const NO_DIRECTION_M: f64 = 1e-3;
/// Narrowest course tolerance that makes two distinct half-planes, rad.
const LEAST_TOLERANCE_RAD: f64 = 1e-3;

/// A row with up to six nonzero elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SparseRow {
    offsets: [usize; NONZEROS],
    values: [f64; NONZEROS],
    length: usize,
}

/// A row and the interval that its product with the state lies in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundedRow {
    /// The row.
    pub row: SparseRow,
    /// Where the product lies.
    pub interval: Interval,
}

/// Up to three bounded rows.
pub type Rows = [Option<BoundedRow>; 3];

impl SparseRow {
    /// A row of one vector at an offset into the state.
    pub fn of(offset: usize, vector: &Vector3<f64>) -> Self {
        let mut row = Self { offsets: [0; NONZEROS], values: [0.0; NONZEROS], length: 0 };
        row.push(offset, vector);
        row
    }

    /// A row of two vectors.
    pub fn of_two(first: (usize, &Vector3<f64>), second: (usize, &Vector3<f64>)) -> Self {
        let mut row = Self::of(first.0, first.1);
        row.push(second.0, second.1);
        row
    }

    fn push(&mut self, offset: usize, vector: &Vector3<f64>) {
        let free = self.offsets.iter_mut().zip(&mut self.values).skip(self.length);
        for ((place, value), (axis, component)) in free.zip(vector.iter().enumerate()) {
            (*place, *value) = (offset + axis, *component);
            self.length += 1;
        }
    }

    /// Offsets and values of the nonzero elements.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        self.offsets.iter().copied().zip(self.values.iter().copied()).take(self.length)
    }

    /// Whether all offsets lie within a state of this many elements.
    pub fn fits(&self, elements: usize) -> bool {
        self.iter().all(|(offset, _)| offset < elements)
    }

    /// cᵀX. The row must fit the state.
    pub fn times(&self, state: &DVector<f64>) -> f64 {
        self.iter().map(|(offset, value)| value * state[offset]).sum()
    }

    /// cᵀPc. The row must fit the covariance.
    pub fn variance(&self, covariance: &DMatrix<f64>) -> f64 {
        let column = |column: usize| {
            self.iter().map(move |(offset, value)| value * covariance[(offset, column)]).sum::<f64>()
        };
        self.iter().map(|(offset, value)| value * column(offset)).sum()
    }

    /// Pc into `product`, which has the size of the state.
    pub fn covariance_times(&self, covariance: &DMatrix<f64>, product: &mut DVector<f64>) {
        product.fill(0.0);
        for (offset, value) in self.iter() {
            product.axpy(value, &covariance.column(offset), 1.0);
        }
    }
}

/// A phone's position in a joint state; `None` when the state does not hold it or it is not finite.
pub fn position(state: &DVector<f64>, phone: usize) -> Option<Ecef> {
    let point = Ecef(part(state, phone, 0)?);
    point.is_finite().then_some(point)
}

/// One of a phone's vectors: 0 position, 1 velocity, 2 acceleration.
fn part(state: &DVector<f64>, phone: usize, which: usize) -> Option<Vector3<f64>> {
    let start = phone.checked_mul(STATES_PER_PHONE)?.checked_add(3 * which)?;
    let slice = state.as_slice().get(start..start.checked_add(3)?)?;
    Some(Vector3::from_column_slice(slice))
}

/// A phone's mean velocity over the horizon, v + ½a·horizon, and the local frame it is seen in.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    frame: LocalFrame,
    velocity: EcefVector,
    offset: usize,
    horizon_s: f64,
}

impl Motion {
    /// Of a phone in a joint state; `None` when the state does not hold it or it is not finite.
    pub fn of(state: &DVector<f64>, phone: usize, horizon_s: f64) -> Option<Self> {
        let frame = LocalFrame::at(position(state, phone)?);
        let velocity = EcefVector(part(state, phone, 1)? + 0.5 * horizon_s * part(state, phone, 2)?);
        let offset = STATES_PER_PHONE * phone + 3;
        velocity.is_finite().then_some(Self { frame, velocity, offset, horizon_s })
    }

    /// The velocity, m/s.
    pub fn velocity(&self) -> Enu {
        self.frame.vector_ecef_to_enu(self.velocity)
    }

    /// The row of the velocity's component along a direction in the local frame.
    pub fn row(&self, direction: Enu) -> SparseRow {
        let axis = self.frame.vector_enu_to_ecef(direction).0;
        if self.horizon_s == 0.0 {
            SparseRow::of(self.offset, &axis)
        } else {
            let half = 0.5 * self.horizon_s * axis;
            SparseRow::of_two((self.offset, &axis), (self.offset + 3, &half))
        }
    }

    /// Standard deviation of the horizontal velocity, m/s: root of the sum of the east and north variances.
    pub fn horizontal_sigma_mps(&self, covariance: &DMatrix<f64>) -> f64 {
        let east = self.row(Enu { east: 1.0, north: 0.0, up: 0.0 }).variance(covariance);
        let north = self.row(Enu { east: 0.0, north: 1.0, up: 0.0 }).variance(covariance);
        (east + north).sqrt()
    }
}

/// |v_up| ≤ maximum: one row with two bounds (Peng Eq. 11, divided by Δt).
pub fn vertical_velocity_rows(motion: &Motion, maximum_mps: f64) -> Rows {
    let row = motion.row(Enu { east: 0.0, north: 0.0, up: 1.0 });
    [Some(BoundedRow { row, interval: Interval { lower: -maximum_mps, upper: maximum_mps } }), None, None]
}

/// |course − given| ≤ tolerance as half-planes of the velocity (Peng Eq. 18, divided by Δt): ahead, not too far
/// right, not too far left. The last two, here scaled by the cosine of the tolerance, imply the first.
pub fn heading_rows(motion: &Motion, course_rad: f64, tolerance_rad: f64) -> Rows {
    let (sin_course, cos_course) = course_rad.sin_cos();
    let (sin_tolerance, cos_tolerance) = tolerance_rad.clamp(LEAST_TOLERANCE_RAD, FRAC_PI_2).sin_cos();
    // Components across the course (to the right) and along it (Eq. 15).
    let row = |across: f64, along: f64| {
        motion.row(Enu {
            east: across * cos_course + along * sin_course,
            north: along * cos_course - across * sin_course,
            up: 0.0,
        })
    };
    let below_zero = Interval { lower: f64::NEG_INFINITY, upper: 0.0 };
    let bounded = |row: SparseRow| Some(BoundedRow { row, interval: below_zero });
    [
        bounded(row(0.0, -1.0)),
        bounded(row(cos_tolerance, -sin_tolerance)),
        bounded(row(-cos_tolerance, -sin_tolerance)),
    ]
}

/// Bounds of a distance, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceBounds {
    /// The pair.
    pub phones: (usize, usize),
    /// Lower bound, m.
    pub minimum_m: f64,
    /// Upper bound, m.
    pub maximum_m: f64,
}

impl DistanceBounds {
    /// The vector from the second to the first phone.
    pub fn difference(&self, state: &DVector<f64>) -> Option<Vector3<f64>> {
        Some((position(state, self.phones.0)? - position(state, self.phones.1)?).0)
    }

    /// Rows when the distance is linearised along `direction`, a unit vector (Jacobian [uᵀ, −uᵀ]).
    pub fn rows(&self, direction: &Vector3<f64>, covariance: &DMatrix<f64>, model: DistanceModel) -> Rows {
        let (first, second) = (STATES_PER_PHONE * self.phones.0, STATES_PER_PHONE * self.phones.1);
        let bounded = |axis: &Vector3<f64>, lower: f64| {
            let row = SparseRow::of_two((first, axis), (second, &-axis));
            Some(BoundedRow { row, interval: Interval { lower, upper: self.maximum_m } })
        };
        if model == DistanceModel::Radial {
            return [bounded(direction, self.minimum_m), None, None];
        }
        let along_m = self.minimum_along_m(direction, covariance);
        let lower_m = if along_m > 0.0 { along_m } else { -self.maximum_m };
        if self.maximum_m.is_infinite() {
            return [bounded(direction, lower_m), None, None];
        }
        let (across, other) = axes_across(direction);
        [bounded(direction, lower_m), bounded(&across, -self.maximum_m), bounded(&other, -self.maximum_m)]
    }

    /// What remains of the lower bound for the component along a direction, given what the uncertain part across
    /// contributes to the distance: d² = along² + across².
    fn minimum_along_m(&self, direction: &Vector3<f64>, covariance: &DMatrix<f64>) -> f64 {
        if self.minimum_m <= 0.0 {
            return 0.0;
        }
        let relative = self.relative_covariance(covariance);
        let across_m2 = (relative.trace() - direction.dot(&(relative * direction))).max(0.0);
        (self.minimum_m * self.minimum_m - across_m2).max(0.0).sqrt()
    }

    fn relative_covariance(&self, covariance: &DMatrix<f64>) -> Matrix3<f64> {
        let (i, j) = (STATES_PER_PHONE * self.phones.0, STATES_PER_PHONE * self.phones.1);
        let block = |row: usize, column: usize| covariance.fixed_view::<3, 3>(row, column).into_owned();
        block(i, i) + block(j, j) - block(i, j) - block(j, i)
    }

    /// The direction to linearise in: along the difference, or, when that is none, where the relative position is
    /// least known.
    ///
    /// `None` when the state does not hold the phones.
    pub fn direction(&self, state: &DVector<f64>, covariance: &DMatrix<f64>) -> Option<Vector3<f64>> {
        let place = position(state, self.phones.0)?;
        let difference = self.difference(state)?;
        let length = difference.norm();
        Some(if length > NO_DIRECTION_M {
            difference / length
        } else {
            self.least_known_direction(place, covariance)
        })
    }

    /// Whether the phones are in one place, where a distance has no direction.
    pub fn is_without_direction(difference: &Vector3<f64>) -> bool {
        difference.norm() <= NO_DIRECTION_M
    }

    fn least_known_direction(&self, place: Ecef, covariance: &DMatrix<f64>) -> Vector3<f64> {
        let relative = self.relative_covariance(covariance);
        if !relative.iter().all(|element| element.is_finite()) {
            return Vector3::x();
        }
        let eigen = SymmetricEigen::new(relative);
        let axis = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
        // The sign is free; fix it by the local axes, for the same input must give the same result everywhere.
        let local = LocalFrame::at(place).rotation_ecef_to_enu() * axis;
        if local[local.iamax()] < 0.0 { -axis } else { axis }
    }
}

/// Two unit vectors that complete a direction to an orthogonal triad, the first across the Earth's axis.
fn axes_across(direction: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let pole = Vector3::z();
    let horizontal = direction.cross(&pole);
    let across = if horizontal.norm() > 1e-6 { horizontal.normalize() } else { Vector3::x() };
    let other = direction.cross(&across).normalize();
    (across, other)
}
