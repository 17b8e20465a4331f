use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use cofix_common::accuracy::{Accuracy, Protection};
use cofix_common::constraint::Distance;
use cofix_common::skips::{Reason, Skips};

use super::*;
use crate::report::scores::TruthReport;
use crate::report::{ConstraintReport, PhoneReport, SameObservations};

fn phone() -> PhoneReport {
    PhoneReport {
        epochs: 100,
        share_of_group: Some(1.0),
        first_gps: Some("2020-08-13T14:00:00.000".to_owned()),
        last_gps: Some("2020-08-13T14:01:39.000".to_owned()),
        observations: 2_000,
        observations_with_rate: 2_000,
        mean_satellites: Some(14.0),
        verdicts: [("reliable".to_owned(), 100)].into(),
        ..PhoneReport::default()
    }
}

fn accuracy() -> Accuracy {
    Accuracy {
        epochs: 100,
        availability: 1.0,
        availability_in_recording: 1.0,
        horizontal_p50_m: 1.0,
        horizontal_p68_m: 1.5,
        horizontal_p95_m: 3.0,
        vertical_p50_m: 1.0,
        vertical_p68_m: 1.0,
        vertical_p95_m: 1.0,
        mean_east_m: 0.1,
        mean_north_m: 0.1,
        mean_up_m: 0.1,
        rmse_east_m: 1.0,
        rmse_north_m: 1.0,
        rmse_up_m: 2.0,
        rmse_2d_m: 1.4,
        nees_horizontal: 2.0,
        nees_up: 1.0,
        protection: Protection::default(),
    }
}

fn constraint() -> ConstraintReport {
    ConstraintReport {
        constraint: Distance { phones: [0, 1], minimum_m: 0.0, maximum_m: 2.0 }.into(),
        phones: vec!["a".to_owned(), "b".to_owned()],
        from_gps: None,
        to_gps: None,
        epochs_in_window: 100,
        epochs_in_force: 100,
        acted: 90,
        violated_before: 10,
        violated_after: 0,
        not_applied: 0,
        not_applied_because: BTreeMap::new(),
        largest_shift_m: 1.0,
        largest_free_sigmas: 0.0,
        mean_shift_m: 0.1,
        enlarged: 0,
    }
}

/// A session of two phones in which nothing is wrong.
fn sound() -> Report {
    let by_phone = |value: Accuracy| ["a", "b"].map(|name| (name.to_owned(), Some(value))).into();
    let truth = TruthReport { rows: 100, counted_rows: 100, ..TruthReport::default() };
    Report {
        methods: crate::report::scores::Methods {
            wls: by_phone(accuracy()),
            local: by_phone(accuracy()),
            joint: by_phone(accuracy()),
        },
        truth: ["a", "b"].map(|name| (name.to_owned(), truth.clone())).into(),
        first_gps: phone().first_gps,
        last_gps: phone().last_gps,
        epochs: 100,
        common_epochs: 100,
        phones: ["a", "b"].map(|name| (name.to_owned(), phone())).into(),
        constraints: [("distance a b".to_owned(), constraint())].into(),
        ..Report::default()
    }
}

fn skips(reason: Reason, count: u64) -> Skips {
    let mut skips = Skips::default();
    (0..count).for_each(|_| skips.add(reason, || "the first".to_owned()));
    skips
}

/// The one finding after a change to the sound session.
fn after(change: impl FnOnce(&mut Report)) -> Finding {
    let mut report = sound();
    change(&mut report);
    let mut found = findings(&report);
    assert_eq!(found.len(), 1, "{}", render(&found));
    found.remove(0)
}

fn of_a(report: &mut Report) -> &mut PhoneReport {
    report.phones.get_mut("a").unwrap()
}

#[test]
fn nothing_is_said_of_a_sound_session() {
    assert_eq!(findings(&sound()), []);
    assert_eq!(render(&[]), "Nothing needs attention.");
}

