//! What the estimator believes of its user and of itself: wrong bounds, bounds at any rate, manoeuvres, few satellites.
#![allow(clippy::unwrap_used, missing_docs)]

mod group;

use cofix_common::constraint::{Constraint, ConstraintOutcome, Distance, SkipReason, VerticalVelocity};
use cofix_common::frames::Enu;
use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::integrity::{Cause, Verdict};
use cofix_common::simulation::{IonosphereResidual, OwnMotion, Scenario, SharedErrors};
use group::Group;

const LEAVES_AT_S: f64 = 60.0;

fn within(maximum_m: f64) -> Constraint {
    Constraint::Distance(Distance { phones: [0, 1], minimum_m: 0.0, maximum_m })
}

fn is_contradicted(epoch: &FusedEpoch) -> bool {
    epoch.actions.iter().any(|a| a.outcome == ConstraintOutcome::Skipped(SkipReason::Contradicted))
}

/// Two phones in a standing car; the second leaves it.
fn leaving(seed: u64, velocity_mps: Enu) -> Group {
    let mut scenario = Scenario { seed, duration_s: 260.0, ..Scenario::stationary(2) };
    scenario.phones[1].motion = OwnMotion::departure(LEAVES_AT_S, velocity_mps);
    Group::simulated(scenario)
}

#[test]
fn a_phone_that_drives_away_is_noticed_and_pulls_nobody() {
    for seed in 1..=10 {
        for speed_mps in [0.3, 0.6] {
            let group = leaving(seed, Enu { east: speed_mps, north: 0.0, up: 0.0 });
            let (mut noticed_s, mut worst_m, mut relied_on) = (None, 0.0f64, 0);
            for (second, epoch) in group.fused(&[within(2.0)]) {
                worst_m = worst_m.max(group.error_m(0, &epoch).horizontal());
                if is_contradicted(&epoch) {
                    noticed_s.get_or_insert(second - LEAVES_AT_S);
                    relied_on += usize::from(epoch.phones[0].verdict == Some(Verdict::Reliable));
                } else {
                    assert!(
                        second < LEAVES_AT_S + 100.0,
                        "seed {seed}, {speed_mps} m/s: holds after {second} s"
                    );
                }
            }
            println!(
                "seed {seed}, {speed_mps} m/s: {noticed_s:?} s, worst {worst_m:.2} m, {relied_on} relied on"
            );
            // The bound is exceeded once the phone is 2 m away.
            let noticed_s = noticed_s.unwrap() - 2.0 / speed_mps;
            assert!(
                (0.0..30.0).contains(&noticed_s),
                "seed {seed}, {speed_mps} m/s: noticed after {noticed_s} s"
            );
            assert!(worst_m < 10.0, "seed {seed}, {speed_mps} m/s: {worst_m} m");
            assert_eq!(relied_on, 0, "seed {seed}, {speed_mps} m/s");
        }
    }
}

#[test]
fn a_lift_under_a_bound_on_vertical_velocity_is_noticed() {
    for seed in 1..=5 {
        let group = leaving(seed, Enu { east: 0.0, north: 0.0, up: 2.0 });
        let bound = |phone| Constraint::VerticalVelocity(VerticalVelocity { phone, maximum_mps: 1.0 });
        let (mut noticed_s, mut worst_m) = (None, 0.0f64);
        for (second, epoch) in group.fused(&[bound(0), bound(1)]) {
            if is_contradicted(&epoch) {
                noticed_s.get_or_insert(second - LEAVES_AT_S);
                assert_eq!(
                    epoch.phones[1].verdict,
                    Some(Verdict::Unreliable(Cause::Constraint)),
                    "seed {seed}"
                );
            }
            // What the bound adds to the error of the state without it.
            let free = epoch.phones[1].free.as_ref().unwrap();
            let free_m = group.error_of(1, epoch.time_gps, free.position()).up;
            worst_m = worst_m.max((group.error_m(1, &epoch).up - free_m).abs());
        }
        println!("seed {seed}: noticed after {noticed_s:?} s, worst {worst_m:.2} m");
        assert!(
            noticed_s.is_some_and(|after_s| (0.0..30.0).contains(&after_s)),
            "seed {seed}: {noticed_s:?}"
        );
        assert!(worst_m < 10.0, "seed {seed}: {worst_m} m");
    }
}

/// Two phones 1.9 m apart on a table, without errors of measurement, so that their own filters are right.
fn nearly_two_metres_apart(interval_s: f64) -> Group {
    let scenario = Scenario::stationary(2);
    let mut scenario = Scenario { duration_s: 200.0, interval_s, noise_free: true, ..scenario };
    for phone in &mut scenario.phones {
        phone.epoch_offset_s = 0.0;
    }
    scenario.phones[1].mount = scenario.phones[0].mount;
    scenario.phones[1].mount.forward_m += 1.9;
    Group::simulated(scenario)
}

