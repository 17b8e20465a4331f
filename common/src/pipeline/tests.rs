//! The pipeline on simulated phones whose clocks or observations are altered.

use super::*;
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::gnss::{Constellation, Observation};
use crate::simulation::{ErrorModel, PhoneOptions, Scenario, SimulatedEpoch, Simulation};

/// A car on an open road for `duration_s`, with its epochs and products.
fn drive(duration_s: f64) -> (Vec<SimulatedEpoch>, Arc<Products>) {
    let phone = PhoneOptions { stops_before_s: 0.0, ..PhoneOptions::of_vehicle(0) };
    let scenario = Scenario { duration_s, phones: vec![phone], canyons: Vec::new(), ..Scenario::default() };
    let simulation = Simulation::new(scenario).unwrap();
    (simulation.epochs(0).collect(), Arc::new(simulation.products()))
}

fn process(
    epochs: impl Iterator<Item = ObservationEpoch>,
    products: &Arc<Products>,
) -> (Vec<EpochMessage>, Skips) {
    let mut pipeline = PhonePipeline::new("P", Arc::clone(products), PipelineOptions::default());
    let messages = epochs.map(|epoch| pipeline.process(&epoch)).collect();
    (messages, pipeline.skips())
}

/// The same instant as seen by a clock that is `offset_s` further ahead: time tag and pseudoranges grow by it.
fn with_clock(epoch: &ObservationEpoch, offset_s: f64) -> ObservationEpoch {
    let mut altered = ObservationEpoch { time_gps: epoch.time_gps + offset_s, ..epoch.clone() };
    for pseudorange_m in altered.observations.iter_mut().filter_map(|o| o.pseudorange_m.as_mut()) {
        *pseudorange_m += SPEED_OF_LIGHT_MPS * offset_s;
    }
    altered
}

/// Checks that a clock with the offset `offset_s(k)` at epoch k changes neither times nor positions, and that times are those of the truth.
fn assert_clock_changes_nothing(offset_s: impl Fn(usize) -> f64) {
    let (simulated, products) = drive(60.0);
    let (expected, _) = process(simulated.iter().map(|s| s.epoch.clone()), &products);
    let altered = simulated.iter().enumerate().map(|(k, s)| with_clock(&s.epoch, offset_s(k)));
    let (messages, skips) = process(altered, &products);
    assert_eq!(skips.count(Reason::EpochTimeLimited), 0, "{skips}");
    for ((message, expected), simulated) in messages.iter().zip(&expected).zip(&simulated) {
        // Errors of the pseudoranges of some metres are tens of nanoseconds.
        assert!((message.time_gps - simulated.truth.time_gps).abs() < 2e-7, "{}", message.time_gps);
        assert!((message.time_gps - expected.time_gps).abs() <= 2e-9, "{}", message.time_gps);
        let positions =
            |m: &EpochMessage| [m.wls.as_ref().unwrap().position, m.local.as_ref().unwrap().position()];
        for (ours, theirs) in positions(message).into_iter().zip(positions(expected)) {
            // The ionosphere of the model is that of the tag, and the steps of time are whole nanoseconds.
            assert!(ours.distance_m(theirs) < 1e-3, "{}: {} m", message.time_gps, ours.distance_m(theirs));
        }
    }
    let fastest_mps = simulated.iter().map(|s| s.truth.velocity.0.norm()).fold(0.0, f64::max);
    assert!(fastest_mps > 8.0, "the car moves");
}

#[test]
fn a_clock_offset_of_400_ms_or_20_ms_is_no_error_of_time() {
    assert_clock_changes_nothing(|_| 0.4);
    assert_clock_changes_nothing(|_| -0.02);
}

#[test]
fn a_clock_that_drifts_and_steps_by_a_millisecond_is_no_error_of_time() {
    assert_clock_changes_nothing(|k| 1e-4 * (k % 10) as f64 - 5e-4);
}

