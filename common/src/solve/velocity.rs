//! Velocity and clock drift from Doppler.

use super::VelocitySolution;
use super::elimination::{Eliminated, Row};
use super::position::line_of_sight;
use crate::frames::{Ecef, EcefVector};
use crate::measurement::{CorrectedObservation, Usage};

/// Outlier limit in σ; range rates with larger residuals are excluded one at a time.
const OUTLIER_SIGMAS: f64 = 4.0;
/// Velocity and clock drift.
const UNKNOWNS: usize = 4;

/// A fit of range rates with the data for its tests.
#[derive(Clone, Debug)]
pub struct RateFit {
    /// The velocity.
    pub solution: VelocitySolution,
    /// D = rᵀWr of the range rates in use.
    pub weighted_square_sum: f64,
    /// Number of range rates in use less four.
    pub degrees_of_freedom: usize,
    /// Number of excluded range rates.
    pub excluded: usize,
}

/// Velocity by weighted least squares; see [`fit_velocity`].
pub fn solve_velocity(observations: &[CorrectedObservation], position: Ecef) -> Option<VelocitySolution> {
    fit_velocity(observations, position).map(|fit| fit.solution)
}

/// Velocity by weighted least squares from the range rates of the observations in use, with one common clock drift, because all signals
/// share the phone's oscillator. Residuals beyond four σ are excluded, the largest first, while redundancy remains.
/// `None` if fewer than four range rates or a singular geometry remain.
pub fn fit_velocity(observations: &[CorrectedObservation], position: Ecef) -> Option<RateFit> {
    let mut rows: Vec<Row> = observations
        .iter()
        .filter(|o| o.usage == Usage::Used)
        .filter_map(|o| rate_row(o, position))
        .collect();
    let offered = rows.len();
    loop {
        if rows.len() < UNKNOWNS {
            return None;
        }
        let eliminated = Eliminated::new(&rows, 1);
        let factor = eliminated.factor()?;
        let velocity = factor.solve(&eliminated.rhs);
        let drift = eliminated.clock(0, &velocity);
        let square = |row: &Row| (row.y - row.h.dot(&velocity) - drift).powi(2) * row.weight;
        let worst = rows.iter().map(square).enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
        if rows.len() == UNKNOWNS || worst.1 < OUTLIER_SIGMAS * OUTLIER_SIGMAS {
            let solution = VelocitySolution { velocity: EcefVector(velocity), covariance: factor.inverse() };
            return solution.velocity.is_finite().then(|| RateFit {
                solution,
                weighted_square_sum: rows.iter().map(square).sum(),
                degrees_of_freedom: rows.len() - UNKNOWNS,
                excluded: offered - rows.len(),
            });
        }
        rows.swap_remove(worst.0);
    }
}

/// Row of the range rate of one observation at `position`: y = ρ̇_c − u·v_s, h = −u; the unknown is the velocity.
pub(crate) fn rate_row(observation: &CorrectedObservation, position: Ecef) -> Option<Row> {
    let rate = observation.range_rate?;
    let u = line_of_sight(observation, position);
    Some(Row {
        h: -u,
        group: 0,
        y: rate.range_rate_mps - u.dot(&observation.satellite_velocity.0),
        weight: rate.sigma_mps.powi(-2),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};

    #[test]
    fn the_true_velocity_comes_back() {
        let receiver = Receiver::in_wuhan();
        let observations = receiver.observe(&OPEN_SKY_DEG);
        let velocity = solve_velocity(&observations, receiver.position).unwrap().velocity;
        assert!((velocity.0 - receiver.velocity.0).norm() < 1e-9);
    }

    #[test]
    fn a_wrong_doppler_is_left_out() {
        let receiver = Receiver::in_wuhan();
        // 10 and 300 standard deviations.
        for error_mps in [1.0, 30.0] {
            let mut observations = receiver.observe(&OPEN_SKY_DEG);
            observations[4].range_rate.as_mut().unwrap().range_rate_mps += error_mps;
            let velocity = solve_velocity(&observations, receiver.position).unwrap().velocity;
            assert!((velocity.0 - receiver.velocity.0).norm() < 1e-9, "{error_mps} m/s");
        }
    }

    #[test]
    fn the_row_is_the_derivative_of_the_rate() {
        let receiver = Receiver::in_wuhan();
        for observation in receiver.observe(&OPEN_SKY_DEG) {
            let row = rate_row(&observation, receiver.position).unwrap();
            // ρ̇ = d|r_s − r|/dt with motion of both ends.
            let range_m = |t: f64, velocity: nalgebra::Vector3<f64>| {
                let satellite = observation.satellite_position.0 + observation.satellite_velocity.0 * t;
                (satellite - receiver.position.0 - velocity * t).norm()
            };
            let rate = |v: nalgebra::Vector3<f64>| (range_m(0.1, v) - range_m(-0.1, v)) / 0.2;
            for axis in 0..3 {
                let mut step = nalgebra::Vector3::zeros();
                step[axis] = 5.0;
                let numeric = (rate(receiver.velocity.0 + step) - rate(receiver.velocity.0 - step)) / 10.0;
                assert!((numeric - row.h[axis]).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn three_rates_are_not_enough() {
        let receiver = Receiver::in_wuhan();
        let observations = receiver.observe(&OPEN_SKY_DEG[..3]);
        assert!(solve_velocity(&observations, receiver.position).is_none());
    }
}
