//! Tables for people, as Markdown that is legible in a terminal too.

use std::collections::BTreeMap;
use std::fmt::Write;

use cofix_common::accuracy::{Accuracy, Protection};
use cofix_common::formats::phone::Typical;

use super::{ConstraintReport, PhoneReport, Report};
use crate::report::scores::{ByPhone, Methods};

impl Report {
    /// The accuracy table of phones that are scored, and, when some are not, a table of the counts of all phones; phones in the order of
    /// `names`.
    pub fn table(&self, names: &[String]) -> String {
        let width = names.iter().map(|name| name.chars().count()).max().unwrap_or(0).max(5);
        let mut tables = Vec::new();
        let methods =
            [("wls", &self.methods.wls), ("local", &self.methods.local), ("joint", &self.methods.joint)];
        let is_scored = |phones: &ByPhone| phones.values().any(Option::is_some);
        if methods.iter().any(|(_, phones)| is_scored(phones)) {
            let rows = methods.map(|(method, phones)| accuracy_rows(method, phones, names, width));
            tables.push(accuracy_header(width) + &rows.concat());
            tables.extend(protection_table(&self.methods, names, width));
        }
        if !self.unscored.is_empty() {
            let rows: String = names.iter().filter_map(|name| self.phone_row(name, width)).collect();
            if !rows.is_empty() {
                tables.push(phone_header(width) + &rows);
            }
        }
        let mut text = tables.join("\n");
        for (phone, reason) in &self.unscored {
            let _ = write!(text, "\n{phone} is not scored: {reason}.");
        }
        text
    }

    /// Counts of constraints, with a row for those of the same kind, time and bounds; empty without constraints.
    pub fn constraint_table(&self) -> String {
        let alike = self.alike_constraints();
        let width = alike.keys().map(|what| what.chars().count()).max().unwrap_or(0).max(10);
        if alike.is_empty() {
            return String::new();
        }
        let mut text = format!(
            "| {:width$} | of | in force | acted | outside before | refused | outside after | largest shift m |\n\
             |:{:-<width$}-|---:|---------:|------:|---------------:|--------:|--------------:|----------------:|\n",
            "constraint", ""
        );
        for (what, constraints) in alike {
            let sum = |count: fn(&ConstraintReport) -> u64| constraints.iter().map(|c| count(c)).sum::<u64>();
            let largest_m = constraints.iter().map(|c| c.largest_shift_m).fold(0.0, f64::max);
            let _ = writeln!(
                text,
                "| {what:width$} | {:2} | {:8} | {:5} | {:14} | {:7} | {:13} | {largest_m:15.2} |",
                constraints.len(),
                sum(|c| c.epochs_in_force),
                sum(|c| c.acted),
                sum(|c| c.violated_before),
                sum(ConstraintReport::refused),
                sum(|c| c.violated_after),
            );
        }
        text
    }

    /// Constraints of one kind, with one time and the same bounds, of all pairs for one, by their words.
    pub(crate) fn alike_constraints(&self) -> BTreeMap<String, Vec<&ConstraintReport>> {
        let mut alike = BTreeMap::<String, Vec<&ConstraintReport>>::new();
        for constraint in self.constraints.values() {
            let window = constraint.window();
            let window = if window.is_empty() { window } else { format!(", {window}") };
            let what = format!(
                "{} {}{window}",
                constraint.constraint.name(),
                constraint.constraint.bounds_in_words()
            );
            alike.entry(what).or_default().push(constraint);
        }
        alike
    }

    fn phone_row(&self, name: &str, width: usize) -> Option<String> {
        let phone = self.phones.get(name)?;
        let Verdicts { reliable, unreliable, unchecked } = Verdicts::of(phone);
        let number = |value: Option<f64>, digits: usize| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
        };
        let sigma = |sigma: Option<Typical>| number(sigma.map(|sigma| sigma.median), 2);
        Some(format!(
            "| {name:width$} | {:6} | {:>8} | {:>5} | {:>8} | {:>6} | {reliable:8} | {unreliable:10} | {unchecked:9} |\n",
            phone.epochs,
            number(phone.share_of_group, 3),
            number(phone.mean_satellites, 1),
            sigma(phone.horizontal_sigma_m),
            sigma(phone.vertical_sigma_m),
        ))
    }
}

/// Epochs by RAIM's verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Verdicts {
    pub(crate) reliable: u64,
    pub(crate) unreliable: u64,
    pub(crate) unchecked: u64,
}

impl Verdicts {
    /// Of a phone, causes together.
    pub(crate) fn of(phone: &PhoneReport) -> Self {
        let mut verdicts = Self::default();
        for (verdict, count) in &phone.verdicts {
            let place = if verdict == "reliable" {
                &mut verdicts.reliable
            } else if verdict.starts_with("unreliable") {
                &mut verdicts.unreliable
            } else {
                &mut verdicts.unchecked
            };
            *place += count;
        }
        verdicts
    }
}

fn phone_header(width: usize) -> String {
    format!(
        "| {:width$} | epochs | of group | sats. | σ hor. m | σ up m | reliable | unreliable | unchecked |\n\
         |:{:-<width$}-|-------:|---------:|------:|---------:|-------:|---------:|-----------:|----------:|\n",
        "phone", ""
    )
}

fn accuracy_header(width: usize) -> String {
    format!(
        "| method | {:width$} | epochs | avail. | p50 m | p68 m | p95 m | RMSE 2D | RMSE E | RMSE N | RMSE U |\n\
         |:-------|:{:-<width$}-|-------:|-------:|------:|------:|------:|--------:|-------:|-------:|-------:|\n",
        "phone", ""
    )
}

/// Protection levels against the errors; `None` where nothing was called reliable.
fn protection_table(methods: &Methods, names: &[String], width: usize) -> Option<String> {
    let header = format!(
        "| method | {:width$} | reliable | HPL p50 m | HPL bounds | VPL p50 m | VPL bounds | misleading |\n\
         |:-------|:{:-<width$}-|---------:|----------:|-----------:|----------:|-----------:|-----------:|\n",
        "phone", ""
    );
    let rows: String = [("wls", &methods.wls), ("local", &methods.local), ("joint", &methods.joint)]
        .into_iter()
        .flat_map(|(method, phones)| names.iter().map(move |name| (method, name, phones.get(name))))
        .filter_map(|(method, name, accuracy)| {
            protection_row(method, name, width, &accuracy.copied()??.protection)
        })
        .collect();
    (!rows.is_empty()).then_some(header + &rows)
}

fn protection_row(method: &str, name: &str, width: usize, protection: &Protection) -> Option<String> {
    let Protection { hpl_p50_m, vpl_p50_m, hpl_bounds, vpl_bounds, reliable_availability, misleading_epochs } =
        *protection;
    let misleading = misleading_epochs?;
    let number = |value: Option<f64>, digits: usize| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    };
    Some(format!(
        "| {method:6} | {name:width$} | {:>8} | {:>9} | {:>10} | {:>9} | {:>10} | {misleading:10} |\n",
        number(reliable_availability, 3),
        number(hpl_p50_m, 1),
        number(hpl_bounds, 4),
        number(vpl_p50_m, 1),
        number(vpl_bounds, 4),
    ))
}

fn accuracy_rows(method: &str, phones: &ByPhone, names: &[String], width: usize) -> String {
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
