//! Standing still, by Doppler.
//!
//! The velocity of each epoch by its range rates alone, averaged over some seconds, tells a phone that stands from one that creeps, whatever
//! the filter believes. A phone that stands gets its velocity as a measurement: zero. Between epochs tied by changes of range (see
//! [`super::changes`]) that is known better already.

use nalgebra::Vector3;

use super::JointFilter;
use super::information::Information;

/// Time over which velocities are averaged, s.
const AVERAGED_S: f64 = 4.0;
/// Averaged speed below which a phone stands, and above which one that stood goes, m/s.
const STANDS_MPS: f64 = 0.25;
const GOES_MPS: f64 = 0.4;
/// Speed of one epoch at which a phone goes at once, m/s.
const STARTS_MPS: f64 = 0.6;
/// Standard deviation of the velocity of a phone that stands, m/s: a creeping phone may be as fast without being noticed.
const SIGMA_MPS: f64 = 0.1;
/// Share of the full average from which it counts.
const ENOUGH: f64 = 0.6;

/// Velocities of late, and what they say.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Standing {
    sum: Vector3<f64>,
    weight: f64,
    stands: bool,
}

impl Standing {
    /// Whether the phone stood at the last epoch.
    pub const fn stands(&self) -> bool {
        self.stands
    }

    /// Takes the velocity of an epoch (m/s) `interval_s` after the one before; `None` if its range rates tell none. Returns whether the phone
    /// stands.
    pub fn take(&mut self, interval_s: f64, velocity: Option<Vector3<f64>>) -> bool {
        let Some(velocity) = velocity else { return false };
        let keep = (-interval_s.max(0.0) / AVERAGED_S).exp();
        self.sum = self.sum * keep + velocity * (1.0 - keep);
        self.weight = self.weight * keep + (1.0 - keep);
        if velocity.norm() > STARTS_MPS {
            *self = Self::default();
        } else if self.weight >= ENOUGH {
            let limit_mps = if self.stands { GOES_MPS } else { STANDS_MPS };
            self.stands = (self.sum / self.weight).norm() < limit_mps;
        }
        self.stands
    }
}

impl JointFilter {
    /// Takes the epoch's velocity by range rates, the solution of `rates` about the state's `predicted` velocity. Gives a phone that stands,
    /// and whose epochs no changes of range tie, a velocity of zero. Returns whether it stands.
    pub(super) fn stand(&mut self, slot: usize, predicted: &Vector3<f64>, rates: &Information) -> bool {
        let interval_s = self.silence_s(slot);
        let change = rates.solution().map(|change| Vector3::new(change[0], change[1], change[2]));
        let stands = self.slots[slot].standing.take(interval_s, change.map(|change| predicted + change));
        if !stands || self.slots[slot].is_tied || !self.options.use_standing {
            return stands;
        }
        let at = self.slots[slot].at + 3;
        let states = [at, at + 1, at + 2];
        let zero = Information::of_values(&-self.mean.fixed_rows::<3>(at), SIGMA_MPS);
        self.apply_unshared(&states, &zero);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::{FilterOptions, Start};
    use crate::measurement::CorrectedObservation;
    use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};
    use crate::time::GpsTime;

    /// Whether a phone stands after each second of these speeds, m/s.
    fn stands(speeds: impl IntoIterator<Item = f64>) -> Vec<bool> {
        let mut standing = Standing::default();
        let along = Vector3::new(0.6, 0.0, 0.8);
        speeds.into_iter().map(|speed| standing.take(1.0, Some(along * speed))).collect()
    }

    #[test]
    fn a_phone_stands_after_some_seconds_and_goes_at_once() {
        let stop_and_go = [3.0, 1.5].into_iter().chain([0.0; 8]).chain([1.5, 3.0, 3.0]);
        let said = stands(stop_and_go);
        let first = said.iter().position(|stands| *stands).unwrap();
        assert!((5..8).contains(&first) && said[first..10].iter().all(|stands| *stands), "{said:?}");
        assert!(said[10..].iter().all(|stands| !stands), "{said:?}");
    }

    #[test]
    fn creeping_is_no_standing_and_noise_is_no_creeping() {
        assert!(stands([0.3; 60]).iter().all(|stands| !stands));
        // One that stood creeps away.
        let said = stands([0.0; 10].into_iter().chain([0.6; 10]));
        assert!(said[9] && !said[15], "{said:?}");
        let noisy = stands((0..60).map(|k| [0.5, -0.4, 0.1, -0.3, 0.2][k % 5]));
        assert!(noisy[10..].iter().all(|stands| *stands), "{noisy:?}");
    }

    /// A phone whose Dopplers, wrong by a metre a second each in turn, say that it stands on the average.
    #[test]
    fn a_phone_that_stands_is_held() {
        let receiver = Receiver::in_wuhan();
        let at = |second: f64| GpsTime::from_week_tow(2118, second);
        let speed_after = |use_standing, speed_mps: f64| {
            let options = FilterOptions { use_standing, ..FilterOptions::default() };
            let mut filter = JointFilter::new(options);
            let (position, position_covariance) = (receiver.position, nalgebra::Matrix3::identity());
            filter.insert(0, at(0.0), &Start { position, position_covariance, velocity: None });
            let mut squares: f64 = 0.0;
            for second in 1..=60_u8 {
                filter.predict(at(f64::from(second)));
                let observe = |(index, observation): (usize, CorrectedObservation)| {
                    let mut observation = observation;
                    let u = (observation.satellite_position - receiver.position).0.normalize();
                    let moving = u.dot(&(receiver.velocity.0 - Vector3::new(speed_mps, 0.0, 0.0)));
                    let error = if (index + usize::from(second)) % 3 == 0 { 0.4 } else { -0.2 };
                    if let Some(rate) = &mut observation.range_rate {
                        rate.range_rate_mps += moving + error;
                        rate.sigma_mps = 0.5;
                    }
                    observation
                };
                let observations: Vec<_> =
                    receiver.observe(&OPEN_SKY_DEG).into_iter().enumerate().map(observe).collect();
                filter.update(0, &observations);
                let off = filter.state(0).unwrap().velocity().0 - Vector3::new(speed_mps, 0.0, 0.0);
                squares += if second > 20 { off.norm_squared() } else { 0.0 };
            }
            (squares / 40.0).sqrt()
        };
        let (held, free) = (speed_after(true, 0.0), speed_after(false, 0.0));
        assert!(held < 0.7 * free, "{held} against {free} m/s");
        let (moving, free) = (speed_after(true, 2.0), speed_after(false, 2.0));
        assert_eq!(moving, free, "a phone that moves is left alone");
    }
}
