//! Options of the integrity tests.

use serde::{Deserialize, Serialize};

use crate::statistics::{ChiSquareThresholds, DetectableNoncentrality};

/// How faulty measurements are excluded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// One after another by the local test, then put back what need not have gone (Cappello 2023, section 2.2).
    #[default]
    ForwardBackward,
    /// The largest subset that passes the global test, if there is one only (section 2.1).
    Subset,
    /// Nothing is excluded; the global test decides.
    None,
}

/// Limits of the tests.
#[derive(Clone, Debug)]
pub struct RaimOptions {
    /// How faulty measurements are excluded.
    pub method: Method,
    /// Quantiles of the global test for its probability of false alarm.
    pub global: ChiSquareThresholds,
    /// Probability of false alarm of the local test.
    pub local_false_alarm: f64,
    /// Minimum correlation of two residuals that counts as inseparable.
    pub separability: f64,
    /// Maximum number of excluded measurements.
    pub maximum_exclusions: usize,
    /// Maximum number of subsets that are tried in one epoch.
    pub maximum_subsets: usize,
    /// Whether a constellation or clock group with absurd residuals is excluded as a whole where single exclusions fail. The paper has no such
    /// exclusion.
    pub exclude_groups: bool,
    /// Limits of PDOP, HDOP and VDOP.
    pub dop_limits: DopLimits,
    /// Protection levels up to which a solution is reliable.
    pub alarm_limits: AlarmLimits,
    /// What the protection levels promise.
    pub protection: ProtectionOptions,
}

/// Limits of the geometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DopLimits {
    /// Maximum PDOP.
    pub pdop: f64,
    /// Maximum HDOP.
    pub hdop: f64,
    /// Maximum VDOP.
    pub vdop: f64,
}

/// Limits of the protection levels; infinite ones limit nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlarmLimits {
    /// Horizontally, m.
    pub horizontal_m: f64,
    /// Vertically, m.
    pub vertical_m: f64,
}

impl AlarmLimits {
    /// No limits.
    pub const NONE: Self = Self { horizontal_m: f64::INFINITY, vertical_m: f64::INFINITY };
}

/// Parameters of the protection levels.
#[derive(Clone, Debug)]
pub struct ProtectionOptions {
    /// Probability, per epoch, that the position errs by more than the protection levels without a warning: half of it vertically, half
    /// horizontally.
    pub misleading: f64,
    /// Prior probability of a fault of one satellite's signals at an epoch. On phones faults are reflections, which are frequent.
    pub satellite_fault: f64,
    /// Prior probability of a fault of a whole constellation at an epoch.
    pub constellation_fault: f64,
    /// Probability of false alarm of the solution separation tests, all together.
    pub false_alarm: f64,
    /// Largest error of a pseudorange that is not random and not a fault, m: on phones, reflections beside the direct signal.
    pub nominal_bias_m: f64,
    /// Standard deviation of what is left of the ionospheric delay, as a share of that by which it is measured
    /// ([`crate::measurement::SharedError::ionosphere_m`]).
    pub ionosphere_share: f64,
    /// Noncentralities that the global test detects with its probability of missed detection, for the slope form.
    pub detectable: DetectableNoncentrality,
}

/// Probability of false alarm of the global test.
const GLOBAL_FALSE_ALARM: f64 = 1e-3;
/// Probability of missed detection of the slope form.
const MISSED_DETECTION: f64 = 1e-3;

impl Default for ProtectionOptions {
    fn default() -> Self {
        Self {
            misleading: 1e-3,
            satellite_fault: 5e-4,
            constellation_fault: 1e-5,
            false_alarm: 1e-3,
            nominal_bias_m: 1.5,
            ionosphere_share: 0.8,
            detectable: DetectableNoncentrality::new(GLOBAL_FALSE_ALARM, MISSED_DETECTION),
        }
    }
}

impl Default for RaimOptions {
    fn default() -> Self {
        Self {
            method: Method::default(),
            global: ChiSquareThresholds::new(GLOBAL_FALSE_ALARM),
            local_false_alarm: 1e-3,
            separability: 0.9,
            maximum_exclusions: 8,
            maximum_subsets: 10_000,
            exclude_groups: true,
            dop_limits: DopLimits { pdop: 30.0, hdop: 25.0, vdop: 20.0 },
            alarm_limits: AlarmLimits::NONE,
            protection: ProtectionOptions::default(),
        }
    }
}
