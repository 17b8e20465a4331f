//! Biases between a receiver's clock groups.
//!
//! The receiver clock is white from epoch to epoch, but the differences between constellations and bands hardly change: they come from
//! delays in the receiver and from the systems' time scales. Each group beside the first has its difference as a state that walks slowly. So
//! a lone satellite of a system counts, and five satellites of three systems carry a phone.

use super::JointFilter;
use super::weights::median;
use crate::gnss::ClockGroup;
use crate::measurement::CorrectedObservation;
use crate::solve::groups::ClockGroups;
use crate::solve::position::code_row;

/// Standard deviation of a new bias about the median of its first epoch, m.
const NEW_BIAS_SIGMA_M: f64 = 1e4;
/// Difference of a group's median innovation from its bias beyond which the bias has jumped, m and in standard deviations.
const JUMP_M: f64 = 15.0;
const JUMP_SIGMAS: f64 = 5.0;

impl JointFilter {
    /// Prepares the bias states of a phone for an epoch's observations: new groups get a state, and one that has jumped is estimated anew.
    pub(super) fn prepare_biases(&mut self, slot: usize, observations: &[&CorrectedObservation]) {
        let groups = ClockGroups::of(observations.iter().copied());
        let position = self.position(slot);
        let innovations = |group: ClockGroup| -> Vec<(f64, f64)> {
            let of_group = observations.iter().filter(|o| o.clock_group() == group);
            of_group.map(|o| code_row(o, position, &groups)).map(|row| (row.y, row.weight)).collect()
        };
        let largest = groups.list().iter().copied().max_by_key(|group| innovations(*group).len());
        let Some(reference) = self.slots[slot].reference.or(largest) else { return };
        self.slots[slot].reference = Some(reference);
        let clock_m = self.clock_m(slot, reference, &groups, &innovations);
        let is_free = self.options.bias_walk_m2ps.is_infinite();
        for group in groups.list().iter().copied().filter(|group| *group != reference) {
            let measured_m = median(innovations(group)) - clock_m;
            match self.slots[slot].bias(group) {
                Some(place) => {
                    let index = self.slots[slot].at + super::STATES_PER_PHONE + place;
                    if is_free || self.has_jumped(index, measured_m, &innovations(group)) {
                        self.reopen(index, measured_m, NEW_BIAS_SIGMA_M.powi(2));
                    }
                }
                None => self.insert_bias(slot, group, measured_m, NEW_BIAS_SIGMA_M.powi(2)),
            }
        }
    }

    /// Clock of the reference group in this epoch: its own median, or, without one of its satellites, that of the groups with known biases.
    fn clock_m(
        &self,
        slot: usize,
        reference: ClockGroup,
        groups: &ClockGroups,
        innovations: &impl Fn(ClockGroup) -> Vec<(f64, f64)>,
    ) -> f64 {
        let own = innovations(reference);
        if !own.is_empty() {
            return median(own);
        }
        let known = groups.list().iter().filter_map(|group| {
            let place = self.slots[slot].bias(*group)?;
            let bias_m = self.mean[self.slots[slot].at + super::STATES_PER_PHONE + place];
            Some(innovations(*group).into_iter().map(move |(y, weight)| (y - bias_m, weight)))
        });
        median(known.flatten().collect())
    }

    /// Whether the innovations of a group contradict its bias together. One satellite alone may be an outlier.
    fn has_jumped(&self, index: usize, measured_m: f64, innovations: &[(f64, f64)]) -> bool {
        let off_m = (measured_m - self.mean[index]).abs();
        let weight: f64 = innovations.iter().map(|(_, weight)| weight).sum();
        let sigma_m = (self.covariance[(index, index)] + 1.0 / weight).sqrt();
        innovations.len() > 1 && off_m > JUMP_M && off_m > JUMP_SIGMAS * sigma_m
    }
}
