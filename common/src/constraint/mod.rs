//! What is known about phones, brought into a Gaussian state by truncation (Peng 2023, §3.2).
//!
//! A constraint says that a quantity lies in an interval: a distance between two phones, a vertical velocity, a
//! course. Linearised, it is a row c with l ≤ cᵀX ≤ u. Under the Gaussian X̂, P the quantity has mean μ₀ = cᵀX̂ and
//! variance σ₀² = cᵀPc; known to be in [l, u] its moments become μ̃, σ̃², and since nothing else was learnt,
//!
//! ```text
//! X̃ = X̂ + Pc/σ₀² (μ̃ − μ₀)        P̃ = P − (Pc)(Pc)ᵀ/σ₀² (1 − σ̃²/σ₀²)
//! ```
//!
//! With the joint covariance of all phones, both ends of a distance move, each by its own uncertainty.
//!
//! | part | what it does |
//! |---|---|
//! | [`options`] | method, enlargement, gates; the presets |
//! | [`kinds`] | everything about a kind of constraint, a file each: bounds, value, rows, gate, words, written form |
//! | [`rows`] | what rows are made of |
//! | [`truncation`] | one interval and one scalar, with the enlargement of Algorithm 1 |
//! | [`engine`] | many constraints on one state: one by one, or by expectation propagation |
//!
//! What is *not* sound: a distance is truncated along lines, not as a ball, so its spread across the line is
//! bounded only by a box (see [`options::DistanceModel`]); the result is a Gaussian that has the moments of a distribution
//! which is none; and information that the state already contains must not come back as a constraint.

pub mod engine;
pub mod kinds;
pub mod options;
pub mod rows;
mod sites;
mod task;
pub mod truncation;

use serde::{Deserialize, Serialize};

pub use engine::constrain;
pub use kinds::{Constraint, Distance, Heading, Speed, VerticalVelocity};
pub use options::{ConstraintOptions, DistanceModel, HeadingGate, Method};
pub use truncation::Enlargement;

/// What one constraint did at one epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstraintAction {
    /// Its place in the list of constraints that was given.
    pub index: usize,
    /// The constraint.
    pub constraint: Constraint,
    /// The constrained quantity before, in the constraint's unit (m, m/s, rad off course).
    pub before: f64,
    /// The same after all constraints.
    pub after: f64,
    /// Length of the largest position shift of a phone that it concerns, m.
    pub shift_m: f64,
    /// How often the interval was enlarged (Algorithm 1).
    pub enlargements: u32,
    /// How it ended.
    pub outcome: ConstraintOutcome,
}

/// How a constraint ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ConstraintOutcome {
    /// The mean is inside the bounds, to a millimetre, millimetre per second or milliradian.
    Holds,
    /// The mean is still outside: the interval was enlarged, constraints contradict each other, or the phones' minimum
    /// distance is explained by what is unknown across (see [`DistanceModel::Box`]).
    Violated,
    /// It was not applied and changed nothing.
    Skipped(SkipReason),
}

/// Why a constraint was not applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SkipReason {
    /// It names a phone that the state does not hold, or one phone twice, or covariance and state differ in size.
    UnknownPhone,
    /// Its bounds are NaN, turned round, negative, or a course tolerance is not below π/2.
    InvalidBounds,
    /// The constrained quantity has no variance: there is nothing to weigh a correction with.
    NoVariance,
    /// State, covariance or the result is not finite.
    NotFinite,
    /// The state contradicts it beyond [`ConstraintOptions::contradiction_sigmas`]: one of the two is wrong.
    Contradicted,
}

/// An angle in (−π, π].
pub fn wrap_rad(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    let wrapped = angle.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}

#[cfg(test)]
mod tests;
