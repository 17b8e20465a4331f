//! Properties of the simulation that hold for any seed, seen from outside.

#![allow(clippy::unwrap_used)] // a test may

use std::collections::{BTreeMap, BTreeSet};

use cofix_common::atmosphere::{
    STANDARD_RELATIVE_HUMIDITY, Troposphere, TroposphereMapping, klobuchar_delay_l1_m, scale_from_l1,
};
use cofix_common::constants::{EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS};
use cofix_common::constraint::{Constraint, Distance, VerticalVelocity};
use cofix_common::frames::{Direction, Enu, LocalFrame};
use cofix_common::gnss::{ClockGroup, Constellation, Observation, SatelliteId, SignalCode};
use cofix_common::measurement::beidou2_code_correction_m;
use cofix_common::orbit::Products;
use cofix_common::simulation::{
    AccelerationPulse, ClockOptions, ConvoyOptions, ErrorModel, InterSystemBiases, IonosphereResidual,
    OwnMotion, PhoneOptions, Scenario, SharedErrors, SimulatedEpoch, Simulation, Traffic,
};
use cofix_common::time::GpsTime;
use nalgebra::{Rotation3, Vector3};

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
    let (mut far, mut hidden, mut same, mut in_canyon) = (0, 0, 0, 0);
    for (with, without) in street.epochs(0).zip(open.epochs(0)) {
        assert!(satellites(&with).is_subset(&satellites(&without)));
        in_canyon += i32::from(with.in_canyon);
        far += i32::from(with == without);
        if !with.in_canyon {
            // Seen from outside, the houses hide or reflect some satellites, and leave the others as they are.
            hidden += satellites(&without).len() - satellites(&with).len();
            same += with.epoch.observations.iter().filter(|o| without.epoch.observations.contains(o)).count();
        }
    }
    assert!(far > 400 && in_canyon > 30, "{far} {in_canyon}");
    assert!((1..200).contains(&hidden) && same > 10_000, "{hidden} {same}");
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

