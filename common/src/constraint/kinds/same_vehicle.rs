//! |v_i − v_j| ≤ maximum: phones on one body.
//!
//! Phones of one vehicle move together, and differ by its turning: at a yaw rate of 0.5 rad/s two phones 1.5 m apart differ by 0.75 m/s.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::super::SkipReason;
use super::super::rows::{Rows, Terms};
use super::super::truncation::Interval;
use super::{BoundedLength, ConstraintKind, Quantity, Unit, positive};
use crate::frames::LocalFrame;

/// |v_i − v_j| ≤ maximum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Keys", into = "Keys")]
pub struct SameVehicle {
    /// Indices of the two phones.
    pub phones: [usize; 2],
    /// Maximum difference of the velocities, m/s.
    pub maximum_mps: f64,
}

/// The written form.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    maximum_mps: f64,
}

impl TryFrom<Keys> for SameVehicle {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        Ok(Self { phones: [0, 0], maximum_mps: positive("maximum_mps", keys.maximum_mps)? })
    }
}

impl From<SameVehicle> for Keys {
    fn from(SameVehicle { maximum_mps, .. }: SameVehicle) -> Self {
        Self { maximum_mps }
    }
}

impl ConstraintKind for SameVehicle {
    fn phones(&self) -> &[usize] {
        &self.phones
    }

    fn phones_mut(&mut self) -> &mut [usize] {
        &mut self.phones
    }

    fn has_valid_bounds(&self) -> bool {
        self.maximum_mps >= 0.0
    }

    fn bounds(&self) -> Interval {
        Interval { lower: 0.0, upper: self.maximum_mps }
    }

    fn terms(&self, _horizon_s: f64) -> Terms {
        Terms::relative_velocity(self.phones)
    }

    fn value(&self, vector: &Vector3<f64>, _frame: &LocalFrame) -> Option<f64> {
        Some(vector.norm())
    }

    fn rows(&self, at: &Quantity<'_>) -> Result<Rows, SkipReason> {
        Ok(self.bounds().shell(at))
    }

    fn length(&self) -> Option<&dyn BoundedLength> {
        Some(self)
    }

    fn unit(&self) -> Unit {
        Unit::METRES_PER_SECOND
    }

    fn bounds_in_words(&self) -> String {
        format!("at most {} m/s apart", self.maximum_mps)
    }
}

impl BoundedLength for SameVehicle {}
