//! The hub's estimator: aligned epochs in, fused and constrained epochs out. No I/O.

use crate::constraint::{Constraint, ConstraintAction, ConstraintOptions, Distance, constrain};
use crate::filter::{FilterOptions, JointFilter, PhoneState, Start};
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;
use crate::wire::EpochMessage;

/// A constraint and when it holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduledConstraint {
    /// The constraint; phones by their index in the group.
    pub constraint: Constraint,
    /// First instant at which it holds; `None`: always.
    pub from_gps: Option<GpsTime>,
    /// Last instant at which it holds; `None`: always.
    pub to_gps: Option<GpsTime>,
}

/// What the engine may be told.
#[derive(Clone, Debug)]
pub struct EngineOptions {
    /// The joint filter.
    pub filter: FilterOptions,
    /// How constraints act.
    pub constraints: ConstraintOptions,
    /// Whether the constrained state is what the filter goes on with (as in Peng 2023), so that phones help each other
    /// over time; without, constraints act on what is given out only. With it, quantities that truly are near
    /// their bound are drawn inwards, for a bound that holds at every epoch is counted at every epoch.
    pub feedback: bool,
}

impl Default for EngineOptions {
    fn default() -> Self {
        Self { filter: FilterOptions::default(), constraints: ConstraintOptions::default(), feedback: true }
    }
}

impl EngineOptions {
    /// Filter and constraints of Peng 2023.
    pub fn peng2023() -> Self {
        Self { filter: FilterOptions::peng2023(), constraints: ConstraintOptions::peng2023(), feedback: true }
    }
}

/// One fused epoch of the group.
#[derive(Clone, Debug)]
pub struct FusedEpoch {
    /// The common time, GPS time: the latest of the phones' receive times.
    pub time_gps: GpsTime,
    /// One entry per phone of the group, in the group's order.
    pub phones: Vec<FusedPhone>,
    /// What every constraint did that was not satisfied already, by its place among those of the engine
    /// ([`Engine::constraints`]).
    pub actions: Vec<ConstraintAction>,
    /// All pairs under a distance constraint.
    pub distances: Vec<PairDistance>,
}

/// One phone in a fused epoch.
#[derive(Clone, Debug)]
pub struct FusedPhone {
    /// Its message of this epoch; `None` when it had none.
    pub message: Option<EpochMessage>,
    /// Its fused state at the common time; `None` until it is initialised.
    pub state: Option<PhoneState>,
}

/// The distance of two phones after fusion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairDistance {
    /// Indices of the phones.
    pub phones: (usize, usize),
    /// Distance, m.
    pub distance_m: f64,
    /// Its standard deviation by the joint covariance, m.
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

    /// Fuses the messages of one aligned epoch: at most one per phone, `None` where a phone has none. Each message updates
    /// the filter at its own receive time, in order of time; constraints act at the latest of them.
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

    /// Forgets all states: the next messages may be earlier than the last ones. The phones begin anew with their next solutions.
    pub fn restart(&mut self) {
        self.filter = JointFilter::new(self.options.filter);
    }

    /// The constraints, in force or not.
    pub fn constraints(&self) -> &[ScheduledConstraint] {
        &self.constraints
    }

    /// What was skipped so far.
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

    /// A state that is not finite or not positive any more costs the phone that brought it; only if that does not help, all.
    /// Phones come back with their next solution.
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

    /// Takes out phones that have been silent for too long to predict.
    fn drop_silent(&mut self, time_gps: GpsTime) {
        for (phone, silence_s) in self.filter.drop_silent(time_gps) {
            let name = self.phones.get(phone).map_or("?", String::as_str);
            self.skips
                .add(Reason::SilentPhoneDropped, || format!("{name} at {time_gps} after {silence_s:.1} s"));
        }
    }

    /// The constraints in force whose phones are all present: their places among all, and themselves with phones by slot.
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
        let (mean, covariance) = self.filter.law_mut();
        let actions = constrain(mean, covariance, &on_slots, &self.options.constraints);
        let named = |action: ConstraintAction| {
            // Those who read it know phones and constraints by their place in the group.
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
