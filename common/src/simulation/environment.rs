//! Errors of a phone's measurements, and their random processes.
//!
//! Three kinds of error come from the surroundings. *Façades* beside the road hide satellites and reflect them
//! ([`super::street`]); the received signal is the sum of the direct and the reflected signal ([`Mixture`]). *Diffuse
//! multipath* of everything else is a first-order Gauss-Markov process of unit variance,
//! x ← x·e^(−Δt/τ) + √(1 − e^(−2Δt/τ))·n, scaled by elevation and surroundings; part of it is common to the phones of one
//! vehicle. *Passing reflections* (vans, lorries): occasionally a satellite is received by reflection only, with a constant positive
//! error for some seconds.

use rand::Rng;
use rand_distr::StandardNormal;

use super::shared::SharedErrors;

/// Sizes of the errors. All scenarios have those of [`ErrorModel::default`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorModel {
    /// Code noise: σ² = a + b·10^(−C/N0/10); a in m².
    pub code_a_m2: f64,
    /// b in m²·Hz.
    pub code_b_m2hz: f64,
    /// Range-rate noise of the same form: a in m²/s².
    pub rate_a_m2ps2: f64,
    /// b in m²/s²·Hz.
    pub rate_b_m2ps2hz: f64,
    /// Standard deviation of the multipath at the horizon in open surroundings, m.
    pub multipath_open_m: f64,
    /// Standard deviation of the multipath at the horizon in a canyon, m.
    pub multipath_canyon_m: f64,
    /// Correlation time τ of the multipath, s.
    pub multipath_correlation_s: f64,
    /// Fraction of the multipath's variance that is common to the phones of one vehicle, 0 to 1.
    pub multipath_shared: f64,
    /// Passing reflections per satellite and second.
    pub outliers_hz: f64,
    /// Fraction of the façades that reflect, 0 to 1.
    pub facades_reflecting: f64,
    /// Standard deviation of the shadowing, dB; twice that in a canyon.
    pub shadowing_db: f64,
    /// Standard deviation of the range error by orbit and clock of the message, constant and the same at all phones, m.
    pub signal_in_space_m: f64,
    /// Ratio of the true ionospheric delay to that of the broadcast model.
    pub ionosphere_scale: f64,
    /// Ratio of the true tropospheric delay to that of the model.
    pub troposphere_scale: f64,
    /// Standard deviation of the satellites' L5 delays, which are in no simulated message, m.
    pub l5_delay_m: f64,
    /// Slowly varying errors of satellites and ionosphere that all phones have alike.
    pub shared: SharedErrors,
}

impl Default for ErrorModel {
    /// Phones in cars: metres of noise, metres of multipath, occasionally tens of metres.
    fn default() -> Self {
        Self {
            code_a_m2: 0.25,
            code_b_m2hz: 5e4,
            rate_a_m2ps2: 4e-4,
            rate_b_m2ps2hz: 100.0,
            multipath_open_m: 5.0,
            multipath_canyon_m: 9.0,
            multipath_correlation_s: 20.0,
            multipath_shared: 0.3,
            outliers_hz: 1.0 / 3_000.0,
            facades_reflecting: 0.6,
            shadowing_db: 1.0,
            signal_in_space_m: 0.5,
            ionosphere_scale: 1.15,
            troposphere_scale: 1.02,
            l5_delay_m: 0.8,
            shared: SharedErrors::default(),
        }
    }
}

impl ErrorModel {
    /// No errors: only geometry, clocks, inter-system biases, and delays that the models remove exactly.
    pub const fn none() -> Self {
        Self {
            code_a_m2: 0.0,
            code_b_m2hz: 0.0,
            rate_a_m2ps2: 0.0,
            rate_b_m2ps2hz: 0.0,
            multipath_open_m: 0.0,
            multipath_canyon_m: 0.0,
            multipath_correlation_s: 20.0,
            multipath_shared: 0.0,
            outliers_hz: 0.0,
            facades_reflecting: 0.0,
            shadowing_db: 0.0,
            signal_in_space_m: 0.0,
            ionosphere_scale: 1.0,
            troposphere_scale: 1.0,
            l5_delay_m: 0.0,
            shared: SharedErrors::NONE,
        }
    }

