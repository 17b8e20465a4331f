use cofix_common::accuracy::{Accuracy, Protection, Truth, TruthPoint};
use cofix_common::constraint::{
    Constraint, ConstraintAction, ConstraintOutcome, Distance, Heading, SkipReason, VerticalVelocity,
};
use cofix_common::filter::PhoneState;
use cofix_common::frames::{Direction, Ecef, EcefVector};
use cofix_common::fusion::engine::{FusedEpoch, FusedPhone, ScheduledConstraint};
use cofix_common::gnss::SignalCode;
use cofix_common::integrity::{Cause, Verdict};
use cofix_common::measurement::{CorrectedObservation, SharedError, Usage};
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;
use nalgebra::{SMatrix, SVector};

use super::*;
use crate::report::scores::{ByPhone, Scores};
use crate::testing::judged;

fn names() -> Vec<String> {
    vec!["b".to_owned(), "a".to_owned()]
}

fn epoch(seconds: f64, verdict: Verdict, actions: Vec<ConstraintAction>) -> FusedEpoch {
    let time_gps = GpsTime::from_week_tow(2118, seconds);
    let phones = vec![
        FusedPhone {
            message: Some(judged("b", time_gps, verdict)),
            state: Some(state()),
            ..FusedPhone::default()
        },
        FusedPhone { message: None, state: Some(state()), ..FusedPhone::default() },
    ];
    FusedEpoch { time_gps, phones, actions, distances: Vec::new(), events: Vec::new() }
}

/// On the equator, with standard deviations of 3 m east, 4 m north and 2 m up.
fn state() -> PhoneState {
    let mut mean = SVector::<f64, 9>::zeros();
    mean[0] = 6_378_137.0;
    let mut covariance = SMatrix::<f64, 9, 9>::identity();
    for (axis, variance) in [(0, 4.0), (1, 9.0), (2, 16.0)] {
        covariance[(axis, axis)] = variance;
    }
    PhoneState { mean, covariance }
}

fn observation(satellite: &str, pseudorange_m: f64) -> CorrectedObservation {
    CorrectedObservation {
        satellite: satellite.parse().unwrap(),
        signal: SignalCode::new(b'1', b'C'),
        pseudorange_m,
        pseudorange_sigma_m: 3.0,
        shared: SharedError::default(),
        range_rate: None,
        range_change: None,
        cn0_dbhz: None,
        direction: Direction { azimuth_rad: 0.0, elevation_rad: 1.0 },
        satellite_position: Ecef::new(2e7, 0.0, 0.0),
        satellite_velocity: EcefVector::new(0.0, 0.0, 0.0),
        usage: Usage::Used,
        residual_m: None,
    }
}

fn always(constraint: Constraint) -> ScheduledConstraint {
    ScheduledConstraint { constraint, from_gps: None, to_gps: None }
}

fn action(
    index: usize,
    constraint: Constraint,
    before: f64,
    shift_m: f64,
    enlargements: u32,
) -> ConstraintAction {
    ConstraintAction {
        index,
        constraint,
        before,
        free_sigmas: 0.0,
        after: 0.0,
        shift_m,
        enlargements,
        outcome: ConstraintOutcome::Holds,
    }
}

#[test]
fn epochs_verdicts_and_constraints_are_counted() {
    let distance = Constraint::Distance(Distance { phones: [0, 1], minimum_m: 1.0, maximum_m: 2.0 });
    let vertical = Constraint::VerticalVelocity(VerticalVelocity { phone: 1, maximum_mps: 1.0 });
    let heading = Constraint::Heading(Heading { phone: 0, course_rad: 1.0, tolerance_rad: 0.1 });
    let mut tally = Tally::new(&names());
    tally.schedule(&[always(distance), always(vertical), always(heading)]);
    let actions = vec![
        action(0, distance, 3.0, 0.5, 2),
        action(1, vertical, -1.5, 0.1, 0),
        action(2, heading, 0.05, 0.2, 0),
    ];
    tally.push(&epoch(10.0, Verdict::Reliable, actions));
    let still = ConstraintAction { outcome: ConstraintOutcome::Violated, ..action(0, distance, 1.5, 0.1, 0) };
    tally.push(&epoch(11.0, Verdict::Unreliable(Cause::Geometry), vec![still]));
    assert_eq!((tally.epochs, tally.common_epochs, tally.usable_epochs(0)), (2, 0, 0));
    let phones = tally.phones(|_| Skips::default());
    assert_eq!((phones["b"].epochs, phones["b"].empty_epochs, phones["a"].epochs), (2, 2, 0));
    assert_eq!(phones["b"].verdicts["reliable"], 1);
    assert_eq!(phones["b"].verdicts["unreliable: geometry"], 1);
    assert_eq!(phones["b"].last_gps.as_deref(), Some("2020-08-09T00:00:11.000"));
    assert_eq!((phones["b"].share_of_group, phones["a"].share_of_group), (Some(1.0), Some(0.0)));
    let sigma = phones["a"].horizontal_sigma_m.unwrap().median;
    assert!((sigma - 5.0).abs() < 1e-9 && (phones["b"].vertical_sigma_m.unwrap().median - 2.0).abs() < 1e-9);
    let constraints = tally.constraints();
    let distance = &constraints["distance b a"];
    assert_eq!(distance.constraint.bounds_in_words(), "1 to 2 m");
    assert_eq!((distance.phones.join(" ").as_str(), distance.from_gps.as_ref()), ("b a", None));
    assert_eq!((distance.epochs_in_window, distance.epochs_in_force, distance.acted), (2, 2, 2));
    assert_eq!((distance.violated_before, distance.violated_after, distance.enlarged), (1, 1, 1));
    assert!((distance.largest_shift_m - 0.5).abs() < 1e-12 && (distance.mean_shift_m - 0.3).abs() < 1e-12);
    assert_eq!(constraints["vertical-velocity a"].violated_before, 1);
    assert_eq!(constraints["heading b"].violated_before, 0);
}

