//! Rules about truths and scores.

use cofix_common::accuracy::Accuracy;

use super::{Finding, Several, Severity};
use crate::report::Report;
use crate::report::scores::TruthReport;

/// Mean heights this far off, with less than half as much scatter, are another reference surface, m. The geoid is up to 106 m from
/// the ellipsoid; an ionosphere that is not corrected moves heights by less than this on most days.
const HEIGHT_OFFSET_M: f64 = 8.0;
/// The same for the horizontal position, m: another datum, another phone's truth.
const HORIZONTAL_OFFSET_M: f64 = 3.0;
/// GPS time was so much ahead of UTC since 2006.
const LEAP_SECONDS_S: std::ops::RangeInclusive<f64> = 13.9..=18.1;
/// Ratio of the joint filter's 95th percentile to the phones' own from which on the constraints are named as misleading.
const MISLED: f64 = 1.2;
/// Normalised squared errors beyond this mean that sigmas are less than half of what they should be.
const PROMISES_TOO_MUCH: f64 = 10.0;

pub(super) fn look(report: &Report, findings: &mut Vec<Finding>) {
    findings.extend(SHIFTS.iter().filter_map(|kind| kind.look(report)));
    findings.extend(unmatched(report));
    findings.extend(misled(report));
}

pub(super) fn look_at_errors(report: &Report, findings: &mut Vec<Finding>) {
    findings.extend(offsets(report));
    findings.extend(promises(report));
    findings.extend(uncounted(report));
    findings.extend(without_truth(report));
}

/// Time shifts with one cause.
struct ShiftKind {
    looks_so: fn(f64) -> bool,
    advice: &'static str,
}

const SHIFTS: [ShiftKind; 3] = [
    ShiftKind {
        looks_so: is_leap_seconds,
        advice: "That looks like UTC (GPS time is 18 s more since 2017, 17 s before) or, if it is 14 s, like BeiDou time: write GPS time; the accuracies say nothing until then",
    },
    ShiftKind {
        looks_so: |shift_s| shift_s.abs() >= 900.0,
        advice: "That looks like the time of a zone: write GPS time; the accuracies say nothing until then",
    },
    ShiftKind {
        looks_so: |shift_s| shift_s.abs() < 900.0 && !is_leap_seconds(shift_s),
        advice: "That looks like a late or early clock: write GPS time; the accuracies say nothing until then",
    },
];

fn is_leap_seconds(shift_s: f64) -> bool {
    LEAP_SECONDS_S.contains(&shift_s)
}

impl ShiftKind {
    fn look(&self, report: &Report) -> Option<Finding> {
        let shifted = report.truth.iter().filter(|(_, truth)| truth.shift_s.is_some_and(self.looks_so));
        let concerned = shifted.filter_map(|(name, truth)| Some((vec![name.clone()], figures(truth)?)));
        Several {
            severity: Severity::Wrong,
            kind: "truth-time",
            text: "the times of a truth are not GPS time, or shifted",
            advice: self.advice,
        }
        .on(concerned.collect())
    }
}

fn figures(truth: &TruthReport) -> Option<String> {
    let (shift_s, shifted_m) = truth.shift_s.zip(truth.shifted_median_m)?;
    let later = if shift_s > 0.0 { "later" } else { "earlier" };
    let as_is = match truth.median_m {
        Some(as_is_m) => format!("{as_is_m:.1} m as it is"),
        None => "no time in common as it is".to_owned(),
    };
    Some(format!("fits {:.2} s {later} ({as_is}, {shifted_m:.1} m then)", shift_s.abs()))
}

/// Phones whose truth does not serve.
fn unmatched(report: &Report) -> Option<Finding> {
    let concerned = report.unscored.iter().filter(|(name, _)| report.truth.contains_key(*name));
    Several {
        severity: Severity::Wrong,
        kind: "truth-without-overlap",
        text: "there is a truth, but nothing was scored against it",
        advice: "Check that it is of this session, in GPS time, and [evaluation] truth_quality",
    }
    .on(concerned.map(|(name, reason)| (vec![name.clone()], format!("({reason})"))).collect())
}

fn scores<'a>(report: &'a Report, name: &str) -> Option<(&'a Accuracy, &'a Accuracy)> {
    let of = |phones: &'a crate::report::scores::ByPhone| phones.get(name)?.as_ref();
    Some((of(&report.methods.local)?, of(&report.methods.joint)?))
}

