//! How noisy a phone's code really is, learnt from its innovations.
//!
//! The stochastic model is one for all phones. A phone with a good antenna under an open sky has less noise than it says, one in a street of
//! houses more. The mean square of the standardised innovations over the last minute scales the noise in the second covariance. The gains
//! keep the nominal model.

use nalgebra::Matrix3;

use super::information::Measured;
use super::weights::mean;
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
        let Some(clock) = mean(rows) else { return };
        // An innovation that is mostly the prediction's error says nothing about the noise.
        let square = |(row, observation): (&Measured, &&CorrectedObservation)| {
            let (noise, predicted) = (observation.pseudorange_sigma_m.powi(2), row.h.dot(&(prior * row.h)));
            (predicted < noise)
                .then(|| ((row.y - clock).powi(2) / (noise + predicted)).min(LARGEST * LARGEST))
        };
        let squares: Vec<f64> = rows.iter().zip(observations).filter_map(square).collect();
        if squares.len() < FEWEST {
            return;
        }
        let mean_square = squares.iter().sum::<f64>() / squares.len() as f64;
        let keep = (-interval_s.max(0.0) / AVERAGED_S).exp();
        self.sum = keep * self.sum + (1.0 - keep) * mean_square;
        self.weight = keep * self.weight + (1.0 - keep);
    }

    /// The ratio.
    pub fn factor(&self) -> f64 {
        let [least, most] = LEVELS;
        ((self.sum + PRIOR) / (self.weight + PRIOR)).clamp(least, most)
    }
}

#[cfg(test)]
mod tests {
    use super::super::information::Other;
    use super::*;
    use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};

    /// The factor after ten minutes at 1 Hz of innovations that are alternately `sigmas` and −`sigmas` standard deviations of the noise.
    fn level(sigmas: f64) -> f64 {
        let observations = Receiver::in_wuhan().observe(&OPEN_SKY_DEG);
        let offered: Vec<&CorrectedObservation> = observations.iter().collect();
        let row = |(index, observation): (usize, &&CorrectedObservation)| {
            let (sign, sigma_m) = ([1.0, -1.0][index % 2], observation.pseudorange_sigma_m);
            let h = nalgebra::Vector3::zeros();
            Measured { h, other: Other::None, y: 300.0 + sign * sigmas * sigma_m, weight: sigma_m.powi(-2) }
        };
        let rows: Vec<Measured> = offered.iter().enumerate().map(row).collect();
        let mut level = NoiseLevel::default();
        for _ in 0..600 {
            level.take(1.0, &rows, &offered, &Matrix3::zeros());
        }
        level.factor()
    }

    #[test]
    fn the_level_is_the_mean_square_of_the_innovations() {
        assert_eq!(NoiseLevel::default().factor(), 1.0);
        // The prior level 1 has a weight of 0.1 beside that of the innovations.
        for sigmas in [0.5, 1.0, 2.0] {
            let expected = (sigmas * sigmas + 0.1) / 1.1;
            assert!((level(sigmas) / expected - 1.0).abs() < 0.05, "{sigmas}: {}", level(sigmas));
        }
        let largest = level(50.0);
        assert!(
            (15.0..25.0).contains(&largest),
            "innovations count as five standard deviations at most: {largest}"
        );
    }
}
