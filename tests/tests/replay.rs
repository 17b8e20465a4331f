//! Whole sessions through agents and hub over Zenoh on loopback.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use cofix_agent::{ProductFiles, ProductSource, Source, Speed, Stop};
use cofix_common::constraint::Constraint;
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::Products;
use cofix_common::simulation::PhoneOptions;
use cofix_hub::outputs::OutputFiles;
use cofix_hub::replay::{Outcome, Plan, ReplayOptions, replay};
use cofix_tests::{limits, plan_of, small_plan};
use cofix_viewer::summary::Summary;

fn run(plan: &Plan) -> anyhow::Result<Outcome> {
    replay(plan, &ReplayOptions::default(), &Stop::default())
}

fn recording_to(path: PathBuf) -> ReplayOptions {
    let files = OutputFiles { recording: Some(path), ..OutputFiles::default() };
    ReplayOptions { files, ..ReplayOptions::default() }
}

fn failure(plan: &Plan) -> String {
    format!("{:#}", run(plan).expect_err("the replay should fail"))
}

fn phone(rank: usize, starts_after_s: f64, stops_before_s: f64) -> PhoneOptions {
    PhoneOptions { starts_after_s, stops_before_s, ..PhoneOptions::of_vehicle(rank) }
}

#[test]
fn every_epoch_of_every_phone_is_fused_and_scored() {
    let plan = small_plan(3, 60.0).unwrap();
    let report = run(&plan).unwrap().report;
    for planned in &plan.phones {
        let Source::Epochs(epochs) = &planned.source else { panic!("simulated") };
        let of_phone = &report.phones[&planned.name];
        assert_eq!(of_phone.epochs, epochs.len() as u64, "{}", planned.name);
        assert!(of_phone.verdicts.values().sum::<u64>() == of_phone.epochs);
        for methods in [&report.methods.wls, &report.methods.local, &report.methods.joint] {
            let accuracy = methods[&planned.name].unwrap();
            assert!(accuracy.availability > 0.95, "{accuracy:?}");
            assert!(accuracy.horizontal_p95_m < 15.0, "{accuracy:?}");
        }
    }
    assert!(report.common_epochs >= 59, "{}", report.common_epochs);
    assert!(report.unscored.is_empty());
    assert!(report.constraints.keys().any(|key| key == "distance SIM1 SIM2"));
}

#[test]
fn two_runs_report_the_same_byte_for_byte() {
    let plan = small_plan(3, 40.0).unwrap();
    let (first, second) = (run(&plan).unwrap(), run(&plan).unwrap());
    assert_eq!(first.report.json().unwrap(), second.report.json().unwrap());
    assert_eq!(first.table, second.table);
}

#[test]
fn phones_that_come_and_go_are_fused_while_they_are_there() {
    let plan = plan_of(vec![phone(0, 0.0, 20.0), phone(1, 20.0, 0.0)], 60.0).unwrap();
    let report = run(&plan).unwrap().report;
    assert!((18..=22).contains(&report.common_epochs), "{}", report.common_epochs);
    assert!((59..=61).contains(&report.epochs), "{}", report.epochs);
}

#[test]
fn one_phone_is_a_group_too() {
    let report = run(&small_plan(1, 30.0).unwrap()).unwrap().report;
    assert_eq!((report.phones.len(), report.common_epochs), (1, 0));
    assert!(report.methods.joint["SIM1"].is_some());
}

#[test]
fn a_phone_without_truth_is_named_and_not_scored() {
    let mut plan = small_plan(2, 20.0).unwrap();
    plan.phones[1].truth = None;
    let outcome = run(&plan).unwrap();
    assert_eq!(outcome.report.methods.joint["SIM2"], None);
    assert!(outcome.report.methods.joint["SIM1"].is_some());
    assert_eq!(outcome.report.unscored["SIM2"], "it has no truth");
    assert!(outcome.report.json().unwrap().contains("\"SIM2\": null"));
    assert!(outcome.table.contains("SIM2 is not scored: it has no truth."));
}

