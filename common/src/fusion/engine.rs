//! Joint estimator of the hub: its input are aligned epochs, its output fused and constrained epochs. No I/O.

use std::borrow::Cow;

use super::biased::BiasedSatellites;
use super::doubt::{Doubt, Excess};
use super::group::{Filters, GroupState};
use crate::constraint::second::carry;
use crate::constraint::{
    Constrained, ConstrainedState, Constraint, ConstraintAction, ConstraintOptions, ConstraintOutcome,
    Distance, SkipReason, apply, excess_sigmas,
};
use crate::filter::{FilterOptions, PhoneState, UpdateReport};
use crate::integrity::{Cause, Verdict};
use crate::measurement::CorrectedObservation;
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
    /// Whether one joint filter continues with the constrained state, as in Peng 2023. A bound that holds all the time then counts at every
    /// epoch, a quantity near its bound is biased inwards, and a wrong bound spoils the state. Without feedback every phone has a filter
    /// that no constraint touches, and constraints act on the output.
    pub feedback: bool,
    /// Limit, in standard deviations, of the averaged residual of a satellite that all phones contradict; see the module `biased`. Infinite: no
    /// satellite is left out.
    pub biased_sigmas: f64,
}

impl Default for EngineOptions {
    fn default() -> Self {
        Self {
            filter: FilterOptions::default(),
            constraints: ConstraintOptions::default(),
            feedback: false,
            biased_sigmas: 3.5,
        }
    }
}

