//! Variances of measurements by C/N0 and elevation.

use serde::{Deserialize, Serialize};

/// C/N0 assumed for a measurement without it, dB-Hz.
const UNKNOWN_CN0_DBHZ: f64 = 25.0;
/// Minimum elevation in the weights, rad (about 3°), because 1/sin e has no bound.
const LOWEST_ELEVATION_RAD: f64 = 0.05;

/// Variance model of one kind of measurement, in the square of its unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum VarianceModel {
    /// σ² = a + b·10^(−C/N0/10) (Peng 2023, after Bahadur 2022).
    Cn0 {
        /// Floor a.
        a: f64,
        /// Noise term b.
        b: f64,
    },
    /// σ² = URA² + (σ_0/sin e)² (Cappello 2023).
    Elevation {
        /// Standard deviation of orbit and clock.
        ura: f64,
        /// Standard deviation at the zenith.
        zenith: f64,
    },
    /// Sum of both: σ² = a + b·10^(−C/N0/10) + (σ_0/sin e)².
    Sum {
        /// Floor a.
        a: f64,
        /// Noise term b.
        b: f64,
        /// Standard deviation at the zenith.
        zenith: f64,
    },
    /// Product: σ² = (a + b·10^(−C/N0/10))/sin² e.
    Product {
        /// Floor a.
        a: f64,
        /// Noise term b.
        b: f64,
    },
}

impl VarianceModel {
    /// Variance for a C/N0 (dB-Hz; 25 if missing) and an elevation (rad; at least 0.05).
    pub fn variance(&self, cn0_dbhz: Option<f64>, elevation_rad: f64) -> f64 {
        let noise = || 10_f64.powf(cn0_dbhz.unwrap_or(UNKNOWN_CN0_DBHZ) / -10.0);
        let sine_squared = || elevation_rad.max(LOWEST_ELEVATION_RAD).sin().powi(2);
        match *self {
            Self::Cn0 { a, b } => b.mul_add(noise(), a),
            Self::Elevation { ura, zenith } => ura.mul_add(ura, zenith * zenith / sine_squared()),
            Self::Sum { a, b, zenith } => b.mul_add(noise(), a) + zenith * zenith / sine_squared(),
            Self::Product { a, b } => b.mul_add(noise(), a) / sine_squared(),
        }
    }
}

/// The variance models of code and Doppler.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StochasticModel {
    /// Model of pseudoranges, m².
    pub code: VarianceModel,
    /// Model of range rates, (m/s)².
    pub rate: VarianceModel,
}

impl StochasticModel {
    /// C/N0 model with the constants of Bahadur 2022 for code as in Peng 2023, and the same form for Doppler.
    pub const fn peng2023() -> Self {
        Self {
            code: VarianceModel::Cn0 { a: 1.0, b: 28_200.0 },
            rate: VarianceModel::Cn0 { a: 0.01, b: 282.0 },
        }
    }
}

impl Default for StochasticModel {
    /// Values rounded from searches on two recorded sessions and checked on a third; see docs/results.md.
    fn default() -> Self {
        Self {
            code: VarianceModel::Sum { a: 1.0, b: 20_000.0, zenith: 0.5 },
            rate: VarianceModel::Cn0 { a: 0.08, b: 400.0 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_follow_their_equations() {
        let (cn0, elevation) = (Some(30.0), 0.5_f64);
        let sine_squared = elevation.sin().powi(2);
        let close = |model: VarianceModel, expected: f64| {
            assert!((model.variance(cn0, elevation) - expected).abs() < 1e-12, "{model:?}");
        };
        close(VarianceModel::Cn0 { a: 1.0, b: 1_000.0 }, 2.0);
        close(VarianceModel::Elevation { ura: 2.0, zenith: 0.5 }, 4.0 + 0.25 / sine_squared);
        close(VarianceModel::Sum { a: 1.0, b: 1_000.0, zenith: 0.5 }, 2.0 + 0.25 / sine_squared);
        close(VarianceModel::Product { a: 1.0, b: 1_000.0 }, 2.0 / sine_squared);
    }

    #[test]
    fn the_horizon_and_a_missing_strength_stay_finite() {
        let model = VarianceModel::Product { a: 1.0, b: 1_000.0 };
        assert!(model.variance(None, -0.1).is_finite());
        assert!(model.variance(None, 0.5) > model.variance(Some(45.0), 0.5));
    }
}