#[test]
fn no_common_time_is_an_error_with_both_spans() {
    let plan = plan_of(vec![phone(0, 0.0, 40.0), phone(1, 40.0, 0.0)], 60.0).unwrap();
    let message = failure(&plan);
    assert!(message.contains("no common time") && message.contains("SIM1 from"), "{message}");
}

#[test]
fn products_that_know_no_satellite_are_an_error_that_says_why() {
    let mut plan = small_plan(2, 20.0).unwrap();
    // One message, of a satellite that no phone sees.
    let text = "     3.04           N: GNSS NAV DATA    M: MIXED            RINEX VERSION / TYPE
                                                            END OF HEADER
R01 2020 08 13 14 15 00-2.458319067955E-05 0.000000000000E+00 3.960000000000E+05
     1.422012255859E+04-4.938831329346E-01-9.313225746155E-10 0.000000000000E+00
    -2.043351660156E+04 5.933942794800E-01 9.313225746155E-10 1.000000000000E+00
     5.539755371094E+03 3.461606979370E+00 0.000000000000E+00 0.000000000000E+00
";
    let navigation = NavigationFile::parse(text.as_bytes()).unwrap();
    plan.products = ProductSource::Loaded(Arc::new(Products::new(vec![], vec![navigation])));
    let message = failure(&plan);
    assert!(message.contains("SIM1: no epoch with a usable observation"), "{message}");
    assert!(message.contains("no orbit in any product"), "{message}");
}

#[test]
fn a_missing_file_is_an_error_that_names_phone_and_file() {
    let mut plan = small_plan(2, 20.0).unwrap();
    plan.phones[1].source = Source::File { path: PathBuf::from("no/such/file.rnx"), near: None };
    let message = failure(&plan);
    assert!(message.contains("SIM2") && message.contains("no/such/file.rnx"), "{message}");
}

#[test]
fn missing_products_are_an_error() {
    let mut plan = small_plan(1, 20.0).unwrap();
    let sp3 = vec![PathBuf::from("no/orbits.sp3")];
    plan.products = ProductSource::Files(ProductFiles { sp3, ..ProductFiles::default() });
    assert!(failure(&plan).contains("no/orbits.sp3"));
    for none in [ProductSource::Files(ProductFiles::default()), ProductSource::Loaded(Arc::default())] {
        plan.products = none;
        assert!(failure(&plan).contains("SIM1: no orbits"));
    }
}

#[test]
fn a_recording_is_written_beside_the_report() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("session.rrd");
    let options = recording_to(recording);
    let outcome = replay(&small_plan(2, 20.0).unwrap(), &options, &Stop::default()).unwrap();
    let written = outcome.written.first().unwrap();
    assert_eq!((written.title, written.path.is_file()), ("Recording", true));
    let epochs = format!(" MB, {} epochs", outcome.report.epochs);
    assert!(written.figures.ends_with(&epochs), "{written:?}");
}

#[test]
fn a_request_to_stop_ends_a_replay_with_an_error() {
    let stop = Stop::default();
    stop.request();
    let error = replay(&small_plan(1, 20.0).unwrap(), &ReplayOptions::default(), &stop).unwrap_err();
    assert!(error.to_string().contains("stopped"), "{error}");
}

