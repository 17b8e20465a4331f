//! What no satellite broadcasts.

use super::{Refused, refused};
use crate::gnss::SatelliteId;
use crate::orbit::{GlonassEphemeris, KeplerEphemeris, RADIUS_BOUNDS_M, SPEED_BOUNDS_MPS};

/// Reference times of orbit and clock are never farther apart than this, s.
const MAX_TOE_TOC_S: f64 = 86_400.0;

/// The ephemeris that a satellite's pieces make, if it is another than the one given before.
///
/// # Errors
/// When it cannot be one.
pub(super) fn news(
    given: &mut Option<KeplerEphemeris>,
    ephemeris: KeplerEphemeris,
) -> Result<Option<KeplerEphemeris>, Refused> {
    if given.is_some_and(|given| given.is_same_as(&ephemeris)) {
        return Ok(None);
    }
    check(&ephemeris)?;
    *given = Some(ephemeris);
    Ok(*given)
}

/// Refuses an ephemeris that cannot be one: a wrong bit that parity did not find, or a test transmission.
fn check(ephemeris: &KeplerEphemeris) -> Result<(), Refused> {
    let limits = [
        ("sqrt(A)", ephemeris.sqrt_a, 4e3, 8e3),
        ("eccentricity", ephemeris.eccentricity, 0.0, 0.5),
        ("OMEGA DOT", ephemeris.omega_dot_radps, -1e-7, 1e-7),
        ("IDOT", ephemeris.i_dot_radps, -1e-8, 1e-8),
        ("delta n", ephemeris.delta_n_radps, -1e-7, 1e-7),
        ("af0", ephemeris.clock.0, -0.1, 0.1),
        ("toe - toc", ephemeris.toe - ephemeris.toc, -MAX_TOE_TOC_S, MAX_TOE_TOC_S),
    ];
    within(ephemeris.satellite, &limits)
}

/// The same for GLONASS.
pub(super) fn check_glonass(ephemeris: &GlonassEphemeris) -> Result<(), Refused> {
    let ((low_m, high_m), (slow, fast)) = (RADIUS_BOUNDS_M, SPEED_BOUNDS_MPS);
    let limits = [
        ("distance from the Earth's centre (m)", ephemeris.position.0.norm(), low_m, high_m),
        ("speed (m/s)", ephemeris.velocity.0.norm(), slow, fast),
    ];
    within(ephemeris.satellite, &limits)
}

/// Refuses a value outside its limits.
fn within(satellite: SatelliteId, limits: &[(&str, f64, f64, f64)]) -> Result<(), Refused> {
    for (name, value, low, high) in limits {
        if !(low..=high).contains(&value) {
            return Err(refused(
                "ephemeris with impossible values",
                format!("{satellite}: {name} = {value:e}, limits {low:e} to {high:e}"),
            ));
        }
    }
    Ok(())
}
