//! GLONASS broadcast orbits and clocks.
//!
//! A message contains position, velocity and the luni-solar acceleration at one instant; the orbit is integrated from there
//! (GLONASS ICD, L1 and L2, edition 5.1, appendix A.3.1.2). The frame is PZ-90.11, which agrees with WGS-84 and
//! ITRF to centimetres and is treated as identical.

use nalgebra::Vector3;

use super::{ClockReference, OrbitError, SatelliteState};
use crate::constants::GRAVITY_PZ90_M3PS2;
use crate::frames::{Ecef, EcefVector};
use crate::gnss::SatelliteId;
use crate::time::GpsTime;

/// Equatorial radius of PZ-90, m (ICD A.3.1.2).
const RADIUS_PZ90_M: f64 = 6_378_136.0;
/// Second zonal harmonic J₂ of PZ-90 (ICD A.3.1.2).
const J2_PZ90: f64 = 1.082_625_7e-3;
/// Earth rotation rate of PZ-90, rad/s (ICD table 3.2).
const EARTH_ROTATION_PZ90_RADPS: f64 = 7.292_115e-5;
/// Maximum integration step, s. Half of the customary 60 s, so that the error of a step is below 0.1 mm.
const MAX_STEP_S: f64 = 30.0;
/// Maximum time from the reference time of a message, s. Messages are half-hourly and valid
/// a quarter of an hour to both sides; files have gaps.
const MAX_AGE_S: f64 = 1_800.0;
/// Maximum integration time, s: the state has no meaning beyond it, and a wrong time must not cost minutes of computation.
const MAX_INTEGRATION_S: f64 = 86_400.0;

/// Standard deviation for a message without an accuracy, m.
const USUAL_ACCURACY_M: f64 = 5.0;
/// Standard deviation by the accuracy factor F_T, m (ICD table 4.4).
const ACCURACY_M: [f64; 15] =
    [1.0, 2.0, 2.5, 4.0, 5.0, 7.0, 10.0, 12.0, 14.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0];

/// Standard deviation of orbit and clock together by the accuracy factor F_T, m; without a factor the usual one.
pub(crate) fn accuracy_m(factor: Option<u8>) -> f64 {
    factor.and_then(|factor| ACCURACY_M.get(usize::from(factor))).copied().unwrap_or(USUAL_ACCURACY_M)
}

/// One GLONASS broadcast ephemeris.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlonassEphemeris {
    /// The satellite (slot).
    pub satellite: SatelliteId,
    /// Reference time t_b, GPS time.
    pub toe: GpsTime,
    /// Position at `toe` in PZ-90.
    pub position: Ecef,
    /// Velocity at `toe` in the rotating frame.
    pub velocity: EcefVector,
    /// Acceleration by Sun and Moon, m/s², constant over the message's validity.
    pub acceleration: EcefVector,
    /// τ_n: delay of the satellite's time *behind* system time, s. The clock offset is −τ_n.
    pub tau_s: f64,
    /// γ_n: relative deviation of the carrier frequency from its nominal value; the clock's drift.
    pub gamma: f64,
    /// Δτ_n: delay of L2 relative to L1 at the satellite, s; `None` if the file does not contain it.
    pub l2_delay_s: Option<f64>,
    /// Frequency channel, −7…13.
    pub frequency_channel: i8,
    /// Health word B_n, 0 = healthy; `None` if the file does not contain it.
    pub health: Option<u8>,
    /// Further health flags (RINEX 3.05, table A10): bit 0 C_n of the almanac (1 = healthy), bit 1 whether the almanac
    /// reports it, bit 2 l_n of string 3 (1 = not healthy). `None` if the file does not contain them.
    pub health_flags: Option<u8>,
    /// Age of the immediate data E_n, days.
    pub age_days: f64,
    /// Standard deviation of orbit and clock together, m.
    pub accuracy_m: f64,
}

/// Position and velocity, or velocity and acceleration.
#[derive(Clone, Copy)]
struct Motion(Vector3<f64>, Vector3<f64>);

impl Motion {
    fn plus(self, rate: Self, step_s: f64) -> Self {
        Self(self.0 + rate.0 * step_s, self.1 + rate.1 * step_s)
    }
}

impl GlonassEphemeris {
    /// Whether the message declares the satellite usable. Missing flags count as healthy.
    pub fn is_healthy(&self) -> bool {
        let flags = self.health_flags.unwrap_or(0);
        let refused_by_almanac = flags & 0b011 == 0b010;
        self.health.unwrap_or(0) == 0 && flags & 0b100 == 0 && !refused_by_almanac
    }

