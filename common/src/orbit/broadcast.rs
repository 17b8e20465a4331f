//! Broadcast (Kepler) orbits and clocks.
//!
//! IS-GPS-200, table 20-IV; Galileo OS SIS ICD, 5.1.1; BDS-SIS-ICD-B1I, 5.2.4.12 (geostationary satellites
//! included); IS-QZSS-PNT, user algorithm of LNAV. Velocities are derivatives of the formulas.

use nalgebra::{Rotation3, Vector3};

use super::{ClockReference, KeplerEphemeris, NavigationMessage, OrbitError, SatelliteState};
use crate::constants::{
    EARTH_ROTATION_BEIDOU_RADPS, EARTH_ROTATION_RADPS, GRAVITY_GPS_M3PS2, GRAVITY_M3PS2, SPEED_OF_LIGHT_MPS,
};
use crate::frames::{Ecef, EcefVector};
use crate::gnss::{Constellation, SatelliteId};
use crate::time::GpsTime;

/// Tilt of the frame in which geostationary BeiDou orbits are given, rad.
const BEIDOU_GEO_TILT_RAD: f64 = -5.0 * std::f64::consts::PI / 180.0;

/// Maximum time from the reference time of an ephemeris, s. GPS and QZSS: half the usual fit
/// interval of 4 h; Galileo: 4 h forward (OS SDD); BeiDou: messages are hourly, and files often have gaps.
const fn max_age_s(constellation: Constellation) -> f64 {
    match constellation {
        Constellation::Galileo => 14_400.0,
        Constellation::Beidou => 21_600.0,
        _ => 7_201.0,
    }
}

/// Constants of a system: gravitational constant (m³/s²) and Earth rotation rate (rad/s).
pub(crate) const fn gravity_and_rotation(constellation: Constellation) -> (f64, f64) {
    match constellation {
        Constellation::Galileo => (GRAVITY_M3PS2, EARTH_ROTATION_RADPS),
        Constellation::Beidou => (GRAVITY_M3PS2, EARTH_ROTATION_BEIDOU_RADPS),
        _ => (GRAVITY_GPS_M3PS2, EARTH_ROTATION_RADPS),
    }
}

/// Whether the message declares the satellite usable.
///
/// GPS, BeiDou: health word 0. QZSS: its lowest bit concerns signals other than L1 C/A and is ignored.
/// Galileo: no health status (HS) and no "without guarantee" flag (DVS) of E1-B, E5a, E5b (RINEX 3.05, table A8).
pub fn is_healthy(ephemeris: &KeplerEphemeris) -> bool {
    match ephemeris.satellite.constellation {
        Constellation::Qzss => ephemeris.health < 2.0,
        _ => ephemeris.health == 0.0,
    }
}

/// Position of the satellite in its orbital plane.
struct InPlane {
    /// Argument of latitude, rad, and its rate.
    latitude: (f64, f64),
    /// Radius, m, and its rate.
    radius: (f64, f64),
    /// Inclination, rad, and its rate.
    inclination: (f64, f64),
    /// Relativistic clock term, s, and its rate.
    relativity: (f64, f64),
}

impl KeplerEphemeris {
    /// Satellite state at an instant, regardless of age and health of the ephemeris.
    pub fn state(&self, time: GpsTime) -> SatelliteState {
        let (gm, earth_rate) = gravity_and_rotation(self.satellite.constellation);
        let elapsed_s = time - self.toe;
        let plane = self.in_plane(elapsed_s, gm);
        let (position, velocity) = if self.satellite.is_beidou_geostationary() {
            self.geostationary(&plane, elapsed_s, earth_rate)
        } else {
            let node_rate = self.omega_dot_radps - earth_rate;
            let node = self.omega0_rad + node_rate * elapsed_s - earth_rate * self.toe_own_tow_s;
            plane.place(node, node_rate)
        };
        let clock_age_s = time - self.toc;
        let (bias, drift, rate) = self.clock;
        SatelliteState {
            position: Ecef(position),
            velocity: EcefVector(velocity),
            clock_s: bias + clock_age_s * (drift + clock_age_s * rate) + plane.relativity.0,
            clock_drift_sps: drift + 2.0 * rate * clock_age_s + plane.relativity.1,
            sigma_m: self.accuracy_m,
            clock_reference: ClockReference::Broadcast,
        }
    }

