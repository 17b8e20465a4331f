//! Which states of the joint distribution belong to which phone.

use nalgebra::Vector3;

use super::STATES_PER_PHONE;
use super::noise_level::NoiseLevel;
use super::standing::Standing;
use crate::frames::Ecef;
use crate::gnss::ClockGroup;
use crate::time::GpsTime;

/// Number of states of a kept position.
pub(super) const KEPT_STATES: usize = 3;

/// Number of steps between measurements from which a phone's interval is known.
const STEPS: usize = 3;

/// States of one phone: position, velocity, acceleration, a bias for each clock group beside the reference, and, from the end of an epoch to
/// the phases of the next, the position at that epoch.
#[derive(Clone, Debug)]
pub(super) struct Slot {
    pub phone: usize,
    /// Offset of the first state.
    pub at: usize,
    pub up: Vector3<f64>,
    pub up_at: Ecef,
    /// Time of the last measurement.
    pub measured: GpsTime,
    /// Clock group to which the biases of the others refer.
    pub reference: Option<ClockGroup>,
    /// Clock groups with a bias, in the order of their states.
    pub biases: Vec<ClockGroup>,
    /// Time of the position that is kept as three states behind the biases, if it is (stochastic clone).
    pub kept: Option<GpsTime>,
    /// Whether changes of range tie this epoch's position to that of the epoch before.
    pub is_tied: bool,
    /// Number of consecutive updates that rejected most of their pseudoranges.
    pub codes_rejected: u32,
    /// Number of consecutive updates that rejected most of their range rates.
    pub rates_rejected: u32,
    /// Number of consecutive reliable solutions that lie far from the prediction.
    pub far: u32,
    pub noise_level: NoiseLevel,
    pub standing: Standing,
}

impl Slot {
    /// Number of states.
    pub fn len(&self) -> usize {
        STATES_PER_PHONE + self.biases.len() + if self.kept.is_some() { KEPT_STATES } else { 0 }
    }

    /// Offset of the first bias; the kept position follows the biases.
    pub const fn first_bias(&self) -> usize {
        self.at + STATES_PER_PHONE
    }

    /// Offset behind the last bias: that of the kept position.
    pub const fn behind_biases(&self) -> usize {
        self.first_bias() + self.biases.len()
    }

    /// Place of a group among the biases; `None` for the reference and for a group without a state.
    pub fn bias(&self, group: ClockGroup) -> Option<usize> {
        self.biases.iter().position(|known| *known == group)
    }
}

/// Interval between a phone's measurements: the shortest of the last three steps, so that single gaps do not count.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Interval {
    last: Option<GpsTime>,
    steps_s: [Option<f64>; STEPS],
}

impl Interval {
    /// Takes the time of a measurement.
    pub fn take(&mut self, time_gps: GpsTime) {
        if let Some(step_s) = self.last.map(|last| time_gps - last).filter(|step_s| *step_s > 0.0) {
            self.steps_s.rotate_right(1);
            self.steps_s[0] = Some(step_s);
        }
        self.last = Some(time_gps);
    }

    /// The interval, s; `None` before the second measurement.
    pub fn seconds(&self) -> Option<f64> {
        self.steps_s.iter().flatten().copied().min_by(f64::total_cmp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_is_no_interval_and_a_new_rate_is_one() {
        let mut interval = Interval::default();
        let mut after = |seconds: f64| {
            interval.take(GpsTime::from_week_tow(2118, seconds));
            interval.seconds()
        };
        assert_eq!(after(0.0), None);
        assert_eq!(after(1.0), Some(1.0));
        assert_eq!((after(61.0), after(62.0)), (Some(1.0), Some(1.0)));
        assert_eq!((after(92.0), after(122.0), after(152.0)), (Some(1.0), Some(1.0), Some(30.0)));
    }
}
