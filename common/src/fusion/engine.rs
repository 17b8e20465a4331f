//! Joint estimator of the hub: its input are aligned epochs, its output fused and constrained epochs. No I/O.

use std::borrow::Cow;

use super::biased::BiasedSatellites;
use super::doubt::{Doubt, Excess};
use super::group::{Filters, FreeGroup, Output, Slots};
use super::peers::{Evidence, IntegrityEvent, Peers, Seen};
use crate::constraint::second::carry;
use crate::constraint::{
    Constraint, ConstraintAction, ConstraintOptions, ConstraintOutcome, Distance, SkipReason, constrain,
    constrain_separately, excess_sigmas,
};
use crate::filter::{FilterOptions, PhoneState, UpdateReport};
use crate::integrity::{
    Cause, ProtectionLevels, RaimOptions, SatelliteFaults, StateReport, Verdict, levels_about, state_levels,
};
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
    /// Tests of the innovations, protection levels of the fused positions and their alarm limits.
    pub integrity: RaimOptions,
    /// Whether phones check each other: one that contradicts the others is isolated. Not with feedback, where one filter holds all phones.
    pub cooperative: bool,
}

impl Default for EngineOptions {
    fn default() -> Self {
        Self {
            filter: FilterOptions::default(),
            constraints: ConstraintOptions::default(),
            feedback: false,
            biased_sigmas: 3.5,
            integrity: RaimOptions::default(),
            cooperative: true,
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
            cooperative: false,
            ..Self::default()
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
    /// What happened to the group's integrity.
    pub events: Vec<IntegrityEvent>,
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
    /// The verdict on the fused state: that of the test of its innovations, or of the message where there is none, and unreliable where the
    /// phone contradicts a constraint or the others, or its levels are beyond the alarm limits; `None` without a message.
    pub verdict: Option<Verdict>,
    /// Protection levels of the fused position; `None` where nothing bounds its error.
    pub protection: Option<ProtectionLevels>,
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
    peers: Peers,
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
        let peers = Peers::new(phones.len(), constraints.len(), options.cooperative && !options.feedback);
        Self { phones, constraints, options, filters, biased, excesses, peers, time_gps, skips }
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
        let doubts = self.doubts(&free);
        let events = self.compare_phones(&free, &doubts, &messages);
        let (slots, output, actions) = self.constrained(&free, &doubts);
        let doubted = self.doubted(&slots, &doubts);
        let distances = self.distances(&slots, &output);
        let levels = self.levels(&slots, &output, &messages);
        let phones = messages
            .into_iter()
            .enumerate()
            .map(|(phone, message)| {
                let protection = slots.of(phone).and_then(|slot| levels.get(slot).copied().flatten());
                let update = updates.get(phone).copied().flatten();
                let test = update.and_then(|update: UpdateReport| update.test);
                FusedPhone {
                    verdict: message.as_ref().map(|message| {
                        let own = StateReport::new(test, &message.raim, protection, &self.options.integrity);
                        verdict(own.verdict, self.suspicion(phone, doubted[phone]))
                    }),
                    message,
                    state: slots.of(phone).and_then(|slot| output.states.get(slot).cloned()),
                    protection,
                    free: free.slots().of(phone).and_then(|slot| free.state(slot)),
                    update,
                }
            })
            .collect();
        FusedEpoch { time_gps: self.time_gps, phones, actions, distances, events }
    }

    /// Protection levels of the states, by slot: the smaller of two bounds. One is that of the filter ([`state_levels`]). The other is the epoch-wise
    /// solution's of the phone, if it is reliable, about its own position ([`levels_about`]).
    fn levels(
        &self,
        slots: &Slots,
        output: &Output,
        messages: &[Option<EpochMessage>],
    ) -> Vec<Option<ProtectionLevels>> {
        let mut levels = self.levels_of_states(output);
        levels.resize(output.states.len(), None);
        for (phone, message) in messages.iter().enumerate() {
            let Some((slot, message)) = slots.of(phone).zip(message.as_ref()) else { continue };
            let Some((state, level)) = output.states.get(slot).zip(levels.get_mut(slot)) else { continue };
            let about_wls = message.wls.as_ref().and_then(|solution| {
                levels_about((solution, message.time_gps), &message.raim, (state, self.time_gps))
            });
            *level = ProtectionLevels::smallest(*level, about_wls);
        }
        levels
    }

    fn levels_of_states(&self, output: &Output) -> Vec<Option<ProtectionLevels>> {
        let Some(faults) = self.filters.faults() else { return Vec::new() };
        let Some(first) = output.states.first() else { return Vec::new() };
        let faults = SatelliteFaults::new(first.position(), output.states.len(), &faults);
        let options = &self.options.integrity.protection;
        output.states.iter().map(|state| state_levels(state, &faults, options)).collect()
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
    fn in_force<'a>(&'a self, slots: &'a Slots) -> impl Iterator<Item = (usize, Constraint)> + 'a {
        self.constraints
            .iter()
            .enumerate()
            .filter(|(_, scheduled)| self.is_valid(scheduled))
            .filter_map(|(place, c)| Some((place, c.constraint.mapped(|phone| slots.of(phone))?)))
    }

    /// What the free distribution says of each constraint, by its place.
    fn doubts(&mut self, free: &FreeGroup) -> Vec<(f64, Doubt)> {
        let limit = self.options.constraints.contradiction_sigmas;
        let sigmas: Vec<f64> =
            (0..self.constraints.len()).map(|place| self.free_sigmas(place, free)).collect();
        let taken = self.excesses.iter_mut().zip(sigmas);
        taken.map(|(excess, sigmas)| (sigmas, excess.take(sigmas, self.time_gps, limit))).collect()
    }

    /// Lets the phones check each other by the constraints in force.
    fn compare_phones(
        &mut self,
        free: &FreeGroup,
        doubts: &[(f64, Doubt)],
        messages: &[Option<EpochMessage>],
    ) -> Vec<IntegrityEvent> {
        let in_force: Vec<usize> = self.in_force(free.slots()).map(|(place, _)| place).collect();
        let evidence: Vec<Evidence<'_>> = in_force
            .into_iter()
            .filter_map(|place| {
                let (constraint, (sigmas, doubt)) =
                    (&self.constraints.get(place)?.constraint, doubts.get(place)?);
                let share = sigmas / self.options.constraints.contradiction_sigmas;
                let within_m = match constraint {
                    Constraint::Distance(distance) => distance.maximum_m,
                    _ => f64::INFINITY,
                };
                Some(Evidence { place, phones: constraint.phones(), doubt: *doubt, share, within_m })
            })
            .collect();
        let seen = messages.iter().enumerate().map(|(phone, message)| {
            let filter = free.phones.get(free.slots().of(phone)?)?;
            Some(Seen::new(filter, message.as_ref(), self.time_gps))
        });
        self.peers.take(self.time_gps, &evidence, &seen.collect::<Vec<_>>())
    }

    /// Why a phone's state is suspect, if it is.
    fn suspicion(&self, phone: usize, is_doubted: bool) -> Option<Cause> {
        if self.peers.is_apart(phone) {
            Some(Cause::Peers)
        } else if is_doubted {
            Some(Cause::Constraint)
        } else {
            None
        }
    }

    /// Whether a constraint couples a phone that is isolated, or suspected, to another.
    fn is_cut(&self, place: usize) -> bool {
        let phones = self.constraints.get(place).map_or(&[][..], |scheduled| scheduled.constraint.phones());
        phones.len() > 1 && phones.iter().any(|phone| self.peers.is_apart(*phone))
    }

    /// Applies the constraints in force that are not contradicted to the joint filter, if there is one, and else to the phones' own.
    fn constrained(
        &mut self,
        free: &FreeGroup,
        doubts: &[(f64, Doubt)],
    ) -> (Slots, Output, Vec<ConstraintAction>) {
        let options = &self.options.constraints;
        let obedient = ConstraintOptions { contradiction_sigmas: f64::INFINITY, ..*options };
        if let Some(mut joint) = self.filters.joint() {
            let chosen = self.chosen(&joint.slots, doubts, |c| c.value(&joint.mean, options.horizon_s));
            let actions = constrain(&mut joint.mean, &mut joint.covariance, &chosen.on_slots, &obedient);
            let output = joint.output(&self.pairs(&joint.slots));
            let actions = self.named(actions, chosen);
            self.filters.go_on_with(&joint);
            return (joint.slots, output, actions);
        }
        let value = |c: &Constraint| c.value_among(&free.phones, options.horizon_s);
        let chosen = self.chosen(free.slots(), doubts, value);
        let pairs = self.pairs(free.slots());
        let separated = constrain_separately(&free.phones, &chosen.on_slots, &pairs, &obedient);
        let stated = carry(&separated, &free.stated, &self.filters.shared(), &pairs);
        let states = separated.means.iter().zip(stated.own);
        let states = states.map(|(mean, covariance)| PhoneState { mean: *mean, covariance }).collect();
        let actions = self.named(separated.actions, chosen);
        (free.slots().clone(), Output { states, pairs: stated.pairs }, actions)
    }

    /// The constraints in force that are not contradicted, and reports on those that are.
    fn chosen(
        &self,
        slots: &Slots,
        doubts: &[(f64, Doubt)],
        value: impl Fn(&Constraint) -> Option<f64>,
    ) -> Chosen {
        let mut chosen = Chosen::default();
        for (place, constraint) in self.in_force(slots) {
            let Some((sigmas, doubt)) = doubts.get(place) else { continue };
            if *doubt == Doubt::Contradicted {
                let value = value(&constraint).unwrap_or(f64::NAN);
                chosen.contradicted.extend(self.contradiction(place, *sigmas, value));
            } else if !self.is_cut(place) {
                chosen.places.push((place, *sigmas));
                chosen.on_slots.push(constraint);
            }
        }
        chosen
    }

    /// Reports in the order of the constraints. Outside the engine phones and constraints are identified by their index in the group.
    fn named(&self, actions: Vec<ConstraintAction>, chosen: Chosen) -> Vec<ConstraintAction> {
        let named = |action: ConstraintAction| {
            let (index, free_sigmas) = *chosen.places.get(action.index)?;
            let constraint = self.constraints.get(index)?.constraint;
            Some(ConstraintAction { index, constraint, free_sigmas, ..action })
        };
        let mut all: Vec<ConstraintAction> =
            actions.into_iter().filter_map(named).chain(chosen.contradicted).collect();
        all.sort_by_key(|action| action.index);
        all
    }

    /// Excess of the free distribution over a valid constraint, in standard deviations of that distribution.
    fn free_sigmas(&self, place: usize, free: &FreeGroup) -> f64 {
        let scheduled = self.constraints.get(place).filter(|scheduled| self.is_valid(scheduled));
        let on_slots =
            scheduled.and_then(|scheduled| scheduled.constraint.mapped(|phone| free.slots().of(phone)));
        let options = &self.options.constraints;
        on_slots.map_or(0.0, |on_slots| excess_sigmas(&on_slots, free.phones.as_slice(), options))
    }

    /// The report on a constraint that is not applied because the free distribution contradicts it.
    fn contradiction(&self, index: usize, free_sigmas: f64, value: f64) -> Option<ConstraintAction> {
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

    /// Whether each phone is under a constraint in force that is at least doubted.
    fn doubted(&self, slots: &Slots, doubts: &[(f64, Doubt)]) -> Vec<bool> {
        let mut doubted = vec![false; self.phones.len()];
        for (place, _) in self.in_force(slots) {
            if doubts.get(place).is_some_and(|(_, doubt)| *doubt >= Doubt::Doubted) {
                // What an isolated phone contradicts says nothing against the others.
                if !self.is_cut(place) {
                    for phone in self.constraints[place].constraint.phones() {
                        doubted[*phone] = true;
                    }
                }
            }
        }
        doubted
    }

    /// The distance constraints in force: place in [`Self::constraints`], and constraint with phones by slot.
    fn distances_in_force<'a>(&'a self, slots: &'a Slots) -> impl Iterator<Item = (usize, Distance)> + 'a {
        self.in_force(slots).filter_map(|(place, constraint)| match constraint {
            Constraint::Distance(distance) => Some((place, distance)),
            _ => None,
        })
    }

    /// The pairs under a distance constraint, by slot.
    fn pairs(&self, slots: &Slots) -> Vec<(usize, usize)> {
        self.distances_in_force(slots).map(|(_, Distance { phones: [a, b], .. })| (a, b)).collect()
    }

    fn distances(&self, slots: &Slots, output: &Output) -> Vec<PairDistance> {
        let distance = |((place, distance), between): ((usize, Distance), &_)| {
            let Distance { phones: [a, b], minimum_m, maximum_m } = distance;
            let &[first, second] = self.constraints.get(place)?.constraint.phones() else { return None };
            let (at, bt) = (output.states.get(a)?, output.states.get(b)?);
            Some(PairDistance {
                phones: (first, second),
                distance_m: at.position().distance_m(bt.position()),
                sigma_m: output.distance_sigma_m((a, b), between)?,
                minimum_m,
                maximum_m,
            })
        };
        self.distances_in_force(slots).zip(&output.pairs).filter_map(distance).collect()
    }
}

/// Constraints of one epoch.
#[derive(Default)]
struct Chosen {
    /// Constraints with phones by slot.
    on_slots: Vec<Constraint>,
    /// Their places in [`Engine::constraints`], and the excess of the free distribution over them in its standard deviations.
    places: Vec<(usize, f64)>,
    /// Reports on constraints that are not applied.
    contradicted: Vec<ConstraintAction>,
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

/// The verdict on a fused position: that of its measurements and levels, unless the phone contradicts the others, or a constraint on it.
const fn verdict(own: Verdict, suspicion: Option<Cause>) -> Verdict {
    match (own, suspicion) {
        // Whoever is isolated is marked as that.
        (_, Some(Cause::Peers)) => Verdict::Unreliable(Cause::Peers),
        (Verdict::Reliable | Verdict::Unreliable(Cause::AlarmLimit), Some(cause)) => {
            Verdict::Unreliable(cause)
        }
        (own, _) => own,
    }
}

#[cfg(test)]
mod tests;
