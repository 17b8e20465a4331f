//! Counts over a session.

use std::collections::BTreeMap;

use cofix_common::filter::PhoneState;
use cofix_common::formats::phone::Quantiles;
use cofix_common::frames::LocalFrame;
use cofix_common::fusion::engine::{FusedEpoch, FusedPhone, ScheduledConstraint};
use cofix_common::fusion::peers::{EventKind, IntegrityEvent};
use cofix_common::gnss::{SatelliteId, SignalCode};
use cofix_common::measurement::CorrectedObservation;
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;

use super::constraints::ConstraintTally;
use super::presence::Presence;
use super::{ConstraintReport, EventReport, PhoneReport, SameObservations};

/// Pseudoranges of two receivers are never the same; those of one recording in two formats are, but for the last digit, m.
const SAME_PSEUDORANGE_M: f64 = 5e-3;
/// Common signals of two phones at one epoch from which on their equality tells something.
const FEWEST_COMMON_SIGNALS: usize = 4;

/// Counts over a session.
#[derive(Clone, Debug)]
pub struct Tally {
    names: Vec<String>,
    phones: Vec<PhoneTally>,
    same: BTreeMap<(usize, usize), u64>,
    constraints: ConstraintTally,
    scheduled: Vec<ScheduledConstraint>,
    events: Vec<EventReport>,
    /// First and last epoch of the group.
    pub span: Option<(GpsTime, GpsTime)>,
    /// Epochs of the group.
    pub epochs: u64,
    /// Epochs of the group in which more than one phone took part.
    pub common_epochs: u64,
}

/// Counts of one phone.
#[derive(Clone, Debug, Default)]
struct PhoneTally {
    report: PhoneReport,
    span: Option<(GpsTime, GpsTime)>,
    presence: Presence,
    satellites: u64,
    horizontal_sigma_m: Quantiles,
    vertical_sigma_m: Quantiles,
    shift_m: Quantiles,
}

impl Tally {
    /// For phones of these names.
    pub fn new(names: &[String]) -> Self {
        Self {
            names: names.to_vec(),
            phones: vec![PhoneTally::default(); names.len()],
            span: None,
            same: BTreeMap::new(),
            constraints: ConstraintTally::default(),
            scheduled: Vec::new(),
            events: Vec::new(),
            epochs: 0,
            common_epochs: 0,
        }
    }

    /// Counts these constraints from now on, whether they ever act or not.
    pub fn schedule(&mut self, constraints: &[ScheduledConstraint]) {
        self.constraints = ConstraintTally::new(constraints, &self.names);
        self.scheduled = constraints.to_vec();
    }

    /// Counts an epoch.
    pub fn push(&mut self, epoch: &FusedEpoch) {
        self.epochs += 1;
        self.span = Some(extended(self.span, epoch.time_gps));
        let present = epoch.phones.iter().filter(|phone| phone.message.is_some()).count();
        self.common_epochs += u64::from(present > 1);
        for (tally, phone) in self.phones.iter_mut().zip(&epoch.phones) {
            tally.push(phone);
        }
        self.compare(&epoch.phones);
        self.constraints.push(epoch);
        for event in &epoch.events {
            let told = self.told(event);
            tracing::warn!("{}: {}", told.time_gps, told.detail);
            self.events.push(told);
        }
    }

    /// What happened to the group's integrity.
    pub fn events(&self) -> Vec<EventReport> {
        self.events.clone()
    }

    fn told(&self, event: &IntegrityEvent) -> EventReport {
        let names: Vec<&str> =
            event.phones.iter().filter_map(|phone| self.names.get(*phone)).map(String::as_str).collect();
        let phone = names.join(", ");
        let detail = match event.kind {
            EventKind::Isolated => {
                let error = event.error.unwrap_or_default().in_words();
                format!("{phone} contradicts the other phones and is isolated: {error}")
            }
            EventKind::Readmitted => format!("{phone} agrees with the other phones again"),
            EventKind::ConstraintContradicted => {
                format!("the constraint{} on {phone} contradicts them", self.bound_in_words(event))
            }
            EventKind::CannotTell if event.constraint.is_some() => {
                let bound = self.bound_in_words(event);
                format!(
                    "{phone} contradict the constraint{bound}, and whether it or which of them is wrong is open"
                )
            }
            EventKind::CannotTell => format!("{phone} contradict each other, and which is wrong is open"),
        };
        EventReport { time_gps: event.time_gps.iso(), phone, kind: event.kind, error: event.error, detail }
    }

    /// The constraint that an event is about, with a space before.
    fn bound_in_words(&self, event: &IntegrityEvent) -> String {
        let scheduled = event.constraint.and_then(|place| self.scheduled.get(place));
        scheduled.map_or_else(String::new, |ScheduledConstraint { constraint, .. }| {
            format!(" {} {}", constraint.name(), constraint.bounds_in_words())
        })
    }

    fn compare(&mut self, phones: &[FusedPhone]) {
        let messages = phones.iter().enumerate().filter_map(|(i, phone)| Some((i, phone.message.as_ref()?)));
        let messages: Vec<(usize, &EpochMessage)> = messages.collect();
        for (n, (i, a)) in messages.iter().enumerate() {
            for (j, b) in messages.iter().skip(n + 1) {
                if are_same(&a.observations, &b.observations) {
                    *self.same.entry((*i, *j)).or_default() += 1;
                }
            }
        }
    }

