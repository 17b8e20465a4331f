//! What came of a session: for machines (JSON) and for people (a table).

use std::collections::BTreeMap;
use std::fmt::Write;

use cofix_common::accuracy::Accuracy;
use cofix_common::constraint::{Constraint, ConstraintAction, ConstraintOutcome};
use cofix_common::integrity::Verdict;
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;
use serde::Serialize;

use crate::engine::FusedEpoch;
use crate::scores::{ByPhone, Methods};

/// The report of a session. Keys are in a fixed order and nothing depends on the wall clock.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The group's name.
    pub group: String,
    /// Accuracy by method and phone; null for a phone that cannot be scored.
    pub methods: Methods,
    /// Why phones are not scored.
    pub unscored: BTreeMap<String, String>,
    /// Epochs of the group.
    pub epochs: u64,
    /// Epochs of the group in which more than one phone took part.
    pub common_epochs: u64,
    /// What is known of each phone.
    pub phones: BTreeMap<String, PhoneReport>,
    /// What each constraint did; those of the same bounds at different times together.
    pub constraints: BTreeMap<String, ConstraintReport>,
    /// What was skipped and belongs to no phone.
    pub skips: Skips,
}

/// One phone in a session.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PhoneReport {
    /// Epochs fused.
    pub epochs: u64,
    /// Epochs without any usable observation.
    pub empty_epochs: u64,
    /// First epoch, GPS time.
    pub first_gps: Option<String>,
    /// Last epoch, GPS time.
    pub last_gps: Option<String>,
    /// Epochs by the agent's integrity verdict.
    pub verdicts: BTreeMap<String, u64>,
    /// What was skipped, by the agent and by the hub.
    pub skips: Skips,
}

/// What a constraint did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ConstraintReport {
    /// Epochs at which it changed the state, be it only the tails.
    pub acted: u64,
    /// Epochs at which the estimate before it was outside the bounds.
    pub violated_before: u64,
    /// Epochs at which the estimate stayed outside the bounds.
    pub violated_after: u64,
    /// Epochs at which it could not be applied.
    pub not_applied: u64,
    /// Largest shift of a phone, m.
    pub largest_shift_m: f64,
    /// Mean shift where it acted, m.
    pub mean_shift_m: f64,
    /// Epochs at which its interval was enlarged.
    pub enlarged: u64,
}

/// Counts over a session.
#[derive(Clone, Debug)]
pub struct Tally {
    names: Vec<String>,
    phones: Vec<PhoneReport>,
    spans: Vec<Option<(GpsTime, GpsTime)>>,
    constraints: BTreeMap<String, ConstraintReport>,
    epochs: u64,
    common_epochs: u64,
}

impl Tally {
    /// For phones of these names.
    pub fn new(names: &[String]) -> Self {
        Self {
            names: names.to_vec(),
            phones: vec![PhoneReport::default(); names.len()],
            spans: vec![None; names.len()],
            constraints: BTreeMap::new(),
            epochs: 0,
            common_epochs: 0,
        }
    }

    /// Counts an epoch.
    pub fn push(&mut self, epoch: &FusedEpoch) {
        self.epochs += 1;
        let present = epoch.phones.iter().filter(|phone| phone.message.is_some()).count();
        self.common_epochs += u64::from(present > 1);
        for ((report, span), phone) in self.phones.iter_mut().zip(&mut self.spans).zip(&epoch.phones) {
            let Some(message) = &phone.message else { continue };
            report.epochs += 1;
            report.empty_epochs += u64::from(message.observations.is_empty());
            *report.verdicts.entry(verdict_key(message.raim.verdict)).or_default() += 1;
            let (first, last) = span.unwrap_or((message.time_gps, message.time_gps));
            *span = Some((first.min(message.time_gps), last.max(message.time_gps)));
        }
        for action in &epoch.actions {
            self.constraints.entry(describe(&action.constraint, &self.names)).or_default().push(action);
        }
    }

    /// Epochs of the group.
    pub const fn epochs(&self) -> u64 {
        self.epochs
    }

    /// Epochs of the group in which more than one phone took part.
    pub const fn common_epochs(&self) -> u64 {
        self.common_epochs
    }

    /// First and last epoch of a phone.
    pub fn span(&self, phone: usize) -> Option<(GpsTime, GpsTime)> {
        self.spans.get(phone).copied().flatten()
    }

    /// Epochs of a phone that had a usable observation.
    pub fn usable_epochs(&self, phone: usize) -> u64 {
        self.phones.get(phone).map_or(0, |report| report.epochs - report.empty_epochs)
    }

    /// The phones' reports, with what was skipped of each.
    pub fn phones(&self, skips: impl Fn(usize) -> Skips) -> BTreeMap<String, PhoneReport> {
        let entry = |(index, name): (usize, &String)| {
            let span = self.span(index);
            let counted = self.phones.get(index).cloned().unwrap_or_default();
            let report = PhoneReport {
                first_gps: span.map(|(first, _)| first.to_string()),
                last_gps: span.map(|(_, last)| last.to_string()),
                skips: skips(index),
                ..counted
            };
            (name.clone(), report)
        };
        self.names.iter().enumerate().map(entry).collect()
    }

    /// What each constraint did.
    pub fn constraints(&self) -> BTreeMap<String, ConstraintReport> {
        self.constraints.clone()
    }
}