/// The scenarios that have a name.
fn named() -> [(&'static str, Scenario); 4] {
    [
        ("convoy", Scenario::convoy(4)),
        ("car", Scenario::car(6)),
        ("canyon", Scenario::canyon(5)),
        ("static", Scenario::stationary(5)),
    ]
}

#[test]
fn the_truth_keeps_the_constraints() {
    for (name, scenario) in named() {
        let simulation = simulation(Scenario { duration_s: 900.0, ..scenario });
        let count = simulation.phone_names().len();
        let constraints =
            [simulation.distance_constraints(), simulation.vertical_velocity_constraints()].concat();
        assert_eq!(constraints.len(), count * (count - 1) / 2 + count);
        let tables: Vec<_> = (0..count).map(|phone| simulation.truth_table(phone)).collect();
        for second in 0..=900 {
            let truth: Vec<_> = tables.iter().map(|table| table[second]).collect();
            for constraint in &constraints {
                match *constraint {
                    Constraint::Distance(Distance { phones: [a, b], minimum_m, maximum_m }) => {
                        let distance = truth[a].position.distance_m(truth[b].position);
                        assert!(
                            (minimum_m..=maximum_m).contains(&distance),
                            "{name}, {second} s: {distance} {constraint:?}"
                        );
                    }
                    Constraint::VerticalVelocity(VerticalVelocity { phone, maximum_mps }) => {
                        let frame = LocalFrame::at(truth[phone].position);
                        let up = frame.vector_ecef_to_enu(truth[phone].velocity).up;
                        assert!(up.abs() <= maximum_mps && maximum_mps < 0.8, "{name}, {second} s: {up}");
                    }
                    _ => panic!("not asked for"),
                }
            }
        }
    }
}

#[test]
fn bounds_within_a_car_leave_room_and_are_no_wider_than_a_car() {
    for (name, scenario) in named() {
        let simulation = simulation(scenario);
        let phones = &simulation.scenario().phones;
        for constraint in simulation.distance_constraints() {
            let Constraint::Distance(Distance { phones: [a, b], minimum_m, maximum_m }) = constraint else {
                continue;
            };
            let apart_m = phones[a].mount.distance_m(&phones[b].mount);
            if phones[a].vehicle == phones[b].vehicle {
                assert!(minimum_m == 0.0 && maximum_m <= 2.5, "{name}: {constraint:?}");
                assert!(apart_m > 0.05 && maximum_m - apart_m >= 0.5, "{name}: {apart_m} {constraint:?}");
            } else {
                assert!(minimum_m > 0.0, "{name}: {constraint:?}");
            }
        }
    }
}

/// Phones of one car are hidden from the same satellites and have the same reflections; their multipath is alike in part.
#[test]
fn phones_of_one_car_share_what_is_outside_it() {
    let phone = |rank| PhoneOptions {
        vehicle: 0,
        starts_after_s: 0.0,
        stops_before_s: 0.0,
        epoch_offset_s: 0.0,
        clock: ClockOptions::default(),
        ..PhoneOptions::of_vehicle(rank)
    };
    let errors = ErrorModel { multipath_shared: 1.0, outliers_hz: 0.0, ..ErrorModel::default() };
    let phones = vec![phone(0), PhoneOptions { starts_after_s: 5.0, ..phone(1) }];
    let simulation = simulation(Scenario { phones, errors, ..Scenario::canyon(2) });
    let (first, second) = (epochs(&simulation, 0), epochs(&simulation, 1));
    let (mut faults, mut shared) = (0, 0);
    for (a, b) in first.iter().skip(5).zip(&second) {
        // The clocks drift apart, so that receptions differ by some nanoseconds.
        assert!((a.truth.time_gps - b.truth.time_gps).abs() < 1e-4);
        for fault in &a.faults {
            faults += 1;
            let same = b.faults.iter().find(|other| other.satellite == fault.satellite);
            shared += i32::from(same.is_some_and(|other| (other.error_m - fault.error_m).abs() < 0.01));
        }
    }
    // The second phone's antenna is weaker and loses some.
    assert!(faults > 500 && f64::from(shared) > 0.8 * f64::from(faults), "{shared} of {faults}");
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
                canyon.push(seen.len() - simulated.faults.len());
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
fn in_the_old_town_satellites_are_hidden_reflected_and_weak() {
    let errors = ErrorModel { outliers_hz: 0.0, ..ErrorModel::default() };
    let (mut reflected, mut seen, mut errors_m) = (0, 0, Vec::new());
    let mut strength = [(0.0, 0); 2];
    for seed in 1..=3 {
        let simulation = simulation(Scenario { seed, errors, ..Scenario::canyon(4) });
        for phone in 0..4 {
            for simulated in simulation.epochs(phone) {
                if simulated.in_canyon {
                    seen += satellites(&simulated).len();
                    reflected += simulated.faults.len();
                    errors_m.extend(simulated.faults.iter().map(|fault| fault.error_m));
                    for observation in &simulated.epoch.observations {
                        let is_fault = simulated.faults.iter().any(|f| f.satellite == observation.satellite);
                        let (sum, count) = &mut strength[usize::from(is_fault)];
                        *sum += observation.cn0_dbhz.unwrap();
                        *count += 1;
                    }
                }
            }
        }
    }
    let share = reflected as f64 / seen as f64;
    assert!((0.03..0.4).contains(&share), "{share} by reflection only");
    assert!(errors_m.iter().all(|error_m| (0.0..60.0).contains(error_m)), "late, by the width of a street");
    let mean_m = errors_m.iter().sum::<f64>() / errors_m.len() as f64;
    assert!((5.0..30.0).contains(&mean_m), "{mean_m}");
    let [direct, by_reflection] = strength.map(|(sum, count)| sum / f64::from(count));
    assert!(by_reflection < direct - 3.0, "{by_reflection} {direct} dB-Hz");
}

#[test]
fn passing_reflections_begin_at_about_the_rate_asked() {
    let simulation = simulation(Scenario { canyons: Vec::new(), ..Scenario::default() });
    let errors = simulation.scenario().errors;
    let (mut beginnings, mut expected) = (0, 0.0);
    for phone in 0..3 {
        let mut before = BTreeMap::new();
        for simulated in simulation.epochs(phone) {
            let now: BTreeMap<_, _> = simulated.faults.iter().map(|f| (f.satellite, f.error_m)).collect();
            assert!(now.keys().all(|satellite| satellites(&simulated).contains(satellite)));
            beginnings += now.iter().filter(|(s, error)| before.get(*s) != Some(*error)).count();
            expected += errors.outliers_hz * (satellites(&simulated).len() - now.len()) as f64;
            before = now;
        }
    }
    let ratio = beginnings as f64 / expected;
    assert!((0.5..2.0).contains(&ratio), "{beginnings} faults, {expected} expected");
}

/// What a receiver makes of a noise-free observation with the broadcast messages and the true position.
struct Corrected {
    satellite: SatelliteId,
    signal: SignalCode,
    /// P − I − T − c·TGD, m.
    without_delays_m: f64,
    /// P_c − range − receiver clock and bias, m.
    residual_m: f64,
    /// −λD without the receiver's drift, m/s.
    without_drift_mps: f64,
    /// Range rate − (v_s − v_k)·u − receiver clock drift, m/s.
    rate_residual_mps: f64,
}

/// Corrects by the book: t_tx = tag − P/c − dT_s, and the Sagnac term ω·(x_s·y_k − y_s·x_k)/c.
fn correct(
    simulation: &Simulation,
    products: &Products,
    biases: &InterSystemBiases,
    simulated: &SimulatedEpoch,
) -> Vec<Corrected> {
    let c = SPEED_OF_LIGHT_MPS;
    let (truth, tag) = (simulated.truth, simulated.epoch.time_gps);
    let frame = LocalFrame::at(truth.position);
    let mapping = TroposphereMapping::default();
    let troposphere = Troposphere::at(frame.geodetic(), tag, mapping, STANDARD_RELATIVE_HUMIDITY);
    let one = |observation: &Observation| {
        let (satellite, signal) = (observation.satellite, observation.signal);
        let pseudorange = observation.pseudorange_m.unwrap();
        let mut clock_s = 0.0;
        for _ in 0..2 {
            clock_s = products.satellite_state(satellite, tag - pseudorange / c - clock_s).unwrap().clock_s;
        }
        let state = products.satellite_state(satellite, tag - pseudorange / c - clock_s).unwrap();
        let (s, k) = (state.position.0, truth.position.0);
        let range = (s - k).norm() + EARTH_ROTATION_RADPS * (s.x * k.y - s.y * k.x) / c;
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -EARTH_ROTATION_RADPS * range / c);
        let unit = (turn * s - k).normalize();
        let direction = frame.direction(&unit);
        let wavelength = signal.wavelength_m(satellite.constellation, None).unwrap();
        let ionosphere = klobuchar_delay_l1_m(simulation.klobuchar(), frame.geodetic(), direction, tag);
        let troposphere = troposphere.delay_m(direction);
        // GPS L5 has no delay in the message, and without errors none in truth
        let group_delay =
            products.group_delay_correction_m(satellite, signal, state.clock_reference, tag).unwrap_or(0.0);
        let group = ClockGroup { constellation: satellite.constellation, band: signal.band };
        let receiver_clock = c * (simulated.clock.bias_s + biases.of(group));
        let code_bias = beidou2_code_correction_m(satellite, signal, direction.elevation_rad);
        let without_delays_m =
            pseudorange - scale_from_l1(ionosphere, c / wavelength) - troposphere + group_delay + code_bias;
        let without_drift_mps = -wavelength * observation.doppler_hz.unwrap() - c * simulated.clock.drift_sps;
        let apparent = unit.dot(&(turn * state.velocity.0 - truth.velocity.0));
        Corrected {
            satellite,
            signal,
            without_delays_m: without_delays_m - c * simulated.clock.bias_s,
            residual_m: without_delays_m + c * clock_s - range - receiver_clock,
            without_drift_mps,
            rate_residual_mps: without_drift_mps + c * state.clock_drift_sps - apparent,
        }
    };
    simulated.epoch.observations.iter().map(one).collect()
}

#[test]
fn without_errors_the_corrected_observations_fit_the_truth() {
    let simulation = simulation(Scenario { noise_free: true, ..Scenario::default() });
    let products = simulation.products();
    let (mut worst_m, mut worst_mps, mut signals) = (0.0_f64, 0.0_f64, BTreeSet::new());
    for phone in 0..3 {
        let epochs = simulation.phone(phone).unwrap();
        let biases = *epochs.inter_system_biases();
        for simulated in epochs {
            assert!(simulated.faults.is_empty());
            for corrected in correct(&simulation, &products, &biases, &simulated) {
                worst_m = worst_m.max(corrected.residual_m.abs());
                worst_mps = worst_mps.max(corrected.rate_residual_mps.abs());
                signals.insert((corrected.satellite.constellation, corrected.signal));
            }
        }
    }
    println!("worst residuals {worst_m:.5} m, {worst_mps:.5} m/s");
    assert!(worst_m < 0.01 && worst_mps < 0.01, "{worst_m} m, {worst_mps} m/s");
    assert_eq!(signals.len(), 4, "{signals:?}");
}

/// Compares the Doppler of a phone without errors with the differences of its pseudoranges over 0.2 s; returns the number of comparisons.
/// The mean of three epochs with the weights 1, 2, 1 is exact while the velocity is linear between epochs.
fn assert_doppler_is_the_derivative(phone: PhoneOptions, traffic: Traffic) -> usize {
    let simulation = simulation(Scenario {
        noise_free: true,
        interval_s: 0.1,
        duration_s: 40.0,
        convoy: ConvoyOptions { traffic, ..ConvoyOptions::default() },
        phones: vec![phone],
        ..Scenario::default()
    });
    let products = simulation.products();
    let epochs = simulation.phone(0).unwrap();
    let biases = *epochs.inter_system_biases();
    let corrected: Vec<_> =
        epochs.map(|simulated| correct(&simulation, &products, &biases, &simulated)).collect();
    let mut compared = 0;
    for three in corrected.windows(3) {
        for middle in &three[1] {
            let same = |o: &&Corrected| (o.satellite, o.signal) == (middle.satellite, middle.signal);
            let (before, after) = (three[0].iter().find(same), three[2].iter().find(same));
            let (Some(before), Some(after)) = (before, after) else { continue };
            let derivative = (after.without_delays_m - before.without_delays_m) / 0.2;
            let ends_mps = before.without_drift_mps + after.without_drift_mps;
            let mean_mps = 0.25 * ends_mps + 0.5 * middle.without_drift_mps;
            assert!((derivative - mean_mps).abs() < 0.006, "{derivative} {mean_mps}");
            compared += 1;
        }
    }
    compared
}

#[test]
fn doppler_is_the_derivative_of_the_pseudorange() {
    let compared = assert_doppler_is_the_derivative(PhoneOptions::of_vehicle(0), Traffic::Town);
    assert!(compared > 5_000, "{compared}");
}

const fn enu(east: f64, north: f64, up: f64) -> Enu {
    Enu { east, north, up }
}

/// A phone that leaves its car at 20 s, one that climbs at 2 m/s, an acceleration of 10 m/s² for three seconds, and an aircraft.
fn motions() -> [(Traffic, OwnMotion); 4] {
    let pulse = AccelerationPulse { from_s: 20.0, duration_s: 3.0, acceleration_mps2: enu(10.0, 0.0, 0.0) };
    [
        (Traffic::Town, OwnMotion::departure(20.0, enu(0.0, 0.3, 0.0))),
        (Traffic::Standing, OwnMotion::with_velocity(enu(0.0, 0.0, 2.0))),
        (Traffic::Town, OwnMotion::default().and(pulse)),
        (Traffic::Standing, OwnMotion::with_velocity(enu(250.0, 0.0, 0.0))),
    ]
}

#[test]
fn in_manoeuvres_doppler_is_the_derivative_of_the_pseudorange_too() {
    for (traffic, motion) in motions() {
        let phone = PhoneOptions { motion, ..PhoneOptions::of_vehicle(0) };
        let compared = assert_doppler_is_the_derivative(phone, traffic);
        assert!(compared > 5_000, "{compared}");
    }
}

#[test]
fn in_manoeuvres_the_velocity_is_the_derivative_of_the_position() {
    for (traffic, motion) in motions() {
        let convoy = ConvoyOptions { traffic, ..ConvoyOptions::default() };
        let moving = PhoneOptions { motion: motion.clone(), ..PhoneOptions::of_vehicle(0) };
        let phones = vec![moving, PhoneOptions { vehicle: 0, ..PhoneOptions::of_vehicle(1) }];
        let simulation = simulation(Scenario { phones, convoy, ..Scenario::default() });
        let at =
            |phone: usize, time_s: f64| simulation.truth_at(phone, simulation.scenario().start_gps + time_s);
        for step in 0..300 {
            let time_s = 0.15 + 0.2 * f64::from(step);
            let h = 1e-3;
            let way = at(0, time_s + h).position - at(0, time_s - h).position;
            let difference = (way.0 / (2.0 * h) - at(0, time_s).velocity.0).norm();
            assert!(difference < 1e-4, "{motion:?} at {time_s} s: {difference}");
        }
        // Relative to the other phone of the car, after a minute.
        let frame = LocalFrame::at(at(1, 60.0).position);
        let apart = frame.ecef_to_enu(at(0, 60.0).position);
        let expected = match (traffic, motion.pulses.len()) {
            (Traffic::Town, 1) if motion.pulses[0].duration_s == 1.0 => enu(0.0, 0.3 * 39.5, 0.0),
            (Traffic::Town, _) => enu(45.0 + 30.0 * 37.0, 0.0, 0.0),
            (Traffic::Standing, _) => (motion.initial_velocity_mps.vector() * 60.0).into(),
        };
        let height_m = at(0, 60.0).position.ecef_to_geodetic().height_m
            - at(1, 60.0).position.ecef_to_geodetic().height_m;
        assert!((height_m - expected.up).abs() < 0.1, "{motion:?}: {height_m} m");
        assert!((apart.east - expected.east).abs() < 0.2, "{motion:?}: {apart:?}");
        assert!((apart.north - expected.north).abs() < 0.2, "{motion:?}: {apart:?}");
    }
}

/// With no other errors, what the models leave is the satellite's bias and the ionosphere residual, the same at all phones.
#[test]
fn slow_errors_of_satellites_and_ionosphere_are_alike_at_all_phones() {
    let errors = ErrorModel { shared: SharedErrors::typical(), ..ErrorModel::none() };
    let scenario = Scenario { duration_s: 200.0, ..Scenario::convoy(2) };
    let simulation = simulation(Scenario { errors, interval_s: 10.0, canyons: Vec::new(), ..scenario });
    let products = simulation.products();
    let of_phone = |phone: usize| {
        let epochs = simulation.phone(phone).unwrap();
        let biases = *epochs.inter_system_biases();
        let of_epoch = |simulated: SimulatedEpoch| {
            (simulated.truth, correct(&simulation, &products, &biases, &simulated))
        };
        epochs.map(of_epoch).collect::<Vec<_>>()
    };
    let (mut compared, mut distinct) = (0, BTreeMap::new());
    let (first, second) = (of_phone(0), of_phone(1));
    for (truth, corrected) in first.iter().chain(&second) {
        let frame = LocalFrame::at(truth.position);
        let zenith = Direction { azimuth_rad: 0.0, elevation_rad: std::f64::consts::FRAC_PI_2 };
        let time_gps = truth.time_gps;
        let vertical_m = klobuchar_delay_l1_m(simulation.klobuchar(), frame.geodetic(), zenith, time_gps);
        let residual = simulation.ionosphere_residual(time_gps);
        for one in corrected {
            let satellite = simulation.satellite_state(one.satellite, time_gps).unwrap();
            let direction = frame.direction(&(satellite.position - truth.position).0.normalize());
            let wavelength_m = one.signal.wavelength_m(one.satellite.constellation, None).unwrap();
            let delay_m = residual.delay_l1_m(vertical_m, frame.geodetic(), direction);
            let bias_m = simulation.satellite_bias_m(one.satellite, time_gps).unwrap();
            let expected_m = bias_m + scale_from_l1(delay_m, SPEED_OF_LIGHT_MPS / wavelength_m);
            assert!((one.residual_m - expected_m).abs() < 0.02, "{} {expected_m}", one.residual_m);
            compared += 1;
            distinct.insert(one.satellite, bias_m);
        }
    }
    let mut biases: Vec<f64> = distinct.into_values().collect();
    biases.sort_by(f64::total_cmp);
    assert!(compared > 800 && biases.len() > 15, "{compared} {biases:?}");
    assert!(biases.windows(2).all(|two| two[0] < two[1]), "different over satellites: {biases:?}");
    // The second phone starts 10 s later.
    for ((_, of_first), (_, of_second)) in first.iter().skip(1).zip(&second) {
        for one in of_first {
            let same = of_second.iter().find(|o| (o.satellite, o.signal) == (one.satellite, one.signal));
            assert!(same.is_none_or(|same| (same.residual_m - one.residual_m).abs() < 0.01));
        }
    }
}

#[test]
fn slow_errors_have_their_standard_deviations() {
    let errors = ErrorModel { shared: SharedErrors::typical(), ..ErrorModel::default() };
    let mut biases: BTreeMap<Constellation, Vec<f64>> = BTreeMap::new();
    let mut ionosphere = [const { Vec::new() }; 3];
    for seed in 0..300 {
        let simulation = simulation(Scenario { errors, ..short(seed) });
        let time_gps = simulation.scenario().start_gps + 30.0;
        for satellite in
            simulation.ephemerides().iter().map(|message| message.satellite).collect::<BTreeSet<_>>()
        {
            let bias_m = simulation.satellite_bias_m(satellite, time_gps).unwrap();
            biases.entry(satellite.constellation).or_default().push(bias_m);
        }
        let IonosphereResidual { vertical_fraction, north_m_per_1000km, east_m_per_1000km } =
            simulation.ionosphere_residual(time_gps);
        for (values, value) in
            ionosphere.iter_mut().zip([vertical_fraction, north_m_per_1000km, east_m_per_1000km])
        {
            values.push(value);
        }
    }
    let assert_sigma = |values: &[f64], sigma: f64| {
        let rms = (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt();
        assert!((rms / sigma - 1.0).abs() < 0.15, "{rms} {sigma}");
    };
    assert_sigma(&biases[&Constellation::Gps], 1.0);
    assert_sigma(&biases[&Constellation::Galileo], 1.0);
    assert_sigma(&biases[&Constellation::Beidou], 2.0);
    for (values, sigma) in ionosphere.iter().zip([0.3, 1.0, 1.0]) {
        assert_sigma(values, sigma);
    }
}

#[test]
fn without_slow_errors_there_are_none_and_with_them_all_others_are_the_same() {
    let without = simulation(short(3));
    let satellite = without.ephemerides()[0].satellite;
    let time_gps = without.scenario().start_gps + 30.0;
    assert_eq!(without.satellite_bias_m(satellite, time_gps), Some(0.0));
    assert_eq!(without.ionosphere_residual(time_gps), IonosphereResidual::NONE);
    let errors = ErrorModel { shared: SharedErrors::typical(), ..ErrorModel::default() };
    let with = simulation(Scenario { errors, ..short(3) });
    for (a, b) in without.epochs(1).zip(with.epochs(1)) {
        let dopplers = |epoch: &SimulatedEpoch| -> Vec<_> {
            epoch.epoch.observations.iter().map(|o| (o.satellite, o.doppler_hz, o.cn0_dbhz)).collect()
        };
        assert_eq!(dopplers(&a), dopplers(&b));
        assert_ne!(a.epoch.observations, b.epoch.observations);
    }
}

/// Range errors of the first phone of a car in the open with an interval and no other errors than multipath, by epoch and satellite, in standard
/// deviations of the multipath. The phone starts with the scenario and its epochs lie `epoch_offset_s` after the full interval.
fn multipath(
    interval_s: f64,
    duration_s: f64,
    epoch_offset_s: f64,
    multipath_shared: f64,
) -> Vec<BTreeMap<SatelliteId, f64>> {
    let errors = ErrorModel { multipath_open_m: 5.0, multipath_shared, ..ErrorModel::none() };
    let phone = PhoneOptions { epoch_offset_s, dual_frequency: false, ..PhoneOptions::of_vehicle(0) };
    let simulation = simulation(Scenario {
        errors,
        interval_s,
        duration_s,
        phones: vec![phone],
        canyons: Vec::new(),
        ..Scenario::default()
    });
    let products = simulation.products();
    let epochs = simulation.phone(0).unwrap();
    let biases = *epochs.inter_system_biases();
    let normalised = |simulated: SimulatedEpoch| {
        let frame = LocalFrame::at(simulated.truth.position);
        let of_satellite = |corrected: Corrected| {
            let state = simulation.satellite_state(corrected.satellite, simulated.truth.time_gps).unwrap();
            let unit = (state.position - simulated.truth.position).0.normalize();
            let sigma_m = errors.multipath_sigma_m(frame.direction(&unit).elevation_rad, false);
            (corrected.satellite, corrected.residual_m / sigma_m)
        };
        correct(&simulation, &products, &biases, &simulated).into_iter().map(of_satellite).collect()
    };
    epochs.map(normalised).collect()
}

/// Mean product of the values of the same satellites in pairs of epochs.
fn correlation<'a>(
    pairs: impl Iterator<Item = (&'a BTreeMap<SatelliteId, f64>, &'a BTreeMap<SatelliteId, f64>)>,
) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for (first, second) in pairs {
        for (satellite, value) in first {
            if let Some(other) = second.get(satellite) {
                sum += value * other;
                count += 1;
            }
        }
    }
    sum / f64::from(count)
}

