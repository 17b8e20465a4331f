//! Rules about counts of skips. Reasons are those under which agents and hub count.

use cofix_common::skips::{Reason, Skip, Skips};

use super::{Finding, Several, Severity, percent, ratio};
use crate::report::{PhoneReport, Report};

/// Reasons that matter by their share of a phone's observations.
struct Share {
    reasons: &'static [Reason],
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
    reason: Reason,
    severity: Severity,
    kind: &'static str,
    advice: &'static str,
}

const SHARES: [Share; 5] = [
    Share {
        reasons: &[Reason::NoIonosphereModel, Reason::OutsideIonosphereMaps, Reason::IonosphereMapEmpty],
        left_out: false,
        limits: (0.0, 0.1),
        kind: "ionosphere-nominal",
        text: "the ionosphere is corrected by a climatology, which may cost metres (observations)",
        advice: "Name a navigation file with Klobuchar terms in its header, or an IONEX map of the day, or ionosphere = \"pair\" for phones with two bands",
    },
    Share {
        reasons: &[Reason::OutsideIonosphereMapsKlobucharUsed, Reason::IonosphereMapEmptyKlobucharUsed],
        left_out: false,
        limits: (0.0, 2.0),
        kind: "ionosphere-map-elsewhere",
        text: "observations for which the ionosphere maps have no value",
        advice: "Name the IONEX files of the day of the recording",
    },
    Share {
        reasons: &[Reason::NoSatelliteState],
        left_out: true,
        limits: (0.15, 0.5),
        kind: "no-orbits",
        text: "observations of satellites whose orbit no product has at that time",
        advice: "Orbits of another day, or without these systems: name products of the day of the recording",
    },
    Share {
        reasons: &[Reason::GroupDelayUnknown],
        left_out: false,
        limits: (0.25, 2.0),
        kind: "group-delay-unknown",
        text: "observations whose group delay no product has",
        advice: "Name a bias file (Bias-SINEX), or a navigation file of the same days",
    },
    Share {
        reasons: &[Reason::NoCarrierFrequency],
        left_out: true,
        limits: (0.05, 2.0),
        kind: "no-carrier-frequency",
        text: "observations whose carrier frequency is not known",
        advice: "GLONASS needs its channels: a navigation file with GLONASS, or a header that tells them",
    },
];

