//! Biases between a receiver's clock groups.
//!
//! The receiver clock is white from epoch to epoch, but the differences between constellations and bands hardly change: they come from
//! delays in the receiver and from the systems' time scales. Each group beside the first has its difference as a state that walks slowly. So
//! a lone satellite of a system counts, and five satellites of three systems carry a phone.

use super::JointFilter;
use super::weights::median;
use crate::gnss::ClockGroup;
use crate::solve::elimination::Row;
use crate::solve::groups::ClockGroups;

/// Standard deviation of a new bias about the median of its first epoch, m.
const NEW_BIAS_SIGMA_M: f64 = 1e4;
/// Difference of a group's median innovation from its bias beyond which the bias has jumped, m and in standard deviations.
const JUMP_M: f64 = 15.0;
const JUMP_SIGMAS: f64 = 5.0;

/// Innovation of one observation before its bias: clock group, value (m) and weight (1/m²).
type Innovation = (ClockGroup, f64, f64);

impl JointFilter {
    /// Prepares the bias states of a phone for the code rows of an epoch about its predicted position: new groups get a state, and one that
    /// has jumped is estimated anew.
    pub(super) fn prepare_biases(&mut self, slot: usize, groups: &ClockGroups, code: &[Row]) {
        let innovation = |row: &Row| -> Innovation { (groups.list()[row.group], row.y, row.weight) };
        let innovations: Vec<Innovation> = code.iter().map(innovation).collect();
        let size = |group: &ClockGroup| innovations.iter().filter(|(of, ..)| of == group).count();
        let largest = groups.list().iter().copied().max_by_key(size);
        let Some(reference) = self.slots[slot].reference.or(largest) else { return };
        self.slots[slot].reference = Some(reference);
        let clock_m = self.clock_m(slot, reference, &innovations);
        let is_free = self.options.bias_walk_m2ps.is_infinite();
        for group in groups.list().iter().copied().filter(|group| *group != reference) {
            let own = of_group(&innovations, group);
            let (count, weight) = (own.len(), own.iter().map(|(_, weight)| weight).sum());
            let measured_m = median(own) - clock_m;
            match self.slots[slot].bias(group) {
                Some(place) => {
                    let index = self.slots[slot].first_bias() + place;
                    if is_free || (count > 1 && self.has_jumped(index, measured_m, weight)) {
                        self.reopen(index, measured_m, NEW_BIAS_SIGMA_M.powi(2));
                    }
                }
                None => self.insert_bias(slot, group, measured_m, NEW_BIAS_SIGMA_M.powi(2)),
            }
        }
    }

    /// Clock of the reference group in this epoch: its own median, or, without one of its satellites, that of the groups with known biases.
    fn clock_m(&self, slot: usize, reference: ClockGroup, innovations: &[Innovation]) -> f64 {
        let own = of_group(innovations, reference);
        if !own.is_empty() {
            return median(own);
        }
        let known = innovations.iter().filter_map(|(group, y, weight)| {
            let place = self.slots[slot].bias(*group)?;
            Some((y - self.mean[self.slots[slot].first_bias() + place], *weight))
        });
        median(known.collect())
    }

    /// Whether the median innovation of several satellites of a group, with this sum of weights, contradicts its bias. One satellite alone may
    /// be an outlier.
    fn has_jumped(&self, index: usize, measured_m: f64, weight: f64) -> bool {
        let off_m = (measured_m - self.mean[index]).abs();
        let sigma_m = (self.covariance[(index, index)] + 1.0 / weight).sqrt();
        off_m > JUMP_M && off_m > JUMP_SIGMAS * sigma_m
    }
}

/// Values and weights of one group.
fn of_group(innovations: &[Innovation], group: ClockGroup) -> Vec<(f64, f64)> {
    innovations.iter().filter(|(of, ..)| *of == group).map(|(_, y, weight)| (*y, *weight)).collect()
}