    /// First and last epoch of a phone.
    pub fn span_of(&self, phone: usize) -> Option<(GpsTime, GpsTime)> {
        self.phones.get(phone).and_then(|tally| tally.span)
    }

    /// Epochs of a phone that had a usable observation.
    pub fn usable_epochs(&self, phone: usize) -> u64 {
        self.phones.get(phone).map_or(0, |tally| tally.report.epochs - tally.report.empty_epochs)
    }

    /// The phones' reports, with the skips of each.
    pub fn phones(&self, skips: impl Fn(usize) -> Skips) -> BTreeMap<String, PhoneReport> {
        let entry = |(index, (name, tally)): (usize, (&String, &PhoneTally))| {
            (name.clone(), tally.report(self.span, skips(index)))
        };
        self.names.iter().zip(&self.phones).enumerate().map(entry).collect()
    }

    /// Phones whose observations were the same at most epochs that they have in common.
    pub fn same_observations(&self) -> Vec<SameObservations> {
        let epochs = |index: usize| self.phones.get(index).map_or(0, |tally| tally.report.epochs);
        let name = |index: usize| self.names.get(index).cloned().unwrap_or_default();
        self.same
            .iter()
            .filter(|((i, j), same)| 2 * **same > epochs(*i).min(epochs(*j)))
            .map(|(&(i, j), &epochs)| SameObservations { phones: [name(i), name(j)], epochs })
            .collect()
    }

    /// Counts of each constraint.
    pub fn constraints(&self) -> BTreeMap<String, ConstraintReport> {
        self.constraints.reports()
    }
}

impl PhoneTally {
    fn push(&mut self, phone: &FusedPhone) {
        if let Some((horizontal_m, vertical_m)) = phone.state.as_ref().map(sigmas_m) {
            self.horizontal_sigma_m.add(horizontal_m);
            self.vertical_sigma_m.add(vertical_m);
        }
        if let Some((fused, free)) = phone.state.as_ref().zip(phone.free.as_ref()) {
            self.shift_m.add(fused.position().distance_m(free.position()));
        }
        let Some(message) = &phone.message else { return };
        let report = &mut self.report;
        report.epochs += 1;
        report.empty_epochs += u64::from(message.observations.is_empty());
        report.epochs_without_solution += u64::from(message.wls.is_none());
        report.observations += message.observations.len() as u64;
        let with_rate = message.observations.iter().filter(|o| o.range_rate.is_some()).count();
        report.observations_with_rate += with_rate as u64;
        *report.verdicts.entry(message.raim.verdict.to_string()).or_default() += 1;
        if let Some(verdict) = phone.verdict {
            *report.fused_verdicts.entry(verdict.to_string()).or_default() += 1;
        }
        if let Some(update) = &phone.update {
            report.filter.push(update);
        }
        self.satellites += message.satellites_used() as u64;
        self.span = Some(extended(self.span, message.time_gps));
        self.presence.push(message.time_gps);
    }

    fn report(&self, group: Option<(GpsTime, GpsTime)>, skips: Skips) -> PhoneReport {
        let counted = self.report.clone();
        let epochs = counted.epochs;
        PhoneReport {
            share_of_group: self.presence.share(group),
            first_gps: self.span.map(|(first, _)| first.iso()),
            last_gps: self.span.map(|(_, last)| last.iso()),
            mean_satellites: (epochs > 0).then(|| self.satellites as f64 / epochs as f64),
            horizontal_sigma_m: self.horizontal_sigma_m.typical(),
            vertical_sigma_m: self.vertical_sigma_m.typical(),
            constraint_shift_m: self.shift_m.typical(),
            skips,
            ..counted
        }
    }
}

/// Standard deviations of the position, m: horizontal (the root of both variances' sum) and vertical.
fn sigmas_m(state: &PhoneState) -> (f64, f64) {
    let covariance = state.covariance.fixed_view::<3, 3>(0, 0).into_owned();
    let enu = LocalFrame::at(state.position()).covariance_ecef_to_enu(&covariance);
    ((enu.m11 + enu.m22).max(0.0).sqrt(), enu.m33.max(0.0).sqrt())
}

/// Whether two phones' common signals have one pseudorange each.
fn are_same(a: &[CorrectedObservation], b: &[CorrectedObservation]) -> bool {
    let key = |o: &CorrectedObservation| -> (SatelliteId, SignalCode) { (o.satellite, o.signal) };
    let mut common = 0;
    for one in a {
        let Some(other) = b.iter().find(|other| key(other) == key(one)) else { continue };
        if (one.pseudorange_m - other.pseudorange_m).abs() > SAME_PSEUDORANGE_M {
            return false;
        }
        common += 1;
    }
    common >= FEWEST_COMMON_SIGNALS
}

/// The span with an instant.
pub(super) fn extended(span: Option<(GpsTime, GpsTime)>, time: GpsTime) -> (GpsTime, GpsTime) {
    let (first, last) = span.unwrap_or((time, time));
    (first.min(time), last.max(time))
}
