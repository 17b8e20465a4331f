//! Options of the joint filter.

use serde::{Deserialize, Serialize};

use super::SharedErrors;

/// Options of the filter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[allow(clippy::struct_excessive_bools)] // independent switches
pub struct FilterOptions {
    /// Motion model of the phones.
    pub process: ProcessNoise,
    /// Standard deviation of each component of a new phone's velocity without Doppler, m/s.
    pub start_speed_mps: f64,
    /// How much of a pseudorange's noise is correlated in time.
    pub code_noise: CodeNoise,
    /// Factor on the variance of a satellite's orbit, clock and group delay in the weights. They last, and no mean over epochs removes them,
    /// so they count more here than in the solution of one epoch.
    pub lasting_weight: f64,
    /// The same factor for epochs that changes of range tie to the one before: the longer a filter remembers, the more lasting errors count.
    pub tied_lasting_weight: f64,
    /// Factor on the standard deviation of a range rate.
    pub rate_sigma_scale: f64,
    /// Down-weighting of large innovations.
    pub robust: RobustWeights,
    /// Mistrust of pseudoranges of weak signals that are longer than predicted.
    pub late_codes: LateCodes,
    /// Whether Doppler is used.
    pub use_rates: bool,
    /// Whether changes of range by carrier phase are used.
    pub use_changes: bool,
    /// Whether a phone that stands still by its Doppler gets a velocity of zero. Off by default: a phone that creeps away from one that stands is
    /// noticed later.
    pub use_standing: bool,
    /// Whether the filter takes only the observations that the phone's RAIM kept.
    pub only_used: bool,
    /// Errors that all phones share, for the second covariance.
    pub shared: SharedErrors,
    /// Spectral density of the random walk of the biases between clock groups, m²/s; infinite: every group has a white clock of its own.
    pub bias_walk_m2ps: f64,
    /// Maximum gap in the measurements of a phone, s; after a longer gap it is initialised anew.
    pub maximum_gap_s: f64,
}

/// Motion model: white jerk drives the acceleration, which decays exponentially.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProcessNoise {
    /// Spectral density of the horizontal jerk, m²/s⁵.
    pub horizontal_m2ps5: f64,
    /// Spectral density of the vertical jerk, m²/s⁵.
    pub vertical_m2ps5: f64,
    /// Time constant of the acceleration, s; infinite: constant acceleration (Peng Eq. 22).
    pub acceleration_time_s: f64,
}

/// How a phone is carried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Motion {
    /// In a road vehicle: quick along the road, slow in height.
    Road,
    /// On foot, on a bicycle, in a lift: slower, in all directions.
    Walk,
    /// On an aircraft or a drone.
    Air,
    /// Standing still for the whole recording.
    Static,
}

impl Motion {
    /// Process noise of this motion.
    pub const fn process(self) -> ProcessNoise {
        let (horizontal_m2ps5, vertical_m2ps5, acceleration_time_s) = match self {
            Self::Road => (0.5, 0.005, 5.0),
            Self::Walk => (0.5, 0.1, 2.0),
            Self::Air => (2.0, 2.0, 10.0),
            Self::Static => (1e-9, 1e-9, 1.0),
        };
        ProcessNoise { horizontal_m2ps5, vertical_m2ps5, acceleration_time_s }
    }

    /// Standard deviation of each component of an unknown velocity, m/s.
    pub const fn speed_mps(self) -> f64 {
        match self {
            Self::Road => 15.0,
            Self::Walk => 3.0,
            Self::Air => 150.0,
            Self::Static => 0.01,
        }
    }
}

/// IGG III weights on standardised innovations (Li 2022, Eq. 6): weight 1 up to `keep`, 0 from `reject`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobustWeights {
    /// k0: weight 1 up to this number of standard deviations; infinite: never down-weight.
    pub keep: f64,
    /// k1: weight 0 from this number of standard deviations.
    pub reject: f64,
}