/// The multipath is one process in time: its variance is 1, and its correlation falls to 1/e in 20 s, at any interval.
#[test]
fn multipath_is_the_same_process_at_any_interval() {
    for (interval_s, duration_s) in [(0.1, 900.0), (1.0, 3_000.0), (5.0, 6_000.0), (30.0, 20_000.0)] {
        let epochs = multipath(interval_s, duration_s, 0.0, 0.3);
        for lag_s in [0.0, 10.0, 20.0, 30.0, 60.0] {
            let lag = (lag_s / interval_s).round();
            if (lag * interval_s - lag_s).abs() > 1e-9 {
                continue;
            }
            let lagged =
                (0..).zip(&epochs).skip_while(|(index, _)| f64::from(*index) < lag).map(|(_, epoch)| epoch);
            let found = correlation(epochs.iter().zip(lagged));
            let expected = (-lag_s / 20.0_f64).exp();
            assert!((found - expected).abs() < 0.15, "{interval_s} s, lag {lag_s} s: {found} {expected}");
        }
    }
}

/// What the phones of a vehicle share is one process in time too: the same values at 1 s and at 30 s, and different ones 15 s later.
#[test]
fn shared_multipath_does_not_depend_on_the_interval() {
    let (dense, sparse) = (multipath(1.0, 9_000.0, 0.0, 1.0), multipath(30.0, 9_000.0, 0.0, 1.0));
    for (one, other) in dense.iter().step_by(30).zip(&sparse) {
        let differences = one.iter().filter_map(|(satellite, value)| Some(value - other.get(satellite)?));
        assert!(differences.map(f64::abs).fold(0.0, f64::max) < 0.05);
    }
    let later = multipath(30.0, 9_000.0, 15.0, 1.0);
    let found = correlation(sparse.iter().zip(&later));
    assert!((found - (-15.0_f64 / 20.0).exp()).abs() < 0.1, "{found}");
}

