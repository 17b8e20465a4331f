//! Rules about constraints.

use std::collections::BTreeSet;

use super::{Finding, Several, Severity, percent, ratio};
use crate::report::{ConstraintReport, Report};

/// Share of its epochs beyond which a refused constraint is wrong; below it, a phone may have left for a while.
const MOSTLY: f64 = 0.5;
/// Share of its epochs beyond which a refused or violated constraint is reported.
const OFTEN: f64 = 0.02;

/// A rule about single constraints.
struct Rule {
    finding: Several,
    /// The figure of a constraint that it concerns.
    figure: fn(&ConstraintReport) -> Option<String>,
}

const REFUSED: Several = Several {
    severity: Severity::Wrong,
    kind: "constraint-refused",
    text: "was refused, because positions contradict it by more than six standard deviations, at so much of its epochs",
    advice: "Either the bound is wrong, or a phone was elsewhere, or the positions are far off: the fused ones are then without it",
};

const RULES: [Rule; 5] = [
    Rule {
        finding: Several {
            severity: Severity::Wrong,
            kind: "constraint-never-in-force",
            text: "was never in force, its phones were not in the joint filter together",
            advice: "Check that the recordings are of one time",
        },
        figure: |c| {
            (c.epochs_in_window > 0 && c.epochs_in_force == 0)
                .then(|| format!("(0 of {} epochs)", c.epochs_in_window))
        },
    },
    Rule {
        finding: REFUSED,
        figure: |c| (refused_share(c) > MOSTLY).then(|| percent(c.refused(), c.epochs_in_force)),
    },
    Rule {
        finding: Several { severity: Severity::Worse, ..REFUSED },
        figure: |c| {
            let share = refused_share(c);
            (share > OFTEN && share <= MOSTLY).then(|| percent(c.refused(), c.epochs_in_force))
        },
    },
    Rule {
        // Applied, and in vain.
        finding: Several {
            severity: Severity::Worse,
            kind: "constraint-violated",
            text: "was applied, and positions are still outside of it, at so much of its epochs",
            advice: "Check whether constraints contradict each other",
        },
        figure: |c| {
            let violated = c.violated_after.saturating_sub(c.not_applied);
            (ratio(violated, c.epochs_in_force) > 5.0 * OFTEN).then(|| percent(violated, c.epochs_in_force))
        },
    },
    Rule {
        // In force, and of no effect: true by far, or a course of a phone that stands.
        finding: Several {
            severity: Severity::Note,
            kind: "constraint-without-effect",
            text: "never changed anything",
            advice: "The positions are inside of it by far, or, of a heading, the phone is too slow to have one",
        },
        figure: |c| {
            (c.epochs_in_force > 0 && c.acted == 0 && c.not_applied == 0)
                .then(|| format!("(in force at {} epochs)", c.epochs_in_force))
        },
    },
];

pub(super) fn look(report: &Report, findings: &mut Vec<Finding>) {
    if report.epochs == 0 {
        return;
    }
    for (what, constraints) in report.alike_constraints() {
        findings.extend(outside_the_session(report, &what, &constraints));
        findings.extend(RULES.iter().filter_map(|rule| on(&what, &constraints, rule)));
    }
    if report.constraints.is_empty() && report.phones.len() > 1 {
        findings.push(Finding {
            severity: Severity::Note,
            kind: "no-constraint",
            phones: Vec::new(),
            text: "no constraint between the phones: fusion cannot help them".to_owned(),
            advice: "Say what is known of them, for one the largest distance, as [[constraint]]".to_owned(),
        });
    }
}

/// Share of its epochs in force at which a constraint was refused.
fn refused_share(constraint: &ConstraintReport) -> f64 {
    ratio(constraint.refused(), constraint.epochs_in_force)
}

/// One finding on the constraints that a rule concerns.
fn on(what: &str, constraints: &[&ConstraintReport], rule: &Rule) -> Option<Finding> {
    let concerned = constraints.iter().filter_map(|c| Some((c.phones.clone(), (rule.figure)(c)?)));
    let finding = rule.finding.on(concerned.collect())?;
    Some(Finding { text: format!("constraint {what} {}", finding.text), ..finding })
}

fn outside_the_session(report: &Report, what: &str, constraints: &[&ConstraintReport]) -> Option<Finding> {
    let phones: Vec<String> = constraints
        .iter()
        .filter(|c| c.epochs_in_window == 0)
        .flat_map(|c| c.phones.iter().cloned())
        .collect::<BTreeSet<_>>()
        .into_iter()
        .collect();
    let (first, last) = report.first_gps.as_ref().zip(report.last_gps.as_ref())?;
    (!phones.is_empty()).then(|| Finding {
        severity: Severity::Wrong,
        kind: "constraint-never-in-force",
        text: format!(
            "constraint {what} of {} was never in force: the session is from {first} to {last} GPS",
            phones.join(", ")
        ),
        phones,
        advice: "Correct from_gps and to_gps, in GPS time".to_owned(),
    })
}
