//! The engine on a simulated convoy, without transport.

use std::sync::Arc;

use crate::pipeline::{PhonePipeline, PipelineOptions};
use crate::simulation::{PhoneOptions, Scenario, Simulation};

use super::*;

/// Two phones from the start to the end, on an open road.
fn convoy(duration_s: f64) -> (Simulation, Vec<Vec<EpochMessage>>) {
    let phone = |vehicle| PhoneOptions {
        starts_after_s: 0.0,
        stops_before_s: 0.0,
        ..PhoneOptions::of_vehicle(vehicle)
    };
    let scenario = Scenario { duration_s, phones: vec![phone(0), phone(1)], ..Scenario::default() };
    let simulation = Simulation::new(scenario).unwrap();
    let products = Arc::new(simulation.products());
    let run = |index: usize, name: &str| {
        let mut pipeline = PhonePipeline::new(name, Arc::clone(&products), PipelineOptions::default());
        simulation.epochs(index).map(|simulated| pipeline.process(&simulated.epoch)).collect()
    };
    let messages = vec![run(0, "SIM1"), run(1, "SIM2")];
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
    assert_eq!(engine.skips().count("silent phone dropped from the filter"), 2);
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
    assert_eq!(engine.skips().count("phone taken out of the filter"), 15);
    assert_eq!(engine.skips().count("joint filter restarted"), 0);
}

#[test]
fn without_feedback_the_filter_never_sees_a_constraint() {
    let (simulation, messages) = convoy(20.0);
    let mut constrained = engine(&simulation, EngineOptions { feedback: false, ..EngineOptions::default() });
    let mut free = Engine::new(&["SIM1".to_owned(), "SIM2".to_owned()], Vec::new(), EngineOptions::default());
    for second in 0..15 {
        let bucket = || messages.iter().map(|of_phone| of_phone.get(second).cloned()).collect();
        constrained.step(bucket());
        free.step(bucket());
        assert_eq!(constrained.filter.state(0), free.filter.state(0), "second {second}");
    }
}