const ANY: [Any; 21] = [
    Any {
        reason: Reason::MessageBeyondRate,
        severity: Severity::Worse,
        kind: "messages-refused",
        advice: "The phone's agent, or whoever speaks for it, sends more than any phone measures: look at that agent",
    },
    Any {
        reason: Reason::TwoAgentsOfOneName,
        severity: Severity::Wrong,
        kind: "two-agents",
        advice: "Two agents go by one name, and the second was refused while the first was there: give each its own, or end the one that is too much",
    },
    Any {
        reason: Reason::JointFilterRestarted,
        severity: Severity::Worse,
        kind: "filter-restarted",
        advice: "Constraints act anew from there; look at that time in the recording",
    },
    Any {
        reason: Reason::PhoneTakenOutOfFilter,
        severity: Severity::Worse,
        kind: "filter-restarted",
        advice: "Its messages made the state unsound; look at that time in the recording",
    },
    Any {
        reason: Reason::LostPhoneRestarted,
        severity: Severity::Worse,
        kind: "filter-restarted",
        advice: "Its observations contradicted its state for five epochs: a jump of its clock, a tunnel, or a wrong constraint",
    },
    Any {
        reason: Reason::LocalFilterRestarted,
        severity: Severity::Note,
        kind: "filter-restarted",
        advice: "The phone's own filter began anew after a gap or a contradiction; look at that time in the recording",
    },
    Any {
        reason: Reason::SilentPhoneDropped,
        severity: Severity::Note,
        kind: "phone-silent",
        advice: "Constraints with it did not act until it came back",
    },
    Any {
        reason: Reason::NoDateGiven,
        severity: Severity::Worse,
        kind: "date-guessed",
        advice: "A copied file has another date: give date = \"YYYY-MM-DDThh:mm:ss\" for this phone",
    },
    Any {
        reason: Reason::ClocksWithoutSp3Orbits,
        severity: Severity::Worse,
        kind: "product-not-used",
        advice: "Name the SP3 orbits that go with it",
    },
    Any {
        reason: Reason::EpochsNotArrived,
        severity: Severity::Worse,
        kind: "epochs-lost",
        advice: "Check the link between agent and hub",
    },
    Any {
        reason: Reason::TooManyEpochsWait,
        severity: Severity::Worse,
        kind: "epochs-lost",
        advice: "The phone is far ahead of the others: check clocks and links of all",
    },
    Any {
        reason: Reason::EpochBeforeFilterTime,
        severity: Severity::Worse,
        kind: "epochs-too-late",
        advice: "They came after their time was fused: a longer --latency waits for them",
    },
    Any {
        reason: Reason::PhoneBehind,
        severity: Severity::Worse,
        kind: "epochs-too-late",
        advice: "Check the phone's link and clock; a longer --latency waits for it",
    },
    Any {
        reason: Reason::PhoneAhead,
        severity: Severity::Worse,
        kind: "phone-ahead",
        advice: "Check the phone's clock: its epochs are fused only when the group has come so far",
    },
    Any {
        reason: Reason::EpochFarFromNeighbours,
        severity: Severity::Worse,
        kind: "epochs-lost",
        advice: "Their times are far from those before and after: check the recording's dates",
    },
    Any {
        reason: Reason::MessageUnreadable,
        severity: Severity::Worse,
        kind: "messages-refused",
        advice: "Agent and hub are of different versions, or somebody else publishes there",
    },
    Any {
        reason: Reason::MessageRefused,
        severity: Severity::Worse,
        kind: "messages-refused",
        advice: "Values that cannot be true: see the first one in the report",
    },
    Any {
        reason: Reason::PhoneUnknown,
        severity: Severity::Worse,
        kind: "unknown-phone",
        advice: "Add it to the session file as [[phone]], or correct the agent's --phone",
    },
    Any {
        reason: Reason::VelocityContradictsPositions,
        severity: Severity::Note,
        kind: "truth-velocity",
        advice: "Check the order and the unit of the truth's velocities",
    },
    Any {
        reason: Reason::GroupDelaysOld,
        severity: Severity::Note,
        kind: "group-delays-old",
        advice: "A navigation file of the same days has newer ones",
    },
    Any {
        reason: Reason::SourceBroughtNothing,
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
        let counted: Vec<(Option<&String>, (&str, &Skip))> =
            all.filter_map(|(name, skips)| Some((name, self.find(skips)?))).collect();
        let total: u64 = counted.iter().map(|(_, (_, skip))| skip.count).sum();
        let (_, (key, Skip { first, .. })) = counted.first()?;
        Some(Finding {
            severity: self.severity,
            kind: self.kind,
            phones: counted.iter().filter_map(|(name, ..)| name.map(String::to_owned)).collect(),
            text: format!("{total} × {key} (first: {first})"),
            advice: self.advice.to_owned(),
        })
    }

    /// The count under the reason alone, or behind the stage that counted it.
    fn find<'a>(&self, skips: &'a Skips) -> Option<(&'a str, &'a Skip)> {
        let is_it = |key: &str| {
            key.strip_suffix(self.reason.text())
                .is_some_and(|stage| stage.is_empty() || stage.ends_with(": "))
        };
        skips.iter().find(|(key, _)| is_it(key))
    }
}

/// All reasons that are looked for.
#[cfg(test)]
pub(super) fn reasons() -> impl Iterator<Item = Reason> {
    let shares = SHARES.iter().flat_map(|share| share.reasons.iter().copied());
    shares.chain(ANY.iter().map(|any| any.reason))
}
