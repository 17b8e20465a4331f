//! Counts of each constraint.

use std::collections::BTreeMap;

use cofix_common::constraint::{Constraint, ConstraintAction, ConstraintOutcome, SkipReason};
use cofix_common::fusion::engine::{FusedEpoch, ScheduledConstraint};
use cofix_common::time::GpsTime;
use serde::Serialize;

/// A constraint and its counts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConstraintReport {
    /// Kind and bounds, as a session file writes them.
    #[serde(flatten)]
    pub constraint: Constraint,
    /// Names of the phones: two of a distance, else one.
    pub phones: Vec<String>,
    /// First instant at which it holds, GPS time; null: always.
    pub from_gps: Option<String>,
    /// Last instant at which it holds, GPS time; null: always.
    pub to_gps: Option<String>,
    /// Epochs of the group within that time.
    pub epochs_in_window: u64,
    /// Those at which all its phones were in the joint filter: it could act.
    pub epochs_in_force: u64,
    /// Epochs at which it changed the state, be it only the tails.
    pub acted: u64,
    /// Epochs at which the estimate before it was outside the bounds.
    pub violated_before: u64,
    /// Epochs at which the estimate stayed outside the bounds.
    pub violated_after: u64,
    /// Epochs at which it was not applied.
    pub not_applied: u64,
    /// The same by reason.
    pub not_applied_because: BTreeMap<&'static str, u64>,
    /// Largest shift of a phone, m.
    pub largest_shift_m: f64,
    /// Largest excess of the positions without constraints over the bounds, in standard deviations.
    pub largest_free_sigmas: f64,
    /// Mean shift where it acted, m.
    pub mean_shift_m: f64,
    /// Epochs at which its interval was enlarged.
    pub enlarged: u64,
}

/// A constraint in words, with the phones' names and the bounds.
pub fn describe(constraint: &Constraint, names: &[String]) -> String {
    format!("{}, {}", label(constraint, names), constraint.bounds_in_words())
}

/// A constraint's kind and the names of its phones.
pub(crate) fn label(constraint: &Constraint, names: &[String]) -> String {
    format!("{} {}", constraint.name(), phones(constraint, names).join("–"))
}

fn phones(constraint: &Constraint, names: &[String]) -> Vec<String> {
    let name = |&phone: &usize| names.get(phone).cloned().unwrap_or_else(|| format!("phone {phone}"));
    constraint.phones().iter().map(name).collect()
}

/// Counts of the constraints of a schedule.
#[derive(Clone, Debug, Default)]
pub(super) struct ConstraintTally {
    schedule: Vec<ScheduledConstraint>,
    reports: Vec<ConstraintReport>,
}

impl ConstraintTally {
    pub(super) fn new(schedule: &[ScheduledConstraint], names: &[String]) -> Self {
        let report = |scheduled: &ScheduledConstraint| ConstraintReport {
            constraint: scheduled.constraint,
            phones: phones(&scheduled.constraint, names),
            from_gps: scheduled.from_gps.map(GpsTime::iso),
            to_gps: scheduled.to_gps.map(GpsTime::iso),
            epochs_in_window: 0,
            epochs_in_force: 0,
            acted: 0,
            violated_before: 0,
            violated_after: 0,
            not_applied: 0,
            not_applied_because: BTreeMap::new(),
            largest_shift_m: 0.0,
            largest_free_sigmas: 0.0,
            mean_shift_m: 0.0,
            enlarged: 0,
        };
        Self { schedule: schedule.to_vec(), reports: schedule.iter().map(report).collect() }
    }

    pub(super) fn push(&mut self, epoch: &FusedEpoch) {
        for (scheduled, report) in self.schedule.iter().zip(&mut self.reports) {
            let is_in_window = scheduled.from_gps.is_none_or(|from| from <= epoch.time_gps)
                && scheduled.to_gps.is_none_or(|to| epoch.time_gps <= to);
            if !is_in_window {
                continue;
            }
            report.epochs_in_window += 1;
            let is_present =
                |index: &usize| epoch.phones.get(*index).is_some_and(|phone| phone.state.is_some());
            report.epochs_in_force += u64::from(scheduled.constraint.phones().iter().all(is_present));
        }
        for action in &epoch.actions {
            if let Some(report) = self.reports.get_mut(action.index) {
                report.push(action);
            }
        }
    }

    /// By a key of kind and phones, and a number from the second of the same on.
    pub(super) fn reports(&self) -> BTreeMap<String, ConstraintReport> {
        let mut reports = BTreeMap::new();
        for report in &self.reports {
            let plain = format!("{} {}", report.constraint.name(), report.phones.join(" "));
            let numbered = (2..).map(|number| format!("{plain} #{number}"));
            let key = std::iter::once(plain.clone()).chain(numbered).find(|key| !reports.contains_key(key));
            reports.insert(key.unwrap_or(plain), report.clone());
        }
        reports
    }
}

impl ConstraintReport {
    fn push(&mut self, action: &ConstraintAction) {
        let is_outside = |value: f64| value.is_finite() && !action.constraint.holds(value);
        self.largest_free_sigmas = self.largest_free_sigmas.max(action.free_sigmas);
        self.violated_before += u64::from(is_outside(action.before));
        if let ConstraintOutcome::Skipped(reason) = action.outcome {
            self.not_applied += 1;
            *self.not_applied_because.entry(name(reason)).or_default() += 1;
            self.violated_after += u64::from(is_outside(action.after));
            return;
        }
        self.acted += 1;
        self.violated_after += u64::from(action.outcome == ConstraintOutcome::Violated);
        self.largest_shift_m = self.largest_shift_m.max(action.shift_m);
        self.mean_shift_m += (action.shift_m - self.mean_shift_m) / self.acted as f64;
        self.enlarged += u64::from(action.enlargements > 0);
    }

    /// Epochs at which the state contradicted it so much that it was refused.
    pub fn refused(&self) -> u64 {
        self.not_applied_because.get(name(SkipReason::Contradicted)).copied().unwrap_or(0)
    }

    /// Its time, for people; empty when it holds always.
    pub fn window(&self) -> String {
        match (&self.from_gps, &self.to_gps) {
            (None, None) => String::new(),
            (Some(from), None) => format!("from {from} GPS"),
            (None, Some(to)) => format!("to {to} GPS"),
            (Some(from), Some(to)) => format!("from {from} to {to} GPS"),
        }
    }
}

const fn name(reason: SkipReason) -> &'static str {
    match reason {
        SkipReason::UnknownPhone => "unknown phone",
        SkipReason::InvalidBounds => "invalid bounds",
        SkipReason::NoVariance => "no variance",
        SkipReason::NotFinite => "not finite",
        SkipReason::Contradicted => "contradicted",
    }
}
