//! minimum ≤ |r_i − r_j| ≤ maximum (Peng Eq. 19).
//!
//! The meaning of the bounds for the vector between the phones is an option: see [`DistanceModel`].

use nalgebra::{DMatrix, DVector, Matrix3, SymmetricEigen, Vector3};
use serde::{Deserialize, Serialize};

use super::super::SkipReason;
use super::super::options::DistanceModel;
use super::super::rows::{BoundedRow, Rows, SparseRow, position};
use super::super::truncation::Interval;
use super::{BoundedLength, ConstrainedState, ConstraintKind, NO_DIRECTION, Unit, not_negative, positive};
use crate::filter::STATES_PER_PHONE;
use crate::frames::{Ecef, LocalFrame};

/// minimum ≤ |r_i − r_j| ≤ maximum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Keys", into = "Keys")]
pub struct Distance {
    /// Indices of the two phones.
    pub phones: [usize; 2],
    /// Lower bound, m, ≥ 0.
    pub minimum_m: f64,
    /// Upper bound, m; may be infinite.
    pub maximum_m: f64,
}

/// The written form.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    #[serde(default)]
    minimum_m: f64,
    maximum_m: f64,
}

impl TryFrom<Keys> for Distance {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        let maximum_m = positive("maximum_m", keys.maximum_m)?;
        let minimum_m = not_negative("minimum_m", keys.minimum_m, "metres")?;
        if minimum_m > maximum_m {
            return Err(format!("minimum_m {minimum_m} is above maximum_m {maximum_m}"));
        }
        Ok(Self { phones: [0, 0], minimum_m, maximum_m })
    }
}

impl From<Distance> for Keys {
    fn from(Distance { minimum_m, maximum_m, .. }: Distance) -> Self {
        Self { minimum_m, maximum_m }
    }
}

impl ConstraintKind for Distance {
    fn phones(&self) -> &[usize] {
        &self.phones
    }

    fn phones_mut(&mut self) -> &mut [usize] {
        &mut self.phones
    }

    fn has_valid_bounds(&self) -> bool {
        self.minimum_m >= 0.0 && self.minimum_m.is_finite() && self.maximum_m >= self.minimum_m
    }

    fn bounds(&self) -> Interval {
        Interval { lower: self.minimum_m, upper: self.maximum_m }
    }

    fn value(&self, state: &DVector<f64>, _horizon_s: f64) -> Option<f64> {
        let [first, second] = self.phones;
        Some(position(state, first)?.distance_m(position(state, second)?))
    }

    fn rows(&self, at: &ConstrainedState<'_>) -> Result<Rows, SkipReason> {
        let model = at.options.distance_model;
        let difference = self.difference(at.state).ok_or(SkipReason::NotFinite)?;
        let is_upper_only = self.minimum_m <= 0.0 && model == DistanceModel::Radial;
        if is_upper_only && difference.norm() <= NO_DIRECTION {
            return Ok([None; 3]);
        }
        let direction = self.direction(at.state, at.covariance).ok_or(SkipReason::NotFinite)?;
        Ok(self.linearised(&direction, at.covariance, model))
    }

    fn length(&self) -> Option<&dyn BoundedLength> {
        Some(self)
    }

    fn unit(&self) -> Unit {
        Unit::METRES
    }

    fn bounds_in_words(&self) -> String {
        format!("{} to {} m", self.minimum_m, self.maximum_m)
    }
}

impl BoundedLength for Distance {
    fn vector(&self, at: &ConstrainedState<'_>) -> Option<Vector3<f64>> {
        self.difference(at.state)
    }

    fn change(&self, _at: &ConstrainedState<'_>, change: &DVector<f64>) -> Option<Vector3<f64>> {
        let [i, j] = self.offsets();
        Some(change.fixed_rows::<3>(i) - change.fixed_rows::<3>(j))
    }