#[test]
fn a_constraint_that_is_refused_counts_as_violated_and_one_that_never_holds_is_there() {
    let distance = Constraint::Distance(Distance { phones: [0, 1], minimum_m: 0.0, maximum_m: 2.0 });
    let at = |seconds| Some(GpsTime::from_week_tow(2118, seconds));
    let within = |from_gps, to_gps| ScheduledConstraint { constraint: distance, from_gps, to_gps };
    let mut tally = Tally::new(&names());
    tally.schedule(&[within(None, at(10.5)), within(at(10.5), None), within(at(1e6), None)]);
    let refused = |index, reason| ConstraintAction {
        outcome: ConstraintOutcome::Skipped(reason),
        after: 9.0,
        ..action(index, distance, 9.0, 0.0, 0)
    };
    tally.push(&epoch(10.0, Verdict::Reliable, vec![refused(0, SkipReason::Contradicted)]));
    tally.push(&epoch(11.0, Verdict::Reliable, vec![action(1, distance, 1.0, 0.1, 0)]));
    let mut unknown = refused(1, SkipReason::NotFinite);
    (unknown.before, unknown.after) = (f64::NAN, f64::NAN);
    tally.push(&epoch(12.0, Verdict::Reliable, vec![unknown]));
    let constraints = tally.constraints();
    let counts = |key: &str| {
        let c = &constraints[key];
        (c.epochs_in_window, c.acted, c.violated_before, c.violated_after, c.not_applied, c.refused())
    };
    assert_eq!(counts("distance b a"), (1, 0, 1, 1, 1, 1));
    assert_eq!(counts("distance b a #2"), (2, 1, 0, 0, 1, 0));
    assert_eq!(counts("distance b a #3"), (0, 0, 0, 0, 0, 0));
    assert_eq!(constraints["distance b a #2"].not_applied_because["not finite"], 1);
    assert_eq!(constraints["distance b a #3"].window(), "from 2020-08-20T13:46:40.000 GPS");
    let report = Report { constraints, ..Report::default() };
    let table = report.constraint_table();
    let rows: Vec<&str> = table.lines().collect();
    assert_eq!(rows.len(), 5, "{table}");
    assert!(rows.iter().all(|row| row.chars().count() == rows[0].chars().count()), "{table}");
    assert!(table.contains("| distance 0 to 2 m, from 2020-08-20T13:46:40.000 GPS "), "{table}");
    assert_eq!(Report::default().constraint_table(), "");
}

#[test]
fn one_recording_for_two_phones_is_noticed() {
    let receiver = |phone: &str, offset_m: f64| {
        let satellites = ["G01", "G02", "G03", "G04", "G05"];
        let observations =
            satellites.iter().enumerate().map(|(i, s)| observation(s, 2e7 + 1e3 * i as f64 + offset_m));
        let mut message = epoch(10.0, Verdict::Reliable, Vec::new()).phones.remove(0).message.unwrap();
        message.phone = phone.to_owned();
        message.observations = observations.collect();
        FusedPhone { message: Some(message), state: None, ..FusedPhone::default() }
    };
    for (offset_m, epochs) in [(0.0, 3), (0.004, 3), (0.2, 0)] {
        let mut tally = Tally::new(&names());
        for second in 0..3_u32 {
            let phones = vec![receiver("b", 0.0), receiver("a", offset_m)];
            let time_gps = GpsTime::from_week_tow(2118, f64::from(second));
            tally.push(&FusedEpoch {
                time_gps,
                phones,
                actions: Vec::new(),
                distances: Vec::new(),
                events: Vec::new(),
            });
        }
        let same: Vec<_> =
            tally.same_observations().into_iter().map(|same| (same.phones, same.epochs)).collect();
        let expected = (epochs > 0).then(|| (["b".to_owned(), "a".to_owned()], epochs));
        assert_eq!(same, Vec::from_iter(expected), "{offset_m} m");
        let phones = tally.phones(|_| Skips::default());
        assert_eq!((phones["a"].observations, phones["a"].observations_with_rate), (15, 0));
        assert_eq!(phones["a"].mean_satellites, Some(5.0));
    }
}

