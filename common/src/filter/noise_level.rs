//! How noisy a phone's code really is, learnt from its innovations.
//!
//! The stochastic model is one for all phones. A phone with a good antenna under an open sky has less noise than it says, one in a street of
//! houses more. The mean square of the standardised innovations over the last minute scales the noise in the second covariance. The gains
//! keep the nominal model.

use nalgebra::Matrix3;

use super::information::Measured;
use crate::measurement::CorrectedObservation;

/// Time over which the level is averaged, s.
const AVERAGED_S: f64 = 60.0;
/// Weight of the level 1 before any innovation, as a share of the full average.
const PRIOR: f64 = 0.1;
/// Standardised innovation at which larger ones count, so that single outliers do not decide.
const LARGEST: f64 = 5.0;
/// Minimum number of innovations of an epoch that counts.
const FEWEST: usize = 5;
/// Bounds of the level.
const LEVELS: [f64; 2] = [0.1, 30.0];

/// Ratio of the real to the nominal variance of code noise.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct NoiseLevel {
    sum: f64,
    weight: f64,
}

impl NoiseLevel {
    /// Takes the innovations of an epoch `interval_s` after the one before; `prior` is the covariance of the predicted position.
    pub fn take(
        &mut self,
        interval_s: f64,
        rows: &[Measured],
        observations: &[&CorrectedObservation],
        prior: &Matrix3<f64>,
    ) {
        let total: f64 = rows.iter().map(|row| row.weight).sum();
        let clock = rows.iter().map(|row| row.weight * row.y).sum::<f64>() / total;
        // An innovation that is mostly the prediction's error says nothing about the noise.
        let square = |(row, observation): (&Measured, &&CorrectedObservation)| {
            let (noise, predicted) = (observation.pseudorange_sigma_m.powi(2), row.h.dot(&(prior * row.h)));
            (predicted < noise)
                .then(|| ((row.y - clock).powi(2) / (noise + predicted)).min(LARGEST * LARGEST))
        };
        let squares: Vec<f64> = rows.iter().zip(observations).filter_map(square).collect();
        if squares.len() < FEWEST || total <= 0.0 {
            return;
        }
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        let keep = (-interval_s.max(0.0) / AVERAGED_S).exp();
        self.sum = keep * self.sum + (1.0 - keep) * mean;
        self.weight = keep * self.weight + (1.0 - keep);
    }

    /// The ratio.
    pub fn factor(&self) -> f64 {
        let [least, most] = LEVELS;
        ((self.sum + PRIOR) / (self.weight + PRIOR)).clamp(least, most)
    }
}