    fn rows_along(&self, at: &ConstrainedState<'_>, direction: &Vector3<f64>) -> Option<Rows> {
        Some(self.linearised(direction, at.covariance, at.options.distance_model))
    }
}

impl Distance {
    fn offsets(&self) -> [usize; 2] {
        self.phones.map(|phone| STATES_PER_PHONE * phone)
    }

    /// The vector from the second to the first phone.
    pub fn difference(&self, state: &DVector<f64>) -> Option<Vector3<f64>> {
        let [first, second] = self.phones;
        Some((position(state, first)? - position(state, second)?).0)
    }

    /// Rows when the distance is linearised along `direction`, a unit vector (Jacobian [uᵀ, −uᵀ]).
    pub(in crate::constraint) fn linearised(
        &self,
        direction: &Vector3<f64>,
        covariance: &DMatrix<f64>,
        model: DistanceModel,
    ) -> Rows {
        let [first, second] = self.offsets();
        let bounded = |axis: &Vector3<f64>, lower: f64| {
            let row = SparseRow::of_two((first, axis), (second, &-axis));
            Some(BoundedRow::new(row, Interval { lower, upper: self.maximum_m }))
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
        let rows = [
            bounded(direction, lower_m),
            bounded(&across, -self.maximum_m),
            bounded(&other, -self.maximum_m),
        ];
        if model == DistanceModel::Ball && self.minimum_m <= 0.0 {
            rows.map(|row| row.map(BoundedRow::of_ball))
        } else {
            rows
        }
    }

    /// Lower bound of the component along a direction, reduced by the contribution of the uncertainty across:
    /// d² = along² + across².
    fn minimum_along_m(&self, direction: &Vector3<f64>, covariance: &DMatrix<f64>) -> f64 {
        if self.minimum_m <= 0.0 {
            return 0.0;
        }
        let relative = self.relative_covariance(covariance);
        let across_m2 = (relative.trace() - direction.dot(&(relative * direction))).max(0.0);
        (self.minimum_m * self.minimum_m - across_m2).max(0.0).sqrt()
    }

    fn relative_covariance(&self, covariance: &DMatrix<f64>) -> Matrix3<f64> {
        let [i, j] = self.offsets();
        let block = |row: usize, column: usize| covariance.fixed_view::<3, 3>(row, column).into_owned();
        block(i, i) + block(j, j) - block(i, j) - block(j, i)
    }

    /// Direction of the linearisation: that of the difference, or, for a zero difference, the direction of the largest uncertainty.
    ///
    /// `None` if the state does not contain the phones.
    fn direction(&self, state: &DVector<f64>, covariance: &DMatrix<f64>) -> Option<Vector3<f64>> {
        let [first, _] = self.phones;
        let place = position(state, first)?;
        let difference = self.difference(state)?;
        let length = difference.norm();
        Some(if length > NO_DIRECTION {
            difference / length
        } else {
            self.least_known_direction(place, covariance)
        })
    }

    fn least_known_direction(&self, place: Ecef, covariance: &DMatrix<f64>) -> Vector3<f64> {
        let relative = self.relative_covariance(covariance);
        if !relative.iter().all(|element| element.is_finite()) {
            return Vector3::x();
        }
        let eigen = SymmetricEigen::new(relative);
        let axis = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
        // The sign is arbitrary; the local axes fix it, so that equal input gives equal results everywhere.
        let local = LocalFrame::at(place).rotation_ecef_to_enu() * axis;
        if local[local.iamax()] < 0.0 { -axis } else { axis }
    }
}

/// Two unit vectors that complete a direction to an orthogonal triad, the first perpendicular to the Earth's axis.
fn axes_across(direction: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let pole = Vector3::z();
    let horizontal = direction.cross(&pole);
    let across = if horizontal.norm() > 1e-6 { horizontal.normalize() } else { Vector3::x() };
    let other = direction.cross(&across).normalize();
    (across, other)
}
