//! Rules about counts of skips. Reasons are those under which agents and hub count.

use cofix_common::skips::Skips;

use super::{Finding, Several, Severity, percent, ratio};
use crate::report::{PhoneReport, Report};

/// Reasons that matter by their share of a phone's observations.
struct Share {
    reasons: &'static [&'static str],
    /// Whether the counted observations were left out of the phone's observations.
    left_out: bool,
    /// Share beyond which it is reported, and share beyond which it is [`Severity::Wrong`].
    limits: (f64, f64),
    kind: &'static str,
    text: &'static str,
    advice: &'static str,
}

/// A reason that matters however seldom it is.
struct Any {
    reason: &'static str,
    severity: Severity,
    kind: &'static str,
    advice: &'static str,
}

const SHARES: [Share; 5] = [
    Share {
        reasons: &[
            "no ionosphere model in any product, ionosphere not corrected",
            "instant outside the ionosphere maps, ionosphere not corrected",
            "ionosphere map without a value at the pierce point, ionosphere not corrected",
        ],
        left_out: false,
        limits: (0.0, 0.1),
        kind: "ionosphere-not-corrected",
        text: "the ionosphere is not corrected, which costs metres (observations)",
        advice: "Name a navigation file with Klobuchar terms in its header, or an IONEX map of the day, or ionosphere = \"pair\" for phones with two bands",
    },
    Share {
        reasons: &[
            "instant outside the ionosphere maps, Klobuchar used",
            "ionosphere map without a value at the pierce point, Klobuchar used",
        ],
        left_out: false,
        limits: (0.0, 2.0),
        kind: "ionosphere-map-elsewhere",
        text: "observations for which the ionosphere maps have no value",
        advice: "Name the IONEX files of the day of the recording",
    },
    Share {
        reasons: &["no satellite state"],
        left_out: true,
        limits: (0.15, 0.5),
        kind: "no-orbits",
        text: "observations of satellites whose orbit no product has at that time",
        advice: "Orbits of another day, or without these systems: name products of the day of the recording",
    },
    Share {
        reasons: &["group delay unknown, used with a larger sigma"],
        left_out: false,
        limits: (0.25, 2.0),
        kind: "group-delay-unknown",
        text: "observations whose group delay no product has",
        advice: "Name a bias file (Bias-SINEX), or a navigation file of the same days",
    },
    Share {
        reasons: &["no carrier frequency"],
        left_out: true,
        limits: (0.05, 2.0),
        kind: "no-carrier-frequency",
        text: "observations whose carrier frequency is not known",
        advice: "GLONASS needs its channels: a navigation file with GLONASS, or a header that tells them",
    },
];

const ANY: [Any; 20] = [
    Any {
        reason: "two agents of one name at a time",
        severity: Severity::Wrong,
        kind: "two-agents",
        advice: "Two phones under one name are mixed: give each its own, and end the agent that is too much",
    },
    Any {
        reason: "joint filter restarted",
        severity: Severity::Worse,
        kind: "filter-restarted",
        advice: "Constraints act anew from there; look at that time in the recording",
    },
    Any {
        reason: "phone taken out of the filter",
        severity: Severity::Worse,
        kind: "filter-restarted",
        advice: "Its messages made the state unsound; look at that time in the recording",
    },
    Any {
        reason: "lost phone started anew in the filter",
        severity: Severity::Worse,
        kind: "filter-restarted",
        advice: "Its observations contradicted its state for five epochs: a jump of its clock, a tunnel, or a wrong constraint",
    },
    Any {
        reason: "local filter restarted",
        severity: Severity::Note,
        kind: "filter-restarted",
        advice: "The phone's own filter began anew after a gap or a contradiction; look at that time in the recording",
    },
    Any {
        reason: "silent phone dropped from the filter",
        severity: Severity::Note,
        kind: "phone-silent",
        advice: "Constraints with it did not act until it came back",
    },
    Any {
        reason: "no date was given: the week is that of the file's last change",
        severity: Severity::Worse,
        kind: "date-guessed",
        advice: "A copied file has another date: give date = \"YYYY-MM-DDThh:mm:ss\" for this phone",
    },
    Any {
        reason: "clock or bias file without SP3 orbits, not used",
        severity: Severity::Worse,
        kind: "product-not-used",
        advice: "Name the SP3 orbits that go with it",
    },
    Any {
        reason: "published epochs did not arrive",
        severity: Severity::Worse,
        kind: "epochs-lost",
        advice: "Check the link between agent and hub",
    },
    Any {
        reason: "too many epochs wait for the other phones",
        severity: Severity::Worse,
        kind: "epochs-lost",
        advice: "The phone is far ahead of the others: check clocks and links of all",
    },
    Any {
        reason: "epoch before the filter's time",
        severity: Severity::Worse,
        kind: "epochs-too-late",
        advice: "They came after their time was fused: a longer --latency waits for them",
    },
    Any {
        reason: "phone behind the others: not waited for",
        severity: Severity::Worse,
        kind: "epochs-too-late",
        advice: "Check the phone's link and clock; a longer --latency waits for it",
    },
    Any {
        reason: "phone ahead of the others: held back",
        severity: Severity::Worse,
        kind: "phone-ahead",
        advice: "Check the phone's clock: its epochs are fused only when the group has come so far",
    },
    Any {
        reason: "epoch far from its neighbours",
        severity: Severity::Worse,
        kind: "epochs-lost",
        advice: "Their times are far from those before and after: check the recording's dates",
    },
    Any {
        reason: "message unreadable",
        severity: Severity::Worse,
        kind: "messages-refused",
        advice: "Agent and hub are of different versions, or somebody else publishes there",
    },
    Any {
        reason: "message refused",
        severity: Severity::Worse,
        kind: "messages-refused",
        advice: "Values that cannot be true: see the first one in the report",
    },
    Any {
        reason: "phone unknown to the session",
        severity: Severity::Worse,
        kind: "unknown-phone",
        advice: "Add it to the session file as [[phone]], or correct the agent's --phone",
    },
    Any {
        reason: "truth: stated velocity contradicts the positions, which are followed",
        severity: Severity::Note,
        kind: "truth-velocity",
        advice: "Check the order and the unit of the truth's velocities",
    },
    Any {
        reason: "group delays more than a week from the observations, used all the same",
        severity: Severity::Note,
        kind: "group-delays-old",
        advice: "A navigation file of the same days has newer ones",
    },
    Any {
        reason: "source brought neither an ephemeris nor an epoch of a base",
        severity: Severity::Worse,
        kind: "no-base",
        advice: "Nothing is corrected by that source: check that it is of the same time and has observations",
    },
];