#[test]
#[allow(clippy::too_many_lines)] // a table
fn each_fault_is_found_by_itself() {
    type Change = fn(&mut Report);
    let table: [(&str, Severity, &str, Change); 27] = [
        ("constraint-never-in-force", Severity::Wrong, "from 2021-08-13T14:00:00.000 GPS", |r| {
            for c in r.constraints.values_mut() {
                c.from_gps = Some("2021-08-13T14:00:00.000".to_owned());
                (c.epochs_in_window, c.epochs_in_force, c.acted) = (0, 0, 0);
            }
        }),
        ("constraint-never-in-force", Severity::Wrong, "0 of 100 epochs", |r| {
            r.constraints.values_mut().for_each(|c| (c.epochs_in_force, c.acted) = (0, 0));
        }),
        ("constraint-refused", Severity::Wrong, "at so much of its epochs: a–b 95 %", |r| {
            for c in r.constraints.values_mut() {
                (c.not_applied, c.violated_after) = (95, 95);
                c.not_applied_because = [("contradicted", 95)].into();
            }
        }),
        ("constraint-refused", Severity::Worse, "a–b 5.0 %", |r| {
            for c in r.constraints.values_mut() {
                (c.not_applied, c.violated_after) = (5, 5);
                c.not_applied_because = [("contradicted", 5)].into();
            }
        }),
        ("constraint-violated", Severity::Worse, "a–b 30 %", |r| {
            r.constraints.values_mut().for_each(|c| c.violated_after = 30);
        }),
        ("constraint-without-effect", Severity::Note, "in force at 100 epochs", |r| {
            r.constraints.values_mut().for_each(|c| c.acted = 0);
        }),
        ("no-constraint", Severity::Note, "no constraint", |r| r.constraints.clear()),
        ("ionosphere-nominal", Severity::Wrong, "a 100 %", |r| {
            of_a(r).skips = skips(Reason::NoIonosphereModel, 2_010);
        }),
        ("ionosphere-nominal", Severity::Worse, "a 0.5 %", |r| {
            of_a(r).skips = skips(Reason::OutsideIonosphereMaps, 10);
        }),
        ("same-observations", Severity::Wrong, "a and b have the same observations (100 epochs)", |r| {
            r.same_observations =
                vec![SameObservations { phones: ["a", "b"].map(str::to_owned), epochs: 100 }];
        }),
        ("truth-time", Severity::Wrong, "a fits 18.00 s later (234.0 m as it is, 1.2 m then)", |r| {
            let truth = r.truth.get_mut("a").unwrap();
            (truth.shift_s, truth.median_m, truth.shifted_median_m) = (Some(18.0), Some(234.0), Some(1.2));
        }),
        ("truth-without-overlap", Severity::Wrong, "a (the truth has no row)", |r| {
            r.unscored.insert("a".to_owned(), "the truth has no row".to_owned());
        }),
        ("fusion-misleads", Severity::Wrong, "a 3.0 m alone, 9.0 m fused", |r| {
            r.methods.joint.get_mut("a").unwrap().as_mut().unwrap().horizontal_p95_m = 9.0;
        }),
        ("height-offset", Severity::Wrong, "a +13.0 ± 2.6 m", |r| {
            let joint = r.methods.joint.get_mut("a").unwrap().as_mut().unwrap();
            (joint.mean_up_m, joint.rmse_up_m) = (13.0, 13.25);
        }),
        ("horizontal-offset", Severity::Worse, "a -4.0 m east, +0.1 m north", |r| {
            let joint = r.methods.joint.get_mut("a").unwrap().as_mut().unwrap();
            (joint.mean_east_m, joint.rmse_2d_m) = (-4.0, 4.2);
        }),
        ("sigma-too-small", Severity::Worse, "a by a factor of 4.0", |r| {
            r.methods.joint.get_mut("a").unwrap().as_mut().unwrap().nees_horizontal = 32.0;
        }),
        ("phone-without-truth", Severity::Note, "for want of a truth: a", |r| drop(r.truth.remove("a"))),
        ("truth-mostly-not-counted", Severity::Note, "a 10 of 100 rows", |r| {
            r.truth.get_mut("a").unwrap().counted_rows = 10;
        }),
        ("phone-without-epochs", Severity::Wrong, "came of a", |r| {
            let phone = of_a(r);
            (phone.epochs, phone.share_of_group, phone.observations) = (0, Some(0.0), 0);
        }),
        ("phone-part-of-the-time", Severity::Worse, "a 40 % of the time", |r| {
            of_a(r).share_of_group = Some(0.4);
        }),
        (
            "phones-apart-in-time",
            Severity::Worse,
            "at 2.0 % of the epochs that they could have in common (2 of 100)",
            |r| {
                r.common_epochs = 2;
            },
        ),
        ("epochs-without-solution", Severity::Worse, "a 30 %", |r| of_a(r).epochs_without_solution = 30),
        ("few-satellites", Severity::Worse, "a 5.2", |r| of_a(r).mean_satellites = Some(5.2)),
        ("no-doppler", Severity::Worse, "a 100 %", |r| of_a(r).observations_with_rate = 0),
        ("not-reliable", Severity::Worse, "a 60 %", |r| {
            of_a(r).verdicts = [("reliable".to_owned(), 40), ("unreliable: geometry".to_owned(), 60)].into();
        }),
        ("no-orbits", Severity::Wrong, "a 60 %", |r| of_a(r).skips = skips(Reason::NoSatelliteState, 3_000)),
        (
            "no-base",
            Severity::Worse,
            "1 × corrections: source brought neither an ephemeris nor an epoch of a base (first: the first)",
            |r| {
                of_a(r).skips = skips(Reason::SourceBroughtNothing, 1).with_prefix("corrections: ");
            },
        ),
    ];
    for (kind, severity, text, change) in table {
        let finding = after(change);
        assert_eq!((finding.kind, finding.severity), (kind, severity), "{finding}");
        assert!(finding.text.contains(text), "expected '{text}' in: {finding}");
        assert!(!finding.advice.is_empty() && !finding.advice.ends_with('.'), "{finding}");
    }
}

