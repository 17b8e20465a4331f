//! Satellite states from Kepler elements, until `crate::orbit` offers them.

use crate::constants::{EARTH_ROTATION_BEIDOU_RADPS, EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS};
use crate::frames::{Ecef, EcefVector};
use crate::gnss::Constellation;
use crate::orbit::{ClockReference, KeplerEphemeris, SatelliteState};
use crate::time::GpsTime;

/// Position, velocity (1 ms difference) and clock.
pub(super) fn satellite_state(e: &KeplerEphemeris, time: GpsTime) -> SatelliteState {
    let (position, clock_s) = position_clock(e, time - e.toe);
    let (before, clock_before) = position_clock(e, time - e.toe - 0.5);
    let (after, clock_after) = position_clock(e, time - e.toe + 0.5);
    SatelliteState {
        position,
        velocity: EcefVector((after - before).0),
        clock_s,
        clock_drift_sps: clock_after - clock_before,
        sigma_m: e.accuracy_m,
        clock_reference: ClockReference::Broadcast,
    }
}

fn position_clock(e: &KeplerEphemeris, tk: f64) -> (Ecef, f64) {
    let (mu, rotation): (f64, f64) = match e.satellite.constellation {
        Constellation::Gps => (3.986_005e14, EARTH_ROTATION_RADPS),
        Constellation::Beidou => (3.986_004_418e14, EARTH_ROTATION_BEIDOU_RADPS),
        _ => (3.986_004_418e14, EARTH_ROTATION_RADPS),
    };
    let a = e.sqrt_a * e.sqrt_a;
    let m = e.m0_rad + (mu.sqrt() / (a * e.sqrt_a) + e.delta_n_radps) * tk;
    let mut ea = m;
    for _ in 0..12 {
        ea = m + e.eccentricity * ea.sin();
    }
    let (sin_e, cos_e) = ea.sin_cos();
    let nu = ((1.0 - e.eccentricity * e.eccentricity).sqrt() * sin_e).atan2(cos_e - e.eccentricity);
    let phi = nu + e.omega_rad;
    let (s2, c2) = (2.0 * phi).sin_cos();
    let u = phi + e.cuc_cus_rad.0 * c2 + e.cuc_cus_rad.1 * s2;
    let r = a * (1.0 - e.eccentricity * cos_e) + e.crc_crs_m.0 * c2 + e.crc_crs_m.1 * s2;
    let i = e.i0_rad + e.i_dot_radps * tk + e.cic_cis_rad.0 * c2 + e.cic_cis_rad.1 * s2;
    let node = e.omega0_rad + (e.omega_dot_radps - rotation) * tk - rotation * e.toe_own_tow_s;
    let (x, y) = (r * u.cos(), r * u.sin());
    let position = Ecef::new(
        x * node.cos() - y * i.cos() * node.sin(),
        x * node.sin() + y * i.cos() * node.cos(),
        y * i.sin(),
    );
    let relativity =
        -2.0 * mu.sqrt() / (SPEED_OF_LIGHT_MPS * SPEED_OF_LIGHT_MPS) * e.eccentricity * e.sqrt_a * sin_e;
    (position, e.clock.0 + e.clock.1 * tk + e.clock.2 * tk * tk + relativity)
}
