//! Bounded rows, the linear form of constraints.
//!
//! Every constraint bounds one vector of three components that is linear in the joint state: the difference of two positions or velocities,
//! a position, or the mean velocity of a phone. A row is a direction in the space of that vector and the interval of the component along it. A length |d| = uᵀd with
//! the unit vector u of its linearisation is homogeneous, so rows have no constant; that of a height is part of its interval. The rotation of the up vector with the phone's position
//! is neglected; it is one part in 6.4 million per metre.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::truncation::{Density, Interval};
use crate::filter::STATES_PER_PHONE;
use crate::frames::Ecef;

/// A row and the interval of its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundedRow {
    /// Direction of the row in the space of the constraint's vector.
    pub axis: Vector3<f64>,
    /// Interval of the row's value.
    pub interval: Interval,
    /// What is known of the value within the interval.
    pub density: Density,
    /// Whether the other rows of the constraint imply this row. Expectation propagation leaves it out.
    pub is_implied: bool,
}

impl BoundedRow {
    /// A row that is not implied by others.
    pub const fn new(axis: Vector3<f64>, interval: Interval) -> Self {
        Self { axis, interval, density: Density::Uniform, is_implied: false }
    }

    /// The same row of a component of a vector in a ball.
    pub const fn of_ball(self) -> Self {
        Self { density: Density::Ball, ..self }
    }

    /// The same row, implied by the constraint's other rows.
    pub const fn implied(self) -> Self {
        Self { is_implied: true, ..self }
    }

    /// The row's value for a vector.
    pub fn at(&self, vector: &Vector3<f64>) -> f64 {
        self.axis.dot(vector)
    }

    /// The row's variance for the covariance of the vector.
    pub fn variance(&self, covariance: &Matrix3<f64>) -> f64 {
        self.axis.dot(&(covariance * self.axis))
    }
}

/// Up to three bounded rows.
pub type Rows = [Option<BoundedRow>; 3];

/// One of a phone's three vectors of three states, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Position, m.
    Position,
    /// Velocity, m/s.
    Velocity,
    /// Acceleration, m/s².
    Acceleration,
}

impl Part {
    /// All parts, in the order of a phone's states.
    pub const ALL: [Self; 3] = [Self::Position, Self::Velocity, Self::Acceleration];

    /// Offset of the first of its three states within the phone's.
    pub const fn offset(self) -> usize {
        3 * self as usize
    }

    /// Offset of the first of its three states in a joint state of nine per phone; `None` beyond all numbers.
    pub fn offset_in_joint(self, phone: usize) -> Option<usize> {
        phone.checked_mul(STATES_PER_PHONE)?.checked_add(self.offset())
    }
}

/// A part of a phone's state times a factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term {
    /// Index of the phone.
    pub phone: usize,
    /// Part of its state.
    pub part: Part,
    /// The factor.
    pub factor: f64,
}

/// A vector that is linear in the joint state: the sum of one or two terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terms {
    first: Term,
    second: Option<Term>,
}

impl Terms {
    /// The position of a phone.
    pub const fn position(phone: usize) -> Self {
        Self { first: Term { phone, part: Part::Position, factor: 1.0 }, second: None }
    }

    /// The vector from the second to the first phone.
    pub fn difference(phones: [usize; 2]) -> Self {
        Self::between(phones, Part::Position)
    }

    /// The velocity of the first phone less that of the second.
    pub fn relative_velocity(phones: [usize; 2]) -> Self {
        Self::between(phones, Part::Velocity)
    }

    fn between([first, second]: [usize; 2], part: Part) -> Self {
        let of = |phone, factor| Term { phone, part, factor };
        Self { first: of(first, 1.0), second: Some(of(second, -1.0)) }
    }

    /// Mean velocity of a phone over the horizon, v + ½a·horizon.
    pub fn motion(phone: usize, horizon_s: f64) -> Self {
        let second =
            (horizon_s != 0.0).then_some(Term { phone, part: Part::Acceleration, factor: 0.5 * horizon_s });
        Self { first: Term { phone, part: Part::Velocity, factor: 1.0 }, second }
    }

    /// The terms.
    pub fn iter(&self) -> impl Iterator<Item = Term> + Clone + use<> {
        std::iter::once(self.first).chain(self.second)
    }

    /// The vector from the parts of phones; `None` if one is missing.
    pub fn sum(&self, part: impl Fn(usize, Part) -> Option<Vector3<f64>>) -> Option<Vector3<f64>> {
        let mut sum = Vector3::zeros();
        for term in self.iter() {
            sum += part(term.phone, term.part)? * term.factor;
        }
        Some(sum)
    }

    /// The terms by their offsets in a state; `None` if the state does not contain one of them.
    pub(super) fn placed(&self, offset: impl Fn(usize, Part) -> Option<usize>) -> Option<Placed> {
        let place = |term: Term| Some((offset(term.phone, term.part)?, term.factor));
        let first = place(self.first)?;
        let second = match self.second {
            Some(term) => Some(place(term)?),
            None => None,
        };
        Some(Placed { first, second })
    }
}

/// Terms by the offsets of their states, with their factors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    first: (usize, f64),
    second: Option<(usize, f64)>,
}

impl Placed {
    /// Offsets and factors.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> + Clone + use<> {
        std::iter::once(self.first).chain(self.second)
    }

    /// The vector in a state.
    pub fn mean(&self, state: &DVector<f64>) -> Vector3<f64> {
        self.iter().map(|(offset, factor)| state.fixed_rows::<3>(offset) * factor).sum()
    }

    /// Its covariance. Only the lower triangle of the state's covariance is read.
    pub fn covariance(&self, lower: &DMatrix<f64>) -> Matrix3<f64> {
        let own = |(offset, factor): (usize, f64)| {
            let mut block = lower.fixed_view::<3, 3>(offset, offset).into_owned();
            block.fill_upper_triangle_with_lower_triangle();
            block * (factor * factor)
        };
        let Some(second) = self.second else { return own(self.first) };
        let (low, high) = if self.first.0 < second.0 { (self.first, second) } else { (second, self.first) };
        let cross = lower.fixed_view::<3, 3>(high.0, low.0) * (low.1 * high.1);
        own(low) + own(high) + cross + cross.transpose()
    }

    /// Covariance of all states with the vector, as three columns. Only the lower triangle of the states' covariance is read.
    pub fn columns(&self, lower: &DMatrix<f64>, into: &mut [Vec<f64>; 3]) {
        let n = lower.nrows();
        for column in into.iter_mut() {
            column.clear();
            column.resize(n, 0.0);
        }
        for (offset, factor) in self.iter() {
            for (axis, sums) in into.iter_mut().enumerate() {
                let place = offset + axis;
                for (state, sum) in sums.iter_mut().enumerate().take(place) {
                    *sum += factor * lower[(place, state)];
                }
                let below = lower.column(place);
                for (sum, element) in sums.iter_mut().zip(below.iter()).skip(place) {
                    *sum += factor * element;
                }
            }
        }
    }
}

/// Position of a phone in a joint state; `None` if the state does not contain the phone or the position is not finite.
pub fn position(state: &DVector<f64>, phone: usize) -> Option<Ecef> {
    let point = Ecef(part(state, phone, Part::Position)?);
    point.is_finite().then_some(point)
}

/// One of a phone's parts in a joint state.
pub(super) fn part(state: &DVector<f64>, phone: usize, part: Part) -> Option<Vector3<f64>> {
    let start = part.offset_in_joint(phone)?;
    let slice = state.as_slice().get(start..start.checked_add(3)?)?;
    Some(Vector3::from_column_slice(slice))
}
