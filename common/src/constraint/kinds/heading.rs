//! |course − given| ≤ tolerance (Peng Eq. 13-18).

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::super::SkipReason;
use super::super::rows::{BoundedRow, Rows, Terms};
use super::super::truncation::Interval;
use super::super::wrap_rad;
use super::{Constraint, ConstraintKind, Quantity, Unit, positive};
use crate::frames::{EcefVector, Enu, LocalFrame};

/// Minimum course tolerance with two distinct half-planes, rad.
const LEAST_TOLERANCE_RAD: f64 = 1e-3;
/// Maximum enlarged course tolerance, rad (89°).
const WIDEST_TOLERANCE_RAD: f64 = 1.553_343_034_274_953_4;

/// |course − given| ≤ tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Keys", into = "Keys")]
pub struct Heading {
    /// Index of the phone.
    pub phone: usize,
    /// Course over ground, rad, clockwise from north.
    pub course_rad: f64,
    /// Tolerance, rad, below π/2.
    pub tolerance_rad: f64,
}

/// The written form.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    course_deg: f64,
    tolerance_deg: f64,
}

impl TryFrom<Keys> for Heading {
    type Error = String;

    fn try_from(Keys { course_deg, tolerance_deg }: Keys) -> Result<Self, String> {
        if !(-360.0..=360.0).contains(&course_deg) {
            return Err(format!("course_deg is {course_deg}; it must lie between -360 and 360"));
        }
        let tolerance_deg = positive("tolerance_deg", tolerance_deg)?;
        if tolerance_deg >= 90.0 {
            return Err(format!("tolerance_deg is {tolerance_deg}; it must be below 90"));
        }
        let course_rad = course_deg.rem_euclid(360.0).to_radians();
        Ok(Self { phone: 0, course_rad, tolerance_rad: tolerance_deg.to_radians() })
    }
}

impl From<Heading> for Keys {
    fn from(Heading { course_rad, tolerance_rad, .. }: Heading) -> Self {
        Self { course_deg: degrees(course_rad), tolerance_deg: degrees(tolerance_rad) }
    }
}

impl ConstraintKind for Heading {
    fn phones(&self) -> &[usize] {
        std::slice::from_ref(&self.phone)
    }

    fn phones_mut(&mut self) -> &mut [usize] {
        std::slice::from_mut(&mut self.phone)
    }

    fn has_valid_bounds(&self) -> bool {
        self.course_rad.is_finite() && (0.0..FRAC_PI_2).contains(&self.tolerance_rad)
    }

    fn bounds(&self) -> Interval {
        Interval::within(self.tolerance_rad)
    }

    fn terms(&self, horizon_s: f64) -> Terms {
        Terms::motion(self.phone, horizon_s)
    }

    fn value(&self, vector: &Vector3<f64>, frame: &LocalFrame) -> Option<f64> {
        let velocity = frame.vector_ecef_to_enu(EcefVector(*vector));
        if velocity.horizontal() == 0.0 {
            return None;
        }
        Some(wrap_rad(velocity.east.atan2(velocity.north) - self.course_rad))
    }

    /// Whether the phone is fast enough for a defined course.
    fn applies(&self, at: &Quantity<'_>) -> Result<bool, SkipReason> {
        let speed_mps = at.velocity().horizontal();
        let sigma_mps = at.horizontal_sigma();
        let gate = at.options.heading_gate;
        if !sigma_mps.is_finite() {
            return Err(SkipReason::NotFinite);
        }
        Ok(speed_mps >= gate.minimum_speed_mps && speed_mps > gate.minimum_sigmas * sigma_mps)
    }

    /// Half-planes of the velocity (Peng Eq. 18, divided by Δt): ahead, limit on the right, limit on the left. The last two, here
    /// scaled by the cosine of the tolerance, imply the first.
    fn rows(&self, at: &Quantity<'_>) -> Result<Rows, SkipReason> {
        let (sin_course, cos_course) = self.course_rad.sin_cos();
        let tolerance_rad = self.tolerance_rad.clamp(LEAST_TOLERANCE_RAD, FRAC_PI_2);
        let (sin_tolerance, cos_tolerance) = tolerance_rad.sin_cos();
        // Components across the course (to the right) and along it (Eq. 15).
        let row = |across: f64, along: f64| {
            at.axis(Enu {
                east: across * cos_course + along * sin_course,
                north: along * cos_course - across * sin_course,
                up: 0.0,
            })
        };
        let below_zero = Interval { lower: f64::NEG_INFINITY, upper: 0.0 };
        let bounded = |axis: Vector3<f64>| BoundedRow::new(axis, below_zero);
        Ok([
            Some(bounded(row(0.0, -1.0)).implied()),
            Some(bounded(row(cos_tolerance, -sin_tolerance))),
            Some(bounded(row(-cos_tolerance, -sin_tolerance))),
        ])
    }

    /// Half-planes have no width, so the tolerance is enlarged for all of them.
    fn widens_as_a_whole(&self) -> bool {
        true
    }

    fn widened(&self, factor: f64) -> Option<Constraint> {
        let tolerance_rad = self.tolerance_rad.max(LEAST_TOLERANCE_RAD);
        (tolerance_rad < WIDEST_TOLERANCE_RAD).then(|| {
            Self { tolerance_rad: (tolerance_rad * factor).min(WIDEST_TOLERANCE_RAD), ..*self }.into()
        })
    }

    fn unit(&self) -> Unit {
        Unit { name: "° off course", per_si: 180.0 / PI, decimals: 1 }
    }

    fn bounds_in_words(&self) -> String {
        format!("{}° ± {}°", degrees(self.course_rad), degrees(self.tolerance_rad))
    }
}

/// Degrees rounded against the last digits of the conversion.
fn degrees(radians: f64) -> f64 {
    (radians.to_degrees() * 1e6).round() / 1e6
}