    fn in_plane(&self, elapsed_s: f64, gm: f64) -> InPlane {
        let e = self.eccentricity;
        let axis = self.sqrt_a * self.sqrt_a;
        let mean_motion = gm.sqrt() / (axis * self.sqrt_a) + self.delta_n_radps;
        let anomaly = eccentric_anomaly(self.m0_rad + mean_motion * elapsed_s, e);
        let (sin_e, cos_e) = anomaly.sin_cos();
        let anomaly_rate = mean_motion / (1.0 - e * cos_e);
        let root = (1.0 - e * e).sqrt();
        let argument = (root * sin_e).atan2(cos_e - e) + self.omega_rad;
        let argument_rate = root * anomaly_rate / (1.0 - e * cos_e);
        let (sin_2, cos_2) = (2.0 * argument).sin_cos();
        // A harmonic correction c·cos 2φ + s·sin 2φ and its rate.
        let harmonic =
            |(c, s): (f64, f64)| (c * cos_2 + s * sin_2, 2.0 * argument_rate * (s * cos_2 - c * sin_2));
        let latitude = harmonic(self.cuc_cus_rad);
        let radius = harmonic(self.crc_crs_m);
        let inclination = harmonic(self.cic_cis_rad);
        let relativity = -2.0 * gm.sqrt() * self.sqrt_a * e / (SPEED_OF_LIGHT_MPS * SPEED_OF_LIGHT_MPS);
        InPlane {
            latitude: (argument + latitude.0, argument_rate + latitude.1),
            radius: (axis * (1.0 - e * cos_e) + radius.0, axis * e * sin_e * anomaly_rate + radius.1),
            inclination: (
                self.i0_rad + inclination.0 + self.i_dot_radps * elapsed_s,
                self.i_dot_radps + inclination.1,
            ),
            relativity: (relativity * sin_e, relativity * cos_e * anomaly_rate),
        }
    }

    /// Geostationary BeiDou satellites: the orbit is given in a tilted frame that does not rotate with the Earth.
    fn geostationary(
        &self,
        plane: &InPlane,
        elapsed_s: f64,
        earth_rate: f64,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let node = self.omega0_rad + self.omega_dot_radps * elapsed_s - earth_rate * self.toe_own_tow_s;
        let (position, velocity) = plane.place(node, self.omega_dot_radps);
        // The ICD's matrices rotate the axes; those of nalgebra rotate the vector.
        let tilt = Rotation3::from_axis_angle(&Vector3::x_axis(), -BEIDOU_GEO_TILT_RAD);
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -earth_rate * elapsed_s);
        let (position, velocity) = (turn * (tilt * position), turn * (tilt * velocity));
        (position, velocity - Vector3::new(-position.y, position.x, 0.0) * earth_rate)
    }
}

impl InPlane {
    /// Rotates into the frame whose x axis is the origin of the ascending node's longitude.
    fn place(&self, node: f64, node_rate: f64) -> (Vector3<f64>, Vector3<f64>) {
        let (sin_u, cos_u) = self.latitude.0.sin_cos();
        let (sin_i, cos_i) = self.inclination.0.sin_cos();
        let (sin_n, cos_n) = node.sin_cos();
        let (r, r_rate) = self.radius;
        let (x, y) = (r * cos_u, r * sin_u);
        let x_rate = r_rate * cos_u - y * self.latitude.1;
        let y_rate = r_rate * sin_u + x * self.latitude.1;
        // Component of y in the equatorial plane, and its rate.
        let flat = y * cos_i;
        let flat_rate = y_rate * cos_i - y * sin_i * self.inclination.1;
        let position = Vector3::new(x * cos_n - flat * sin_n, x * sin_n + flat * cos_n, y * sin_i);
        let velocity = Vector3::new(
            x_rate * cos_n - flat_rate * sin_n - position.y * node_rate,
            x_rate * sin_n + flat_rate * cos_n + position.x * node_rate,
            y_rate * sin_i + y * cos_i * self.inclination.1,
        );
        (position, velocity)
    }
}

/// Solves Kepler's equation M = E − e sin E by Newton's method. It converges quadratically: after a step below
/// 1e-8 the error is below 1e-16.
fn eccentric_anomaly(mean: f64, e: f64) -> f64 {
    let (sin, cos) = mean.sin_cos();
    let mut anomaly = mean + e * sin * (1.0 + e * cos);
    for _ in 0..20 {
        let (sin, cos) = anomaly.sin_cos();
        let step = (anomaly - e * sin - mean) / (1.0 - e * cos);
        anomaly -= step;
        if step.abs() < 1e-8 {
            break;
        }
    }
    anomaly
}