/// Distance of the fused positions, and how far the bound moves the second phone, means after a minute, m.
fn drawn(group: &Group) -> (f64, f64) {
    let epochs = group.fused(&[within(2.0)]);
    let settled: Vec<&FusedEpoch> =
        epochs.iter().filter(|(s, _)| *s > 60.0).map(|(_, epoch)| epoch).collect();
    let position =
        |state: &Option<_>| state.as_ref().map(cofix_common::filter::PhoneState::position).unwrap();
    let distances = settled.iter().map(|epoch| epoch.distances[0].distance_m);
    let shifts = settled.iter().map(|epoch| {
        let phone = &epoch.phones[1];
        position(&phone.state).distance_m(position(&phone.free))
    });
    let count = settled.len() as f64;
    (distances.sum::<f64>() / count, shifts.sum::<f64>() / count)
}

/// With feedback a bound acts at every epoch, and draws the phones together; without it is one piece of information.
#[test]
fn a_bound_that_holds_all_the_time_counts_once() {
    let mut group = nearly_two_metres_apart(1.0);
    let (once_m, _) = drawn(&group);
    group.engine.feedback = true;
    let (fed_back_m, _) = drawn(&group);
    println!("1.9 m apart: {once_m:.2} m, with feedback {fed_back_m:.2} m");
    assert!(once_m > 0.9 && once_m > 1.5 * fed_back_m, "{once_m} m against {fed_back_m} m");
}

/// One phone at 10 Hz draws the other, at 1 Hz, about as much as at equal rates.
#[test]
fn the_rate_of_one_phone_does_not_strengthen_a_bound_on_the_other() {
    let mut group = nearly_two_metres_apart(0.1);
    let thin = |messages: &mut Vec<_>| *messages = messages.iter().step_by(10).cloned().collect();
    thin(&mut group.messages[1]);
    let mixed = drawn(&group);
    thin(&mut group.messages[0]);
    let equal = drawn(&group);
    println!("distance and shift of the second phone: beside 10 Hz {mixed:.3?}, beside 1 Hz {equal:.3?} m");
    // The phone at 10 Hz is known better, so more of the correction falls to the other.
    assert!((mixed.0 / equal.0 - 1.0).abs() < 0.15, "{mixed:?} against {equal:?}");
    assert!(mixed.1 < 1.4 * equal.1, "{mixed:?} against {equal:?}");
}

/// Mean normalised errors squared of the local filters over seeds, horizontal and up, after the first two minutes.
fn consistency(interval_s: f64, duration_s: f64) -> (f64, f64) {
    let (mut horizontal, mut up) = (0.0, 0.0);
    let seeds = 12;
    for seed in 1..=seeds {
        let mut scenario = Scenario { seed, interval_s, duration_s, ..Scenario::stationary(2) };
        for phone in &mut scenario.phones {
            phone.epoch_offset_s = 0.0;
        }
        let sigma = |vertical_fraction, gradient| IonosphereResidual {
            vertical_fraction,
            north_m_per_1000km: gradient,
            east_m_per_1000km: gradient,
        };
        scenario.errors.shared = SharedErrors {
            gps_galileo_bias_sigma_m: 1.0,
            beidou_bias_sigma_m: 1.8,
            ionosphere_sigma: sigma(0.6, 3.5),
            ..SharedErrors::default()
        };
        let group = Group::simulated(scenario);
        for (phone, messages) in group.messages.iter().enumerate() {
            let start = group.simulation.scenario().start_gps + 120.0;
            let late = messages.iter().filter(|message| message.time_gps > start);
            let states: Vec<_> = late.filter_map(|m| Some((m.time_gps, m.local.clone()?))).collect();
            let accuracy = group.accuracy(phone, &states);
            horizontal += accuracy.nees_horizontal / (2.0 * seeds as f64);
            up += accuracy.nees_up / (2.0 * seeds as f64);
        }
    }
    (horizontal, up)
}

#[test]
fn the_covariance_is_honest_at_any_rate() {
    let rates = [(0.1, 240.0), (0.5, 400.0), (1.0, 600.0), (5.0, 1_200.0), (30.0, 3_600.0)];
    let seen = rates.map(|(interval_s, duration_s)| (interval_s, consistency(interval_s, duration_s)));
    println!("interval s, NEES horizontal and up: {seen:.2?}");
    for (interval_s, (horizontal, up)) in seen {
        assert!((1.0..4.0).contains(&horizontal), "{interval_s} s: {horizontal}");
        assert!((0.3..2.0).contains(&up), "{interval_s} s: {up}");
    }
}
