//! Signal path: light time, rotation of the Earth, and the exact derivative of both.
//!
//! With the satellite's state (r, v) at transmission, the flight time τ and the rotation R(ω_E·τ) from the Earth-fixed
//! frame of the transmission to that of the reception, s = R·r and the range is ρ = cτ = |s − r_k|, solved by
//! iteration. Its derivative with respect to the time of reception follows from ds/dt = (1 − τ̇)·R·v + τ̇·ω_E·(s_y, −s_x, 0) with
//! τ̇ = ρ̇/c: ρ̇ = u·(R·v − v_k) / (1 − u·(ω_E·(s_y, −s_x, 0) − R·v)/c). The usual approximation (v_s − v_k)·u of
//! receivers differs by some millimetres per second.

use nalgebra::Vector3;

use crate::constants::{EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS};
use crate::frames::{Ecef, EcefVector};
use crate::orbit::SatelliteState;
use crate::time::GpsTime;

/// Initial flight time, typical for a medium orbit, s.
const TYPICAL_FLIGHT_S: f64 = 0.075;
/// Iterations of the light time; each reduces the error by v/c ≈ 3e-6, so that less than a picosecond is left after two.
const ITERATIONS: usize = 2;

/// Path of a signal to a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Path {
    /// Range ρ, m.
    pub range_m: f64,
    /// Derivative of the range with respect to the time of reception, m/s.
    pub range_rate_mps: f64,
    /// Unit vector from receiver to satellite, in the frame of the reception.
    pub unit: Vector3<f64>,
    /// Satellite clock at transmission, s.
    pub clock_s: f64,
    /// Satellite clock drift, s/s.
    pub clock_drift_sps: f64,
}

/// Solves the light time for a receiver at `position` with `velocity` at `receive`; `satellite` returns the satellite's
/// state at an instant. `None` without a state.
pub(super) fn path(
    receive: GpsTime,
    position: Ecef,
    velocity: EcefVector,
    satellite: impl Fn(GpsTime) -> Option<SatelliteState>,
) -> Option<Path> {
    let mut flight_s = TYPICAL_FLIGHT_S;
    let mut state = satellite(receive - flight_s)?;
    for _ in 0..ITERATIONS {
        let rotated = rotated(state.position.0, flight_s);
        flight_s = (rotated - position.0).norm() / SPEED_OF_LIGHT_MPS;
        state = satellite(receive - flight_s)?;
    }
    let place = rotated(state.position.0, flight_s);
    let sight = place - position.0;
    let range_m = sight.norm();
    let unit = sight / range_m;
    let satellite_velocity = rotated(state.velocity.0, flight_s);
    let by_rotation = EARTH_ROTATION_RADPS * Vector3::new(place.y, -place.x, 0.0);
    let apparent = unit.dot(&(satellite_velocity - velocity.0));
    let stretch = 1.0 - unit.dot(&(by_rotation - satellite_velocity)) / SPEED_OF_LIGHT_MPS;
    Some(Path {
        range_m,
        range_rate_mps: apparent / stretch,
        unit,
        clock_s: state.clock_s,
        clock_drift_sps: state.clock_drift_sps,
    })
}

/// A vector of the Earth-fixed frame in the frame `flight_s` later.
fn rotated(vector: Vector3<f64>, flight_s: f64) -> Vector3<f64> {
    let (sin, cos) = (EARTH_ROTATION_RADPS * flight_s).sin_cos();
    Vector3::new(cos * vector.x + sin * vector.y, cos * vector.y - sin * vector.x, vector.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::orbit::ClockReference;

    /// For a satellite and a receiver on straight lines in the Earth-fixed frame, the rate equals the derivative of the range.
    #[test]
    fn the_rate_is_the_derivative_of_the_range() {
        let start = GpsTime::from_week_tow(2400, 1_000.0);
        let satellite = |time: GpsTime| {
            let velocity = Vector3::new(900.0, -2_500.0, 1_800.0);
            Some(SatelliteState {
                position: Ecef(Vector3::new(15e6, 12e6, 18e6) + velocity * (time - start)),
                velocity: EcefVector(velocity),
                clock_s: 0.0,
                clock_drift_sps: 0.0,
                sigma_m: 1.0,
                clock_reference: ClockReference::Broadcast,
            })
        };
        let velocity = EcefVector::new(10.0, -5.0, 3.0);
        let at = |offset_s: f64| {
            let position = Ecef(Vector3::new(4.2e6, 0.85e6, 4.7e6) + velocity.0 * offset_s);
            path(start + offset_s, position, velocity, satellite).unwrap()
        };
        let derivative = (at(0.5).range_m - at(-0.5).range_m) / 1.0;
        assert!(
            (derivative - at(0.0).range_rate_mps).abs() < 1e-4,
            "{derivative} {}",
            at(0.0).range_rate_mps
        );
    }
}