#[test]
fn without_a_truth_the_table_tells_what_is_known() {
    let mut tally = Tally::new(&names());
    tally.push(&epoch(10.0, Verdict::Reliable, Vec::new()));
    tally.push(&epoch(11.0, Verdict::Unreliable(Cause::Geometry), Vec::new()));
    let report = Report {
        phones: tally.phones(|_| Skips::default()),
        unscored: names().into_iter().map(|name| (name, "it has no truth".to_owned())).collect(),
        ..Report::default()
    };
    let table = report.table(&names());
    let lines: Vec<&str> = table.lines().collect();
    assert!(
        lines[0].starts_with("| phone | epochs | of group | sats. | σ hor. m | σ up m | reliable"),
        "{table}"
    );
    assert_eq!(
        lines[2],
        "| b     |      2 |    1.000 |   0.0 |     5.00 |   2.00 |        1 |          1 |         0 |"
    );
    assert_eq!(
        lines[3],
        "| a     |      0 |    0.000 |     - |     5.00 |   2.00 |        0 |          0 |         0 |"
    );
    assert!(lines[..4].iter().all(|line| line.chars().count() == lines[0].chars().count()), "{table}");
    assert!(
        table.ends_with("a is not scored: it has no truth.\nb is not scored: it has no truth."),
        "{table}"
    );
}

#[test]
fn the_table_follows_the_sessions_order_and_means_what_is_scored() {
    let accuracy = |p50: f64| Accuracy {
        epochs: 10,
        availability: 1.0,
        availability_in_recording: 1.0,
        vertical_p50_m: 1.0,
        vertical_p68_m: 1.0,
        vertical_p95_m: 1.0,
        mean_east_m: 0.0,
        mean_north_m: 0.0,
        mean_up_m: 0.0,
        horizontal_p50_m: p50,
        horizontal_p68_m: 2.0,
        horizontal_p95_m: 3.0,
        rmse_east_m: 1.0,
        rmse_north_m: 1.0,
        rmse_up_m: 1.0,
        nees_horizontal: 2.0,
        nees_up: 1.0,
        rmse_2d_m: 1.0,
        protection: Protection::default(),
    };
    let scored: ByPhone = [("a", Some(1.0)), ("b", Some(2.0)), ("c", None)]
        .map(|(name, p50)| (name.to_owned(), p50.map(accuracy)))
        .into();
    let report = Report {
        group: "g".to_owned(),
        methods: Methods { joint: scored, ..Methods::default() },
        unscored: [("c".to_owned(), "it has no truth".to_owned())].into(),
        ..Report::default()
    };
    let table = report.table(&["b".to_owned(), "c".to_owned(), "a".to_owned()]);
    let rows: Vec<&str> = table.lines().filter(|line| line.starts_with("| joint")).collect();
    assert_eq!(rows.len(), 3, "{table}");
    assert!(rows[0].contains("| b ") && rows[1].contains("| a ") && rows[2].contains("| mean "), "{table}");
    assert!(rows[2].contains("  1.50 |"), "{table}");
    assert!(table.ends_with("c is not scored: it has no truth."), "{table}");
    let widths: Vec<usize> = table.lines().take(5).map(|line| line.chars().count()).collect();
    assert!(widths.iter().all(|width| *width == widths[0]), "{table}");
    let json = report.json().unwrap();
    assert!(json.contains("\"c\": null") && json.ends_with("}\n"));
    assert!(json.find("\"wls\"") < json.find("\"local\"") && json.find("\"local\"") < json.find("\"joint\""));
}

/// The local solution of an epoch that came too late to be fused counts, whatever came before it.
#[test]
fn late_epochs_are_scored_as_their_agents_solved_them() {
    let start = GpsTime::from_week_tow(2_118, 397_000.0);
    let position = state().position();
    let point = TruthPoint { position, velocity: EcefVector::new(0.0, 0.0, 0.0) };
    let truth = Truth::from_points((0..4).map(|second| (start + f64::from(second), point)), 1);
    let mut scores = Scores::new(vec![("a".to_owned(), Some(truth))], vec![1]);
    let message = |second: f64| EpochMessage {
        local: Some(state()),
        ..judged("a", start + second, Verdict::CannotBeChecked)
    };
    for second in [0.0, 3.0] {
        let phone =
            FusedPhone { message: Some(message(second)), state: Some(state()), ..FusedPhone::default() };
        let (actions, distances, events) = Default::default();
        scores.push(&FusedEpoch {
            time_gps: start + second,
            phones: vec![phone],
            actions,
            distances,
            events,
        });
    }
    let local = |scores: &Scores| scores.methods().local["a"].as_ref().map(|accuracy| accuracy.epochs);
    assert_eq!(local(&scores), Some(2));
    scores.late(0, &message(2.0));
    scores.late(0, &message(1.0));
    assert_eq!(local(&scores), Some(4));
    assert_eq!(scores.methods().joint["a"].as_ref().map(|accuracy| accuracy.epochs), Some(2));
}
