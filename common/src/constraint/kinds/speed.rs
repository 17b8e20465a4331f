//! minimum ≤ |v_horizontal| ≤ maximum.
//!
//! Along the direction u of motion the speed is uᵀv. An upper bound holds for every component of the horizontal velocity: for an uncertain
//! direction the component across is bounded too, and for a phone without motion the east and north components are. A lower bound needs a
//! direction: it is applied to the component along a certain direction
//! ([`HeadingGate::minimum_sigmas`](crate::constraint::HeadingGate::minimum_sigmas)), reduced by the uncertainty across, and not at all
//! otherwise.

use nalgebra::{DVector, Vector3};
use serde::{Deserialize, Serialize};

use super::super::SkipReason;
use super::super::rows::{BoundedRow, Motion, Rows};
use super::super::truncation::Interval;
use super::{BoundedLength, ConstrainedState, ConstraintKind, NO_DIRECTION, Unit, not_negative, positive};
use crate::frames::Enu;

const EAST: Enu = Enu { east: 1.0, north: 0.0, up: 0.0 };
const NORTH: Enu = Enu { east: 0.0, north: 1.0, up: 0.0 };

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

    fn value(&self, state: &DVector<f64>, horizon_s: f64) -> Option<f64> {
        Some(Motion::of(state, self.phone, horizon_s)?.velocity().horizontal())
    }

    /// An upper bound applies always; a lower bound alone only for a certain direction.
    fn applies(&self, at: &ConstrainedState<'_>) -> Result<bool, SkipReason> {
        let motion = self.motion(at).ok_or(SkipReason::NotFinite)?;
        if !motion.horizontal_sigma_mps(at.covariance).is_finite() {
            return Err(SkipReason::NotFinite);
        }
        Ok(self.maximum_mps.is_finite() || has_direction(&motion, at))
    }

    fn rows(&self, at: &ConstrainedState<'_>) -> Result<Rows, SkipReason> {
        let velocity = self.vector(at).ok_or(SkipReason::NotFinite)?;
        let speed_mps = velocity.norm();
        let direction = if speed_mps > NO_DIRECTION { velocity / speed_mps } else { Vector3::x() };
        self.rows_along(at, &direction).ok_or(SkipReason::NotFinite)
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
    fn vector(&self, at: &ConstrainedState<'_>) -> Option<Vector3<f64>> {
        let velocity = self.motion(at)?.velocity();
        Some(Vector3::new(velocity.east, velocity.north, 0.0))
    }

    fn change(&self, at: &ConstrainedState<'_>, change: &DVector<f64>) -> Option<Vector3<f64>> {
        let motion = self.motion(at)?;
        let component = |axis: Enu| motion.row(axis).times(change);
        Some(Vector3::new(component(EAST), component(NORTH), 0.0))
    }

    fn rows_along(&self, at: &ConstrainedState<'_>, direction: &Vector3<f64>) -> Option<Rows> {
        let motion = self.motion(at)?;
        let bounded = |axis: Enu, lower: f64| {
            Some(BoundedRow::new(motion.row(axis), Interval { lower, upper: self.maximum_mps }))
        };
        let along = Enu { east: direction.x, north: direction.y, up: 0.0 };
        let across = Enu { east: -direction.y, north: direction.x, up: 0.0 };
        if !has_direction(&motion, at) {
            if self.maximum_mps.is_infinite() {
                return Some([None; 3]);
            }
            return Some([bounded(along, -self.maximum_mps), bounded(across, -self.maximum_mps), None]);
        }
        // The uncertainty across contributes to the speed: speed² = along² + across².
        let across_m2ps2 = motion.row(across).variance(at.covariance).max(0.0);
        let least_mps = (self.minimum_mps * self.minimum_mps - across_m2ps2).max(0.0).sqrt();
        let lower_mps = if least_mps > 0.0 { least_mps } else { -self.maximum_mps };
        Some([bounded(along, lower_mps), None, None])
    }
}

impl Speed {
    fn motion(&self, at: &ConstrainedState<'_>) -> Option<Motion> {
        Motion::of(at.state, self.phone, at.options.horizon_s)
    }
}

/// Whether the direction of a motion is certain: the speed exceeds the gate's number of standard deviations of the horizontal velocity.
fn has_direction(motion: &Motion, at: &ConstrainedState<'_>) -> bool {
    let sigma_mps = motion.horizontal_sigma_mps(at.covariance);
    let speed_mps = motion.velocity().horizontal();
    speed_mps > NO_DIRECTION && speed_mps > at.options.heading_gate.minimum_sigmas * sigma_mps
}
