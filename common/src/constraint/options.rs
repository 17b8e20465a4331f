//! Options of the constraints.

use serde::{Deserialize, Serialize};

use super::truncation::Enlargement;

/// Method for applying several constraints to one state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// One by one in the given order (Peng §2.2.4), with further sweeps for violated constraints. A repeated constraint replaces its own
    /// former effect; it is never counted twice.
    Sequential {
        /// Maximum number of sweeps, ≥ 1.
        max_sweeps: u32,
    },
    /// Expectation propagation (Minka 2001): each constraint is refreshed given all others until convergence.
    ExpectationPropagation {
        /// Maximum number of sweeps, ≥ 1.
        max_sweeps: u32,
        /// Fraction of the former site that is kept, in [0, 1); 0: no damping.
        damping: f64,
    },
}

/// Meaning of a bounded distance for the vector d between two phones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DistanceModel {
    /// As in the paper: minimum ≤ uᵀd ≤ maximum along the line u between the phones.
    Radial,
    /// As [`DistanceModel::Box`], but without a minimum each component of d has the density of a component of a vector that is equally likely
    /// anywhere in the ball |d| ≤ maximum, ∝ maximum² − y². A vector that is equally likely in the box is longer on average (1.9 instead of
    /// 1.5 m for a maximum of 2 m).
    Ball,
    /// Three axes. |d| ≤ maximum bounds every component of d: −maximum ≤ eᵀd ≤ maximum along the line and along two axes across. A minimum
    /// bounds the component along the line, reduced by the uncertainty across: two phones that are close along the line, but uncertain by
    /// metres across it, need not be pushed apart. After a violated minimum the distance of the means may therefore still be below it.
    ///
    /// Largest error of a mean against rejection sampling, in prior standard deviations, `Box` and `Radial`: two phones in one
    /// car that are 16 m apart 0.04 and 0.87, 1 m apart 0.04 and 0.11; a convoy 8 m apart that should be 10 m, known to 1.5 m
    /// each 0.09 and 0.24, to 3 m 0.10 and 0.42; too far by 11 m 0.09 and 0.09
    /// (`cargo test -p cofix-common --test constraint_properties distances -- --nocapture`).
    Box,
}

/// Minimum speed of a phone with a defined heading.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HeadingGate {
    /// Minimum horizontal speed, m/s.
    pub minimum_speed_mps: f64,
    /// Minimum horizontal speed in standard deviations of the horizontal velocity.
    pub minimum_sigmas: f64,
}

impl Default for HeadingGate {
    fn default() -> Self {
        Self { minimum_speed_mps: 1.0, minimum_sigmas: 3.0 }
    }
}

/// Options of the constraints.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConstraintOptions {
    /// Method for several constraints.
    pub method: Method,
    /// Treatment of an interval that the state contradicts.
    pub enlargement: Enlargement,
    /// Whether a distribution with its mean within the bounds is truncated too. Algorithm 1 leaves it alone, although its tails may be
    /// outside.
    pub act_when_inside: bool,
    /// Model of a distance constraint.
    pub distance_model: DistanceModel,
    /// Prediction time of velocity constraints with the acceleration, s; 0 constrains the velocity itself.
    pub horizon_s: f64,
    /// Minimum speed for heading constraints.
    pub heading_gate: HeadingGate,
    /// Distance from the bounds, in standard deviations, beyond which a constraint is reported and not applied, e.g. because a phone has
    /// left the car or the course is not that of the road. Infinite: every constraint is applied, as in the paper.
    pub contradiction_sigmas: f64,
    /// Maximum number of relinearisations of a distance per refresh.
    pub max_relinearisations: u32,
}

impl Default for ConstraintOptions {
    /// Expectation propagation with the intervals as given.
    fn default() -> Self {
        Self {
            method: Method::ExpectationPropagation { max_sweeps: 10, damping: 0.0 },
            enlargement: Enlargement::Fixed,
            act_when_inside: true,
            distance_model: DistanceModel::Ball,
            horizon_s: 0.0,
            heading_gate: HeadingGate::default(),
            contradiction_sigmas: 6.0,
            max_relinearisations: 5,
        }
    }
}

impl ConstraintOptions {
    /// As in Peng 2023: Algorithm 1 with c = 0.1 and factor 1.5, one by one, velocities over 1 s.
    pub fn peng2023() -> Self {
        Self {
            method: Method::Sequential { max_sweeps: 5 },
            enlargement: Enlargement::Peng { confidence: 0.1, factor: 1.5, max_iterations: 50 },
            act_when_inside: false,
            distance_model: DistanceModel::Radial,
            horizon_s: 1.0,
            heading_gate: HeadingGate::default(),
            contradiction_sigmas: f64::INFINITY,
            max_relinearisations: 10,
        }
    }
}