#[test]
fn without_a_reliable_solution_the_last_clock_offset_holds() {
    let (simulated, products) = drive(30.0);
    let altered = simulated.iter().enumerate().map(|(k, s)| {
        let mut epoch = with_clock(&s.epoch, 0.4);
        match k {
            // Every pseudorange is wrong by its own hundreds of kilometres, a millisecond of light.
            10 => {
                for (i, observation) in epoch.observations.iter_mut().enumerate() {
                    let error_m = 3e5 * (1.0 + (i * i % 7) as f64);
                    observation.pseudorange_m = observation.pseudorange_m.map(|p| p + error_m);
                }
            }
            11 => epoch.observations.truncate(3),
            _ => {}
        }
        epoch
    });
    let (messages, _) = process(altered, &products);
    assert!(matches!(messages[10].raim.verdict, Verdict::Unreliable(_)), "{}", messages[10].raim.verdict);
    assert!(messages[11].wls.is_none());
    for (message, simulated) in messages.iter().zip(&simulated) {
        assert!((message.time_gps - simulated.truth.time_gps).abs() < 2e-7, "{}", message.time_gps);
    }
}

/// Pseudoranges of Galileo that are wrong by each satellite's own hundreds of kilometres.
fn ruin_galileo(epoch: &mut ObservationEpoch) {
    let of_galileo = |o: &&mut Observation| o.satellite.constellation == Constellation::Galileo;
    for (i, observation) in epoch.observations.iter_mut().filter(of_galileo).enumerate() {
        let error_m = 1e5 * [3.0, -2.1, 1.7, -3.3, 2.6][i % 5];
        observation.pseudorange_m = observation.pseudorange_m.map(|p| p + error_m);
    }
}

#[test]
fn a_constellation_that_is_wrong_as_a_whole_costs_only_itself() {
    let (simulated, products) = drive(30.0);
    let altered = simulated.iter().map(|s| {
        let mut epoch = s.epoch.clone();
        ruin_galileo(&mut epoch);
        epoch
    });
    let (messages, _) = process(altered, &products);
    let mut reliable = 0;
    for (message, simulated) in messages.iter().zip(&simulated) {
        let error_m = |position: Ecef| position.distance_m(simulated.truth.position);
        if let Some(solution) = &message.wls {
            assert!(error_m(solution.position) < 30.0, "{}", message.time_gps);
        }
        assert!(message.local.as_ref().is_none_or(|local| error_m(local.position()) < 15.0));
        reliable += usize::from(message.raim.verdict == Verdict::Reliable);
    }
    assert!(reliable > 20, "{reliable} of {} epochs are reliable", messages.len());
}

#[test]
fn an_absurd_solution_is_no_position_and_starts_no_filter() {
    let (simulated, products) = drive(12.0);
    let altered = simulated.iter().enumerate().map(|(k, s)| {
        let mut epoch = s.epoch.clone();
        if k < 5 {
            // All constellations are wrong: no exclusion helps.
            for (i, observation) in epoch.observations.iter_mut().enumerate() {
                let error_m = 1e4 * (i * i % 7) as f64;
                observation.pseudorange_m = observation.pseudorange_m.map(|p| p + error_m);
            }
        }
        epoch
    });
    let (messages, skips) = process(altered, &products);
    for message in &messages[..5] {
        assert!(message.wls.is_none() && message.local.is_none(), "{}", message.time_gps);
        assert!(matches!(message.raim.verdict, Verdict::Unreliable(_)), "{}", message.raim.verdict);
        assert!(message.observations.iter().all(|o| o.residual_m.is_none()));
    }
    assert_eq!(skips.count(Reason::EpochContradictory), 5, "{skips}");
    for (message, simulated) in messages[5..].iter().zip(&simulated[5..]) {
        let local = message.local.as_ref().unwrap().position();
        assert!(local.distance_m(simulated.truth.position) < 30.0, "{}", message.time_gps);
    }
}

