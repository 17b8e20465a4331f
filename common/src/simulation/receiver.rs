//! A phone's oscillator and hardware biases.
//!
//! Clock: the usual two-state model, bias b (s) and drift d (s/s) with white noise of densities S_f (s²/s) on the
//! frequency and S_g (s²/s³) on its change; over Δt the noise has the covariance
//! [S_f·Δt + S_g·Δt³/3, S_g·Δt²/2; S_g·Δt²/2, S_g·Δt] (Brown & Hwang, "Introduction to Random Signals and Applied
//! Kalman Filtering", ch. 9). The densities are those of a temperature-compensated crystal.

use rand::Rng;
use rand_distr::StandardNormal;

use crate::gnss::{ClockGroup, Constellation};

/// White frequency noise S_f, s²/s.
const FREQUENCY_DENSITY_S: f64 = 1e-19;
/// Random-walk frequency noise S_g, s²/s³.
const DRIFT_DENSITY_1PS: f64 = 4e-19;

/// A phone's clock at the start of the scenario.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClockOptions {
    /// Bias of the first epoch, s; positive = the clock is fast.
    pub bias_s: f64,
    /// Drift of the first epoch, s/s.
    pub drift_sps: f64,
}

/// Clock bias and drift at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockState {
    /// Bias dt_r, s: the time tag minus GPS time.
    pub bias_s: f64,
    /// Drift, s/s.
    pub drift_sps: f64,
}

impl ClockState {
    /// The state `step_s` later.
    pub fn advance(self, step_s: f64, random: &mut impl Rng) -> Self {
        let drift_variance = DRIFT_DENSITY_1PS * step_s;
        let bias_given_drift = FREQUENCY_DENSITY_S * step_s + DRIFT_DENSITY_1PS * step_s.powi(3) / 12.0;
        let drift_noise = drift_variance.sqrt() * random.sample::<f64, _>(StandardNormal);
        let bias_noise = bias_given_drift.sqrt() * random.sample::<f64, _>(StandardNormal);
        Self {
            // The covariance with the noise of the drift is half a step.
            bias_s: self.bias_s + self.drift_sps * step_s + 0.5 * step_s * drift_noise + bias_noise,
            drift_sps: self.drift_sps + drift_noise,
        }
    }
}

impl From<ClockOptions> for ClockState {
    fn from(options: ClockOptions) -> Self {
        Self { bias_s: options.bias_s, drift_sps: options.drift_sps }
    }
}

/// Clock groups with a bias against GPS L1.
const BIASED_GROUPS: [ClockGroup; 3] = [
    ClockGroup { constellation: Constellation::Gps, band: b'5' },
    ClockGroup { constellation: Constellation::Galileo, band: b'1' },
    ClockGroup { constellation: Constellation::Beidou, band: b'2' },
];
/// Standard deviation of the biases, s.
const BIAS_SIGMA_S: f64 = 40e-9;

/// Constant receiver biases of the clock groups against GPS L1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InterSystemBiases {
    /// In the order of `BIASED_GROUPS`, s.
    biases_s: [f64; BIASED_GROUPS.len()],
}

impl InterSystemBiases {
    /// Draws biases with a standard deviation of 40 ns.
    pub(super) fn draw(random: &mut impl Rng) -> Self {
        Self { biases_s: BIASED_GROUPS.map(|_| BIAS_SIGMA_S * random.sample::<f64, _>(StandardNormal)) }
    }

    /// The bias of a clock group, s; 0 for GPS L1 and for groups that are not simulated.
    pub fn of(&self, group: ClockGroup) -> f64 {
        let mut biases = BIASED_GROUPS.iter().zip(self.biases_s);
        biases.find(|(of, _)| **of == group).map_or(0.0, |(_, bias_s)| bias_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// Variances after 100 s must not depend on the division of the time into steps.
    #[test]
    fn variances_do_not_depend_on_the_step() {
        let spread = |steps: u32| {
            let runs = 2_000;
            let (mut bias2, mut drift2, mut cross) = (0.0, 0.0, 0.0);
            for run in 0..runs {
                let mut random = ChaCha8Rng::seed_from_u64(run);
                let mut clock = ClockState::from(ClockOptions::default());
                for _ in 0..steps {
                    clock = clock.advance(100.0 / f64::from(steps), &mut random);
                }
                bias2 += clock.bias_s.powi(2);
                drift2 += clock.drift_sps.powi(2);
                cross += clock.bias_s * clock.drift_sps;
            }
            [bias2, drift2, cross].map(|sum| sum / runs as f64)
        };
        let expected = [
            FREQUENCY_DENSITY_S * 100.0 + DRIFT_DENSITY_1PS * 1e6 / 3.0,
            DRIFT_DENSITY_1PS * 100.0,
            DRIFT_DENSITY_1PS * 5_000.0,
        ];
        for steps in [1, 20] {
            for (measured, expected) in spread(steps).into_iter().zip(expected) {
                assert!((measured / expected - 1.0).abs() < 0.15, "{steps} steps: {measured} {expected}");
            }
        }
    }
}