#[test]
fn a_long_drive_over_the_end_of_a_week_fits_too() {
    let simulation = simulation(Scenario {
        noise_free: true,
        start_gps: GpsTime::from_week_tow(2409, 604_800.0 - 5_000.0),
        duration_s: 18_000.0,
        interval_s: 100.0,
        phones: vec![PhoneOptions::of_vehicle(0)],
        ..Scenario::default()
    });
    let products = simulation.products();
    let epochs = simulation.phone(0).unwrap();
    let biases = *epochs.inter_system_biases();
    let (mut worst_m, mut count) = (0.0_f64, 0);
    for simulated in epochs {
        let corrected = correct(&simulation, &products, &biases, &simulated);
        assert_eq!(corrected.len(), simulated.epoch.observations.len());
        worst_m = corrected.iter().map(|one| one.residual_m.abs()).fold(worst_m, f64::max);
        count += 1;
    }
    assert!(worst_m < 0.01, "{worst_m}");
    assert_eq!(count, 180);
}

#[test]
fn a_scenario_shorter_than_a_phones_absence_gives_no_epochs() {
    let simulation = simulation(Scenario { duration_s: 5.0, ..Scenario::default() });
    assert_eq!(epochs(&simulation, 0).len(), 5);
    assert!(epochs(&simulation, 2).is_empty());
    assert!(epochs(&simulation, 99).is_empty());
}