    /// Standard deviation of the multipath at an elevation, m.
    pub fn multipath_sigma_m(&self, elevation_rad: f64, in_canyon: bool) -> f64 {
        let at_horizon = if in_canyon { self.multipath_canyon_m } else { self.multipath_open_m };
        at_horizon * (-elevation_rad / 0.6).exp()
    }

    /// Standard deviation of the code noise at a C/N0, m.
    pub fn code_sigma_m(&self, cn0_dbhz: f64) -> f64 {
        (self.code_a_m2 + self.code_b_m2hz * 10_f64.powf(-cn0_dbhz / 10.0)).sqrt()
    }

    /// Standard deviation of the range rate at a C/N0, m/s.
    pub fn rate_sigma_mps(&self, cn0_dbhz: f64) -> f64 {
        (self.rate_a_m2ps2 + self.rate_b_m2ps2hz * 10_f64.powf(-cn0_dbhz / 10.0)).sqrt()
    }
}

/// Received signal of a satellite: the direct signal, a reflected signal, or both.
///
/// With the relative amplitude α, the phase φ and the delay d of the reflection, a delay that is short against a chip shifts the
/// code by d·α(α + cos φ)/(1 + 2α·cos φ + α²) and changes the amplitude by |1 + α·e^(iφ)| (Kaplan & Hegarty,
/// "Understanding GPS/GNSS", ch. 9, for a narrow correlator). Without the direct signal (α → ∞) the error is d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mixture {
    /// Signal power relative to an undisturbed direct signal, dB.
    pub gain_db: f64,
    /// Code delay as a fraction of the reflection's delay.
    pub delayed: f64,
}

impl Mixture {
    /// The mixture of a direct and a reflected signal by their losses (dB, `None` if absent), at a phase (rad); `None` without
    /// any signal.
    pub(super) fn of(direct_db: Option<f64>, reflected_db: Option<f64>, phase_rad: f64) -> Option<Self> {
        match (direct_db, reflected_db) {
            (None, None) => None,
            (Some(loss_db), None) => Some(Self { gain_db: -loss_db, delayed: 0.0 }),
            (None, Some(loss_db)) => Some(Self { gain_db: -loss_db, delayed: 1.0 }),
            (Some(direct_db), Some(reflected_db)) => {
                let alpha = 10_f64.powf((direct_db - reflected_db) / 20.0);
                let power = 1.0 + alpha * (2.0 * phase_rad.cos() + alpha);
                // Two equal signals may cancel; the loss is limited to 40 dB.
                let power = power.max(1e-4);
                Some(Self {
                    gain_db: 10.0 * power.log10() - direct_db,
                    delayed: alpha * (alpha + phase_rad.cos()) / power,
                })
            }
        }
    }
}

/// A Gauss-Markov process of unit variance.
#[derive(Clone, Copy, Debug)]
pub(super) struct GaussMarkov {
    value: f64,
}

impl GaussMarkov {
    /// Starts in the steady state.
    pub(super) fn start(random: &mut impl Rng) -> Self {
        Self { value: random.sample(StandardNormal) }
    }

    /// Advances by `step_s` with the correlation time `correlation_s` and returns the new value.
    pub(super) fn advance(&mut self, step_s: f64, correlation_s: f64, random: &mut impl Rng) -> f64 {
        let keep = (-step_s / correlation_s).exp();
        let noise: f64 = random.sample(StandardNormal);
        self.value = keep * self.value + (1.0 - keep * keep).max(0.0).sqrt() * noise;
        self.value
    }

    /// The present value.
    pub(super) const fn value(self) -> f64 {
        self.value
    }
}

/// Minimum duration of a passing reflection, s.
const SHORTEST_OUTLIER_S: f64 = 3.0;
/// Range of the durations above the minimum, s.
const OUTLIER_RANGE_S: f64 = 9.0;

/// Reflected-only reception of one satellite.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outlier {
    left_s: f64,
    error_m: f64,
}

