//! Options of the joint filter.

use serde::{Deserialize, Serialize};

/// Options of the filter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FilterOptions {
    /// Motion model of the phones.
    pub process: ProcessNoise,
    /// Factor on the standard deviation of a pseudorange. Multipath is correlated from epoch to epoch; treated as white noise it would get
    /// too much weight.
    pub code_sigma_scale: f64,
    /// Factor on the standard deviation of a range rate.
    pub rate_sigma_scale: f64,
    /// Down-weighting of large innovations.
    pub robust: RobustWeights,
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

/// IGG III weights on standardised innovations (Li 2022, Eq. 6): weight 1 up to `keep`, 0 from `reject`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobustWeights {
    /// k0: weight 1 up to this number of standard deviations; infinite: never down-weight.
    pub keep: f64,
    /// k1: weight 0 from this number of standard deviations.
    pub reject: f64,
}

impl FilterOptions {
    /// Peng 2023: constant acceleration, white jerk with σ_a² = (0.01 m)² per second (Eq. 21), no robust weights.
    pub const fn peng2023() -> Self {
        Self {
            process: ProcessNoise {
                horizontal_m2ps5: 1e-4,
                vertical_m2ps5: 1e-4,
                acceleration_time_s: f64::INFINITY,
            },
            code_sigma_scale: 1.0,
            rate_sigma_scale: 1.0,
            robust: RobustWeights { keep: f64::INFINITY, reject: f64::INFINITY },
            maximum_gap_s: 10.0,
        }
    }
}

impl Default for FilterOptions {
    /// Values for road vehicles, rounded from searches on two recorded sessions and checked on a third; see docs/results.md.
    fn default() -> Self {
        Self {
            process: ProcessNoise { horizontal_m2ps5: 0.5, vertical_m2ps5: 0.005, acceleration_time_s: 5.0 },
            code_sigma_scale: 2.0,
            rate_sigma_scale: 1.0,
            robust: RobustWeights { keep: 2.0, reject: 8.0 },
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
}