    /// Satellite state at an instant, regardless of age and health of the message; beyond a day from its reference time, the
    /// state at one day.
    pub fn state(&self, time: GpsTime) -> SatelliteState {
        let elapsed_s = (time - self.toe).clamp(-MAX_INTEGRATION_S, MAX_INTEGRATION_S);
        let Motion(position, velocity) = self.integrate(elapsed_s);
        SatelliteState {
            position: Ecef(position),
            velocity: EcefVector(velocity),
            clock_s: -self.tau_s + self.gamma * elapsed_s,
            clock_drift_sps: self.gamma,
            sigma_m: self.accuracy_m,
            clock_reference: ClockReference::Broadcast,
        }
    }

    /// Fourth-order Runge-Kutta integration in equal steps.
    fn integrate(&self, elapsed_s: f64) -> Motion {
        let mut motion = Motion(self.position.0, self.velocity.0);
        let steps = (elapsed_s.abs() / MAX_STEP_S).ceil().max(1.0);
        let step_s = elapsed_s / steps;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most a day of steps
        for _ in 0..steps as u32 {
            let a = self.rate(motion);
            let b = self.rate(motion.plus(a, 0.5 * step_s));
            let c = self.rate(motion.plus(b, 0.5 * step_s));
            let d = self.rate(motion.plus(c, step_s));
            let mean = Motion((a.0 + 2.0 * (b.0 + c.0) + d.0) / 6.0, (a.1 + 2.0 * (b.1 + c.1) + d.1) / 6.0);
            motion = motion.plus(mean, step_s);
        }
        motion
    }

    /// Equations of motion in the rotating frame: central attraction, oblateness, Sun and Moon, rotation.
    fn rate(&self, Motion(r, v): Motion) -> Motion {
        let square = r.norm_squared();
        let central = GRAVITY_PZ90_M3PS2 / (square * square.sqrt());
        let oblate = 1.5 * J2_PZ90 * central * RADIUS_PZ90_M * RADIUS_PZ90_M / square;
        let equatorial = -central - oblate * (1.0 - 5.0 * r.z * r.z / square);
        let spin = EARTH_ROTATION_PZ90_RADPS;
        let gravity = Vector3::new(equatorial * r.x, equatorial * r.y, (equatorial - 2.0 * oblate) * r.z);
        let rotation = Vector3::new(spin * (spin * r.x + 2.0 * v.y), spin * (spin * r.y - 2.0 * v.x), 0.0);
        Motion(v, gravity + rotation + self.acceleration.0)
    }

    /// Health word and flags in one number for texts: B_n + 2·flags.
    fn health_number(&self) -> f64 {
        f64::from(self.health.unwrap_or(0)) + 2.0 * f64::from(self.health_flags.unwrap_or(0))
    }
}

/// A satellite's messages in order of reference time, later transmissions last.
#[derive(Clone, Debug, Default)]
pub(super) struct GlonassOrbit(Vec<GlonassEphemeris>);

impl GlonassOrbit {
    /// Adds a message; messages of one reference time are in order of transmission.
    pub(super) fn add(&mut self, ephemeris: GlonassEphemeris) {
        let at = self.0.partition_point(|other| other.toe <= ephemeris.toe);
        self.0.insert(at, ephemeris);
    }

    /// Whether there is no message.
    pub(super) const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The message with the nearest reference time, at any age; of equal ones the last transmitted.
    pub(super) fn nearest(&self, time: GpsTime) -> Option<&GlonassEphemeris> {
        let split = self.0.partition_point(|ephemeris| ephemeris.toe < time);
        let before = split.checked_sub(1).and_then(|index| self.0.get(index));
        let next = self.0.get(split).map(|ephemeris| ephemeris.toe);
        let after = next.and_then(|toe| self.0.iter().skip(split).take_while(|e| e.toe == toe).last());
        match (before, after) {
            (Some(a), Some(b)) => Some(if time - a.toe < b.toe - time { a } else { b }),
            (a, b) => a.or(b),
        }
    }

    /// The message in force: the nearest within the maximum age.
    pub(super) fn in_force(&self, time: GpsTime) -> Option<&GlonassEphemeris> {
        self.nearest(time).filter(|ephemeris| (time - ephemeris.toe).abs() <= MAX_AGE_S)
    }

