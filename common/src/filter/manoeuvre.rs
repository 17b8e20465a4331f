//! Manoeuvres: accelerations beyond the motion model.
//!
//! The range rates of an epoch that agree with each other on a velocity, but not with the prediction, are right, and the prediction is wrong.
//! A robust filter would reject them all. Then a velocity step d over the last interval Δt is taken as one more unknown: the state's covariance
//! grows by ggᵀ, g = (½dΔt, d, d/Δt) in position, velocity and acceleration.

use nalgebra::{Cholesky, DVector, Vector3};

use super::information::{Information, Measured};
use super::{JointFilter, STATES_PER_PHONE};

/// Residual beyond which a range rate does not belong to the common velocity, standard deviations.
const OUTLIER_SIGMAS: f64 = 4.0;
/// Minimum number of range rates that agree: two more than velocity and drift need.
const FEWEST: usize = 6;
/// Minimum share of the offered range rates that agree. In a street a wrong velocity may suit more than half.
const AGREEING_SHARE: f64 = 0.8;
/// Velocity step in standard deviations of the difference between common velocity and prediction.
const STEP_SIGMAS: f64 = 5.0;
/// Longest time over which a velocity step is an acceleration, s.
const LONGEST_S: f64 = 10.0;

impl JointFilter {
    /// Opens the state of a phone for a velocity step, if its range rates (innovations with nominal weights) agree on one.
    /// Returns whether they do.
    pub(super) fn open_for_manoeuvre(&mut self, slot: usize, rates: &[Measured]) -> bool {
        let Some((step, information)) = common_velocity(rates) else { return false };
        let at = self.slots[slot].at;
        let predicted = self.covariance.fixed_view::<3, 3>(at + 3, at + 3).into_owned();
        let normal = &information.root * information.root.transpose();
        let Some(measured) = Cholesky::new(normal.fixed_view::<3, 3>(0, 0).into_owned()) else {
            return false;
        };
        let Some(expected) = Cholesky::new(measured.inverse() + predicted) else { return false };
        if step.dot(&expected.solve(&step)) < STEP_SIGMAS * STEP_SIGMAS {
            return false;
        }
        let interval_s = self.silence_s(slot).clamp(1e-3, LONGEST_S);
        let mut direction = DVector::zeros(STATES_PER_PHONE);
        direction.fixed_rows_mut::<3>(0).copy_from(&(step * (0.5 * interval_s)));
        direction.fixed_rows_mut::<3>(3).copy_from(&step);
        direction.fixed_rows_mut::<3>(6).copy_from(&(step / interval_s));
        let second = self.consider.as_mut().map(|consider| &mut consider.covariance);
        for covariance in std::iter::once(&mut self.covariance).chain(second) {
            let mut block = covariance.view_mut((at, at), (STATES_PER_PHONE, STATES_PER_PHONE));
            block.ger(1.0, &direction, &direction, 1.0);
        }
        true
    }
}

/// Difference between the velocity on which most range rates agree and the prediction, with its information.
fn common_velocity(rates: &[Measured]) -> Option<(Vector3<f64>, Information)> {
    let mut rows = rates.to_vec();
    loop {
        if rows.len() < FEWEST || (rows.len() as f64) < AGREEING_SHARE * rates.len() as f64 {
            return None;
        }
        let information = Information::new(&rows, 3);
        let velocity: Vector3<f64> = information.solution()?.fixed_rows::<3>(0).into_owned();
        let total: f64 = rows.iter().map(|row| row.weight).sum();
        let left = |row: &Measured| row.y - row.h.dot(&velocity);
        let drift = rows.iter().map(|row| row.weight * left(row)).sum::<f64>() / total;
        let normalised = |row: &Measured| (left(row) - drift).powi(2) * row.weight;
        let worst = rows.iter().map(normalised).enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
        if worst.1 < OUTLIER_SIGMAS * OUTLIER_SIGMAS {
            return Some((velocity, information));
        }
        rows.swap_remove(worst.0);
    }
}
