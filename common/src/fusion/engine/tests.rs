//! The engine on a simulated convoy, without transport.

use std::sync::Arc;

use crate::constraint::Speed;
use crate::frames::LocalFrame;
use crate::integrity::{AlarmLimits, RaimReport};
use crate::pipeline::{PhonePipeline, PipelineOptions};
use crate::simulation::{PhoneOptions, Scenario, Simulation};
use crate::skips::Reason;

use super::*;

const NAMES: [&str; 2] = ["SIM1", "SIM2"];

/// Two phones from start to end, on an open road.
fn convoy(duration_s: f64) -> (Simulation, Vec<Vec<EpochMessage>>) {
    let phone = |vehicle| PhoneOptions {
        starts_after_s: 0.0,
        stops_before_s: 0.0,
        ..PhoneOptions::of_vehicle(vehicle)
    };
    simulated(Scenario { duration_s, phones: vec![phone(0), phone(1)], ..Scenario::default() })
}

/// A scenario of two phones, with their agents' messages.
fn simulated(scenario: Scenario) -> (Simulation, Vec<Vec<EpochMessage>>) {
    let simulation = Simulation::new(scenario).unwrap();
    let products = Arc::new(simulation.products());
    let run = |index: usize, name: &str| {
        let mut pipeline = PhonePipeline::new(name, Arc::clone(&products), PipelineOptions::default());
        simulation.epochs(index).map(|simulated| pipeline.process(&simulated.epoch)).collect()
    };
    let messages = vec![run(0, NAMES[0]), run(1, NAMES[1])];
    (simulation, messages)
}

fn engine(simulation: &Simulation, options: EngineOptions) -> Engine {
    let always = |constraint| ScheduledConstraint { constraint, from_gps: None, to_gps: None };
    let constraints = simulation.distance_constraints().into_iter().map(always).collect();
    Engine::new(&["SIM1".to_owned(), "SIM2".to_owned()], constraints, options)
}

fn error_m(simulation: &Simulation, phone: usize, epoch: &FusedEpoch) -> f64 {
    let state = epoch.phones[phone].state.as_ref().unwrap();
    state.position().distance_m(simulation.truth_at(phone, epoch.time_gps).position)
}

#[test]
fn after_a_gap_of_all_phones_nothing_stems_from_the_extrapolation() {
    let (simulation, messages) = convoy(160.0);
    let mut engine = engine(&simulation, EngineOptions::default());
    for second in (0..30).chain(130..150) {
        let bucket = messages.iter().map(|of_phone| of_phone.get(second).cloned()).collect();
        let epoch = engine.step(bucket);
        for phone in 0..2 {
            let error_m = error_m(&simulation, phone, &epoch);
            assert!(error_m < 25.0, "second {second}, phone {phone}: {error_m} m");
        }
    }
    assert_eq!(engine.skips().count(Reason::SilentPhoneDropped), 2);
}

/// The levels bound the errors, and are no more than a few times as large as those of single epochs; beyond alarm limits nothing is reliable.
#[test]
fn protection_levels_bound_the_errors_of_fused_positions() {
    let (simulation, messages) = convoy(160.0);
    let limits = AlarmLimits { horizontal_m: 1.0, vertical_m: 100.0 };
    let mut usual = engine(&simulation, EngineOptions::default());
    let integrity = RaimOptions { alarm_limits: limits, ..RaimOptions::default() };
    let mut strict = engine(&simulation, EngineOptions { integrity, ..EngineOptions::default() });
    let mut plain = engine(&simulation, EngineOptions::peng2023());
    for second in 0..150 {
        let bucket = || messages.iter().map(|of_phone| of_phone.get(second).cloned()).collect();
        let (epoch, strict, plain) = (usual.step(bucket()), strict.step(bucket()), plain.step(bucket()));
        for (phone, fused) in epoch.phones.iter().enumerate().filter(|_| second > 10) {
            let (levels, state) = (fused.protection.unwrap(), fused.state.as_ref().unwrap());
            let truth = simulation.truth_at(phone, epoch.time_gps).position;
            let error = LocalFrame::at(truth).ecef_to_enu(state.position());
            assert!(
                error.horizontal() < levels.horizontal_m && error.up.abs() < levels.vertical_m,
                "{levels:?}"
            );
            let by_epoch = fused.message.as_ref().unwrap().raim.protection.unwrap();
            assert!(levels.horizontal_m < 3.0 * by_epoch.horizontal_m, "{levels:?} {by_epoch:?}");
            let is_reliable = |fused: &FusedPhone| fused.verdict == Some(Verdict::Reliable);
            assert!(!is_reliable(&strict.phones[phone]), "second {second}");
            // Pseudoranges without robust weights: no fault is bounded, and the epoch-wise levels remain.
            assert!(plain.phones[phone].protection.is_some() || !is_reliable(fused), "second {second}");
        }
    }
}

