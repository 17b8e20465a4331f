//! |v_up| ≤ maximum (Peng Eq. 4-12).

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::super::SkipReason;
use super::super::rows::{BoundedRow, Rows, Terms};
use super::super::truncation::Interval;
use super::{ConstraintKind, Quantity, Unit, positive};
use crate::frames::{EcefVector, Enu, LocalFrame};

/// |v_up| ≤ maximum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Keys", into = "Keys")]
pub struct VerticalVelocity {
    /// Index of the phone.
    pub phone: usize,
    /// Maximum absolute value, m/s.
    pub maximum_mps: f64,
}

/// The written form.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    maximum_mps: f64,
}

impl TryFrom<Keys> for VerticalVelocity {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        Ok(Self { phone: 0, maximum_mps: positive("maximum_mps", keys.maximum_mps)? })
    }
}

impl From<VerticalVelocity> for Keys {
    fn from(VerticalVelocity { maximum_mps, .. }: VerticalVelocity) -> Self {
        Self { maximum_mps }
    }
}

impl ConstraintKind for VerticalVelocity {
    fn phones(&self) -> &[usize] {
        std::slice::from_ref(&self.phone)
    }

    fn phones_mut(&mut self) -> &mut [usize] {
        std::slice::from_mut(&mut self.phone)
    }

    fn has_valid_bounds(&self) -> bool {
        self.maximum_mps >= 0.0
    }

    fn bounds(&self) -> Interval {
        Interval::within(self.maximum_mps)
    }

    fn terms(&self, horizon_s: f64) -> Terms {
        Terms::motion(self.phone, horizon_s)
    }

    fn value(&self, vector: &Vector3<f64>, frame: &LocalFrame) -> Option<f64> {
        Some(frame.vector_ecef_to_enu(EcefVector(*vector)).up)
    }

    /// One row with two bounds (Peng Eq. 11, divided by Δt).
    fn rows(&self, at: &Quantity<'_>) -> Result<Rows, SkipReason> {
        let up = at.axis(Enu { east: 0.0, north: 0.0, up: 1.0 });
        Ok([Some(BoundedRow::new(up, self.bounds())), None, None])
    }

    fn unit(&self) -> Unit {
        Unit::METRES_PER_SECOND
    }

    fn bounds_in_words(&self) -> String {
        format!("±{} m/s", self.maximum_mps)
    }
}
