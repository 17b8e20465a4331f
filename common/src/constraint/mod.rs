//! What is known about phones, brought into a Gaussian state by truncation (Peng 2023, §3.2).

use serde::{Deserialize, Serialize};

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
}
