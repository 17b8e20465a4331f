//! What needs attention after a run, most harmful first: a report in, findings out. No I/O.
//!
//! A wrong run looks like a right run: a truth in UTC, a constraint whose time has a typing error, a recording that was named twice. Each rule
//! here looks for one such mistake in counts and scores. Skipped parts are listed elsewhere.

mod constraints;
mod counted;
mod phones;
mod truth;

use std::fmt;

use serde::Serialize;

use crate::report::Report;

/// How harmful something is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Figures or positions are wrong, or not what was asked for.
    Wrong,
    /// Positions are worse than these recordings allow, or fewer.
    Worse,
    /// Worth knowing.
    Note,
}

/// A finding that needs attention.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// How harmful it is.
    pub severity: Severity,
    /// Its kind, for machines.
    pub kind: &'static str,
    /// The phones that it concerns; empty for the whole session.
    pub phones: Vec<String>,
    /// The finding, with its figures.
    pub text: String,
    /// Advice on a remedy.
    pub advice: String,
}

/// The findings of a session, most harmful first.
pub fn findings(report: &Report) -> Vec<Finding> {
    let mut findings = Vec::new();
    truth::look(report, &mut findings);
    constraints::look(report, &mut findings);
    phones::look(report, &mut findings);
    counted::look(report, &mut findings);
    // Causes first: large errors often follow from the findings so far.
    truth::look_at_errors(report, &mut findings);
    // Stable: within a severity the order of the rules stays.
    findings.sort_by_key(|finding| finding.severity);
    findings
}

/// The findings as a list for people.
pub fn render(findings: &[Finding]) -> String {
    if findings.is_empty() {
        return "Nothing needs attention.".to_owned();
    }
    let lines = findings.iter().map(|finding| format!("\n- {finding}"));
    std::iter::once("Needs attention, most harmful first:".to_owned()).chain(lines).collect()
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}. {}.", self.severity, self.text, self.advice)
    }
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Wrong => "WRONG",
            Self::Worse => "worse",
            Self::Note => "note",
        })
    }
}

/// A finding on several phones (or pairs), each with its figure.
struct Several {
    severity: Severity,
    kind: &'static str,
    text: &'static str,
    advice: &'static str,
}

impl Several {
    /// The finding, if `concerned` is not empty; each entry has phones and their figure.
    fn on(&self, concerned: Vec<(Vec<String>, String)>) -> Option<Finding> {
        let &Self { severity, kind, text, advice } = self;
        if concerned.is_empty() {
            return None;
        }
        let list: Vec<String> =
            concerned.iter().map(|(phones, figure)| format!("{} {figure}", phones.join("–"))).collect();
        let mut phones: Vec<String> = Vec::new();
        for phone in concerned.into_iter().flat_map(|(phones, _)| phones) {
            if !phones.contains(&phone) {
                phones.push(phone);
            }
        }
        let text = format!("{text}: {}", list.join(", "));
        Some(Finding { severity, kind, phones, text, advice: advice.to_owned() })
    }
}

/// A part of a whole as text.
fn percent(part: u64, whole: u64) -> String {
    let share = ratio(part, whole) * 100.0;
    if (10.0..99.5).contains(&share) || part == whole {
        format!("{share:.0} %")
    } else {
        format!("{share:.1} %")
    }
}

/// A part of a whole, at most 1; 0 of nothing.
fn ratio(part: u64, whole: u64) -> f64 {
    if whole == 0 { 0.0 } else { (part as f64 / whole as f64).min(1.0) }
}

#[cfg(test)]
mod tests;
