//! minimum ≤ h ≤ maximum, the ellipsoidal height.
//!
//! In a street between houses few satellites are low in all directions, and the height is the least certain component; errors of the height are
//! errors of the horizontal position too. The height of a road or a site is often known to a metre.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::super::SkipReason;
use super::super::rows::{BoundedRow, Rows, Terms};
use super::super::truncation::Interval;
use super::{Constraint, ConstraintKind, Quantity, Unit};
use crate::frames::{Ecef, Enu, LocalFrame};

/// Heights that can be meant, m: from the Dead Sea to beyond the stratosphere.
const PLAUSIBLE_M: std::ops::RangeInclusive<f64> = -1_000.0..=1e5;
/// Distance, m, by which a bound without a counterpart is moved when it is enlarged by a factor of 2.
const STEP_M: f64 = 10.0;

/// minimum ≤ ellipsoidal height ≤ maximum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Keys", into = "Keys")]
pub struct Height {
    /// Index of the phone.
    pub phone: usize,
    /// Lower bound above the WGS 84 ellipsoid, m; may be −∞.
    pub minimum_m: f64,
    /// Upper bound, m; may be infinite.
    pub maximum_m: f64,
}

/// The written form.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    #[serde(default = "lowest")]
    minimum_m: f64,
    #[serde(default = "highest")]
    maximum_m: f64,
}

const fn lowest() -> f64 {
    f64::NEG_INFINITY
}

const fn highest() -> f64 {
    f64::INFINITY
}

impl TryFrom<Keys> for Height {
    type Error = String;

    fn try_from(Keys { minimum_m, maximum_m }: Keys) -> Result<Self, String> {
        for (key, value) in [("minimum_m", minimum_m), ("maximum_m", maximum_m)] {
            if value.is_nan() || (value.is_finite() && !PLAUSIBLE_M.contains(&value)) {
                let (least, most) = (PLAUSIBLE_M.start(), PLAUSIBLE_M.end());
                return Err(format!(
                    "{key} is {value}; it must be an ellipsoidal height from {least} to {most} m"
                ));
            }
        }
        if minimum_m >= maximum_m {
            return Err(format!("minimum_m {minimum_m} is not below maximum_m {maximum_m}"));
        }
        if minimum_m.is_infinite() && maximum_m.is_infinite() {
            return Err("minimum_m and maximum_m are missing: write at least one of both".to_owned());
        }
        Ok(Self { phone: 0, minimum_m, maximum_m })
    }
}

impl From<Height> for Keys {
    fn from(Height { minimum_m, maximum_m, .. }: Height) -> Self {
        Self { minimum_m, maximum_m }
    }
}

impl Height {
    /// Height of a position, linearised at the frame's origin, less its component along the frame's vertical.
    fn offset_m(frame: &LocalFrame) -> f64 {
        frame.geodetic().height_m - frame.up().dot(&frame.origin().0)
    }
}

impl ConstraintKind for Height {
    fn phones(&self) -> &[usize] {
        std::slice::from_ref(&self.phone)
    }

    fn phones_mut(&mut self) -> &mut [usize] {
        std::slice::from_mut(&mut self.phone)
    }

    fn has_valid_bounds(&self) -> bool {
        self.minimum_m < self.maximum_m
    }

    fn bounds(&self) -> Interval {
        Interval { lower: self.minimum_m, upper: self.maximum_m }
    }

    fn terms(&self, _horizon_s: f64) -> Terms {
        Terms::position(self.phone)
    }

    fn value(&self, vector: &Vector3<f64>, _frame: &LocalFrame) -> Option<f64> {
        Some(Ecef(*vector).ecef_to_geodetic().height_m)
    }

    /// One row: the component of the position along the vertical. The curvature of the Earth within the position's uncertainty is neglected,
    /// 1 mm for 100 m.
    fn rows(&self, at: &Quantity<'_>) -> Result<Rows, SkipReason> {
        let frame = LocalFrame::at(Ecef(at.mean));
        let offset_m = Self::offset_m(&frame);
        let interval = Interval { lower: self.minimum_m - offset_m, upper: self.maximum_m - offset_m };
        let up = frame.vector_enu_to_ecef(Enu { east: 0.0, north: 0.0, up: 1.0 }).0;
        Ok([Some(BoundedRow::new(up, interval)), None, None])
    }

    fn widens_as_a_whole(&self) -> bool {
        true
    }

    /// Both bounds move outwards: an interval grows about its centre, a single bound by 10 m for a factor of 2.
    fn widened(&self, factor: f64) -> Option<Constraint> {
        let width_m = self.maximum_m - self.minimum_m;
        let half_m = if width_m.is_finite() { 0.5 * width_m } else { STEP_M };
        let by_m = half_m * (factor - 1.0);
        Some(Self { minimum_m: self.minimum_m - by_m, maximum_m: self.maximum_m + by_m, ..*self }.into())
    }

    fn unit(&self) -> Unit {
        Unit::METRES
    }

    fn bounds_in_words(&self) -> String {
        match (self.minimum_m.is_finite(), self.maximum_m.is_finite()) {
            (true, true) => format!("{} to {} m", self.minimum_m, self.maximum_m),
            (true, false) => format!("at least {} m", self.minimum_m),
            _ => format!("at most {} m", self.maximum_m),
        }
    }
}
