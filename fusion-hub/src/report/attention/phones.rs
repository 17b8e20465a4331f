//! Rules about phones.

use super::{Finding, Several, Severity, percent, ratio};
use crate::report::{PhoneReport, Report, Verdicts};

/// Least share of the group's time.
const LEAST_SHARE: f64 = 0.9;
/// Least share of the group's epochs with more than one phone.
const LEAST_COMMON: f64 = 0.5;
/// Least share of a phone's observations with a range rate.
const LEAST_RATES: f64 = 0.5;
/// Largest share of a phone's epochs without a solution.
const MOST_UNSOLVED: f64 = 0.05;
/// Largest share of a phone's epochs that are not reliable.
const MOST_UNRELIABLE: f64 = 0.25;
/// The same, beyond which the positions cannot be trusted.
const HARDLY_RELIABLE: f64 = 0.9;
/// Least mean number of satellites.
const FEWEST_SATELLITES: f64 = 7.0;

/// A rule about single phones.
struct Rule {
    finding: Several,
    /// The figure of a phone that it concerns.
    figure: fn(&PhoneReport) -> Option<String>,
}

const PART_OF_THE_TIME: Rule = Rule {
    finding: Several {
        severity: Severity::Worse,
        kind: "phone-part-of-the-time",
        text: "phones that were there for a part of the session",
        advice: "Their scores hold for that part only; availability counts what they missed",
    },
    figure: |phone| {
        let share = phone.share_of_group.filter(|share| *share < LEAST_SHARE)?;
        let (first, last) = phone.first_gps.as_ref().zip(phone.last_gps.as_ref())?;
        Some(format!("{:.0} % of the time, {first} to {last} GPS", share * 100.0))
    },
};

const RULES: [Rule; 3] = [
    Rule {
        finding: Several {
            severity: Severity::Worse,
            kind: "epochs-without-solution",
            text: "epochs without a solution of their own",
            advice: "Too few satellites: check the masks, and that the products hold them all",
        },
        figure: |phone| {
            let unsolved = phone.epochs_without_solution;
            (ratio(unsolved, phone.epochs) > MOST_UNSOLVED).then(|| percent(unsolved, phone.epochs))
        },
    },
    Rule {
        finding: Several {
            severity: Severity::Worse,
            kind: "few-satellites",
            text: "few satellites in use, on average",
            advice: "Check the masks, that the products hold all systems, and what the phone records",
        },
        figure: |phone| {
            phone.mean_satellites.filter(|mean| *mean < FEWEST_SATELLITES).map(|mean| format!("{mean:.1}"))
        },
    },
    Rule {
        finding: Several {
            severity: Severity::Worse,
            kind: "no-doppler",
            text: "observations without Doppler",
            advice: "Velocities then follow from positions alone, and are metres per second worse",
        },
        figure: |phone| {
            let without = phone.observations - phone.observations_with_rate.min(phone.observations);
            (ratio(without, phone.observations) > 1.0 - LEAST_RATES)
                .then(|| percent(without, phone.observations))
        },
    },
];

pub(super) fn look(report: &Report, findings: &mut Vec<Finding>) {
    findings.extend(report.same_observations.iter().map(|same| Finding {
        severity: Severity::Wrong,
        kind: "same-observations",
        phones: same.phones.to_vec(),
        text: format!("{} have the same observations ({} epochs)", same.phones.join(" and "), same.epochs),
        advice:
            "One recording was named for two phones: it counts twice, and sigmas are too small".to_owned(),
    }));
    findings.extend(absent(report));
    findings.extend(on(report, &PART_OF_THE_TIME));
    findings.extend(apart(report));
    findings.extend(RULES.iter().filter_map(|rule| on(report, rule)));
    findings.extend(unreliable(report));
}

/// Phones that came.
fn came(report: &Report) -> impl Iterator<Item = (&String, &PhoneReport)> {
    report.phones.iter().filter(|(_, phone)| phone.epochs > 0)
}

/// One finding on the phones that a rule concerns.
fn on(report: &Report, rule: &Rule) -> Option<Finding> {
    let concerned =
        came(report).filter_map(|(name, phone)| Some((vec![name.clone()], (rule.figure)(phone)?)));
    rule.finding.on(concerned.collect())
}

fn absent(report: &Report) -> Option<Finding> {
    let phones: Vec<String> = report
        .phones
        .iter()
        .filter(|(_, phone)| phone.epochs == phone.empty_epochs)
        .map(|(name, _)| name.clone())
        .collect();
    (!phones.is_empty()).then(|| Finding {
        severity: Severity::Wrong,
        kind: "phone-without-epochs",
        text: format!("no epoch with a usable observation came of {}", phones.join(", ")),
        phones,
        advice: "Check that its agent ran, for this group and under this name, and what it says".to_owned(),
    })
}

fn apart(report: &Report) -> Option<Finding> {
    // A phone at a lower rate than another has at most all of its own epochs in common with it.
    let mut epochs: Vec<u64> = report.phones.values().map(|phone| phone.epochs).collect();
    epochs.sort_unstable();
    let possible = epochs.iter().rev().nth(1).copied().unwrap_or_default().min(report.epochs);
    let share = ratio(report.common_epochs, possible);
    (possible > 0 && share < LEAST_COMMON).then(|| Finding {
        severity: Severity::Worse,
        kind: "phones-apart-in-time",
        phones: Vec::new(),
        text: format!(
            "phones were together at {} of the epochs that they could have in common ({} of {possible})",
            percent(report.common_epochs, possible),
            report.common_epochs,
        ),
        advice: "Fusion helps only then: check that the recordings are of one time".to_owned(),
    })
}

fn unreliable(report: &Report) -> Option<Finding> {
    let mut severity = Severity::Worse;
    let mut concerned = Vec::new();
    for (name, phone) in came(report) {
        let bad = phone.epochs - Verdicts::of(phone).reliable.min(phone.epochs);
        let share = ratio(bad, phone.epochs);
        if share > HARDLY_RELIABLE {
            severity = Severity::Wrong;
        }
        if share > MOST_UNRELIABLE {
            concerned.push((vec![name.clone()], percent(bad, phone.epochs)));
        }
    }
    let finding = Several {
        severity,
        kind: "not-reliable",
        text: "epochs that RAIM does not call reliable",
        advice: "The report has the verdicts by cause; the recording shows when",
    };
    finding.on(concerned)
}
