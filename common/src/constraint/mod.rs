//! Knowledge about phones, applied to a Gaussian state by truncation (Peng 2023, §3.2).
//!
//! A constraint bounds a quantity to an interval: a distance between two phones, a vertical velocity, a course. Linearised, it is a row c
//! with l ≤ cᵀX ≤ u. Under the Gaussian X̂, P the quantity has mean μ₀ = cᵀX̂ and variance σ₀² = cᵀPc. Its truncation to [l, u] has the
//! moments μ̃, σ̃². With no other information the state becomes
//!
//! ```text
//! X̃ = X̂ + Pc/σ₀² (μ̃ − μ₀)        P̃ = P − (Pc)(Pc)ᵀ/σ₀² (1 − σ̃²/σ₀²)
//! ```
//!
//! The joint covariance of all phones distributes the correction of a distance over both phones according to their uncertainties.
//!
//! | part | content |
//! |---|---|
//! | [`options`] | method, enlargement, gates; the presets |
//! | [`kinds`] | one file per kind of constraint: bounds, value, rows, gate, words, written form |
//! | [`rows`] | vectors that are linear in the state, rows and their intervals |
//! | [`prior`] | the distribution before constraints: one joint state, or independent phones |
//! | [`truncation`] | one interval and one scalar, with the enlargement of Algorithm 1 |
//! | [`engine`] | several constraints on one state: one by one, or by expectation propagation |
//! | [`separate`] | several constraints on independent phones, by components |
//! | [`second`] | the covariance that is stated, through the same constraints |
//!
//! Approximations: a distance is truncated along lines, not as a ball, so its spread across the line is bounded only by a box (see
//! [`options::DistanceModel`]). The result is a Gaussian with the moments of a distribution that is not Gaussian. A constraint must not
//! repeat information that the state already contains.

pub mod engine;
pub mod kinds;
mod local;
pub mod options;
pub mod prior;
pub mod rows;
pub mod second;
pub mod separate;
mod sites;
mod task;
pub mod truncation;

use serde::{Deserialize, Serialize};

pub use engine::constrain;
pub use kinds::{Constraint, Distance, Heading, Height, Quantity, SameVehicle, Speed, VerticalVelocity};
pub use options::{ConstraintOptions, DistanceModel, HeadingGate, Method};
pub use prior::{FreePhone, Prior};
pub use separate::{Separated, constrain_separately};
pub use task::excess_sigmas;
pub use truncation::Enlargement;

/// Effect of one constraint at one epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstraintAction {
    /// Index in the given list of constraints.
    pub index: usize,
    /// The constraint.
    pub constraint: Constraint,
    /// Value of the constrained quantity before, in the constraint's unit (m, m/s, rad off course).
    pub before: f64,
    /// Excess of the state without any constraint over the bounds, in standard deviations; the caller that has such a state sets it.
    pub free_sigmas: f64,
    /// Value of the constrained quantity after all constraints.
    pub after: f64,
    /// Largest position shift of the constrained phones, m.
    pub shift_m: f64,
    /// Number of enlargements of the interval (Algorithm 1).
    pub enlargements: u32,
    /// Outcome.
    pub outcome: ConstraintOutcome,
}

/// Outcome of a constraint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ConstraintOutcome {
    /// The mean is within the bounds, to 1 mm, 1 mm/s or 1 mrad.
    Holds,
    /// The mean is still outside: the interval was enlarged, constraints contradict each other, or the uncertainty across explains the
    /// minimum distance (see [`DistanceModel::Box`]).
    Violated,
    /// The constraint was not applied and changed nothing.
    Skipped(SkipReason),
}

/// Reason for which a constraint was not applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SkipReason {
    /// The constraint names a phone that the state does not contain, or one phone twice, or covariance and state differ in size.
    UnknownPhone,
    /// The bounds are NaN, in the wrong order or negative, or a course tolerance is not below π/2.
    InvalidBounds,
    /// The constrained quantity has no variance, so that a correction has no gain.
    NoVariance,
    /// State, covariance or result is not finite.
    NotFinite,
    /// State and constraint contradict each other beyond [`ConstraintOptions::contradiction_sigmas`].
    Contradicted,
}

/// Wraps an angle into (−π, π].
pub fn wrap_rad(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    let wrapped = angle.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}

#[cfg(test)]
mod tests;