#[test]
fn a_phone_with_an_impossible_start_costs_itself_only() {
    let (simulation, mut messages) = convoy(20.0);
    for message in &mut messages[1] {
        if let Some(solution) = &mut message.wls {
            solution.position_covariance.fill(0.0);
        }
    }
    let mut engine = engine(&simulation, EngineOptions::default());
    for second in 0..15 {
        let bucket = messages.iter().map(|of_phone| of_phone.get(second).cloned()).collect();
        let epoch = engine.step(bucket);
        assert!(epoch.phones[0].state.is_some(), "second {second}");
        assert!(epoch.phones[1].state.is_none(), "second {second}");
    }
    assert_eq!(engine.skips().count(Reason::PhoneTakenOutOfFilter), 15);
    assert_eq!(engine.skips().count(Reason::JointFilterRestarted), 0);
}

#[test]
fn without_feedback_the_filter_never_sees_a_constraint() {
    let (simulation, messages) = convoy(20.0);
    let mut constrained = engine(&simulation, EngineOptions { feedback: false, ..EngineOptions::default() });
    let mut free = Engine::new(&["SIM1".to_owned(), "SIM2".to_owned()], Vec::new(), EngineOptions::default());
    for second in 0..15 {
        let bucket = || messages.iter().map(|of_phone| of_phone.get(second).cloned()).collect();
        let (constrained, free) = (constrained.step(bucket()), free.step(bucket()));
        assert_eq!(constrained.phones[0].free, free.phones[0].state, "second {second}");
    }
}

/// Two phones at rest with a speed limit of 5 cm/s: their speed stays below it, and their positions improve.
#[test]
fn a_bound_on_the_speed_holds_and_helps_phones_that_stand() {
    let scenario = Scenario { duration_s: 240.0, ..Scenario::stationary(2) };
    let (simulation, messages) = simulated(scenario);
    let maximum_mps = 0.05;
    let bound = |phone| Constraint::Speed(Speed { phone, minimum_mps: 0.0, maximum_mps });
    let run = |constraints: Vec<Constraint>| {
        let always = |constraint| ScheduledConstraint { constraint, from_gps: None, to_gps: None };
        let constraints = constraints.into_iter().map(always).collect();
        let mut engine = Engine::new(&NAMES.map(str::to_owned), constraints, EngineOptions::default());
        let (mut errors_m, mut fastest_mps) = (Vec::new(), 0.0f64);
        for second in 0..230 {
            let bucket = messages.iter().map(|of_phone: &Vec<EpochMessage>| of_phone.get(second).cloned());
            let epoch = engine.step(bucket.collect());
            for (phone, fused) in epoch.phones.iter().enumerate().filter(|(_, fused)| fused.state.is_some()) {
                let state = fused.state.as_ref().unwrap();
                let velocity = LocalFrame::at(state.position()).vector_ecef_to_enu(state.velocity());
                fastest_mps = fastest_mps.max(velocity.horizontal());
                errors_m.push(error_m(&simulation, phone, &epoch));
            }
        }
        errors_m.sort_by(f64::total_cmp);
        (errors_m[errors_m.len() / 2], fastest_mps)
    };
    let (free_m, free_mps) = run(Vec::new());
    let (bound_m, bound_mps) = run(vec![bound(0), bound(1)]);
    println!(
        "median error {free_m:.3} m and {bound_m:.3} m, fastest {free_mps:.3} m/s and {bound_mps:.3} m/s"
    );
    assert!(free_mps > 2.0 * maximum_mps, "{free_mps}");
    assert!(bound_mps <= maximum_mps + 1e-3, "{bound_mps}");
    assert!(bound_m < 0.95 * free_m, "{bound_m} {free_m}");
}

/// The fused verdict is that of the innovations: it stands where a phone has too few satellites for RAIM of its own, and falls where measurements
/// contradict the prediction.
#[test]
fn fused_verdicts_rest_on_innovations() {
    let (simulation, mut messages) = convoy(60.0);
    for message in &mut messages[0][30..40] {
        message.observations.truncate(4);
        (message.wls, message.raim) = (None, RaimReport::of(Verdict::CannotBeChecked));
    }
    for message in &mut messages[1][30..40] {
        for (observation, error_m) in
            message.observations.iter_mut().zip([60.0, -50.0, 40.0, -70.0].repeat(9))
        {
            observation.pseudorange_m += error_m;
        }
    }
    let mut engine = engine(&simulation, EngineOptions::default());
    let (mut sparse, mut disturbed, mut before) = (0, 0, 0);
    for second in 0..40 {
        let bucket = messages.iter().map(|of_phone| of_phone.get(second).cloned()).collect();
        let epoch = engine.step(bucket);
        let is_reliable = |phone: usize| epoch.phones[phone].verdict == Some(Verdict::Reliable);
        if second < 30 {
            before += usize::from(is_reliable(0)) + usize::from(is_reliable(1));
        } else {
            sparse += usize::from(is_reliable(0));
            disturbed += usize::from(is_reliable(1));
        }
    }
    assert!(before >= 57, "{before} of 60");
    // Then the prediction has become vague.
    assert!((6..10).contains(&sparse), "{sparse} of 10");
    // The filter is lost after five seconds and starts anew, once, with the verdict of the agent.
    assert!(disturbed <= 1, "{disturbed} of 10");
}
