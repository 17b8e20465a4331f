//! minimum ≤ |r_i − r_j| ≤ maximum (Peng Eq. 19).
//!
//! The meaning of the bounds for the vector between the phones is an option: see [`DistanceModel`].

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::super::SkipReason;
use super::super::rows::{Rows, Terms};
use super::super::truncation::Interval;
use super::{BoundedLength, ConstraintKind, Quantity, Unit, not_negative, positive};
use crate::frames::LocalFrame;

/// minimum ≤ |r_i − r_j| ≤ maximum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Keys", into = "Keys")]
pub struct Distance {
    /// Indices of the two phones.
    pub phones: [usize; 2],
    /// Lower bound, m, ≥ 0.
    pub minimum_m: f64,
    /// Upper bound, m; may be infinite.
    pub maximum_m: f64,
}

/// The written form.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    #[serde(default)]
    minimum_m: f64,
    maximum_m: f64,
}

impl TryFrom<Keys> for Distance {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        let maximum_m = positive("maximum_m", keys.maximum_m)?;
        let minimum_m = not_negative("minimum_m", keys.minimum_m, "metres")?;
        if minimum_m > maximum_m {
            return Err(format!("minimum_m {minimum_m} is above maximum_m {maximum_m}"));
        }
        Ok(Self { phones: [0, 0], minimum_m, maximum_m })
    }
}

impl From<Distance> for Keys {
    fn from(Distance { minimum_m, maximum_m, .. }: Distance) -> Self {
        Self { minimum_m, maximum_m }
    }
}

impl ConstraintKind for Distance {
    fn phones(&self) -> &[usize] {
        &self.phones
    }

    fn phones_mut(&mut self) -> &mut [usize] {
        &mut self.phones
    }

    fn has_valid_bounds(&self) -> bool {
        self.minimum_m >= 0.0 && self.minimum_m.is_finite() && self.maximum_m >= self.minimum_m
    }

    fn bounds(&self) -> Interval {
        Interval { lower: self.minimum_m, upper: self.maximum_m }
    }

    fn terms(&self, _horizon_s: f64) -> Terms {
        Terms::difference(self.phones)
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
        Unit::METRES
    }

    fn bounds_in_words(&self) -> String {
        format!("{} to {} m", self.minimum_m, self.maximum_m)
    }
}

impl BoundedLength for Distance {}
