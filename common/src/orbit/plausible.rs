//! Limits on broadcast values: one table for the messages of all formats, files and bits.

use std::ops::RangeInclusive;

use super::{GlonassEphemeris, KeplerEphemeris};
use crate::time::SECONDS_PER_WEEK;

/// Maximum difference between the reference times of orbit and clock, s.
const MAX_TOE_TOC_S: f64 = 86_400.0;
/// Valid seconds of the week of a reference time; files write the end of a week for the beginning of the next one.
const REFERENCE_BOUNDS_S: RangeInclusive<f64> = 0.0..=SECONDS_PER_WEEK;
/// Distance of a GLONASS satellite from the Earth's centre, m; all are near 25,510 km.
const GLONASS_RADIUS_BOUNDS_M: RangeInclusive<f64> = 2.4e7..=2.7e7;
/// Speed of a GLONASS satellite in the rotating frame, m/s.
const GLONASS_SPEED_BOUNDS_MPS: RangeInclusive<f64> = 1e3..=6e3;
/// Acceleration of a GLONASS satellite by Sun and Moon, m/s²; the true order of magnitude is 10⁻⁶.
const GLONASS_ACCELERATION_BOUNDS_MPS2: RangeInclusive<f64> = 0.0..=1e-4;

/// A value outside the broadcast limits.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name} = {value:e}, limits {low:e} to {high:e}")]
pub(crate) struct Implausible {
    name: &'static str,
    value: f64,
    low: f64,
    high: f64,
}

/// Refuses a value outside its limits, or NaN.
pub(crate) fn within(name: &'static str, value: f64, bounds: RangeInclusive<f64>) -> Result<(), Implausible> {
    if bounds.contains(&value) {
        return Ok(());
    }
    Err(Implausible { name, value, low: *bounds.start(), high: *bounds.end() })
}

/// Refuses a reference time of orbit or clock outside the week, before its conversion to an instant.
pub(crate) fn check_reference_s(name: &'static str, own_tow_s: f64) -> Result<(), Implausible> {
    within(name, own_tow_s, REFERENCE_BOUNDS_S)
}

fn within_all<const N: usize>(
    limits: [(&'static str, f64, RangeInclusive<f64>); N],
) -> Result<(), Implausible> {
    limits.into_iter().try_for_each(|(name, value, bounds)| within(name, value, bounds))
}

impl KeplerEphemeris {
    /// Refuses an implausible ephemeris: an undetected bit error, a damaged number of a file, or a test
    /// transmission. The limits of the rates are several times the values of all systems' satellites; BeiDou's
    /// geostationary satellites have the largest.
    pub(crate) fn check(&self) -> Result<(), Implausible> {
        check_reference_s("toe", self.toe_own_tow_s)?;
        within_all([
            ("sqrt(A)", self.sqrt_a, 4e3..=8e3),
            // With all bits set the value is 0.49999.
            ("eccentricity", self.eccentricity, 0.0..=0.499),
            ("i0", self.i0_rad, -7.0..=7.0),
            ("IDOT", self.i_dot_radps, -1e-8..=1e-8),
            ("OMEGA0", self.omega0_rad, -7.0..=7.0),
            ("OMEGA DOT", self.omega_dot_radps, -1e-7..=1e-7),
            ("omega", self.omega_rad, -7.0..=7.0),
            ("M0", self.m0_rad, -7.0..=7.0),
            ("delta n", self.delta_n_radps, -1e-7..=1e-7),
            ("Cuc", self.cuc_cus_rad.0, -1e-3..=1e-3),
            ("Cus", self.cuc_cus_rad.1, -1e-3..=1e-3),
            ("Crc", self.crc_crs_m.0, -1e4..=1e4),
            ("Crs", self.crc_crs_m.1, -1e4..=1e4),
            ("Cic", self.cic_cis_rad.0, -1e-3..=1e-3),
            ("Cis", self.cic_cis_rad.1, -1e-3..=1e-3),
            ("af0", self.clock.0, -0.1..=0.1),
            ("af1", self.clock.1, -1e-7..=1e-7),
            ("af2", self.clock.2, -1e-12..=1e-12),
            ("health", self.health, 0.0..=65_535.0),
            ("toe - toc", self.toe - self.toc, -MAX_TOE_TOC_S..=MAX_TOE_TOC_S),
        ])
    }
}

impl GlonassEphemeris {
    /// Refuses an implausible GLONASS ephemeris, like [`KeplerEphemeris::check`].
    pub(crate) fn check(&self) -> Result<(), Implausible> {
        within_all([
            ("distance from the Earth's centre (m)", self.position.0.norm(), GLONASS_RADIUS_BOUNDS_M),
            ("speed (m/s)", self.velocity.0.norm(), GLONASS_SPEED_BOUNDS_MPS),
            ("acceleration (m/s²)", self.acceleration.0.norm(), GLONASS_ACCELERATION_BOUNDS_MPS2),
            ("clock bias", -self.tau_s, -0.01..=0.01),
            ("frequency bias", self.gamma, -1e-8..=1e-8),
        ])
    }
}