impl ConstraintReport {
    fn push(&mut self, action: &ConstraintAction) {
        if matches!(action.outcome, ConstraintOutcome::Skipped(_)) {
            self.not_applied += 1;
            return;
        }
        self.acted += 1;
        self.violated_before += u64::from(!action.constraint.holds(action.before));
        self.violated_after += u64::from(action.outcome == ConstraintOutcome::Violated);
        self.largest_shift_m = self.largest_shift_m.max(action.shift_m);
        self.mean_shift_m += (action.shift_m - self.mean_shift_m) / self.acted as f64;
        self.enlarged += u64::from(action.enlargements > 0);
    }
}

fn verdict_key(verdict: Verdict) -> String {
    verdict.to_string()
}

/// A constraint in words, with the phones' names and the bounds.
pub fn describe(constraint: &Constraint, names: &[String]) -> String {
    let name = |index: usize| names.get(index).map_or("?", String::as_str);
    match *constraint {
        Constraint::Distance { phones: (i, j), minimum_m, maximum_m } => {
            format!("distance {}–{}, {minimum_m} to {maximum_m} m", name(i), name(j))
        }
        Constraint::VerticalVelocity { phone, maximum_mps } => {
            format!("vertical-velocity {}, ±{maximum_mps} m/s", name(phone))
        }
        Constraint::Heading { phone, course_rad, tolerance_rad } => {
            let (course, tolerance) = (degrees(course_rad), degrees(tolerance_rad));
            format!("heading {}, {course}° ± {tolerance}°", name(phone))
        }
    }
}

/// Degrees without the last digits of the conversion.
fn degrees(radians: f64) -> f64 {
    (radians.to_degrees() * 1e6).round() / 1e6
}

impl Report {
    /// The report as JSON text with a line end.
    ///
    /// # Errors
    /// When it cannot be serialised, which does not happen.
    pub fn json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string_pretty(self).map(|text| text + "\n")
    }

    /// What was skipped, a line for each phone, one for the group and one for each constraint that was at times not applied;
    /// empty when nothing was.
    pub fn skipped(&self) -> String {
        let counts = |skips: &Skips| {
            let counts: Vec<String> =
                skips.iter().map(|(reason, skip)| format!("{} × {reason}", skip.count)).collect();
            counts.join(", ")
        };
        let phones = self.phones.iter().map(|(name, phone)| (name.as_str(), &phone.skips));
        phones
            .chain([("group", &self.skips)])
            .filter(|(_, skips)| !skips.is_empty())
            .map(|(name, skips)| format!("{name}: {}", counts(skips)))
            .chain(self.constraints.iter().filter(|(_, c)| c.not_applied > 0).map(|(name, c)| {
                format!("{name}: not applied in {} epochs, contradicted or not computable", c.not_applied)
            }))
            .collect::<Vec<_>>()
            .join("\n")
    }

    /// The accuracy table, phones in the order of `names`, as Markdown that is legible in a terminal too.
    pub fn table(&self, names: &[String]) -> String {
        let width = names.iter().map(|name| name.chars().count()).max().unwrap_or(0).max(5);
        let mut text = format!(
            "| method | {:width$} | epochs | avail. | p50 m | p68 m | p95 m | RMSE 2D | RMSE E | RMSE N | RMSE U |\n",
            "phone"
        );
        let _ = writeln!(
            text,
            "|:-------|:{:-<width$}-|-------:|-------:|------:|------:|------:|--------:|-------:|-------:|-------:|",
            ""
        );
        for (method, phones) in
            [("wls", &self.methods.wls), ("local", &self.methods.local), ("joint", &self.methods.joint)]
        {
            text.push_str(&rows(method, phones, names, width));
        }
        for (phone, reason) in &self.unscored {
            let _ = write!(text, "\n{phone} is not scored: {reason}.");
        }
        text
    }
}

fn rows(method: &str, phones: &ByPhone, names: &[String], width: usize) -> String {
    let mut text = String::new();
    let mut scored = Vec::new();
    for name in names {
        let Some(Some(a)) = phones.get(name) else { continue };
        scored.push(a);
        let _ = writeln!(
            text,
            "| {method:6} | {name:width$} | {:6} | {:6.3} | {:5.2} | {:5.2} | {:5.2} | {:7.2} | {:6.2} | {:6.2} | {:6.2} |",
            a.epochs,
            a.availability,
            a.horizontal_p50_m,
            a.horizontal_p68_m,
            a.horizontal_p95_m,
            a.rmse_2d_m,
            a.rmse_east_m,
            a.rmse_north_m,
            a.rmse_up_m,
        );
    }
    if scored.len() > 1 {
        let mean =
            |value: fn(&Accuracy) -> f64| scored.iter().map(|a| value(a)).sum::<f64>() / scored.len() as f64;
        let _ = writeln!(
            text,
            "| {method:6} | {:width$} |        | {:6.3} | {:5.2} | {:5.2} | {:5.2} | {:7.2} | {:6.2} | {:6.2} | {:6.2} |",
            "mean",
            mean(|a| a.availability),
            mean(|a| a.horizontal_p50_m),
            mean(|a| a.horizontal_p68_m),
            mean(|a| a.horizontal_p95_m),
            mean(|a| a.rmse_2d_m),
            mean(|a| a.rmse_east_m),
            mean(|a| a.rmse_north_m),
            mean(|a| a.rmse_up_m),
        );
    }
    text
}

#[cfg(test)]
mod tests;
