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
//! | [`rows`] | a constraint as bounded rows at a state |
//! | [`truncation`] | one interval and one scalar, with the enlargement of Algorithm 1 |
//! | [`engine`] | many constraints on one state: one by one, or by expectation propagation |
//!
//! What is *not* sound: a distance is truncated along lines, not as a ball, so its spread across the line is
//! bounded only by a box (see [`options::DistanceModel`]); the result is a Gaussian that has the moments of a law
//! which is none; and information that the state already contains must not come back as a constraint.

pub mod engine;
pub mod options;
pub mod rows;
mod sites;
mod task;
pub mod truncation;

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

pub use engine::constrain;
pub use options::{ConstraintOptions, DistanceModel, HeadingGate, Method};
pub use truncation::Enlargement;

/// A constraint on the phones of a joint state, by their index in it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Constraint {
    /// minimum ≤ |r_i − r_j| ≤ maximum (Peng Eq. 19).
    Distance {
        /// The pair's indices.
        phones: (usize, usize),
        /// Lower bound, m, ≥ 0.
        minimum_m: f64,
        /// Upper bound, m; may be infinite.
        maximum_m: f64,
    },
    /// |v_up| ≤ maximum (Peng Eq. 4-12).
    VerticalVelocity {
        /// The phone's index.
        phone: usize,
        /// Bound, m/s.
        maximum_mps: f64,
    },
    /// |course − given| ≤ tolerance (Peng Eq. 13-18).
    Heading {
        /// The phone's index.
        phone: usize,
        /// Course over ground, rad, clockwise from north.
        course_rad: f64,
        /// Tolerance, rad, below π/2.
        tolerance_rad: f64,
    },
}

/// What one constraint did at one epoch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConstraintAction {
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

impl Constraint {
    /// The phones that it concerns; one phone comes twice.
    pub const fn phones(&self) -> [usize; 2] {
        match *self {
            Self::Distance { phones: (first, second), .. } => [first, second],
            Self::VerticalVelocity { phone, .. } | Self::Heading { phone, .. } => [phone, phone],
        }
    }

    /// The constrained quantity in a joint state: distance (m), vertical velocity (m/s, positive up) or angle off the
    /// course (rad, in (−π, π], positive to the right).
    ///
    /// The velocity is the mean one over `horizon_s` to come, v + ½a·horizon; 0 takes the velocity itself. `None` when
    /// the state does not hold the phones, is not finite, or a course is asked of a phone without horizontal velocity.
    pub fn value(&self, state: &DVector<f64>, horizon_s: f64) -> Option<f64> {
        let value = match *self {
            Self::Distance { phones: (first, second), .. } => {
                rows::position(state, first)?.distance_m(rows::position(state, second)?)
            }
            Self::VerticalVelocity { phone, .. } => rows::Motion::of(state, phone, horizon_s)?.velocity().up,
            Self::Heading { phone, course_rad, .. } => {
                let velocity = rows::Motion::of(state, phone, horizon_s)?.velocity();
                if velocity.horizontal() == 0.0 {
                    return None;
                }
                wrap_rad(velocity.east.atan2(velocity.north) - course_rad)
            }
        };
        value.is_finite().then_some(value)
    }

    /// Whether a value (see [`Constraint::value`]) is within the bounds.
    pub fn holds(&self, value: f64) -> bool {
        self.excess(value) == 0.0
    }

    /// How far a value is outside of the bounds, in its unit; 0 inside, NaN for NaN.
    pub fn excess(&self, value: f64) -> f64 {
        let (quantity, minimum, maximum) = match *self {
            Self::Distance { minimum_m, maximum_m, .. } => (value, minimum_m, maximum_m),
            Self::VerticalVelocity { maximum_mps, .. } => (value.abs(), 0.0, maximum_mps),
            Self::Heading { tolerance_rad, .. } => (wrap_rad(value).abs(), 0.0, tolerance_rad),
        };
        if quantity < minimum {
            minimum - quantity
        } else if quantity > maximum {
            quantity - maximum
        } else if quantity.is_nan() {
            quantity
        } else {
            0.0
        }
    }

    /// Whether the bounds make sense.
    fn has_valid_bounds(&self) -> bool {
        match *self {
            Self::Distance { minimum_m, maximum_m, .. } => {
                minimum_m >= 0.0 && minimum_m.is_finite() && maximum_m >= minimum_m
            }
            Self::VerticalVelocity { maximum_mps, .. } => maximum_mps >= 0.0,
            Self::Heading { course_rad, tolerance_rad, .. } => {
                course_rad.is_finite() && (0.0..std::f64::consts::FRAC_PI_2).contains(&tolerance_rad)
            }
        }
    }
}

/// An angle in (−π, π].
pub fn wrap_rad(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    let wrapped = angle.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}

#[cfg(test)]
mod tests;
