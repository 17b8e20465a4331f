//! Own motion of a phone, which is added to that of its vehicle.
//!
//! The velocity relative to the vehicle is constant before the first pulse of acceleration, and changes by acceleration × time within each.
//! East and north are those of the scenario's origin; up is away from the curved Earth, so that what moves horizontally keeps its height.

use nalgebra::Vector3;

use crate::frames::Enu;

/// Time in which a phone reaches the speed of its departure, s.
const DEPARTURE_S: f64 = 1.0;

/// A constant acceleration for some time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccelerationPulse {
    /// Begin after that of the scenario, s.
    pub from_s: f64,
    /// Duration, s.
    pub duration_s: f64,
    /// Acceleration relative to the vehicle, m/s².
    pub acceleration_mps2: Enu,
}

/// Motion of a phone relative to its vehicle; by default none.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnMotion {
    /// Relative velocity before the first pulse, m/s. At the scenario's start the phone is in its mount.
    pub initial_velocity_mps: Enu,
    /// Accelerations, which add up where they overlap.
    pub pulses: Vec<AccelerationPulse>,
}

impl Default for OwnMotion {
    fn default() -> Self {
        Self::with_velocity(Enu { east: 0.0, north: 0.0, up: 0.0 })
    }
}

impl OwnMotion {
    /// A constant velocity relative to the vehicle from the start on, m/s; with a standing vehicle the velocity itself.
    pub const fn with_velocity(velocity_mps: Enu) -> Self {
        Self { initial_velocity_mps: velocity_mps, pulses: Vec::new() }
    }

    /// A phone that leaves its mount at `from_s` and moves on with a constant velocity relative to the vehicle, which it reaches within 1 s.
    pub fn departure(from_s: f64, velocity_mps: Enu) -> Self {
        let acceleration_mps2 = (velocity_mps.vector() / DEPARTURE_S).into();
        Self::default().and(AccelerationPulse { from_s, duration_s: DEPARTURE_S, acceleration_mps2 })
    }

    /// The same motion with one more pulse.
    #[must_use]
    pub fn and(mut self, pulse: AccelerationPulse) -> Self {
        self.pulses.push(pulse);
        self
    }

    /// Displacement from the mount (m) and its rate (m/s) at `time_s` since the scenario's start.
    pub(super) fn at(&self, time_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let initial = self.initial_velocity_mps.vector();
        let start = (initial * time_s, initial);
        self.pulses.iter().fold(start, |(displacement, velocity), pulse| {
            let (by_pulse, rate) = pulse.at(time_s);
            (displacement + by_pulse, velocity + rate)
        })
    }

    /// Whether the phone stays in its mount.
    pub(super) fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

impl AccelerationPulse {
    fn at(&self, time_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let acceleration = self.acceleration_mps2.vector();
        let since_s = (time_s - self.from_s).max(0.0);
        let within_s = since_s.min(self.duration_s);
        let velocity = acceleration * within_s;
        (velocity * (since_s - 0.5 * within_s), velocity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pulse(from_s: f64, duration_s: f64, east: f64, up: f64) -> AccelerationPulse {
        AccelerationPulse { from_s, duration_s, acceleration_mps2: Enu { east, north: 0.0, up } }
    }

    #[test]
    fn pulses_add_up_to_their_velocities_and_ways() {
        // 10 m/s² for 3 s gives 30 m/s and 45 m, and 60 m more in the next 2 s.
        let motion = OwnMotion::default().and(pulse(10.0, 3.0, 10.0, 0.0)).and(pulse(12.0, 1.0, 0.0, 2.0));
        for (time_s, displacement_m, velocity_mps) in [
            (-5.0, [0.0; 3], [0.0; 3]),
            (10.0, [0.0; 3], [0.0; 3]),
            (11.0, [5.0, 0.0, 0.0], [10.0, 0.0, 0.0]),
            (13.0, [45.0, 0.0, 1.0], [30.0, 0.0, 2.0]),
            (15.0, [105.0, 0.0, 5.0], [30.0, 0.0, 2.0]),
        ] {
            assert_eq!(motion.at(time_s), (displacement_m.into(), velocity_mps.into()), "{time_s} s");
        }
    }

    #[test]
    fn a_departure_reaches_its_velocity_in_a_second() {
        let motion = OwnMotion::departure(100.0, Enu { east: 0.0, north: 0.3, up: 0.0 });
        let (displacement, velocity) = motion.at(111.0);
        assert!((displacement.y - 3.15).abs() < 1e-12 && (velocity.y - 0.3).abs() < 1e-12);
        assert_eq!(motion.at(100.0).0.norm(), 0.0);
        assert!(!motion.is_none() && OwnMotion::default().is_none());
        assert!(!OwnMotion::with_velocity(Enu { east: 250.0, north: 0.0, up: 0.0 }).is_none());
    }
}
