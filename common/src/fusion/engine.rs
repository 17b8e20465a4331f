//! Joint estimator of the hub: its input are aligned epochs, its output fused and constrained epochs. No I/O.

use crate::constraint::{Constraint, ConstraintAction, ConstraintOptions, Distance, constrain};
use crate::filter::{FilterOptions, JointFilter, PhoneState, Start};
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;
use crate::wire::EpochMessage;

/// A constraint and its period of validity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduledConstraint {
    /// The constraint; phones by their index in the group.
    pub constraint: Constraint,
    /// Start of validity, inclusive; `None`: from the beginning.
    pub from_gps: Option<GpsTime>,
    /// End of validity, inclusive; `None`: to the end.
    pub to_gps: Option<GpsTime>,
}

/// Options of the engine.
#[derive(Clone, Debug)]
pub struct EngineOptions {
    /// Options of the joint filter.
    pub filter: FilterOptions,
    /// Options of the constraints.
    pub constraints: ConstraintOptions,
    /// Whether the filter continues with the constrained state (as in Peng 2023), so that phones improve each other over time. Without
    /// feedback constraints only affect the output. With feedback a quantity near its bound is biased inwards, because a bound that holds
    /// at every epoch is applied at every epoch.
    pub feedback: bool,
}

impl Default for EngineOptions {
    fn default() -> Self {
        Self { filter: FilterOptions::default(), constraints: ConstraintOptions::default(), feedback: true }
    }
}

impl EngineOptions {
    /// Options of filter and constraints as in Peng 2023.
    pub fn peng2023() -> Self {
        Self { filter: FilterOptions::peng2023(), constraints: ConstraintOptions::peng2023(), feedback: true }
    }
}

/// One fused epoch of the group.
#[derive(Clone, Debug)]
pub struct FusedEpoch {
    /// Latest receive time of the phones, GPS time.
    pub time_gps: GpsTime,
    /// One entry per phone of the group, in the group's order.
    pub phones: Vec<FusedPhone>,
    /// Effects of the constraints that were not satisfied already; `index` is the place in [`Engine::constraints`].
    pub actions: Vec<ConstraintAction>,
    /// Distances of all pairs under a distance constraint.
    pub distances: Vec<PairDistance>,
}

/// One phone in a fused epoch.
#[derive(Clone, Debug)]
pub struct FusedPhone {
    /// Message of the phone for this epoch; `None` if there is none.
    pub message: Option<EpochMessage>,
    /// Fused state at the common time; `None` before initialisation.
    pub state: Option<PhoneState>,
}

/// Distance between two phones after fusion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairDistance {
    /// Indices of the phones.
    pub phones: (usize, usize),
    /// Distance, m.
    pub distance_m: f64,
    /// Standard deviation of the distance from the joint covariance, m.
    pub sigma_m: f64,
    /// Lower bound, m.
    pub minimum_m: f64,
    /// Upper bound, m.
    pub maximum_m: f64,
}

/// The joint estimator of a group.
pub struct Engine {
    phones: Vec<String>,
    constraints: Vec<ScheduledConstraint>,
    options: EngineOptions,
    filter: JointFilter,
    skips: Skips,
}

impl Engine {
    /// An engine for the named phones.
    pub fn new(phones: &[String], constraints: Vec<ScheduledConstraint>, options: EngineOptions) -> Self {
        let filter = JointFilter::new(options.filter);
        Self { phones: phones.to_vec(), constraints, options, filter, skips: Skips::default() }
    }

    /// Fuses the messages of one aligned epoch, at most one per phone. Each message updates the filter at its own receive time, in order of
    /// time; constraints are applied at the latest of these times.
    pub fn step(&mut self, messages: Vec<Option<EpochMessage>>) -> FusedEpoch {
        let mut order: Vec<(GpsTime, usize)> = messages
            .iter()
            .enumerate()
            .filter_map(|(phone, message)| message.as_ref().map(|m| (m.time_gps, phone)))
            .collect();
        order.sort_unstable();
        for (_, phone) in &order {
            if let Some(Some(message)) = messages.get(*phone) {
                self.admit(*phone, message);
            }
        }
        let time_gps = order.last().map_or(self.filter.time_gps(), |(time, _)| *time);
        let kept = (!self.options.feedback).then(|| self.filter.clone());
        let actions = self.constrain(time_gps);
        let distances = self.distances(time_gps);
        let phones = messages
            .into_iter()
            .enumerate()
            .map(|(phone, message)| FusedPhone {
                message,
                state: self.filter.slot(phone).and_then(|slot| self.filter.state(slot)),
            })
            .collect();
        if let Some(unconstrained) = kept {
            self.filter = unconstrained;
        }
        FusedEpoch { time_gps, phones, actions, distances }
    }

    /// Discards all states, so that the next messages may be earlier than the last ones. Phones restart from their next solutions.
    pub fn restart(&mut self) {
        self.filter = JointFilter::new(self.options.filter);
    }