/// Mistrust of long pseudoranges of weak signals. A signal that comes by a reflection alone is weak, and its path is longer, never shorter: in a
/// street pseudoranges below 20 dB-Hz are tens of metres too long on the average (docs/results.md).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LateCodes {
    /// Factor on the standardised innovation of a late pseudorange of a very weak signal; 1: none.
    pub factor: f64,
    /// C/N0 at which half of what exceeds 1 in the factor applies, dB-Hz.
    pub cn0_dbhz: f64,
}

/// C/N0 over which the factor of late pseudoranges changes, dB.
const LATE_WIDTH_DB: f64 = 3.0;

impl LateCodes {
    /// No mistrust.
    pub const NONE: Self = Self { factor: 1.0, cn0_dbhz: 25.0 };

    /// Factor for a C/N0, dB-Hz: 1 where there is none.
    pub fn factor(&self, cn0_dbhz: Option<f64>) -> f64 {
        cn0_dbhz.map_or(1.0, |cn0| {
            1.0 + (self.factor - 1.0) / (1.0 + ((cn0 - self.cn0_dbhz) / LATE_WIDTH_DB).exp())
        })
    }
}

/// Correlation of code noise in time. Multipath lasts for tens of seconds; a filter that took it for white noise would average it away.
///
/// The noise is white with variance (1 − κ)σ² and a Gauss-Markov process with κσ² and time constant τ. Over many epochs an interval Δt apart
/// their mean has the variance of white noise of (1 − κ)σ² + κσ² coth(Δt/2τ), which is what the filter takes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CodeNoise {
    /// κ, 0 to 1, of a phone whose position is tied from epoch to epoch by Doppler alone: its filter forgets before the noise has changed.
    pub correlated_share: f64,
    /// κ, 0 to 1, of a phone whose position is tied by changes of range: its filter remembers for minutes.
    pub tied_share: f64,
    /// τ, s.
    pub correlation_time_s: f64,
}

impl CodeNoise {
    /// Factor on the variance for measurements `interval_s` apart.
    /// `is_tied`: whether changes of range tie the position to that of the measurements before.
    pub fn inflation(&self, interval_s: f64, is_tied: bool) -> f64 {
        let share = if is_tied { self.tied_share } else { self.correlated_share };
        if share <= 0.0 {
            return 1.0;
        }
        let half = (interval_s / (2.0 * self.correlation_time_s)).max(1e-6);
        1.0 + share * (1.0 / half.tanh() - 1.0)
    }
}

impl FilterOptions {
    /// Peng 2023: constant acceleration, white jerk with σ_a² = (0.01 m)² per second (Eq. 21), no robust weights; pseudoranges alone (section
    /// 4.1), those that RAIM kept.
    pub const fn peng2023() -> Self {
        Self {
            process: ProcessNoise {
                horizontal_m2ps5: 1e-4,
                vertical_m2ps5: 1e-4,
                acceleration_time_s: f64::INFINITY,
            },
            start_speed_mps: 15.0,
            code_noise: CodeNoise { correlated_share: 0.0, tied_share: 0.0, correlation_time_s: 20.0 },
            bias_walk_m2ps: f64::INFINITY,
            lasting_weight: 1.0,
            tied_lasting_weight: 1.0,
            rate_sigma_scale: 1.0,
            robust: RobustWeights { keep: f64::INFINITY, reject: f64::INFINITY },
            late_codes: LateCodes::NONE,
            use_rates: false,
            use_changes: false,
            use_standing: false,
            only_used: true,
            shared: SharedErrors::NONE,
            maximum_gap_s: 10.0,
        }
    }
}

