//! Four phones on one car with truth, through agents, Zenoh and hub: accuracy must not slip by a tenth.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

#[path = "../../common/tests/beside/mod.rs"]
mod beside;

use std::path::PathBuf;

use cofix_agent::Stop;
use cofix_common::accuracy::Accuracy;
use cofix_hub::replay::{Outcome, Plan, ReplayOptions, replay};
use cofix_hub::scores::ByPhone;
use cofix_hub::session::Session;

/// Mean over the four phones of the 50th and 95th percentile of the horizontal error, m.
type Percentiles = (f64, f64);

/// What was measured when this was written.
struct Measured {
    session: &'static str,
    wls: Percentiles,
    local: Percentiles,
    joint: Percentiles,
}

const SLIP: f64 = 1.10;

/// A session's plan.
fn plan(name: &str) -> Plan {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("sessions/{name}.toml"));
    Plan::from_session(&Session::read_with_data(&path, Some(&beside::path("data"))).unwrap()).unwrap()
}

fn accuracies(phones: &ByPhone) -> Vec<Accuracy> {
    phones.iter().map(|(name, accuracy)| accuracy.unwrap_or_else(|| panic!("{name} is not scored"))).collect()
}

fn check(name: &str, method: &str, phones: &ByPhone, measured: Percentiles) {
    let accuracies = accuracies(phones);
    let mean =
        |value: fn(&Accuracy) -> f64| accuracies.iter().map(value).sum::<f64>() / accuracies.len() as f64;
    let (p50, p95) = (mean(|a| a.horizontal_p50_m), mean(|a| a.horizontal_p95_m));
    println!("{name} {method}: {p50:.3} / {p95:.3} m");
    assert!(p50 <= SLIP * measured.0, "{name} {method}: p50 {p50:.3} m, was {}", measured.0);
    assert!(p95 <= SLIP * measured.1, "{name} {method}: p95 {p95:.3} m, was {}", measured.1);
    for accuracy in &accuracies {
        assert!(accuracy.availability >= 0.97, "{name} {method}: availability {}", accuracy.availability);
    }
}

fn check_session(measured: &Measured) -> (Plan, Outcome) {
    let plan = plan(measured.session);
    let folder = tempfile::tempdir().unwrap();
    let options =
        ReplayOptions { recording: Some(folder.path().join("run.rrd")), ..ReplayOptions::default() };
    let outcome = replay(&plan, &options, &Stop::default()).unwrap();
    let methods = &outcome.report.methods;
    check(measured.session, "wls", &methods.wls, measured.wls);
    check(measured.session, "local", &methods.local, measured.local);
    check(measured.session, "joint", &methods.joint, measured.joint);
    for (joint, local) in accuracies(&methods.joint).iter().zip(accuracies(&methods.local)) {
        assert!(joint.horizontal_p95_m < local.horizontal_p95_m, "{joint:?} against {local:?}");
    }
    let bytes = outcome.recording.as_ref().unwrap().1.bytes;
    assert!(bytes < 20_000_000, "{}: a recording of {bytes} bytes", measured.session);
    (plan, outcome)
}

#[test]
#[ignore = "needs the reference data"]
fn wh_3_08() {
    let measured =
        Measured { session: "WH-3-08", wls: (1.780, 5.245), local: (1.054, 2.809), joint: (0.533, 1.490) };
    let (plan, outcome) = check_session(&measured);
    let again = replay(&plan, &ReplayOptions::default(), &Stop::default()).unwrap();
    assert_eq!(outcome.report.json().unwrap(), again.report.json().unwrap(), "two runs, one report");
}

#[test]
#[ignore = "needs the reference data"]
fn wh_3_09() {
    check_session(&Measured {
        session: "WH-3-09",
        wls: (1.888, 5.158),
        local: (1.274, 2.737),
        joint: (0.632, 1.492),
    });
}

#[test]
#[ignore = "needs the reference data"]
fn wh_4_06() {
    check_session(&Measured {
        session: "WH-4-06",
        wls: (1.840, 4.674),
        local: (1.092, 2.201),
        joint: (0.761, 1.636),
    });
}
