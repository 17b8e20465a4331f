//! Simulated satellites: three Walker-like constellations and a few inclined geosynchronous satellites, as broadcast ephemerides.
//!
//! Planes, inclinations and radii are those of the interface documents and the published constellations; phases, eccentricities, clocks and
//! group delays are random, so they describe no real satellites. Each orbit is written as one message per hour. All messages of a satellite
//! describe exactly the same ellipse and clock, so that the choice of the message does not matter.

use std::f64::consts::TAU;

use rand::Rng;
use rand_distr::StandardNormal;

use crate::gnss::{Constellation, SatelliteId};
use crate::orbit::{KeplerEphemeris, NavigationMessage, gravity_and_rotation};
use crate::time::{BEIDOU_BEHIND_GPS_S, GpsTime, SECONDS_PER_WEEK};

/// Time between messages of one satellite, s.
const MESSAGE_INTERVAL_S: f64 = 3_600.0;

/// A Walker pattern with the common properties of its satellites.
struct Shell {
    constellation: Constellation,
    message: NavigationMessage,
    first_number: u8,
    planes: u8,
    per_plane: u8,
    /// Phase between neighbouring planes, as a fraction of the spacing within a plane.
    phasing: f64,
    semi_major_m: f64,
    inclination_deg: f64,
    eccentricity: f64,
    /// Standard deviation of a satellite's phase about the pattern, rad.
    phase_spread_rad: f64,
    group_delay_s: f64,
    accuracy_m: f64,
}

const GPS: Shell = Shell {
    constellation: Constellation::Gps,
    message: NavigationMessage::Lnav,
    first_number: 1,
    planes: 6,
    per_plane: 5,
    phasing: 0.4,
    semi_major_m: 26_559_700.0,
    inclination_deg: 55.0,
    eccentricity: 0.008,
    phase_spread_rad: 0.15,
    group_delay_s: 6e-9,
    accuracy_m: 2.0,
};
const GALILEO: Shell = Shell {
    constellation: Constellation::Galileo,
    message: NavigationMessage::GalileoInav,
    first_number: 1,
    planes: 3,
    per_plane: 8,
    phasing: 1.0 / 3.0,
    semi_major_m: 29_600_318.0,
    inclination_deg: 56.0,
    eccentricity: 3e-4,
    phase_spread_rad: 0.01,
    group_delay_s: 3e-9,
    accuracy_m: 3.12,
};
const BEIDOU_MEO: Shell = Shell {
    constellation: Constellation::Beidou,
    message: NavigationMessage::BeidouD1D2,
    first_number: 19,
    planes: 3,
    per_plane: 8,
    phasing: 1.0 / 3.0,
    semi_major_m: 27_906_100.0,
    inclination_deg: 55.0,
    eccentricity: 8e-4,
    phase_spread_rad: 0.01,
    group_delay_s: 8e-9,
    accuracy_m: 2.0,
};
/// Three planes with one satellite each, phased so that their ground tracks coincide.
const BEIDOU_IGSO: Shell = Shell {
    constellation: Constellation::Beidou,
    message: NavigationMessage::BeidouD1D2,
    first_number: 6,
    planes: 3,
    per_plane: 1,
    phasing: -1.0 / 3.0,
    semi_major_m: 42_164_200.0,
    inclination_deg: 55.0,
    eccentricity: 3e-3,
    phase_spread_rad: 0.01,
    group_delay_s: 8e-9,
    accuracy_m: 2.0,
};

/// Hourly ephemerides of all satellites, from the hour before that of `from`, so that a user of past messages only
/// has one, to the first that is not before `to`.
pub(super) fn ephemerides(from: GpsTime, to: GpsTime, random: &mut impl Rng) -> Vec<KeplerEphemeris> {
    let hour = ((from.tow_s() / MESSAGE_INTERVAL_S).floor() - 1.0) * MESSAGE_INTERVAL_S;
    let first = GpsTime::from_week_tow(from.week(), hour);
    let mut all = Vec::new();
    for shell in [GPS, GALILEO, BEIDOU_MEO, BEIDOU_IGSO] {
        let node_rad = random.random::<f64>() * TAU;
        for plane in 0..shell.planes {
            for slot in 0..shell.per_plane {
                let message = shell.satellite(plane, slot, node_rad, first, random);
                let mut later = message;
                all.push(later);
                while later.toe < to {
                    later = restated(&later, MESSAGE_INTERVAL_S);
                    all.push(later);
                }
            }
        }
    }
    all
}