pub(super) fn look(report: &Report, findings: &mut Vec<Finding>) {
    for share in &SHARES {
        findings.extend(share.look(report));
    }
    for any in &ANY {
        findings.extend(any.look(report));
    }
}

impl Share {
    fn look(&self, report: &Report) -> Option<Finding> {
        let (least, wrong) = self.limits;
        let mut severity = Severity::Worse;
        let concerned = report.phones.iter().filter_map(|(name, phone)| {
            let (counted, all) = self.count(phone);
            let share = ratio(counted, all);
            if share > wrong {
                severity = Severity::Wrong;
            }
            (counted > 0 && share > least).then(|| (vec![name.clone()], percent(counted.min(all), all)))
        });
        let concerned = concerned.collect();
        let Self { kind, text, advice, .. } = *self;
        Several { severity, kind, text, advice }.on(concerned)
    }

    fn count(&self, phone: &PhoneReport) -> (u64, u64) {
        let counted = self.reasons.iter().map(|reason| phone.skips.count(reason)).sum();
        (counted, phone.observations + if self.left_out { counted } else { 0 })
    }
}

impl Any {
    fn look(&self, report: &Report) -> Option<Finding> {
        let of_phones = report.phones.iter().map(|(name, phone)| (Some(name), &phone.skips));
        let all = of_phones.chain([(None, &report.skips)]);
        let counted: Vec<(Option<&String>, u64, &str)> =
            all.filter_map(|(name, skips)| self.count(skips).map(|(n, first)| (name, n, first))).collect();
        let total: u64 = counted.iter().map(|(_, count, _)| count).sum();
        let (_, _, first) = counted.first()?;
        Some(Finding {
            severity: self.severity,
            kind: self.kind,
            phones: counted.iter().filter_map(|(name, ..)| name.map(String::to_owned)).collect(),
            text: format!("{total} × {} (first: {first})", self.reason),
            advice: self.advice.to_owned(),
        })
    }

    fn count<'a>(&self, skips: &'a Skips) -> Option<(u64, &'a str)> {
        let is_it = |reason: &str| {
            reason.strip_suffix(self.reason).is_some_and(|doing| doing.is_empty() || doing.ends_with(": "))
        };
        let (_, skip) = skips.iter().find(|(reason, _)| is_it(reason))?;
        Some((skip.count, skip.first.as_str()))
    }
}

/// All reasons that are looked for, without what the hub puts before them.
#[cfg(test)]
pub(super) fn reasons() -> impl Iterator<Item = &'static str> {
    let shares = SHARES.iter().flat_map(|share| share.reasons.iter().copied());
    shares.chain(ANY.iter().map(|any| any.reason.trim_start_matches("truth: ")))
}
