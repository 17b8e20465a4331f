//! minimum ≤ |v_horizontal| ≤ maximum.
//!
//! Along the direction u of motion the speed is uᵀv. An upper bound holds for every component of the horizontal velocity: for an uncertain
//! direction the component across is bounded too, and for a phone without motion the east and north components are. A lower bound needs a
//! direction: it is applied to the component along a certain direction
//! ([`HeadingGate::minimum_sigmas`](crate::constraint::HeadingGate::minimum_sigmas)), reduced by the uncertainty across, and not at all
//! otherwise.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::super::SkipReason;
use super::super::rows::{BoundedRow, Rows, Terms};
use super::super::truncation::Interval;
use super::{BoundedLength, ConstraintKind, NO_DIRECTION, Quantity, Unit, not_negative, positive};
use crate::frames::{EcefVector, Enu, LocalFrame};

/// minimum ≤ |v_horizontal| ≤ maximum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Keys", into = "Keys")]
pub struct Speed {
    /// Index of the phone.
    pub phone: usize,
    /// Lower bound, m/s, ≥ 0.
    pub minimum_mps: f64,
    /// Upper bound, m/s; may be infinite.
    pub maximum_mps: f64,
}

/// The written form.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    #[serde(default)]
    minimum_mps: f64,
    #[serde(default = "unbounded")]
    maximum_mps: f64,
}

const fn unbounded() -> f64 {
    f64::INFINITY
}

impl TryFrom<Keys> for Speed {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        let maximum_mps = positive("maximum_mps", keys.maximum_mps)?;
        let minimum_mps = not_negative("minimum_mps", keys.minimum_mps, "metres per second")?;
        if minimum_mps > maximum_mps {
            return Err(format!("minimum_mps {minimum_mps} is above maximum_mps {maximum_mps}"));
        }
        if minimum_mps == 0.0 && maximum_mps.is_infinite() {
            return Err("minimum_mps and maximum_mps are missing: write at least one of both".to_owned());
        }
        Ok(Self { phone: 0, minimum_mps, maximum_mps })
    }
}

impl From<Speed> for Keys {
    fn from(Speed { minimum_mps, maximum_mps, .. }: Speed) -> Self {
        Self { minimum_mps, maximum_mps }
    }
}

impl ConstraintKind for Speed {
    fn phones(&self) -> &[usize] {
        std::slice::from_ref(&self.phone)
    }

    fn phones_mut(&mut self) -> &mut [usize] {
        std::slice::from_mut(&mut self.phone)
    }

    fn has_valid_bounds(&self) -> bool {
        self.minimum_mps >= 0.0 && self.minimum_mps.is_finite() && self.maximum_mps >= self.minimum_mps
    }

    fn bounds(&self) -> Interval {
        Interval { lower: self.minimum_mps, upper: self.maximum_mps }
    }

    fn terms(&self, horizon_s: f64) -> Terms {
        Terms::motion(self.phone, horizon_s)
    }

    fn value(&self, vector: &Vector3<f64>, frame: &LocalFrame) -> Option<f64> {
        Some(frame.vector_ecef_to_enu(EcefVector(*vector)).horizontal())
    }

    /// An upper bound applies always; a lower bound alone only for a certain direction.
    fn applies(&self, at: &Quantity<'_>) -> Result<bool, SkipReason> {
        if !at.horizontal_sigma().is_finite() {
            return Err(SkipReason::NotFinite);
        }
        Ok(self.maximum_mps.is_finite() || has_direction(at))
    }

    fn rows(&self, at: &Quantity<'_>) -> Result<Rows, SkipReason> {
        let velocity = self.bounded(&at.mean, at.frame);
        let speed_mps = velocity.norm();
        let direction = if speed_mps > NO_DIRECTION { velocity / speed_mps } else { Vector3::x() };
        Ok(self.rows_along(at, &direction))
    }

    fn length(&self) -> Option<&dyn BoundedLength> {
        Some(self)
    }

    fn unit(&self) -> Unit {
        Unit::METRES_PER_SECOND
    }

    fn bounds_in_words(&self) -> String {
        format!("{} to {} m/s", self.minimum_mps, self.maximum_mps)
    }
}

/// The horizontal velocity: east, north and zero.
impl BoundedLength for Speed {
    fn bounded(&self, vector: &Vector3<f64>, frame: &LocalFrame) -> Vector3<f64> {
        let velocity = frame.vector_ecef_to_enu(EcefVector(*vector));
        Vector3::new(velocity.east, velocity.north, 0.0)
    }

    fn rows_along(&self, at: &Quantity<'_>, direction: &Vector3<f64>) -> Rows {
        let bounded = |axis: Enu, lower: f64| {
            Some(BoundedRow::new(at.axis(axis), Interval { lower, upper: self.maximum_mps }))
        };
        let along = Enu { east: direction.x, north: direction.y, up: 0.0 };
        let across = Enu { east: -direction.y, north: direction.x, up: 0.0 };
        if !has_direction(at) {
            if self.maximum_mps.is_infinite() {
                return [None; 3];
            }
            return [bounded(along, -self.maximum_mps), bounded(across, -self.maximum_mps), None];
        }
        // The uncertainty across contributes to the speed: speed² = along² + across².
        let across_m2ps2 = at.variance(across).max(0.0);
        let least_mps = (self.minimum_mps * self.minimum_mps - across_m2ps2).max(0.0).sqrt();
        let lower_mps = if least_mps > 0.0 { least_mps } else { -self.maximum_mps };
        [bounded(along, lower_mps), None, None]
    }
}

/// Whether the direction of a motion is certain: the speed exceeds the gate's number of standard deviations of the horizontal velocity.
fn has_direction(at: &Quantity<'_>) -> bool {
    let speed_mps = at.velocity().horizontal();
    speed_mps > NO_DIRECTION && speed_mps > at.options.heading_gate.minimum_sigmas * at.horizontal_sigma()
}
