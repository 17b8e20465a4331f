//! Speed of the lead vehicle over time: constant speeds and transitions with bounded acceleration and jerk.
//!
//! A transition from v₀ to v₁ over T is v(τ) = v₀ + (v₁ − v₀)·(τ − sin(2πτ)/2π), τ ∈ [0, 1]. Its maximum acceleration
//! is 2|Δv|/T and its maximum jerk 2π|Δv|/T², so T follows from the limits. Distances are closed forms.

use std::f64::consts::TAU;

/// Acceleration limit, m/s².
pub(super) const MAXIMUM_ACCELERATION_MPS2: f64 = 2.0;
/// Jerk limit, m/s³.
pub(super) const MAXIMUM_JERK_MPS3: f64 = 1.5;
/// Repeated pattern: speeds (m/s) and their durations (s), each followed by the transition to the next.
const PATTERN: [(f64, f64); 7] =
    [(0.0, 8.0), (14.0, 45.0), (9.0, 20.0), (14.0, 40.0), (0.0, 18.0), (11.0, 35.0), (14.0, 50.0)];

/// A period with one law of motion.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Phase {
    start_s: f64,
    start_m: f64,
    duration_s: f64,
    from_mps: f64,
    to_mps: f64,
}

/// Distance and speed along the road at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Distance since the start, m.
    pub distance_m: f64,
    /// Speed, m/s, ≥ 0.
    pub speed_mps: f64,
}

/// Progress of the lead vehicle. Before time zero it stands at zero; afterwards the pattern repeats without end.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedProfile {
    phases: Vec<Phase>,
    period_s: f64,
    period_m: f64,
}

impl SpeedProfile {
    /// Town traffic: standing, 14 m/s, slower stretches, a red light.
    pub fn town() -> Self {
        Self::repeating(&PATTERN)
    }

    /// A standing vehicle.
    pub fn standing() -> Self {
        Self::repeating(&[(0.0, 60.0)])
    }

    fn repeating(pattern: &[(f64, f64)]) -> Self {
        let mut phases = Vec::with_capacity(2 * pattern.len());
        let (mut start_s, mut start_m) = (0.0, 0.0);
        let next_speeds = pattern.iter().cycle().skip(1).map(|(speed, _)| *speed);
        for (&(speed_mps, hold_s), next_mps) in pattern.iter().zip(next_speeds) {
            let transition_s = transition_duration_s(next_mps - speed_mps);
            let both = [(hold_s, speed_mps), (transition_s, next_mps)];
            for (duration_s, to_mps) in both.into_iter().filter(|(duration_s, _)| *duration_s > 0.0) {
                let phase = Phase { start_s, start_m, duration_s, from_mps: speed_mps, to_mps };
                phases.push(phase);
                start_s += duration_s;
                start_m += 0.5 * (speed_mps + to_mps) * duration_s;
            }
        }
        Self { phases, period_s: start_s, period_m: start_m }
    }

    /// Maximum speed, m/s.
    pub fn maximum_speed_mps(&self) -> f64 {
        self.phases.iter().map(|phase| phase.from_mps).fold(0.0, f64::max)
    }

    /// Progress at `time_s` since the start.
    pub fn at(&self, time_s: f64) -> Progress {
        if time_s <= 0.0 {
            return Progress { distance_m: 0.0, speed_mps: 0.0 };
        }
        let periods = (time_s / self.period_s).floor();
        let within_s = time_s - periods * self.period_s;
        let index = self.phases.partition_point(|phase| phase.start_s <= within_s).saturating_sub(1);
        let progress = self.phases.get(index).map_or_else(
            || Progress { distance_m: 0.0, speed_mps: 0.0 },
            |phase| phase.at(within_s - phase.start_s),
        );
        Progress { distance_m: progress.distance_m + periods * self.period_m, ..progress }
    }
}

impl Phase {
    fn at(&self, elapsed_s: f64) -> Progress {
        let fraction = (elapsed_s / self.duration_s).clamp(0.0, 1.0);
        let change_mps = self.to_mps - self.from_mps;
        let (sin, cos) = (TAU * fraction).sin_cos();
        let shape = fraction - sin / TAU;
        let integral = 0.5 * fraction * fraction + (cos - 1.0) / (TAU * TAU);
        Progress {
            distance_m: self.start_m + self.from_mps * elapsed_s + change_mps * self.duration_s * integral,
            speed_mps: (self.from_mps + change_mps * shape).max(0.0),
        }
    }
}

fn transition_duration_s(change_mps: f64) -> f64 {
    let by_acceleration = 2.0 * change_mps.abs() / MAXIMUM_ACCELERATION_MPS2;
    let by_jerk = (TAU * change_mps.abs() / MAXIMUM_JERK_MPS3).sqrt();
    by_acceleration.max(by_jerk)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speed_is_the_derivative_and_the_limits_hold() {
        let profile = SpeedProfile::town();
        let h = 1e-3;
        let speed = |t: f64| profile.at(t).speed_mps;
        let mut standing = 0;
        for step in 1..12_000 {
            let t = f64::from(step) * 0.1;
            let derivative = (profile.at(t + h).distance_m - profile.at(t - h).distance_m) / (2.0 * h);
            assert!((derivative - speed(t)).abs() < 1e-5, "at {t}: {derivative} {}", speed(t));
            let acceleration = (speed(t + h) - speed(t - h)) / (2.0 * h);
            assert!(acceleration.abs() < MAXIMUM_ACCELERATION_MPS2 * 1.000_1, "at {t}: {acceleration}");
            let h = 0.05;
            let jerk = (speed(t + h) - 2.0 * speed(t) + speed(t - h)) / (h * h);
            assert!(jerk.abs() < MAXIMUM_JERK_MPS3 * 1.01, "at {t}: {jerk}");
            assert!(speed(t) <= profile.maximum_speed_mps() + 1e-12);
            standing += i32::from(speed(t) == 0.0);
        }
        assert!(standing > 500, "it stands at lights: {standing}");
    }

    #[test]
    fn what_stands_stays_where_it_is() {
        let profile = SpeedProfile::standing();
        for time_s in [0.0, 30.0, 60.0, 1e5] {
            assert_eq!(profile.at(time_s), Progress { distance_m: 0.0, speed_mps: 0.0 });
        }
        assert_eq!(profile.maximum_speed_mps(), 0.0);
    }
}
