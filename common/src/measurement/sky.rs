//! Simulated sky for unit tests: corrected observations of satellites in given directions, without errors.

use super::{CorrectedObservation, RangeRate, SharedError, Usage};
use crate::frames::{Direction, Ecef, EcefVector, Enu, Geodetic, LocalFrame};
use crate::gnss::{Constellation, SatelliteId, SignalCode};

/// True state and clocks of a phone.
pub(crate) struct Receiver {
    pub position: Ecef,
    pub velocity: EcefVector,
    /// Clocks of GPS, Galileo and BeiDou, m.
    pub clocks_m: [f64; 3],
    pub drift_mps: f64,
}

impl Receiver {
    pub fn in_wuhan() -> Self {
        Self {
            position: Geodetic::from_degrees(30.5, 114.3, 25.0).geodetic_to_ecef(),
            velocity: EcefVector::new(3.0, -8.0, 5.0),
            clocks_m: [150.0, 157.0, 138.0],
            drift_mps: 0.7,
        }
    }

    /// Observations in the directions (azimuth°, elevation°), with alternating systems.
    pub fn observe(&self, directions_deg: &[(f64, f64)]) -> Vec<CorrectedObservation> {
        let systems = [Constellation::Gps, Constellation::Galileo, Constellation::Beidou];
        directions_deg
            .iter()
            .enumerate()
            .map(|(i, (azimuth_deg, elevation_deg))| {
                let satellite = SatelliteId::new(systems[i % 3], u8::try_from(i + 1).unwrap());
                let direction = Direction {
                    azimuth_rad: azimuth_deg.to_radians(),
                    elevation_rad: elevation_deg.to_radians(),
                };
                self.observe_one(satellite, self.clocks_m[i % 3], direction)
            })
            .collect()
    }

    fn observe_one(
        &self,
        satellite: SatelliteId,
        clock_m: f64,
        direction: Direction,
    ) -> CorrectedObservation {
        let range_m = 2.2e7 + 1e5 * f64::from(satellite.number);
        let (sin_e, cos_e) = direction.elevation_rad.sin_cos();
        let (sin_a, cos_a) = direction.azimuth_rad.sin_cos();
        let line = Enu { east: cos_e * sin_a, north: cos_e * cos_a, up: sin_e };
        let u = LocalFrame::at(self.position).vector_enu_to_ecef(line).0;
        let number = f64::from(satellite.number);
        let satellite_velocity = EcefVector::new(900.0 * number.sin(), 2_500.0 * number.cos(), -700.0);
        CorrectedObservation {
            satellite,
            signal: SignalCode::new(b'1', b'C'),
            pseudorange_m: range_m + clock_m,
            pseudorange_sigma_m: 1.0 + 0.1 * number,
            shared: SharedError::default(),
            range_rate: Some(RangeRate {
                range_rate_mps: u.dot(&(satellite_velocity.0 - self.velocity.0)) + self.drift_mps,
                sigma_mps: 0.1,
                averaged_s: 0.0,
            }),
            range_change: None,
            cn0_dbhz: Some(40.0),
            direction,
            satellite_position: Ecef(self.position.0 + u * range_m),
            satellite_velocity,
            usage: Usage::Used,
            residual_m: None,
        }
    }
}

/// Twelve directions with a good geometry.
pub(crate) const OPEN_SKY_DEG: [(f64, f64); 12] = [
    (10.0, 70.0),
    (80.0, 25.0),
    (150.0, 40.0),
    (200.0, 15.0),
    (260.0, 55.0),
    (310.0, 30.0),
    (350.0, 20.0),
    (45.0, 45.0),
    (120.0, 12.0),
    (180.0, 80.0),
    (230.0, 35.0),
    (285.0, 18.0),
];
