//! Receiver autonomous integrity monitoring (Cappello 2023).
//!
//! ```
//! # use std::sync::Arc;
//! # use cofix_common::simulation::{Scenario, Simulation};
//! # let simulation = Simulation::new(Scenario { duration_s: 10.0, ..Scenario::default() })?;
//! # let simulated = simulation.epochs(0).next().ok_or("no epoch")?;
//! # let (epoch, products) = (simulated.epoch, Arc::new(simulation.products()));
//! # use cofix_common::frames::Ecef;
//! # use cofix_common::measurement::{CorrectionOptions, Corrector, without_position};
//! # use cofix_common::solve::solve_position;
//! use cofix_common::integrity::{RaimOptions, solve_with_raim};
//!
//! # let mut corrector = Corrector::new(products, CorrectionOptions::default());
//! # let prepared = corrector.prepare(&epoch);
//! # // Without a position there is no elevation yet, and no atmosphere: a first solution comes first.
//! # let rough = solve_position(&without_position(&prepared), Ecef::new(0.0, 0.0, 0.0))?;
//! # let (mut corrected, _) = corrector.finish(&prepared, rough.position(), epoch.time_gps);
//! corrected[0].pseudorange_m += 300.0;
//! let monitored = solve_with_raim(&mut corrected, rough.position(), &RaimOptions::default());
//! assert!(monitored.report.excluded >= 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod checks;
mod forward_backward;
mod group_exclusion;
mod innovations;
mod monitor;
mod options;
mod protection;
mod state;
mod subset;

pub(crate) use innovations::Innovations;
pub(crate) use monitor::exceeds;
pub use monitor::{Monitored, solve_with_raim, velocity_report};
pub use options::{AlarmLimits, DopLimits, Method, ProtectionOptions, RaimOptions};
pub use protection::{ProtectionLevels, SlopeLevels};
pub(crate) use state::levels_about;
pub use state::{SatelliteFaults, StateReport, state_levels};

use std::fmt;

use serde::{Deserialize, Serialize};

/// RAIM verdict on one epoch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Verdict {
    /// Global test passed, geometry within limits.
    Reliable,
    /// A solution exists but must not be relied on.
    Unreliable(Cause),
    /// No redundancy: m − n = 0, or no solution at all.
    CannotBeChecked,
}

/// Reason for which a solution is unreliable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Cause {
    /// The global test failed and there are too few measurements to exclude one.
    InsufficientRedundancy,
    /// A dilution of precision is beyond its limit.
    Geometry,
    /// What is known about the phones contradicts the phone's own measurements.
    Constraint,
    /// The phone contradicts the other phones of its group, which agree with each other.
    Peers,
    /// A protection level is beyond its alarm limit.
    AlarmLimit,
    /// The global test fails, and so it does after all permitted exclusions.
    TestsFailed,
    /// The measurement with the largest residual cannot be told from another one.
    Inseparable,
    /// Several subsets of the measurements pass, and which one is right is open.
    Tie,
    /// The search for a subset that passes became too long.
    SearchLimit,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Reliable => "reliable",
            Self::Unreliable(Cause::InsufficientRedundancy) => "unreliable: insufficient redundancy",
            Self::Unreliable(Cause::Geometry) => "unreliable: geometry",
            Self::Unreliable(Cause::Constraint) => "unreliable: contradicts a constraint",
            Self::Unreliable(Cause::Peers) => "unreliable: contradicts the other phones",
            Self::Unreliable(Cause::AlarmLimit) => "unreliable: alarm limit",
            Self::Unreliable(Cause::TestsFailed) => "unreliable: tests failed",
            Self::Unreliable(Cause::Inseparable) => "unreliable: faults cannot be told apart",
            Self::Unreliable(Cause::Tie) => "unreliable: several subsets pass",
            Self::Unreliable(Cause::SearchLimit) => "unreliable: too many subsets to search",
            Self::CannotBeChecked => "cannot be checked",
        })
    }
}

/// RAIM verdict with its test values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RaimReport {
    /// The verdict.
    pub verdict: Verdict,
    /// Last global test, if there was redundancy.
    pub global_test: Option<GlobalTest>,
    /// Number of excluded signals.
    pub excluded: u16,
    /// Protection levels by solution separation; `None` where they cannot be computed.
    pub protection: Option<ProtectionLevels>,
    /// Levels by the largest slope; `None` where they cannot be computed.
    pub slope: Option<SlopeLevels>,
    /// Tests of the velocity; `None` without one.
    pub velocity: Option<TestReport>,
}

/// Verdict by a test of residuals: on the velocity of an epoch by its range rates, or on a predicted state by its innovations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TestReport {
    /// The verdict.
    pub verdict: Verdict,
    /// Global test of the measurements that are not excluded, if there was redundancy.
    pub global_test: Option<GlobalTest>,
    /// Number of excluded measurements.
    pub excluded: u16,
}

impl RaimReport {
    /// A report without test values.
    pub const fn of(verdict: Verdict) -> Self {
        Self { verdict, global_test: None, excluded: 0, protection: None, slope: None, velocity: None }
    }
}

/// Maximum posterior scale of a solution that says anything about the position. Of 385 unreliable epochs of a phone in a city's streets one
/// is beyond it; below it the horizontal errors are at most 172 m.
const LARGEST_POSTERIOR_SCALE: f64 = 10.0;

impl RaimReport {
    /// Whether a solution with this report may start a filter and be given as a position. It may not if the tests failed and its residuals
    /// are absurd (posterior scale above 10): then measurements are wrong by kilometres, and so may be the position. Solutions that are merely
    /// unreliable may, because in cities there are often no others for minutes.
    pub fn may_start_filter(&self) -> bool {
        match (self.verdict, self.global_test) {
            (Verdict::Unreliable(_), Some(test)) => test.posterior_scale() <= LARGEST_POSTERIOR_SCALE,
            _ => true,
        }
    }
}

/// Global test: D = rᵀWr against a χ² quantile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GlobalTest {
    /// D.
    pub statistic: f64,
    /// χ²(1 − P_fa, dof).
    pub threshold: f64,
    /// m − n.
    pub degrees_of_freedom: u16,
}

impl GlobalTest {
    /// Whether the statistic does not exceed its threshold.
    pub fn passes(&self) -> bool {
        self.statistic <= self.threshold
    }

    /// Posterior scale √(D/(m − n)): the ratio of the residuals to what the stochastic model expects.
    pub fn posterior_scale(&self) -> f64 {
        (self.statistic / f64::from(self.degrees_of_freedom)).sqrt()
    }
}

#[cfg(test)]
mod rates;
#[cfg(test)]
mod tests;
