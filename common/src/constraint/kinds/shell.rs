//! A vector whose length lies between two bounds: the rows for it.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::super::options::DistanceModel;
use super::super::rows::{BoundedRow, Rows};
use super::super::truncation::Interval;
use super::{NO_DIRECTION, Quantity};

/// Bounds of a length.
impl Interval {
    /// Rows when the length is linearised along the vector's own direction.
    pub(super) fn shell(&self, at: &Quantity<'_>) -> Rows {
        let is_upper_only = self.lower <= 0.0 && at.options.distance_model == DistanceModel::Radial;
        if is_upper_only && at.mean.norm() <= NO_DIRECTION {
            return [None; 3];
        }
        self.shell_along(at, &direction(at))
    }

    /// Rows when the length is linearised along `direction`, a unit vector: |d| ≈ uᵀd.
    pub(super) fn shell_along(&self, at: &Quantity<'_>, direction: &Vector3<f64>) -> Rows {
        let bounded =
            |axis: &Vector3<f64>, lower: f64| Some(BoundedRow::new(*axis, Self { lower, upper: self.upper }));
        let model = at.options.distance_model;
        if model == DistanceModel::Radial {
            return [bounded(direction, self.lower), None, None];
        }
        let along = self.least_along(direction, &at.covariance);
        let lower = if along > 0.0 { along } else { -self.upper };
        if self.upper.is_infinite() {
            return [bounded(direction, lower), None, None];
        }
        let (across, other) = axes_across(direction);
        let rows = [bounded(direction, lower), bounded(&across, -self.upper), bounded(&other, -self.upper)];
        if model == DistanceModel::Ball && self.lower <= 0.0 {
            rows.map(|row| row.map(BoundedRow::of_ball))
        } else {
            rows
        }
    }

    /// Lower bound of the component along a direction, reduced by the contribution of the uncertainty across: d² = along² + across².
    fn least_along(&self, direction: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
        if self.lower <= 0.0 {
            return 0.0;
        }
        let across = (covariance.trace() - direction.dot(&(covariance * direction))).max(0.0);
        (self.lower * self.lower - across).max(0.0).sqrt()
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
