use cofix_common::constraint::SkipReason;
use cofix_common::integrity::{Cause, RaimReport};
use cofix_common::wire::EpochMessage;

use super::*;
use crate::engine::FusedPhone;

fn names() -> Vec<String> {
    vec!["b".to_owned(), "a".to_owned()]
}

fn epoch(seconds: f64, verdict: Verdict, actions: Vec<ConstraintAction>) -> FusedEpoch {
    let time_gps = GpsTime::from_week_tow(2118, seconds);
    let message = EpochMessage {
        phone: "b".to_owned(),
        sequence: 0,
        time_gps,
        observations: Vec::new(),
        wls: None,
        local: None,
        raim: RaimReport { verdict, global_test: None, excluded: 0 },
    };
    let phones =
        vec![FusedPhone { message: Some(message), state: None }, FusedPhone { message: None, state: None }];
    FusedEpoch { time_gps, phones, actions, distances: Vec::new() }
}

fn action(constraint: Constraint, before: f64, shift_m: f64, enlargements: u32) -> ConstraintAction {
    ConstraintAction {
        constraint,
        before,
        after: 0.0,
        shift_m,
        enlargements,
        outcome: ConstraintOutcome::Holds,
    }
}

#[test]
fn epochs_verdicts_and_constraints_are_counted() {
    let distance = Constraint::Distance { phones: (0, 1), minimum_m: 1.0, maximum_m: 2.0 };
    let vertical = Constraint::VerticalVelocity { phone: 1, maximum_mps: 1.0 };
    let heading = Constraint::Heading { phone: 0, course_rad: 1.0, tolerance_rad: 0.1 };
    let mut tally = Tally::new(&names());
    let actions =
        vec![action(distance, 3.0, 0.5, 2), action(vertical, -1.5, 0.1, 0), action(heading, 0.05, 0.2, 0)];
    tally.push(&epoch(10.0, Verdict::Reliable, actions));
    let still = ConstraintAction { outcome: ConstraintOutcome::Violated, ..action(distance, 1.5, 0.1, 0) };
    let reason = SkipReason::NoVariance;
    let skipped =
        ConstraintAction { outcome: ConstraintOutcome::Skipped(reason), ..action(distance, 9.0, 9.0, 9) };
    tally.push(&epoch(11.0, Verdict::Unreliable(Cause::Geometry), vec![still, skipped]));
    assert_eq!((tally.epochs(), tally.common_epochs(), tally.usable_epochs(0)), (2, 0, 0));
    let phones = tally.phones(|_| Skips::default());
    assert_eq!((phones["b"].epochs, phones["b"].empty_epochs, phones["a"].epochs), (2, 2, 0));
    assert_eq!(phones["b"].verdicts["reliable"], 1);
    assert_eq!(phones["b"].verdicts["unreliable: geometry"], 1);
    assert_eq!(phones["b"].last_gps.as_deref(), Some("2020-08-09T00:00:11.000"));
    let constraints = tally.constraints();
    let expected = ConstraintReport {
        acted: 2,
        violated_before: 1,
        violated_after: 1,
        not_applied: 1,
        largest_shift_m: 0.5,
        mean_shift_m: 0.3,
        enlarged: 1,
    };
    assert_eq!(constraints["distance b–a, 1 to 2 m"], expected);
    assert_eq!(constraints["vertical-velocity a, ±1 m/s"].violated_before, 1);
    assert_eq!(constraints["heading b, 57.29578° ± 5.729578°"].violated_before, 0);
}

#[test]
fn the_table_follows_the_sessions_order_and_means_what_is_scored() {
    let accuracy = |p50: f64| Accuracy {
        epochs: 10,
        availability: 1.0,
        horizontal_p50_m: p50,
        horizontal_p68_m: 2.0,
        horizontal_p95_m: 3.0,
        rmse_east_m: 1.0,
        rmse_north_m: 1.0,
        rmse_up_m: 1.0,
        nees_horizontal: 2.0,
        nees_up: 1.0,
        rmse_2d_m: 1.0,
    };
    let scored: ByPhone = [("a", Some(1.0)), ("b", Some(2.0)), ("c", None)]
        .map(|(name, p50)| (name.to_owned(), p50.map(accuracy)))
        .into();
    let report = Report {
        group: "g".to_owned(),
        methods: Methods { joint: scored, ..Methods::default() },
        unscored: [("c".to_owned(), "it has no truth".to_owned())].into(),
        epochs: 10,
        common_epochs: 10,
        phones: BTreeMap::new(),
        constraints: BTreeMap::new(),
        skips: Skips::default(),
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