    /// All constraints, whether valid now or not.
    pub fn constraints(&self) -> &[ScheduledConstraint] {
        &self.constraints
    }

    /// Counts of skipped messages and states by reason.
    pub const fn skips(&self) -> &Skips {
        &self.skips
    }

    fn admit(&mut self, phone: usize, message: &EpochMessage) {
        if !self.filter.is_empty() && message.time_gps < self.filter.time_gps() {
            let (name, time) = (&message.phone, message.time_gps);
            let late_s = self.filter.time_gps() - time;
            self.skips.add(Reason::EpochBeforeFilterTime, || format!("{name} at {time}, {late_s:.3} s late"));
            return;
        }
        self.drop_silent(message.time_gps);
        self.filter.predict(message.time_gps);
        let slot = self.filter.slot(phone);
        let lost = slot.is_some_and(|slot| self.filter.is_lost(slot));
        match (slot, &message.wls) {
            (_, Some(solution)) if slot.is_none() || lost => {
                if lost {
                    self.skips.add(Reason::LostPhoneRestarted, || {
                        format!(
                            "{} at {}: its pseudoranges contradict the prediction",
                            message.phone, message.time_gps
                        )
                    });
                }
                self.filter.insert(
                    phone,
                    message.time_gps,
                    &Start::at_solution(solution, message.raim.verdict),
                );
            }
            (Some(slot), _) if !message.observations.is_empty() => {
                self.filter.update(slot, &message.observations);
            }
            _ => {}
        }
        self.remove_unsound(phone, message);
    }

    /// Removes the phone whose message made the state not finite or not positive definite. If the state is still unsound, the whole filter
    /// restarts.
    /// Phones return with their next solution.
    fn remove_unsound(&mut self, phone: usize, message: &EpochMessage) {
        if self.filter.is_sound() {
            return;
        }
        let describe = || format!("state not sound after {} at {}", message.phone, message.time_gps);
        if let Some(slot) = self.filter.slot(phone) {
            self.filter.remove(slot);
            self.skips.add(Reason::PhoneTakenOutOfFilter, describe);
        }
        if !self.filter.is_sound() {
            self.filter = JointFilter::new(self.options.filter);
            self.skips.add(Reason::JointFilterRestarted, describe);
        }
    }

    /// Removes phones whose silence is too long for prediction.
    fn drop_silent(&mut self, time_gps: GpsTime) {
        for (phone, silence_s) in self.filter.drop_silent(time_gps) {
            let name = self.phones.get(phone).map_or("?", String::as_str);
            self.skips
                .add(Reason::SilentPhoneDropped, || format!("{name} at {time_gps} after {silence_s:.1} s"));
        }
    }

    /// The valid constraints whose phones are all present: index in [`Self::constraints`] and constraint with phones by slot.
    fn in_force(&self, time_gps: GpsTime) -> impl Iterator<Item = (usize, Constraint)> + '_ {
        self.constraints
            .iter()
            .enumerate()
            .filter(move |(_, c)| {
                c.from_gps.is_none_or(|from| from <= time_gps) && c.to_gps.is_none_or(|to| time_gps <= to)
            })
            .filter_map(|(place, c)| Some((place, c.constraint.mapped(|phone| self.filter.slot(phone))?)))
    }

    fn constrain(&mut self, time_gps: GpsTime) -> Vec<ConstraintAction> {
        let (places, on_slots): (Vec<_>, Vec<_>) = self.in_force(time_gps).unzip();
        if on_slots.is_empty() {
            return Vec::new();
        }
        let (mean, covariance) = self.filter.distribution_mut();
        let actions = constrain(mean, covariance, &on_slots, &self.options.constraints);
        let named = |action: ConstraintAction| {
            // Outside the engine phones and constraints are identified by their index in the group.
            let index = *places.get(action.index)?;
            Some(ConstraintAction { index, constraint: self.constraints.get(index)?.constraint, ..action })
        };
        actions.into_iter().filter_map(named).collect()
    }

    fn distances(&self, time_gps: GpsTime) -> Vec<PairDistance> {
        self.in_force(time_gps).filter_map(|(place, on_slots)| self.distance(place, on_slots)).collect()
    }

    fn distance(&self, place: usize, on_slots: Constraint) -> Option<PairDistance> {
        let Constraint::Distance(Distance { phones: [a, b], minimum_m, maximum_m }) = on_slots else {
            return None;
        };
        let &[first, second] = self.constraints.get(place)?.constraint.phones() else { return None };
        let (at, bt) = (self.filter.state(a)?, self.filter.state(b)?);
        Some(PairDistance {
            phones: (first, second),
            distance_m: at.position().distance_m(bt.position()),
            sigma_m: self.filter.distance_sigma_m(a, b)?,
            minimum_m,
            maximum_m,
        })
    }
}

#[cfg(test)]
mod tests;