fn misled(report: &Report) -> Option<Finding> {
    if report.phones.len() < 2 {
        return None;
    }
    let concerned = report.phones.keys().filter_map(|name| {
        let (local, joint) = scores(report, name)?;
        let (alone_m, fused_m) = (local.horizontal_p95_m, joint.horizontal_p95_m);
        (fused_m > MISLED * alone_m && fused_m - alone_m > 1.0)
            .then(|| (vec![name.clone()], format!("{alone_m:.1} m alone, {fused_m:.1} m fused")))
    });
    Several {
        severity: Severity::Wrong,
        kind: "fusion-misleads",
        text: "fusion makes phones worse, by the 95th percentile of the horizontal error",
        advice: "A constraint that is not true does that: check bounds, phones and times of all of them",
    }
    .on(concerned.collect())
}

fn offsets(report: &Report) -> Vec<Finding> {
    let joint = |name: &String| scores(report, name).map(|(_, joint)| joint);
    let heights = report.phones.keys().filter_map(|name| {
        let a = joint(name)?;
        let scatter_m = (a.rmse_up_m.powi(2) - a.mean_up_m.powi(2)).max(0.0).sqrt();
        (a.mean_up_m.abs() > HEIGHT_OFFSET_M && scatter_m < 0.5 * a.mean_up_m.abs())
            .then(|| (vec![name.clone()], format!("{:+.1} ± {scatter_m:.1} m", a.mean_up_m)))
    });
    let heights = Several {
        severity: Severity::Wrong,
        kind: "height-offset",
        text: "heights are off by nearly the same everywhere (fused less truth)",
        advice: "Truths have heights above the ellipsoid, not above the geoid or the sea: check that, then the ionosphere",
    }
    .on(heights.collect());
    let places = report.phones.keys().filter_map(|name| {
        let a = joint(name)?;
        let mean_m = a.mean_east_m.hypot(a.mean_north_m);
        let scatter_m = (a.rmse_2d_m.powi(2) - mean_m.powi(2)).max(0.0).sqrt();
        // A truth whose times are off is told already.
        let is_told = report.truth.get(name).is_some_and(|truth| truth.shift_s.is_some());
        let figure = format!("{:+.1} m east, {:+.1} m north", a.mean_east_m, a.mean_north_m);
        (!is_told && mean_m > HORIZONTAL_OFFSET_M && scatter_m < 0.5 * mean_m)
            .then(|| (vec![name.clone()], figure))
    });
    let places = Several {
        severity: Severity::Worse,
        kind: "horizontal-offset",
        text: "positions are off by nearly the same everywhere (fused less truth)",
        advice: "Check the datum of truth, base station and orbits, and whose truth it is",
    }
    .on(places.collect());
    [heights, places].into_iter().flatten().collect()
}

fn promises(report: &Report) -> Option<Finding> {
    let concerned = report.phones.keys().filter_map(|name| {
        let joint = scores(report, name)?.1;
        let is_told = report.truth.get(name).is_some_and(|truth| truth.shift_s.is_some());
        let too_small = (joint.nees_horizontal / 2.0).sqrt();
        (!is_told && joint.nees_horizontal > PROMISES_TOO_MUCH)
            .then(|| (vec![name.clone()], format!("by a factor of {too_small:.1}")))
    });
    Several {
        severity: Severity::Worse,
        kind: "sigma-too-small",
        text: "fused positions are worse than their standard deviations promise",
        advice: "Do not rely on the sigmas of this session; reflections, a wrong constraint or a wrong truth do that",
    }
    .on(concerned.collect())
}

fn uncounted(report: &Report) -> Option<Finding> {
    let concerned =
        report.truth.iter().filter(|(_, truth)| 2 * truth.counted_rows < truth.rows).map(|(name, truth)| {
            (vec![name.clone()], format!("{} of {} rows", truth.counted_rows, truth.rows))
        });
    Several {
        severity: Severity::Note,
        kind: "truth-mostly-not-counted",
        text: "most rows of the truth are of a quality that does not count",
        advice: "Scores hold for the rest only; [evaluation] truth_quality says which count",
    }
    .on(concerned.collect())
}

/// Reported only when other phones have a truth: without any, the table says so.
fn without_truth(report: &Report) -> Option<Finding> {
    let phones: Vec<String> =
        report.phones.keys().filter(|name| !report.truth.contains_key(*name)).cloned().collect();
    (!report.truth.is_empty() && !phones.is_empty()).then(|| Finding {
        severity: Severity::Note,
        kind: "phone-without-truth",
        text: format!("not scored, for want of a truth: {}", phones.join(", ")),
        phones,
        advice: "Means over phones do not contain them".to_owned(),
    })
}