impl EngineOptions {
    /// Options of filter and constraints as in Peng 2023.
    pub fn peng2023() -> Self {
        Self {
            filter: FilterOptions::peng2023(),
            constraints: ConstraintOptions::peng2023(),
            feedback: true,
            biased_sigmas: f64::INFINITY,
        }
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
#[derive(Clone, Debug, Default)]
pub struct FusedPhone {
    /// Message of the phone for this epoch; `None` if there is none.
    pub message: Option<EpochMessage>,
    /// Fused state at the common time; `None` before initialisation.
    pub state: Option<PhoneState>,
    /// State at the common time without any constraint.
    pub free: Option<PhoneState>,
    /// The verdict on the fused state: that of the message, and unreliable where the phone's measurements doubt a constraint on it; `None`
    /// without a message.
    pub verdict: Option<Verdict>,
    /// What the phone's filter made of the message; `None` without one, or where it started the phone.
    pub update: Option<UpdateReport>,
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
    filters: Filters,
    biased: BiasedSatellites,
    /// One per constraint.
    excesses: Vec<Excess>,
    /// Time of the last fused epoch.
    time_gps: GpsTime,
    skips: Skips,
}

impl Engine {
    /// An engine for the named phones.
    pub fn new(phones: &[String], constraints: Vec<ScheduledConstraint>, options: EngineOptions) -> Self {
        let filters = Filters::new(phones.len(), &options);
        let (phones, time_gps, skips) = (phones.to_vec(), GpsTime::default(), Skips::default());
        let excesses = vec![Excess::default(); constraints.len()];
        let biased = BiasedSatellites::new(options.biased_sigmas);
        Self { phones, constraints, options, filters, biased, excesses, time_gps, skips }
    }

    /// Fuses the messages of one aligned epoch, at most one per phone. Each message updates its phone's filter at its own receive time;
    /// constraints are applied at the latest of these times.
    pub fn step(&mut self, messages: Vec<Option<EpochMessage>>) -> FusedEpoch {
        let mut order: Vec<(GpsTime, usize)> = messages
            .iter()
            .enumerate()
            .filter_map(|(phone, message)| message.as_ref().map(|m| (m.time_gps, phone)))
            .collect();
        order.sort_unstable();
        if let Some((time_gps, _)) = order.last() {
            self.biased.take(*time_gps, messages.iter().flatten());
        }
        let mut updates = vec![None; messages.len()];
        for (_, phone) in &order {
            if let Some((Some(message), update)) = messages.get(*phone).zip(updates.get_mut(*phone)) {
                let trusted = trusted(message, &self.biased, &mut self.skips);
                *update = self.filters.admit(*phone, &trusted, &self.phones, &mut self.skips);
            }
        }
        if let Some((time_gps, _)) = order.last() {
            self.time_gps = *time_gps;
        }
        self.filters.predict(self.time_gps, &self.phones, &mut self.skips);
        let free = self.filters.free();
        let mut group = self.filters.prior().unwrap_or_else(|| free.clone());
        let doubts = self.doubts(&free);
        let actions = self.constrain(&mut group, &doubts);
        let doubted = self.doubted(&group, &doubts);
        self.filters.go_on_with(&group);
        let distances = self.distances(&group);
        let phones = messages
            .into_iter()
            .enumerate()
            .map(|(phone, message)| FusedPhone {
                verdict: message.as_ref().map(|message| verdict(message, doubted.contains(&phone))),
                message,
                state: group.slot(phone).and_then(|slot| group.state(slot)),
                free: free.slot(phone).and_then(|slot| free.state(slot)),
                update: updates.get(phone).copied().flatten(),
            })
            .collect();
        FusedEpoch { time_gps: self.time_gps, phones, actions, distances }
    }

    /// Discards all states, so that the next messages may be earlier than the last ones. Phones restart from their next solutions.
    pub fn restart(&mut self) {
        self.filters = Filters::new(self.phones.len(), &self.options);
        self.excesses.fill(Excess::default());
    }

    /// All constraints, whether valid now or not.
    pub fn constraints(&self) -> &[ScheduledConstraint] {
        &self.constraints
    }

    /// Counts of skipped messages and states by reason.
    pub const fn skips(&self) -> &Skips {
        &self.skips
    }

    /// Whether a constraint is valid at the time of the last fused epoch.
    fn is_valid(&self, scheduled: &ScheduledConstraint) -> bool {
        scheduled.from_gps.is_none_or(|from| from <= self.time_gps)
            && scheduled.to_gps.is_none_or(|to| self.time_gps <= to)
    }

    /// The valid constraints whose phones are all present: index in [`Self::constraints`] and constraint with phones by slot.
    fn in_force<'a>(&'a self, group: &'a GroupState) -> impl Iterator<Item = (usize, Constraint)> + 'a {
        self.constraints
            .iter()
            .enumerate()
            .filter(|(_, scheduled)| self.is_valid(scheduled))
            .filter_map(|(place, c)| Some((place, c.constraint.mapped(|phone| group.slot(phone))?)))
    }

    /// What the free distribution says of each constraint, by its place.
    fn doubts(&mut self, free: &GroupState) -> Vec<(f64, Doubt)> {
        let limit = self.options.constraints.contradiction_sigmas;
        let sigmas: Vec<f64> =
            (0..self.constraints.len()).map(|place| self.free_sigmas(place, free)).collect();
        let taken = self.excesses.iter_mut().zip(sigmas);
        taken.map(|(excess, sigmas)| (sigmas, excess.take(sigmas, self.time_gps, limit))).collect()
    }

    /// Applies the constraints in force that are not contradicted.
    fn constrain(&self, group: &mut GroupState, doubts: &[(f64, Doubt)]) -> Vec<ConstraintAction> {
        let (mut places, mut on_slots, mut contradicted) = (Vec::new(), Vec::new(), Vec::new());
        for (place, constraint) in self.in_force(group) {
            let Some((sigmas, doubt)) = doubts.get(place) else { continue };
            if *doubt == Doubt::Contradicted {
                contradicted.extend(self.contradiction(place, constraint, *sigmas, group));
            } else {
                places.push((place, *sigmas));
                on_slots.push(constraint);
            }
        }
        if on_slots.is_empty() {
            return contradicted;
        }
        let before = group.second.as_ref().map(|_| group.covariance.clone());
        let obedient = ConstraintOptions { contradiction_sigmas: f64::INFINITY, ..self.options.constraints };
        let Constrained { actions, applied } =
            apply(&mut group.mean, &mut group.covariance, &on_slots, &obedient);
        if let Some((second, before)) = group.second.as_mut().zip(before) {
            carry(&before, &applied, second);
        }
        let named = |action: ConstraintAction| {
            // Outside the engine phones and constraints are identified by their index in the group.
            let (index, free_sigmas) = *places.get(action.index)?;
            let constraint = self.constraints.get(index)?.constraint;
            Some(ConstraintAction { index, constraint, free_sigmas, ..action })
        };
        let mut all: Vec<ConstraintAction> =
            actions.into_iter().filter_map(named).chain(contradicted).collect();
        all.sort_by_key(|action| action.index);
        all
    }

    /// Excess of the free distribution over a valid constraint, in standard deviations of that distribution.
    fn free_sigmas(&self, place: usize, free: &GroupState) -> f64 {
        let scheduled = self.constraints.get(place).filter(|scheduled| self.is_valid(scheduled));
        let constraint = scheduled.map(|scheduled| scheduled.constraint);
        let on_slots = constraint.and_then(|constraint| constraint.mapped(|phone| free.slot(phone)));
        let options = &self.options.constraints;
        on_slots.map_or(0.0, |on_slots| {
            let at = ConstrainedState { state: &free.mean, covariance: &free.covariance, options };
            excess_sigmas(&on_slots, &at)
        })
    }

    /// The report on a constraint that is not applied because the free distribution contradicts it.
    fn contradiction(
        &self,
        index: usize,
        on_slots: Constraint,
        free_sigmas: f64,
        group: &GroupState,
    ) -> Option<ConstraintAction> {
        let value = on_slots.value(&group.mean, self.options.constraints.horizon_s).unwrap_or(f64::NAN);
        Some(ConstraintAction {
            index,
            constraint: self.constraints.get(index)?.constraint,
            before: value,
            free_sigmas,
            after: value,
            shift_m: 0.0,
            enlargements: 0,
            outcome: ConstraintOutcome::Skipped(SkipReason::Contradicted),
        })
    }

    /// The phones of constraints in force that are at least doubted.
    fn doubted(&self, group: &GroupState, doubts: &[(f64, Doubt)]) -> Vec<usize> {
        let is_doubted = |(place, _): &(usize, Constraint)| {
            doubts.get(*place).is_some_and(|(_, doubt)| *doubt >= Doubt::Doubted)
        };
        self.in_force(group)
            .filter(is_doubted)
            .filter_map(|(place, _)| self.constraints.get(place))
            .flat_map(|scheduled| scheduled.constraint.phones().to_vec())
            .collect()
    }

    fn distances(&self, group: &GroupState) -> Vec<PairDistance> {
        self.in_force(group).filter_map(|(place, on_slots)| self.distance(group, place, on_slots)).collect()
    }

    fn distance(&self, group: &GroupState, place: usize, on_slots: Constraint) -> Option<PairDistance> {
        let Constraint::Distance(Distance { phones: [a, b], minimum_m, maximum_m }) = on_slots else {
            return None;
        };
        let &[first, second] = self.constraints.get(place)?.constraint.phones() else { return None };
        let (at, bt) = (group.state(a)?, group.state(b)?);
        Some(PairDistance {
            phones: (first, second),
            distance_m: at.position().distance_m(bt.position()),
            sigma_m: group.distance_sigma_m(a, b)?,
            minimum_m,
            maximum_m,
        })
    }
}

/// A message without the satellites that all phones contradict, which are counted.
fn trusted<'a>(
    message: &'a EpochMessage,
    biased: &BiasedSatellites,
    skips: &mut Skips,
) -> Cow<'a, EpochMessage> {
    let is_left_out = |observation: &CorrectedObservation| biased.is_left_out(observation.satellite);
    let Some(first) = message.observations.iter().find(|observation| is_left_out(observation)) else {
        return Cow::Borrowed(message);
    };
    skips.add(Reason::SatelliteContradictedByAll, || {
        format!("{} of {} at {}", first.satellite, message.phone, message.time_gps)
    });
    let mut trusted = message.clone();
    trusted.observations.retain(|observation| !is_left_out(observation));
    Cow::Owned(trusted)
}

/// The verdict on a fused position: the phone's own, unless its measurements doubt a constraint on it.
const fn verdict(message: &EpochMessage, is_doubted: bool) -> Verdict {
    match message.raim.verdict {
        Verdict::Reliable if is_doubted => Verdict::Unreliable(Cause::Constraint),
        own => own,
    }
}

#[cfg(test)]
mod tests;
