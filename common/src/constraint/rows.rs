//! Bounded rows of a joint state, the linear form of constraints.
//!
//! A row is cᵀX + c₀. The constant is zero for linear quantities, and for a length |d| = uᵀd with the unit vector u of its linearisation,
//! which is homogeneous. The rotation of the up vector with the phone's position is neglected; it is one part in 6.4 million per metre.

use nalgebra::{DMatrix, DVector, Vector3};

use super::truncation::{Density, Interval};
use crate::filter::STATES_PER_PHONE;
use crate::frames::{Ecef, EcefVector, Enu, LocalFrame};

/// Maximum number of nonzero elements of a row: two vectors.
const NONZEROS: usize = 6;

/// A row with up to six nonzero elements, and a constant added to its product with the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SparseRow {
    offsets: [usize; NONZEROS],
    values: [f64; NONZEROS],
    length: usize,
    constant: f64,
}

/// A row and the interval of its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundedRow {
    /// The row.
    pub row: SparseRow,
    /// Interval of the row's value.
    pub interval: Interval,
    /// What is known of the value within the interval.
    pub density: Density,
    /// Whether the other rows of the constraint imply this row. Expectation propagation leaves it out.
    pub is_implied: bool,
}

impl BoundedRow {
    /// A row that is not implied by others.
    pub const fn new(row: SparseRow, interval: Interval) -> Self {
        Self { row, interval, density: Density::Uniform, is_implied: false }
    }

    /// The same row of a component of a vector in a ball.
    pub const fn of_ball(self) -> Self {
        Self { density: Density::Ball, ..self }
    }

    /// The same row, implied by the constraint's other rows.
    pub const fn implied(self) -> Self {
        Self { is_implied: true, ..self }
    }
}

/// Up to three bounded rows.
pub type Rows = [Option<BoundedRow>; 3];

impl SparseRow {
    /// A row of one vector at an offset into the state.
    pub fn of(offset: usize, vector: &Vector3<f64>) -> Self {
        let mut row = Self { offsets: [0; NONZEROS], values: [0.0; NONZEROS], length: 0, constant: 0.0 };
        row.push(offset, vector);
        row
    }

    /// A row of two vectors.
    pub fn of_two(first: (usize, &Vector3<f64>), second: (usize, &Vector3<f64>)) -> Self {
        let mut row = Self::of(first.0, first.1);
        row.push(second.0, second.1);
        row
    }

    /// The row with another constant: value − c·X of a quantity linearised at X.
    pub const fn with_constant(self, constant: f64) -> Self {
        Self { constant, ..self }
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

    /// Whether all offsets lie within a state of `elements` elements.
    pub fn fits(&self, elements: usize) -> bool {
        self.iter().all(|(offset, _)| offset < elements)
    }

    /// cᵀX + c₀. The row must fit the state.
    pub fn at(&self, state: &DVector<f64>) -> f64 {
        self.times(state) + self.constant
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

/// Position of a phone in a joint state; `None` if the state does not contain the phone or the position is not finite.
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

/// Mean velocity of a phone over the horizon, v + ½a·horizon, with its local frame.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    frame: LocalFrame,
    velocity: EcefVector,
    offset: usize,
    horizon_s: f64,
}

impl Motion {
    /// Motion of a phone in a joint state; `None` if the state does not contain the phone or the motion is not finite.
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

    /// The row of the velocity component along a direction in the local frame.
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
