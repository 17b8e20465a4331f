//! minimum ≤ |r_i − r_j| ≤ maximum (Peng Eq. 19).
//!
//! The meaning of the bounds for the vector between the phones is an option: see [`DistanceModel`].

use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use serde::{Deserialize, Serialize};

use super::super::SkipReason;
use super::super::options::DistanceModel;
use super::super::rows::{BoundedRow, Rows, Terms};
use super::super::truncation::Interval;
use super::{BoundedLength, ConstraintKind, NO_DIRECTION, Quantity, Unit, not_negative, positive};
use crate::frames::LocalFrame;

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

    fn terms(&self, _horizon_s: f64) -> Terms {
        Terms::difference(self.phones)
    }

    fn value(&self, vector: &Vector3<f64>, _frame: &LocalFrame) -> Option<f64> {
        Some(vector.norm())
    }

    fn rows(&self, at: &Quantity<'_>) -> Result<Rows, SkipReason> {
        let model = at.options.distance_model;
        let is_upper_only = self.minimum_m <= 0.0 && model == DistanceModel::Radial;
        if is_upper_only && at.mean.norm() <= NO_DIRECTION {
            return Ok([None; 3]);
        }
        Ok(self.linearised(&direction(at), &at.covariance, model))
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
    fn bounded(&self, vector: &Vector3<f64>, _frame: &LocalFrame) -> Vector3<f64> {
        *vector
    }

    fn rows_along(&self, at: &Quantity<'_>, direction: &Vector3<f64>) -> Rows {
        self.linearised(direction, &at.covariance, at.options.distance_model)
    }
}

impl Distance {
    /// Rows when the distance is linearised along `direction`, a unit vector (Jacobian [uᵀ, −uᵀ]); `covariance` is that of the
    /// difference.
    pub(in crate::constraint) fn linearised(
        &self,
        direction: &Vector3<f64>,
        covariance: &Matrix3<f64>,
        model: DistanceModel,
    ) -> Rows {
        let bounded = |axis: &Vector3<f64>, lower: f64| {
            Some(BoundedRow::new(*axis, Interval { lower, upper: self.maximum_m }))
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
    fn minimum_along_m(&self, direction: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
        if self.minimum_m <= 0.0 {
            return 0.0;
        }
        let across_m2 = (covariance.trace() - direction.dot(&(covariance * direction))).max(0.0);
        (self.minimum_m * self.minimum_m - across_m2).max(0.0).sqrt()
    }
}

/// Direction of the linearisation: that of the difference, or, for a zero difference, the direction of the largest uncertainty.
fn direction(at: &Quantity<'_>) -> Vector3<f64> {
    let length = at.mean.norm();
    if length > NO_DIRECTION { at.mean / length } else { least_known_direction(at) }
}

fn least_known_direction(at: &Quantity<'_>) -> Vector3<f64> {
    if !at.covariance.iter().all(|element| element.is_finite()) {
        return Vector3::x();
    }
    let eigen = SymmetricEigen::new(at.covariance);
    let axis = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    // The sign is arbitrary; the local axes fix it, so that equal input gives equal results everywhere.
    let local = at.frame.rotation_ecef_to_enu() * axis;
    if local[local.iamax()] < 0.0 { -axis } else { axis }
}

/// Two unit vectors that complete a direction to an orthogonal triad, the first perpendicular to the Earth's axis.
fn axes_across(direction: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let pole = Vector3::z();
    let horizontal = direction.cross(&pole);
    let across = if horizontal.norm() > 1e-6 { horizontal.normalize() } else { Vector3::x() };
    let other = direction.cross(&across).normalize();
    (across, other)
}
