//! `docs/report.md` names every key of a report.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

use std::collections::BTreeSet;

use cofix_agent::Stop;
use cofix_agent::files::Named;
use cofix_common::simulation::Scenario;
use cofix_common::skips::Reason;
use cofix_hub::demo;
use cofix_hub::replay::{ReplayOptions, replay};
use cofix_hub::report::{InputFile, Report, SameObservations};
use serde_json::Value;

const DOCUMENT: &str = include_str!("../../docs/report.md");

/// Objects whose keys are data: names of phones, reasons, verdicts.
const BY_NAME: [&str; 13] = [
    "lost",
    "changed",
    "wls",
    "local",
    "joint",
    "unscored",
    "truth",
    "phones",
    "constraints",
    "verdicts",
    "by_reason",
    "not_applied_because",
    "",
];

fn keys(name: &str, value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(members) => {
            for (key, value) in members {
                if BY_NAME.contains(&name) {
                    keys("a name", value, found);
                } else {
                    found.insert(key.clone());
                    keys(key, value, found);
                }
            }
        }
        Value::Array(values) => values.iter().for_each(|value| keys("an element", value, found)),
        _ => {}
    }
}

/// Of a small session, simulated.
fn report() -> Report {
    let mut plan = demo::plan(Scenario { duration_s: 20.0, ..Scenario::default() }).unwrap();
    plan.settings.estimator.filter.maximum_gap_s = 4.0;
    replay(&plan, &ReplayOptions::default(), &Stop::default()).unwrap().report
}

#[test]
fn every_key_of_a_report_is_documented() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("a.rnx");
    std::fs::write(&input, "abc").unwrap();
    let mut report = report();
    report.inputs =
        vec![InputFile::read(&Named::new("the observations of a", &input), folder.path()).unwrap()];
    report.skips.add(Reason::SourceFailed, || "the first".to_owned());
    let phones = ["a", "b"].map(str::to_owned);
    report.same_observations = vec![SameObservations { phones, epochs: 1 }];
    let value: Value = serde_json::from_str(&report.json().unwrap()).unwrap();
    let mut found = BTreeSet::new();
    keys("the report", &value, &mut found);
    for key in [
        "sha256",
        "severity",
        "from_gps",
        "maximum_m",
        "first",
        "shift_s",
        "vertical_p95_m",
        "median",
        "changed",
    ] {
        assert!(found.contains(key), "{key} is not in the report that is looked at: {found:?}");
    }
    let missing: Vec<&String> = found.iter().filter(|key| !DOCUMENT.contains(&format!("`{key}`"))).collect();
    assert!(missing.is_empty(), "docs/report.md does not tell of {missing:?}");
}

#[test]
fn reports_of_two_runs_are_the_same() {
    assert_eq!(report().json().unwrap(), report().json().unwrap());
}

#[test]
fn every_kind_of_finding_is_documented() {
    let sources = [
        include_str!("../src/report/attention/truth.rs"),
        include_str!("../src/report/attention/constraints.rs"),
        include_str!("../src/report/attention/phones.rs"),
        include_str!("../src/report/attention/counted.rs"),
    ];
    let kinds: BTreeSet<&str> = sources
        .iter()
        .flat_map(|source| source.split("kind: \"").skip(1))
        .filter_map(|rest| rest.split('"').next())
        .collect();
    assert!(kinds.len() > 25, "{kinds:?}");
    for kind in kinds {
        assert!(DOCUMENT.contains(&format!("`{kind}`")), "docs/report.md does not tell of {kind}");
    }
}