/// A satellite's ephemerides of one message type in order of reference time, later transmissions last.
#[derive(Clone, Debug, Default)]
struct Series(Vec<KeplerEphemeris>);

impl Series {
    /// Index of the first ephemeris whose reference time is not before `time`.
    fn split(&self, time: GpsTime) -> usize {
        self.0.partition_point(|ephemeris| ephemeris.toe < time)
    }

    /// The latest ephemeris with a reference time before `time`.
    fn before(&self, time: GpsTime) -> Option<&KeplerEphemeris> {
        self.split(time).checked_sub(1).and_then(|index| self.0.get(index))
    }

    /// The ephemeris with the nearest reference time; of equal ones the last transmitted.
    fn nearest(&self, time: GpsTime) -> Option<&KeplerEphemeris> {
        let before = self.before(time);
        let after = self.0.get(self.split(time)).and_then(|ephemeris| self.before(ephemeris.toe + 1e-9));
        match (before, after) {
            (Some(a), Some(b)) => Some(if time - a.toe < b.toe - time { a } else { b }),
            (a, b) => a.or(b),
        }
    }

    fn span(&self) -> Option<(GpsTime, GpsTime)> {
        Some((self.0.first()?.toe, self.0.last()?.toe))
    }
}

/// Broadcast orbits of one satellite. Galileo has two series; I/NAV is preferred, because phones track E1.
#[derive(Clone, Debug, Default)]
pub(super) struct BroadcastOrbit {
    main: Series,
    galileo_fnav: Series,
}

impl BroadcastOrbit {
    /// Adds an ephemeris; ephemerides of one reference time are in order of transmission.
    pub(super) fn add(&mut self, ephemeris: KeplerEphemeris) {
        let series = match ephemeris.message {
            NavigationMessage::GalileoFnav => &mut self.galileo_fnav,
            _ => &mut self.main,
        };
        let at = series.0.partition_point(|other| other.toe <= ephemeris.toe);
        series.0.insert(at, ephemeris);
    }

    /// Whether there is no ephemeris.
    pub(super) const fn is_empty(&self) -> bool {
        self.main.0.is_empty() && self.galileo_fnav.0.is_empty()
    }

    /// State by the ephemeris in force.
    pub(super) fn state(&self, satellite: SatelliteId, time: GpsTime) -> Result<SatelliteState, OrbitError> {
        let Some(ephemeris) = self.in_force(satellite, time) else {
            return Err(self.not_covered(satellite, time));
        };
        if !is_healthy(ephemeris) {
            return Err(OrbitError::Unhealthy { satellite, time, health: ephemeris.health });
        }
        Ok(ephemeris.state(time))
    }

    /// The ephemeris in force: that of the nearest reference time within the maximum age. Galileo sends its
    /// messages after their reference time, so there it is the latest one before `time`.
    pub(super) fn in_force(&self, satellite: SatelliteId, time: GpsTime) -> Option<&KeplerEphemeris> {
        let limit = max_age_s(satellite.constellation);
        [&self.main, &self.galileo_fnav].into_iter().find_map(|series| {
            let candidate = match satellite.constellation {
                Constellation::Galileo => series.before(time),
                _ => series.nearest(time),
            };
            candidate.filter(|ephemeris| (time - ephemeris.toe).abs() <= limit)
        })
    }

    /// The message nearest in time at any age: of the main series (I/NAV), and F/NAV.
    pub(super) fn nearest(&self, time: GpsTime) -> (Option<&KeplerEphemeris>, Option<&KeplerEphemeris>) {
        (self.main.nearest(time), self.galileo_fnav.nearest(time))
    }

    fn not_covered(&self, satellite: SatelliteId, time: GpsTime) -> OrbitError {
        let Some((first, last)) = self.main.span().or_else(|| self.galileo_fnav.span()) else {
            return OrbitError::Unknown { satellite };
        };
        let age = max_age_s(satellite.constellation);
        let first = if satellite.constellation == Constellation::Galileo { first } else { first - age };
        OrbitError::NotCovered { satellite, time, first, last: last + age }
    }
}
