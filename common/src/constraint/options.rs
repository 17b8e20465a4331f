//! How constraints are applied.

use serde::{Deserialize, Serialize};

use super::truncation::Enlargement;

/// How several constraints are brought into one state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// One by one in the given order (Peng §2.2.4), those that are violated again in further sweeps. A constraint that
    /// comes again replaces what it did before; it never counts twice.
    Sequential {
        /// Largest number of sweeps, ≥ 1.
        max_sweeps: u32,
    },
    /// Expectation propagation (Minka 2001): each constraint is refreshed given all the others until nothing changes.
    ExpectationPropagation {
        /// Largest number of sweeps, ≥ 1.
        max_sweeps: u32,
        /// Part of the former site that is kept, in [0, 1): 0 for none.
        damping: f64,
    },
}

/// What a bounded distance means for the vector d between two phones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DistanceModel {
    /// The paper's: minimum ≤ uᵀd ≤ maximum on the line u between the phones.
    Radial,
    /// Three axes. |d| ≤ maximum bounds every component of d: −maximum ≤ eᵀd ≤ maximum on the line and on two axes across. A
    /// minimum bounds the component on the line as far as the uncertainty across leaves it: phones whose distance *on the
    /// line* is short, but unknown to metres across it, need not be pushed apart. So after a violated minimum the distance
    /// of the means may still be below it.
    ///
    /// Largest error of a mean against rejection sampling, in prior standard deviations, `Box` and `Radial`: two phones in one
    /// car that are 16 m apart 0.04 and 0.87, 1 m apart 0.04 and 0.11; a convoy 8 m apart that should be 10 m, known to 1.5 m
    /// each 0.09 and 0.24, to 3 m 0.10 and 0.42; too far by 11 m 0.09 and 0.09
    /// (`cargo test -p cofix-common --test constraint_properties distances -- --nocapture`).
    Box,
}

/// When a phone moves fast enough to have a heading.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HeadingGate {
    /// Least horizontal speed, m/s.
    pub minimum_speed_mps: f64,
    /// Least horizontal speed in standard deviations of the horizontal velocity.
    pub minimum_sigmas: f64,
}

impl Default for HeadingGate {
    fn default() -> Self {
        Self { minimum_speed_mps: 1.0, minimum_sigmas: 3.0 }
    }
}

/// How constraints are applied.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConstraintOptions {
    /// How several are combined.
    pub method: Method,
    /// What happens to an interval that the state contradicts.
    pub enlargement: Enlargement,
    /// Whether the distribution is truncated even if its mean is inside the bounds already. Algorithm 1 leaves such a state alone;
    /// but a mean inside does not mean that the tails are.
    pub act_when_inside: bool,
    /// What a distance constrains.
    pub distance_model: DistanceModel,
    /// Time over which velocity constraints look ahead with the acceleration, s; 0 constrains the velocity itself.
    pub horizon_s: f64,
    /// When a heading applies.
    pub heading_gate: HeadingGate,
    /// A constraint that the state puts this many standard deviations out of bounds is not applied but reported: a phone
    /// has left the car, or a course is not that of the road. Infinite: apply whatever is said, as the paper does.
    pub contradiction_sigmas: f64,
    /// Largest number of times that a distance is linearised anew at one refresh.
    pub max_relinearisations: u32,
}

impl Default for ConstraintOptions {
    /// Expectation propagation with the intervals as given.
    fn default() -> Self {
        Self {
            method: Method::ExpectationPropagation { max_sweeps: 10, damping: 0.0 },
            enlargement: Enlargement::Fixed,
            act_when_inside: true,
            distance_model: DistanceModel::Box,
            horizon_s: 0.0,
            heading_gate: HeadingGate::default(),
            contradiction_sigmas: 6.0,
            max_relinearisations: 5,
        }
    }
}

impl ConstraintOptions {
    /// As Peng 2023 does it: Algorithm 1 with c = 0.1 and factor 1.5, one by one, velocities over 1 s.
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