#[test]
fn every_reason_that_matters_is_found() {
    for reason in counted::reasons() {
        let kind_of = |report: &Report| findings(report).into_iter().map(|f| f.kind).collect::<Vec<_>>();
        let mut report = sound();
        of_a(&mut report).skips = skips(reason, 4_000).with_prefix("truth: ");
        of_a(&mut report).skips.merge(&skips(reason, 4_000));
        assert_eq!(kind_of(&report).len(), 1, "{reason}: {:?}", kind_of(&report));
    }
}

#[test]
fn the_most_harmful_comes_first_and_pairs_are_told_together() {
    let mut report = sound();
    of_a(&mut report).mean_satellites = Some(5.0);
    report.constraints.clear();
    for (i, j) in [("a", "b"), ("a", "c"), ("b", "c")] {
        let never = ConstraintReport {
            phones: vec![i.to_owned(), j.to_owned()],
            epochs_in_window: 0,
            to_gps: Some("2019-08-13T14:00:00.000".to_owned()),
            ..constraint()
        };
        report.constraints.insert(format!("distance {i} {j}"), never);
    }
    let found = findings(&report);
    let kinds: Vec<&str> = found.iter().map(|finding| finding.kind).collect();
    assert_eq!(kinds, ["constraint-never-in-force", "few-satellites"], "{}", render(&found));
    assert_eq!(found[0].phones, ["a", "b", "c"]);
    let text = render(&found);
    assert!(
        text.starts_with(
            "Needs attention, most harmful first:\n- WRONG: constraint distance 0 to 2 m, to 2019"
        ),
        "{text}"
    );
}

/// What is looked for must be what agents and hub count, and a reason that nobody counts does not stand in the list.
#[test]
fn every_reason_is_counted_somewhere() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut sources = String::new();
    for folder in ["common/src", "agent/src", "fusion-hub/src"] {
        read_sources(&root.join(folder), &mut sources);
    }
    for reason in Reason::ALL {
        let is_counted = sources
            .match_indices(&format!("Reason::{reason:?}"))
            .any(|(at, name)| !sources[at + name.len()..].starts_with(|next: char| next.is_alphanumeric()));
        assert!(is_counted, "nobody counts '{reason}'");
    }
}

fn read_sources(folder: &Path, sources: &mut String) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("attention") {
            read_sources(&path, sources);
        } else if path.extension().is_some_and(|extension| extension == "rs") && !path.ends_with("tests.rs") {
            sources.push_str(&std::fs::read_to_string(&path).unwrap());
        }
    }
}
