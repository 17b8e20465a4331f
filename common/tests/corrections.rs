//! Corrections undo what a noise-free simulation put into its observations.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use cofix_common::constants::SPEED_OF_LIGHT_MPS;
use cofix_common::measurement::{CorrectedObservation, CorrectionOptions, Corrector};
use cofix_common::simulation::{Scenario, SimulatedEpoch, Simulation};

/// Code and rate residuals of an observation against the simulated truth, m and m/s.
fn residuals(observation: &CorrectedObservation, simulated: &SimulatedEpoch, bias_s: f64) -> (f64, f64) {
    let line = observation.satellite_position - simulated.truth.position;
    let clock_m = SPEED_OF_LIGHT_MPS * (simulated.clock.bias_s + bias_s);
    let approach = observation.satellite_velocity.0 - simulated.truth.velocity.0;
    let rate_mps = observation.range_rate.unwrap().range_rate_mps;
    let drift_mps = SPEED_OF_LIGHT_MPS * simulated.clock.drift_sps;
    (
        observation.pseudorange_m - line.norm() - clock_m,
        rate_mps - line.0.normalize().dot(&approach) - drift_mps,
    )
}

#[test]
fn corrected_observations_fit_the_truth() {
    let scenario = Scenario { noise_free: true, duration_s: 120.0, ..Scenario::default() };
    let simulation = Simulation::new(scenario).unwrap();
    let mut compared = 0;
    for phone in 0..3 {
        let mut corrector = Corrector::new(Arc::new(simulation.products()), CorrectionOptions::default());
        let epochs = simulation.phone(phone).unwrap();
        let biases = *epochs.inter_system_biases();
        for simulated in epochs {
            let prepared = corrector.prepare(&simulated.epoch);
            let (corrected, _) =
                corrector.finish(&prepared, simulated.truth.position, simulated.epoch.time_gps);
            for observation in corrected {
                let (code_m, rate_mps) =
                    residuals(&observation, &simulated, biases.of(observation.clock_group()));
                let name = format!("{} {}", observation.satellite, observation.signal);
                assert!(code_m.abs() < 1e-3, "{name}: {code_m} m");
                assert!(rate_mps.abs() < 5e-3, "{name}: {rate_mps} m/s");
                compared += 1;
            }
        }
    }
    assert!(compared > 5_000, "{compared} observations compared");
}