/// Five satellites of three systems give no solution. Their observations are corrected for the last position all the same, so that the
/// filter can go on.
#[test]
fn observations_without_a_solution_are_corrected_for_the_last_position() {
    let (simulated, products) = drive(20.0);
    let (expected, _) = process(simulated.iter().map(|s| s.epoch.clone()), &products);
    let of = |constellation, count| {
        let seen = expected[9].observations.iter().filter(|o| o.signal.band != b'5');
        seen.filter(move |o| o.satellite.constellation == constellation).map(|o| o.satellite).take(count)
    };
    let five: Vec<_> = of(Constellation::Gps, 2)
        .chain(of(Constellation::Galileo, 2))
        .chain(of(Constellation::Beidou, 1))
        .collect();
    let altered = simulated.iter().enumerate().map(|(k, s)| {
        let mut epoch = s.epoch.clone();
        let is_left = |o: &Observation| five.contains(&o.satellite) && o.signal.band != b'5';
        epoch.observations.retain(|o| k < 10 || is_left(o));
        epoch
    });
    let (messages, _) = process(altered, &products);
    for (message, expected) in messages.iter().zip(&expected).skip(10) {
        assert!(message.wls.is_none(), "{}", message.time_gps);
        assert_eq!(message.observations.len(), 5, "{}", message.time_gps);
        for ours in &message.observations {
            let is_same =
                |o: &&CorrectedObservation| (o.satellite, o.signal) == (ours.satellite, ours.signal);
            let theirs = expected.observations.iter().find(is_same).unwrap();
            let difference_m = ours.pseudorange_m - theirs.pseudorange_m;
            assert!(difference_m.abs() < 0.1, "{} at {}: {difference_m} m", ours.satellite, message.time_gps);
        }
    }
}

/// A car between houses, with the phases of a good receiver: range and clock without multipath, less the ionospheric delay, and a constant for
/// each signal.
fn drive_with_phases(noise_m: f64) -> (Vec<SimulatedEpoch>, Arc<Products>) {
    let phone = PhoneOptions { stops_before_s: 0.0, ..PhoneOptions::of_vehicle(0) };
    let scenario = Scenario { duration_s: 300.0, phones: vec![phone], ..Scenario::default() };
    let simulation = Simulation::new(scenario.clone()).unwrap();
    let mut simulated: Vec<SimulatedEpoch> = simulation.epochs(0).collect();
    let exact = |ionosphere_scale| {
        let errors = ErrorModel { ionosphere_scale, ..ErrorModel::none() };
        let simulation = Simulation::new(Scenario { errors, ..scenario.clone() }).unwrap();
        simulation.epochs(0).map(|simulated| simulated.epoch).collect::<Vec<_>>()
    };
    let (without, delayed) = (exact(0.0), exact(scenario.errors.ionosphere_scale));
    for (k, simulated) in simulated.iter_mut().enumerate() {
        for observation in &mut simulated.epoch.observations {
            let key = (observation.satellite, observation.signal);
            let range_m = |epoch: &ObservationEpoch| {
                epoch
                    .observations
                    .iter()
                    .find(|o| (o.satellite, o.signal) == key)
                    .and_then(|o| o.pseudorange_m)
            };
            let scatter = (k * 7_919 + usize::from(observation.satellite.number) * 104_729) % 1_000;
            let error_m = noise_m * (scatter as f64 / 250.0 - 2.0);
            let wavelength_m = observation.signal.wavelength_m(observation.satellite.constellation, None);
            let ranges = range_m(&without[k]).zip(range_m(&delayed[k])).zip(wavelength_m);
            observation.carrier_phase_cycles = ranges.map(|((without_m, delayed_m), wavelength_m)| {
                (2.0 * without_m - delayed_m + error_m) / wavelength_m - 5e6
            });
        }
    }
    (simulated, Arc::new(simulation.products()))
}

/// Root mean square of the local filter's position error after the first minute, m.
fn local_error_m(simulated: &[SimulatedEpoch], products: &Arc<Products>, carrier_phase: bool) -> f64 {
    let filter = FilterOptions { use_changes: carrier_phase, ..FilterOptions::default() };
    let options = PipelineOptions { filter, ..PipelineOptions::default() };
    let mut pipeline = PhonePipeline::new("P", Arc::clone(products), options);
    let squares: Vec<f64> = simulated
        .iter()
        .map(|s| (pipeline.process(&s.epoch), s.truth.position))
        .skip(60)
        .map(|(message, truth)| message.local.unwrap().position().distance_m(truth).powi(2))
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn good_phases_help_and_worthless_ones_do_not_harm() {
    let (good, products) = drive_with_phases(0.003);
    let [with_m, without_m] = [true, false].map(|phases| local_error_m(&good, &products, phases));
    assert!(with_m < 0.6 * without_m, "{with_m} m, {without_m} m");
    let (noisy, products) = drive_with_phases(0.15);
    let [with_m, without_m] = [true, false].map(|phases| local_error_m(&noisy, &products, phases));
    assert!(with_m < 1.02 * without_m, "{with_m} m, {without_m} m");
}
