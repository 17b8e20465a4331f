//! Properties of the simulated convoy that hold for any seed, seen from outside.

use std::collections::{BTreeMap, BTreeSet};

use cofix_common::constraint::Constraint;
use cofix_common::frames::LocalFrame;
use cofix_common::gnss::{Constellation, SatelliteId};
use cofix_common::simulation::{PhoneOptions, Scenario, SimulatedEpoch, Simulation};

fn simulation(scenario: Scenario) -> Simulation {
    Simulation::new(scenario).unwrap()
}

fn epochs(simulation: &Simulation, phone: usize) -> Vec<SimulatedEpoch> {
    simulation.epochs(phone).collect()
}

fn short(seed: u64) -> Scenario {
    Scenario { seed, duration_s: 60.0, ..Scenario::default() }
}

fn satellites(epoch: &SimulatedEpoch) -> BTreeSet<SatelliteId> {
    epoch.epoch.observations.iter().map(|observation| observation.satellite).collect()
}

#[test]
fn one_seed_gives_one_result_and_another_seed_another() {
    let first = epochs(&simulation(short(7)), 1);
    assert_eq!(first, epochs(&simulation(short(7)), 1));
    assert_ne!(first, epochs(&simulation(short(8)), 1));
}

#[test]
fn the_order_of_phones_does_not_matter() {
    let simulation = simulation(short(7));
    let forward: Vec<_> = (0..3).map(|phone| epochs(&simulation, phone)).collect();
    let backward: Vec<_> = (0..3).rev().map(|phone| epochs(&simulation, phone)).rev().collect();
    assert_eq!(forward, backward);
    let mut iterators: Vec<_> = (0..3).map(|phone| simulation.epochs(phone)).collect();
    for index in 0..40 {
        for (phone, iterator) in iterators.iter_mut().enumerate() {
            assert_eq!(iterator.next().as_ref(), forward[phone].get(index));
        }
    }
}

#[test]
fn what_blocks_one_satellite_changes_nothing_for_others() {
    let open = simulation(Scenario { canyons: Vec::new(), ..Scenario::default() });
    let street = simulation(Scenario::default());
    let (mut compared, mut in_canyon) = (0, 0);
    for (with, without) in street.epochs(0).zip(open.epochs(0)) {
        if with.in_canyon {
            in_canyon += 1;
        } else if in_canyon == 0 {
            compared += 1;
            assert_eq!(with, without);
        }
        assert!(satellites(&with).is_subset(&satellites(&without)));
    }
    assert!(compared > 100 && in_canyon > 30, "{compared} {in_canyon}");
}

#[test]
fn tags_differ_between_phones_and_truth_is_at_reception() {
    let simulation = simulation(Scenario::default());
    let start = simulation.scenario().start_gps;
    let phones: Vec<_> = (0..3).map(|phone| epochs(&simulation, phone)).collect();
    let first: Vec<f64> = phones.iter().map(|epochs| epochs[0].epoch.time_gps - start).collect();
    assert!(first[0] > 0.0 && first[0] < 1e-3, "{first:?}");
    assert!((first[1].fract() - 0.2).abs() < 0.01 && (first[2].fract() - 0.5).abs() < 0.01, "{first:?}");
    let last: Vec<f64> = phones.iter().map(|e| (e[e.len() - 1].epoch.time_gps - start).floor()).collect();
    assert_eq!(first.iter().map(|s| s.floor()).collect::<Vec<_>>(), [0.0, 3.0, 6.0]);
    assert!(last[0] > last[1] && last[1] > last[2] && last[2] > 580.0, "{last:?}");
    for (phone, epochs) in phones.iter().enumerate() {
        for simulated in epochs {
            let bias_s = simulated.epoch.time_gps - simulated.truth.time_gps;
            assert!((bias_s - simulated.clock.bias_s).abs() < 2e-9 && bias_s.abs() < 5e-5);
            let truth = simulation.truth_at(phone, simulated.truth.time_gps);
            assert!(truth.position.distance_m(simulated.truth.position) < 1e-6);
        }
    }
    assert_eq!(simulation.truth_table(0).len(), 601);
}

#[test]
fn the_truth_keeps_the_constraints() {
    let phones = (0..4).map(PhoneOptions::of_vehicle).collect();
    let simulation = simulation(Scenario { phones, duration_s: 900.0, ..Scenario::default() });
    let constraints =
        [simulation.distance_constraints(), simulation.vertical_velocity_constraints()].concat();
    assert_eq!(constraints.len(), 6 + 4);
    let tables: Vec<_> = (0..4).map(|phone| simulation.truth_table(phone)).collect();
    for second in 0..=900 {
        let truth: Vec<_> = tables.iter().map(|table| table[second]).collect();
        for constraint in &constraints {
            match *constraint {
                Constraint::Distance { phones: (a, b), minimum_m, maximum_m } => {
                    let distance = truth[a].position.distance_m(truth[b].position);
                    assert!(
                        (minimum_m..=maximum_m).contains(&distance),
                        "{second} s: {distance} {constraint:?}"
                    );
                }
                Constraint::VerticalVelocity { phone, maximum_mps } => {
                    let frame = LocalFrame::at(truth[phone].position);
                    let up = frame.vector_ecef_to_enu(truth[phone].velocity).up;
                    assert!(up.abs() <= maximum_mps && maximum_mps < 0.8, "{second} s: {up}");
                }
                Constraint::Heading { .. } => panic!("not asked for"),
            }
        }
    }
}

#[test]
fn the_sky_is_full_in_the_open_and_narrow_in_the_canyon() {
    for seed in [1, 2, 3] {
        let simulation = simulation(Scenario { seed, ..Scenario::default() });
        let (mut open, mut canyon) = (Vec::new(), Vec::new());
        for simulated in simulation.epochs(0) {
            let seen = satellites(&simulated);
            let systems: BTreeSet<Constellation> = seen.iter().map(|s| s.constellation).collect();
            if simulated.in_canyon {
                canyon.push(seen.len());
            } else {
                assert!(seen.len() >= 15 && systems.len() == 3, "{} of {systems:?}", seen.len());
                open.push(seen.len());
            }
        }
        let mean = |counts: &[usize]| counts.iter().sum::<usize>() as f64 / counts.len() as f64;
        assert!(canyon.len() > 40, "{}", canyon.len());
        assert!(mean(&canyon) < 0.7 * mean(&open), "{} {}", mean(&canyon), mean(&open));
        assert!(canyon.iter().min() >= Some(&5), "{canyon:?}");
    }
}

#[test]
fn faults_begin_at_about_the_rate_asked() {
    let simulation = simulation(Scenario::default());
    let errors = simulation.scenario().errors;
    let (mut beginnings, mut expected) = (0, 0.0);
    for phone in 0..3 {
        let mut before = BTreeMap::new();
        for simulated in simulation.epochs(phone) {
            let now: BTreeMap<_, _> = simulated.faults.iter().map(|f| (f.satellite, f.error_m)).collect();
            assert!(now.keys().all(|satellite| satellites(&simulated).contains(satellite)));
            beginnings += now.iter().filter(|(s, error)| before.get(*s) != Some(*error)).count();
            let rate = if simulated.in_canyon { errors.outliers_canyon_hz } else { errors.outliers_open_hz };
            expected += rate * (satellites(&simulated).len() - now.len()) as f64;
            before = now;
        }
    }
    let ratio = beginnings as f64 / expected;
    assert!((0.5..2.0).contains(&ratio), "{beginnings} faults, {expected} expected");
}