impl Shell {
    fn satellite(
        &self,
        plane: u8,
        slot: u8,
        node_rad: f64,
        toe: GpsTime,
        random: &mut impl Rng,
    ) -> KeplerEphemeris {
        let (plane_number, slot_number) = (f64::from(plane), f64::from(slot));
        let spacing_rad = TAU / f64::from(self.per_plane);
        let mut normal = || random.sample::<f64, _>(StandardNormal);
        let perigee_rad = 2.0 * normal();
        let phase_rad =
            spacing_rad * (slot_number + self.phasing * plane_number) + self.phase_spread_rad * normal();
        let mut delay_s = || self.group_delay_s * normal();
        let group_delays_s = match self.constellation {
            Constellation::Gps => (delay_s() - self.group_delay_s, 0.0),
            _ => (delay_s(), delay_s()),
        };
        KeplerEphemeris {
            satellite: SatelliteId::new(
                self.constellation,
                self.first_number + plane * self.per_plane + slot,
            ),
            message: self.message,
            toe,
            toe_own_tow_s: self.own_tow_s(toe),
            toc: toe,
            sqrt_a: self.semi_major_m.sqrt(),
            eccentricity: self.eccentricity * (1.0 + 0.3 * normal()).abs(),
            i0_rad: self.inclination_deg.to_radians() + 0.01 * normal(),
            i_dot_radps: 1e-10 * normal(),
            omega0_rad: wrapped(node_rad + TAU * plane_number / f64::from(self.planes)),
            omega_dot_radps: -8e-9,
            omega_rad: wrapped(perigee_rad),
            m0_rad: wrapped(phase_rad - perigee_rad),
            delta_n_radps: 4.5e-9,
            cuc_cus_rad: (1e-6 * normal(), 5e-6 * normal()),
            crc_crs_m: (200.0 + 80.0 * normal(), 60.0 * normal()),
            cic_cis_rad: (5e-8 * normal(), 5e-8 * normal()),
            clock: (2e-4 * normal(), 5e-12 * normal(), 0.0),
            group_delays_s,
            accuracy_m: self.accuracy_m,
            health: 0.0,
            issue_of_data: 1,
            issue_of_clock: 1,
        }
    }

    /// Seconds of the system's own week.
    fn own_tow_s(&self, time: GpsTime) -> f64 {
        if self.constellation == Constellation::Beidou {
            (time.tow_s() - BEIDOU_BEHIND_GPS_S).rem_euclid(SECONDS_PER_WEEK)
        } else {
            time.tow_s()
        }
    }
}

/// The same orbit and clock, with reference times `step_s` later. Within one week only the mean anomaly, inclination,
/// node and clock polynomial change; across the week's end the node refers to the start of the *new* week.
fn restated(message: &KeplerEphemeris, step_s: f64) -> KeplerEphemeris {
    let (gravity, earth_radps) = gravity_and_rotation(message.satellite.constellation);
    let mean_motion_radps = gravity.sqrt() / message.sqrt_a.powi(3) + message.delta_n_radps;
    let own_tow_s = message.toe_own_tow_s + step_s;
    let weeks = (own_tow_s / SECONDS_PER_WEEK).floor();
    let new_week_rad = weeks * SECONDS_PER_WEEK * earth_radps;
    let (bias_s, drift_sps, rate_sps2) = message.clock;
    KeplerEphemeris {
        toe: message.toe + step_s,
        toc: message.toc + step_s,
        toe_own_tow_s: own_tow_s - weeks * SECONDS_PER_WEEK,
        m0_rad: wrapped(message.m0_rad + mean_motion_radps * step_s),
        i0_rad: message.i0_rad + message.i_dot_radps * step_s,
        omega0_rad: wrapped(message.omega0_rad + message.omega_dot_radps * step_s - new_week_rad),
        clock: (
            bias_s + step_s * (drift_sps + step_s * rate_sps2),
            drift_sps + 2.0 * step_s * rate_sps2,
            rate_sps2,
        ),
        issue_of_data: message.issue_of_data + 1,
        issue_of_clock: message.issue_of_clock + 1,
        ..*message
    }
}

/// An angle in (−π, π], as messages have them.
fn wrapped(angle_rad: f64) -> f64 {
    let turned = angle_rad.rem_euclid(TAU);
    if turned > TAU / 2.0 { turned - TAU } else { turned }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// Three hours across the end of a week.
    fn messages() -> Vec<KeplerEphemeris> {
        let from = GpsTime::from_week_tow(2409, SECONDS_PER_WEEK - 4_000.0);
        ephemerides(from, from + 10_800.0, &mut ChaCha8Rng::seed_from_u64(4))
    }

    #[test]
    fn every_message_of_a_satellite_describes_the_same_orbit_and_clock() {
        let mut compared = 0;
        for pair in messages().windows(2).filter(|pair| pair[0].satellite == pair[1].satellite) {
            let time = pair[0].toe + 1_000.0;
            let (a, b) = (pair[0].state(time), pair[1].state(time));
            let satellite = pair[0].satellite;
            assert!(a.position.distance_m(b.position) < 1e-4, "{satellite}: {a:?} {b:?}");
            assert!((a.velocity.0 - b.velocity.0).norm() < 1e-7, "{satellite}");
            assert!((a.clock_s - b.clock_s).abs() < 1e-15, "{satellite}");
            assert!(pair[1].toe_own_tow_s < SECONDS_PER_WEEK);
            compared += 1;
        }
        assert_eq!(compared, 81 * 5);
    }

    #[test]
    fn satellites_are_as_many_and_as_high_as_meant() {
        let messages = messages();
        let count = |constellation, radius_m: f64| {
            let mut satellites: Vec<_> = messages
                .iter()
                .filter(|m| m.satellite.constellation == constellation)
                .filter(|m| (m.state(m.toe).position.0.norm() / radius_m - 1.0).abs() < 0.03)
                .map(|m| m.satellite)
                .collect();
            satellites.dedup();
            satellites.len()
        };
        assert_eq!(count(Constellation::Gps, 26.56e6), 30);
        assert_eq!(count(Constellation::Galileo, 29.60e6), 24);
        assert_eq!(count(Constellation::Beidou, 27.91e6), 24);
        assert_eq!(count(Constellation::Beidou, 42.16e6), 3);
    }
}