impl Outlier {
    /// Advances by `step_s` with `rate_hz` onsets per second; returns the error, m, 0 without an outlier.
    ///
    /// A passing reflection lasts 3 to 12 s from the first epoch that sees it. After steps longer than 3 s, between which one may pass
    /// unseen, it lasts that long from its onset, so that the fraction of epochs with an outlier does not depend on the interval.
    ///
    /// The number of draws does not depend on the outcome, so that an option changes only its own effects.
    pub(super) fn advance(&mut self, step_s: f64, rate_hz: f64, random: &mut impl Rng) -> f64 {
        let (chance, duration, size) =
            (random.random::<f64>(), random.random::<f64>(), random.random::<f64>());
        self.left_s -= step_s;
        if self.left_s <= 0.0 {
            *self = Self::default();
            if chance < 1.0 - (-rate_hz * step_s).exp() {
                let onset_s = -(-chance).ln_1p() / rate_hz;
                let passed_s = if step_s > SHORTEST_OUTLIER_S { step_s - onset_s } else { 0.0 };
                let left_s = SHORTEST_OUTLIER_S + OUTLIER_RANGE_S * duration - passed_s;
                if left_s > 0.0 {
                    *self = Self { left_s, error_m: 15.0 + 45.0 * size };
                }
            }
        }
        self.error_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn multipath_is_correlated_as_asked() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut process = GaussMarkov::start(&mut random);
        let values: Vec<f64> = (0..200_000).map(|_| process.advance(1.0, 20.0, &mut random)).collect();
        for (lag, expected) in [(0, 1.0), (10, (-0.5_f64).exp()), (20, (-1.0_f64).exp()), (100, 0.0)] {
            let products = values.iter().zip(values.iter().skip(lag)).map(|(a, b)| a * b);
            let correlation = products.sum::<f64>() / (values.len() - lag) as f64;
            assert!((correlation - expected).abs() < 0.05, "lag {lag}: {correlation} {expected}");
        }
    }

    #[test]
    fn outliers_begin_at_the_rate_asked() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut outlier = Outlier::default();
        let (mut beginnings, mut free_s, mut before) = (0, 0, 0.0);
        for _ in 0..400_000 {
            let error = outlier.advance(1.0, 1.0 / 150.0, &mut random);
            assert!(error == 0.0 || (15.0..=60.0).contains(&error));
            beginnings += i32::from(error != 0.0 && error != before);
            free_s += i32::from(error == 0.0);
            before = error;
        }
        let rate = f64::from(beginnings) / f64::from(free_s);
        assert!((rate * 150.0 - 1.0).abs() < 0.1, "{rate}");
    }

    /// At one onset in 300 s and a mean duration of 7.5 s, a satellite is received by reflection only for 2.4 % of the time.
    #[test]
    fn the_share_of_outliers_does_not_depend_on_the_interval() {
        for (step_s, epochs) in [(0.1, 4_000_000_u32), (1.0, 400_000), (5.0, 400_000), (30.0, 400_000)] {
            let mut random = ChaCha8Rng::seed_from_u64(5);
            let mut outlier = Outlier::default();
            let present = (0..epochs).filter(|_| outlier.advance(step_s, 1.0 / 300.0, &mut random) != 0.0);
            let share = present.count() as f64 / f64::from(epochs);
            assert!((share / 0.0244 - 1.0).abs() < 0.12, "{step_s} s: {share}");
        }
    }

    #[test]
    fn a_mixture_goes_from_the_direct_signal_to_the_reflected_one() {
        let of = |reflected_db: f64, phase_rad: f64| {
            Mixture::of(Some(3.0), Some(reflected_db), phase_rad).unwrap()
        };
        assert_eq!(Mixture::of(None, None, 0.0), None);
        assert_eq!(Mixture::of(Some(3.0), None, 1.0), Some(Mixture { gain_db: -3.0, delayed: 0.0 }));
        assert_eq!(Mixture::of(None, Some(9.0), 1.0), Some(Mixture { gain_db: -9.0, delayed: 1.0 }));
        // Half the amplitude, in phase: 1.5 times the amplitude, a third of the delay; in opposition: minus the delay.
        let half_db = 3.0 + 20.0 * 2.0_f64.log10();
        let (together, against) = (of(half_db, 0.0), of(half_db, std::f64::consts::PI));
        assert!((together.delayed - 1.0 / 3.0).abs() < 1e-9 && (together.gain_db - 0.522).abs() < 1e-3);
        assert!((against.delayed + 1.0).abs() < 1e-9 && (against.gain_db + 9.021).abs() < 1e-3);
        assert!(of(80.0, 0.5).delayed.abs() < 1e-3 && (of(-80.0, 0.5).delayed - 1.0).abs() < 1e-3);
        assert!(of(3.0, std::f64::consts::PI).gain_db > -45.0);
    }
}