#[test]
fn a_replay_that_is_aborted_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let stop = Stop::default();
    let options = ReplayOptions {
        files: OutputFiles {
            recording: Some(at("session.rrd")),
            positions: Some(at("positions.csv")),
            ..OutputFiles::default()
        },
        speed: Speed::Times(5.0),
        ..ReplayOptions::default()
    };
    let asked = stop.clone();
    let thread = limits::spawn(move || replay(&small_plan(2, 600.0).unwrap(), &options, &asked));
    // Until it is at work, and writes under another name.
    let start = std::time::Instant::now();
    while !at("session.partial.rrd").exists() && start.elapsed() < Duration::from_mins(1) {
        std::thread::sleep(Duration::from_millis(10));
    }
    assert!(at("session.partial.rrd").exists() && !at("session.rrd").exists());
    stop.request();
    assert!(thread.join().unwrap().unwrap_err().to_string().contains("stopped"));
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn what_a_phone_missed_that_came_late_counts() {
    let plan = plan_of(vec![phone(0, 0.0, 0.0), phone(1, 40.0, 0.0)], 80.0).unwrap();
    let report = run(&plan).unwrap().report;
    for methods in [&report.methods.wls, &report.methods.local, &report.methods.joint] {
        let late = methods["SIM2"].unwrap();
        assert!((0.4..0.6).contains(&late.availability), "{late:?}");
        assert!(late.availability_in_recording > 0.95, "{late:?}");
        assert!(methods["SIM1"].unwrap().availability > 0.95);
    }
    let found = report.attention.iter().find(|finding| finding.kind == "phone-part-of-the-time").unwrap();
    assert_eq!(found.phones, ["SIM2"]);
}

#[test]
fn what_is_wrong_without_stopping_a_run_is_said() {
    let mut plan = small_plan(2, 30.0).unwrap();
    plan.phones[1].source = plan.phones[0].source.clone();
    for scheduled in &mut plan.constraints {
        let is_distance = matches!(scheduled.constraint, Constraint::Distance(_));
        scheduled.to_gps = is_distance.then_some("2001-01-01T00:00:00".parse().unwrap());
    }
    let outcome = run(&plan).unwrap();
    let kinds: Vec<&str> = outcome.report.attention.iter().map(|finding| finding.kind).collect();
    for kind in ["same-observations", "constraint-never-in-force"] {
        assert!(kinds.contains(&kind), "{kinds:?}");
    }
    let distance = &outcome.report.constraints["distance SIM1 SIM2"];
    assert_eq!((distance.epochs_in_window, distance.acted), (0, 0));
    assert_eq!(distance.to_gps.as_deref(), Some("2001-01-01T00:00:00.000"));
}

#[test]
fn files_that_are_there_are_replaced_only_when_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("session.rrd");
    let plan = small_plan(1, 20.0).unwrap();
    for (there, said) in
        [("session.rrd", "there is a file already"), ("session.partial.rrd", "did not come to its end")]
    {
        let there = folder.path().join(there);
        std::fs::write(&there, "precious").unwrap();
        let mut options = recording_to(recording.clone());
        let error = format!("{:#}", replay(&plan, &options, &Stop::default()).unwrap_err());
        assert!(error.contains(said) && error.contains("--overwrite"), "{error}");
        assert_eq!(std::fs::read_to_string(&there).unwrap(), "precious");
        options.files.overwrite = true;
        replay(&plan, &options, &Stop::default()).unwrap();
        let left: Vec<_> =
            std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(left, ["session.rrd"]);
        assert!(Summary::read(&recording).unwrap().warnings.is_empty());
        std::fs::remove_file(&recording).unwrap();
    }
}

#[cfg(unix)]
#[test]
fn a_recording_that_breaks_off_costs_nothing_else() {
    use std::io::Read;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.rrd");
    assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
    let reader = path.clone();
    let reader = limits::spawn(move || {
        let mut first = Vec::new();
        std::fs::File::open(reader).unwrap().take(200_000).read_to_end(&mut first).unwrap()
    });
    let plan = small_plan(2, 600.0).unwrap();
    let options = recording_to(path);
    let outcome = replay(&plan, &options, &Stop::default()).unwrap();
    assert_eq!(reader.join().unwrap(), 200_000);
    assert!(outcome.written.is_empty(), "{:?}", outcome.written);
    let failure = outcome.failure.unwrap();
    assert!(failure.contains("session.rrd") && failure.contains("incomplete"), "{failure}");
    assert!(outcome.report.epochs >= 600, "{}", outcome.report.epochs);
}