impl Default for FilterOptions {
    /// Values for road vehicles, rounded from searches on two recorded sessions and checked on a third; see docs/results.md.
    fn default() -> Self {
        Self {
            process: Motion::Road.process(),
            start_speed_mps: Motion::Road.speed_mps(),
            code_noise: CodeNoise { correlated_share: 0.077, tied_share: 0.3, correlation_time_s: 20.0 },
            bias_walk_m2ps: 0.003,
            lasting_weight: 1.8,
            tied_lasting_weight: 3.0,
            rate_sigma_scale: 1.3,
            robust: RobustWeights { keep: 1.0, reject: 5.0 },
            late_codes: LateCodes { factor: 3.0, cn0_dbhz: 25.0 },
            use_rates: true,
            use_changes: true,
            use_standing: false,
            only_used: false,
            shared: SharedErrors {
                satellite_sigma_m: 0.3,
                satellite_share: 0.3,
                ionosphere_share: 0.8,
                gradient_share: 0.5,
                time_constant_s: 7_200.0,
            },
            maximum_gap_s: 10.0,
        }
    }
}

impl RobustWeights {
    /// Factor γ on the weight of a measurement with standardised innovation `standardised`:
    /// 1 up to k0, (k0/|v|)·((k1 − |v|)/(k1 − k0))² between, 0 from k1.
    pub fn factor(&self, standardised: f64) -> f64 {
        let v = standardised.abs();
        if v <= self.keep {
            1.0
        } else if v < self.reject {
            let remaining = (self.reject - v) / (self.reject - self.keep);
            self.keep / v * remaining * remaining
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_fall_from_one_to_zero() {
        let robust = RobustWeights { keep: 1.5, reject: 5.0 };
        assert_eq!(robust.factor(-1.5), 1.0);
        assert!((robust.factor(3.0) - 0.5 * (2.0_f64 / 3.5).powi(2)).abs() < 1e-12);
        assert_eq!(robust.factor(5.0), 0.0);
        let plain = RobustWeights { keep: f64::INFINITY, reject: f64::INFINITY };
        assert_eq!(plain.factor(1e9), 1.0);
    }

    #[test]
    fn late_pseudoranges_of_weak_signals_are_mistrusted_and_of_strong_ones_are_not() {
        let late = LateCodes { factor: 3.0, cn0_dbhz: 25.0 };
        assert!((late.factor(Some(25.0)) - 2.0).abs() < 1e-12);
        assert!(late.factor(Some(12.0)) > 2.9 && late.factor(Some(40.0)) < 1.02);
        assert!(late.factor(None) == 1.0 && LateCodes::NONE.factor(Some(10.0)) == 1.0);
    }

    /// The mean of n measurements with correlations ρ^k of a share κ of their variance has n times the variance 1 + 2κΣρ^k of one, which is
    /// 1 − κ + κ(1 + ρ)/(1 − ρ) for many.
    #[test]
    fn correlated_noise_counts_as_much_as_the_mean_of_many_says() {
        let noise = CodeNoise { correlated_share: 0.3, tied_share: 0.0, correlation_time_s: 20.0 };
        for interval_s in [0.1_f64, 1.0, 5.0, 30.0, 300.0] {
            let correlation = (-interval_s / noise.correlation_time_s).exp();
            let sum: f64 = (1..10_000).map(|lag| correlation.powi(lag)).sum();
            let expected = 1.0 + 2.0 * noise.correlated_share * sum;
            let inflation = noise.inflation(interval_s, false);
            assert!((inflation / expected - 1.0).abs() < 1e-9, "{interval_s} s: {inflation} {expected}");
        }
        assert!((noise.inflation(1e4, false) - 1.0).abs() < 1e-9);
        assert_eq!(CodeNoise { correlated_share: 0.0, ..noise }.inflation(0.1, false), 1.0);
        let tied = CodeNoise { correlated_share: 0.0, tied_share: 0.3, ..noise };
        assert_eq!(tied.inflation(0.1, true), noise.inflation(0.1, false));
        assert_eq!(noise.inflation(0.1, true), 1.0);
    }
}