    /// State by the message in force.
    pub(super) fn state(&self, satellite: SatelliteId, time: GpsTime) -> Result<SatelliteState, OrbitError> {
        let Some(ephemeris) = self.in_force(time) else {
            let (Some(first), Some(last)) = (self.0.first(), self.0.last()) else {
                return Err(OrbitError::Unknown { satellite });
            };
            let (first, last) = (first.toe - MAX_AGE_S, last.toe + MAX_AGE_S);
            return Err(OrbitError::NotCovered { satellite, time, first, last });
        };
        if !ephemeris.is_healthy() {
            return Err(OrbitError::Unhealthy { satellite, time, health: ephemeris.health_number() });
        }
        Ok(ephemeris.state(time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::Constellation;

    /// A message of slot 1.
    pub(super) fn message() -> GlonassEphemeris {
        GlonassEphemeris {
            satellite: SatelliteId::new(Constellation::Glonass, 1),
            toe: GpsTime::from_week_tow(2253, 918.0),
            position: Ecef::new(14_220_122.558_59, -20_433_516.601_56, 5_539_755.371_094),
            velocity: EcefVector(Vector3::new(-493.883_132_934_6, 593.394_279_48, 3_461.606_979_37)),
            acceleration: EcefVector(Vector3::new(-9.313_225_746e-7, 9.313_225_746e-7, 0.0)),
            tau_s: -2.458_319_067_955e-5,
            gamma: 1e-12,
            l2_delay_s: None,
            frequency_channel: 1,
            health: Some(0),
            health_flags: None,
            age_days: 0.0,
            accuracy_m: 5.0,
        }
    }

    #[test]
    fn forth_and_back_is_where_it_began() {
        let start = message();
        let there = start.state(start.toe + 1_700.0);
        let moved = GlonassEphemeris {
            toe: start.toe + 1_700.0,
            position: there.position,
            velocity: there.velocity,
            ..start
        };
        let back = moved.state(start.toe);
        assert!(back.position.distance_m(start.position) < 1e-4);
        assert!((back.velocity.0 - start.velocity.0).norm() < 1e-7);
    }

    /// Energy in the rotating frame (Jacobi's integral) is constant without Sun and Moon.
    #[test]
    fn energy_is_kept() {
        let start = GlonassEphemeris { acceleration: EcefVector(Vector3::zeros()), ..message() };
        let energy = |s: &SatelliteState| {
            let (r, v) = (s.position.0, s.velocity.0);
            let square = r.norm_squared();
            let oblate = J2_PZ90 * RADIUS_PZ90_M.powi(2) / square * (1.5 * r.z * r.z / square - 0.5);
            let spin = EARTH_ROTATION_PZ90_RADPS.powi(2) * (r.x * r.x + r.y * r.y);
            0.5 * v.norm_squared() - GRAVITY_PZ90_M3PS2 / square.sqrt() * (1.0 - oblate) - 0.5 * spin
        };
        let (a, b) = (start.state(start.toe), start.state(start.toe + 10_000.0));
        assert!((energy(&a) - energy(&b)).abs() < 1e-9 * energy(&a).abs());
    }

    #[test]
    fn the_nearest_message_holds_and_the_last_sent_of_equals() {
        let mut orbit = GlonassOrbit::default();
        let first = message();
        orbit.add(GlonassEphemeris { toe: first.toe + 1_800.0, ..first });
        orbit.add(first);
        orbit.add(GlonassEphemeris { tau_s: 1.0, ..first });
        let (satellite, toe) = (first.satellite, first.toe);
        assert_eq!(orbit.nearest(toe).unwrap().tau_s, 1.0);
        assert_eq!(orbit.nearest(toe + 899.0).unwrap().tau_s, 1.0);
        assert_eq!(orbit.nearest(toe + 901.0).unwrap().toe, toe + 1_800.0);
        assert!(orbit.state(satellite, toe - 1_801.0).is_err());
        assert!(orbit.state(satellite, toe + 3_599.0).is_ok());
    }

    #[test]
    fn health_is_the_word_and_the_flags() {
        let with = |health, health_flags| GlonassEphemeris { health, health_flags, ..message() }.is_healthy();
        assert!(with(Some(0), None) && with(None, None) && with(Some(0), Some(0b011)) && with(None, Some(0)));
        assert!(!with(Some(1), None) && !with(Some(0), Some(0b111)) && !with(Some(0), Some(0b010)));
    }

    #[test]
    fn an_absurd_time_is_harmless() {
        let state = message().state(GpsTime::from_nanos(i64::MIN));
        assert!(state.position.is_finite() && state.clock_s.is_finite());
    }
}
