//! Differential corrections in a simulated convoy: the leader is the base, the next vehicle the rover, both without noise, and the
//! receivers are told wrong orbits, clocks and no ionosphere.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

use std::sync::Arc;

use cofix_common::frames::Ecef;
use cofix_common::gnss::{Constellation, ObservationEpoch};
use cofix_common::measurement::{
    Applied, CorrectedObservation, CorrectionOptions, Corrector, Differential, DifferentialCounts,
    DifferentialOptions, Uncorrected,
};
use cofix_common::orbit::IonosphereTerms;
use cofix_common::orbit::Products;
use cofix_common::simulation::{PhoneOptions, Scenario, SimulatedEpoch, Simulation};
use cofix_common::skips::Reason;
use cofix_common::solve::solve_position;
use cofix_common::time::GpsTime;

/// GPS and BeiDou go to the next hourly message at half past.
const BEFORE_THE_SWITCH_S: f64 = 208_800.0 + 1_790.0;

struct World {
    simulation: Simulation,
    products: Arc<Products>,
    base: Vec<SimulatedEpoch>,
    rover: Vec<SimulatedEpoch>,
}

impl World {
    fn new(start_tow_s: f64, duration_s: f64) -> Self {
        let phone = |rank| PhoneOptions {
            starts_after_s: 0.0,
            stops_before_s: 0.0,
            epoch_offset_s: 0.0,
            dual_frequency: true,
            ..PhoneOptions::of_vehicle(rank)
        };
        let simulation = Simulation::new(Scenario {
            start_gps: GpsTime::from_week_tow(2409, start_tow_s),
            duration_s,
            phones: vec![phone(0), phone(1)],
            canyons: Vec::new(),
            noise_free: true,
            ..Scenario::default()
        })
        .unwrap();
        let products = Arc::new(wrong_products(&simulation));
        let (base, rover) = (simulation.epochs(0).collect(), simulation.epochs(1).collect());
        Self { simulation, products, base, rover }
    }

    fn differential(&self, options: DifferentialOptions) -> Differential {
        Differential::new(self.products.clone(), CorrectionOptions::default(), options)
    }

    /// The rover's observations, corrected for its true position.
    fn observations(&self, at: usize) -> Vec<CorrectedObservation> {
        let SimulatedEpoch { epoch, truth, .. } = &self.rover[at];
        let mut corrector = Corrector::new(self.products.clone(), CorrectionOptions::default());
        let prepared = corrector.prepare(epoch);
        corrector.finish(&prepared, truth.position, epoch.time_gps).0
    }

    /// Error of the rover's position, m.
    fn error_m(&self, at: usize, observations: &[CorrectedObservation]) -> f64 {
        let truth = self.rover[at].truth.position;
        solve_position(observations, truth).unwrap().position().distance_m(truth)
    }

    /// The rover's epoch `at` with the corrections of a base epoch.
    fn apply(&self, differential: &mut Differential, at: usize) -> (Vec<CorrectedObservation>, Applied) {
        let mut observations = self.observations(at);
        let SimulatedEpoch { epoch, truth, .. } = &self.rover[at];
        let applied = differential.apply(&mut observations, truth.position, epoch.time_gps);
        (observations, applied)
    }

    fn add_base(&self, differential: &mut Differential, at: usize) {
        let SimulatedEpoch { epoch, truth, .. } = &self.base[at];
        differential.add(0, epoch.clone(), truth.position);
    }
}

/// Each message off by metres, along the orbit and in its clock, and differently from the one an hour later; no ionosphere.
fn wrong_products(simulation: &Simulation) -> Products {
    let mut file = simulation.navigation();
    for ephemeris in &mut file.ephemerides {
        let turn = f64::from(ephemeris.satellite.number) + ephemeris.toe.tow_s() / 3_600.0 * 1.7;
        ephemeris.clock.0 += 1e-8 * turn.sin();
        ephemeris.m0_rad += 1e-7 * turn.cos();
    }
    file.ionosphere = IonosphereTerms::default();
    Products::new(Vec::new(), vec![file])
}

fn without(epoch: &ObservationEpoch, constellation: Constellation) -> ObservationEpoch {
    let mut epoch = epoch.clone();
    epoch.observations.retain(|o| o.satellite.constellation != constellation);
    epoch
}

#[test]
fn errors_that_base_and_rover_share_go() {
    let world = World::new(208_800.0, 3.0);
    let plain_m = world.error_m(2, &world.observations(2));
    let mut differential = world.differential(DifferentialOptions::default());
    world.add_base(&mut differential, 2);
    let (observations, applied) = world.apply(&mut differential, 2);
    let with_m = world.error_m(2, &observations);
    println!("{plain_m:.3} m, with corrections {with_m:.4} m; {:?}", applied.counts);
    assert!(plain_m > 1.0 && with_m < 0.005, "{plain_m} m, with corrections {with_m} m");
    let count = observations.len() as u64;
    assert_eq!(applied.counts, DifferentialCounts { corrected: count, ..DifferentialCounts::default() });
    assert!(applied.skips.is_empty() && count > 20, "{}", applied.skips);
    let model = CorrectionOptions::default().stochastic.code;
    for observation in &observations {
        let code_m = model.variance(observation.cn0_dbhz, observation.direction.elevation_rad).sqrt();
        let sigma_m = observation.pseudorange_sigma_m;
        assert!(sigma_m > code_m && sigma_m < code_m + 1.5, "{} {sigma_m} {code_m}", observation.satellite);
    }
}

/// The base heard ten seconds before that the rover goes by other messages.
#[test]
fn a_change_of_message_between_base_and_rover_goes_too() {
    let world = World::new(BEFORE_THE_SWITCH_S, 21.0);
    let mut differential = world.differential(DifferentialOptions::default());
    world.add_base(&mut differential, 5);
    let changed = |satellite| {
        let issue =
            |at: usize| world.products.ephemeris(satellite, world.rover[at].epoch.time_gps).unwrap().toe;
        issue(5) != issue(20)
    };
    let (observations, _) = world.apply(&mut differential, 20);
    let switched = observations.iter().filter(|o| changed(o.satellite)).count();
    assert!(switched > 5 && switched < observations.len(), "{switched} of {}", observations.len());
    let (plain_m, with_m) = (world.error_m(20, &world.observations(20)), world.error_m(20, &observations));
    println!("{plain_m:.3} m, with corrections {with_m:.4} m, {switched} switched");
    assert!(plain_m > 1.0 && with_m < 0.1, "{plain_m} m, with corrections {with_m} m");
}

/// New messages may come between base and rover: what was computed from the old ones is computed again.
#[test]
fn new_products_are_used_on_both_sides() {
    let mut world = World::new(208_800.0, 3.0);
    let mut differential = world.differential(DifferentialOptions::default());
    world.add_base(&mut differential, 2);
    world.apply(&mut differential, 2);
    world.products = Arc::new(world.simulation.products());
    differential.set_products(world.products.clone());
    let (observations, _) = world.apply(&mut differential, 2);
    assert!(world.error_m(2, &observations) < 0.005);
}

#[test]
fn without_fresh_corrections_nothing_changes() {
    let world = World::new(208_800.0, 12.0);
    let options = DifferentialOptions { maximum_age_s: 5.0, ..DifferentialOptions::default() };
    let mut differential = world.differential(options);
    let (observations, applied) = world.apply(&mut differential, 0);
    assert_eq!(observations, world.observations(0), "no base yet");
    assert_eq!(applied.counts.missing, observations.len() as u64);
    world.add_base(&mut differential, 0);
    let (observations, applied) = world.apply(&mut differential, 5);
    assert_ne!(observations, world.observations(5), "five seconds will do");
    assert_eq!(applied.counts.too_old, 0);
    let (observations, applied) = world.apply(&mut differential, 6);
    assert_eq!(observations, world.observations(6), "six are too many");
    assert_eq!(applied.counts.too_old, observations.len() as u64);
    let named = applied.skips.iter().next().unwrap();
    assert_eq!(named.0, Reason::EpochWithOldCorrections.text());
    assert!(named.1.first.contains("6.0 s, the last are of"), "{}", named.1.first);
    // A base whose clock is ahead.
    let mut differential = world.differential(options);
    world.add_base(&mut differential, 10);
    let (observations, applied) = world.apply(&mut differential, 2);
    assert_eq!(observations, world.observations(2), "eight seconds later are too many");
    assert_eq!((applied.counts.too_old, applied.counts.missing), (0, observations.len() as u64));
    let named = applied.skips.iter().next().unwrap();
    assert_eq!(named.0, Reason::EpochBeforeCorrections.text());
    assert!(named.1.first.contains("the nearest are 8.0 s later"), "{}", named.1.first);
}

#[test]
fn signals_that_the_base_lacks_stay_with_a_larger_sigma_or_go() {
    let world = World::new(208_800.0, 2.0);
    let galileo = |o: &&CorrectedObservation| o.satellite.constellation == Constellation::Galileo;
    let plain = world.observations(1);
    for (uncorrected, sigma_m) in
        [(Uncorrected::Kept { sigma_m: 3.0 }, Some(3.0)), (Uncorrected::Dropped, None)]
    {
        let options = DifferentialOptions { uncorrected, ..DifferentialOptions::default() };
        let mut differential = world.differential(options);
        let SimulatedEpoch { epoch, truth, .. } = &world.base[1];
        differential.add(0, without(epoch, Constellation::Galileo), truth.position);
        let (observations, applied) = world.apply(&mut differential, 1);
        let missing = plain.iter().filter(galileo).count() as u64;
        assert!(missing > 4);
        assert_eq!((applied.counts.missing, applied.skips.total()), (missing, missing), "{}", applied.skips);
        let kept: Vec<_> = observations.iter().filter(galileo).collect();
        let expected = if sigma_m.is_some() { missing } else { 0 };
        assert_eq!(kept.len() as u64, expected);
        for (now, before) in kept.iter().zip(plain.iter().filter(galileo)) {
            assert_eq!(now.pseudorange_m, before.pseudorange_m);
            assert_eq!(now.pseudorange_sigma_m, before.pseudorange_sigma_m.hypot(sigma_m.unwrap()));
        }
    }
}

/// A satellite that a base's last epoch lacks is corrected by the one before.
#[test]
fn a_gap_of_one_satellite_at_the_base_is_bridged() {
    let world = World::new(208_800.0, 3.0);
    let mut differential = world.differential(DifferentialOptions::default());
    world.add_base(&mut differential, 0);
    let SimulatedEpoch { epoch, truth, .. } = &world.base[1];
    differential.add(0, without(epoch, Constellation::Galileo), truth.position);
    let (observations, applied) = world.apply(&mut differential, 2);
    assert_eq!(applied.counts.corrected, observations.len() as u64, "{}", applied.skips);
    assert!(world.error_m(2, &observations) < 0.05);
}

#[test]
fn another_code_of_the_band_serves_with_a_larger_sigma() {
    let world = World::new(208_800.0, 2.0);
    let mut same = world.differential(DifferentialOptions::default());
    world.add_base(&mut same, 1);
    let (expected, _) = world.apply(&mut same, 1);
    let mut other = world.differential(DifferentialOptions::default());
    let SimulatedEpoch { epoch, truth, .. } = &world.base[1];
    let mut renamed = epoch.clone();
    for observation in &mut renamed.observations {
        observation.signal.attribute = b'X';
    }
    other.add(0, renamed, truth.position);
    let (observations, applied) = world.apply(&mut other, 1);
    let of_x = expected.iter().filter(|o| o.signal.attribute == b'X').count() as u64;
    let count = observations.len() as u64;
    assert_eq!(
        (applied.counts.corrected, applied.counts.other_code),
        (of_x, count - of_x),
        "{}",
        applied.skips
    );
    assert!(count - of_x > 20);
    for (other, same) in observations.iter().zip(&expected).filter(|(o, _)| o.signal.attribute != b'X') {
        assert!((other.pseudorange_m - same.pseudorange_m).abs() < 3.0);
        assert!((other.pseudorange_sigma_m - same.pseudorange_sigma_m.hypot(1.0)).abs() < 1e-9);
    }
}

#[test]
fn a_satellite_that_stands_apart_at_the_base_is_refused_and_named() {
    let world = World::new(208_800.0, 2.0);
    let SimulatedEpoch { epoch, truth, .. } = &world.base[1];
    let victim = world.observations(1)[0].satellite;
    let mut damaged = epoch.clone();
    for observation in damaged.observations.iter_mut().filter(|o| o.satellite == victim) {
        observation.pseudorange_m = observation.pseudorange_m.map(|p| p + 150.0);
    }
    let mut differential = world.differential(DifferentialOptions::default());
    differential.add(0, damaged, truth.position);
    let (observations, applied) = world.apply(&mut differential, 1);
    assert!(observations.iter().all(|o| o.satellite != victim));
    assert!(applied.counts.refused >= 1 && applied.counts.corrected > 20, "{:?}", applied.counts);
    let skips = differential.skips();
    let named: Vec<_> = skips.iter().filter(|(reason, _)| reason.contains("stands apart")).collect();
    assert!(named.len() == 1 && named[0].1.first.contains(&victim.to_string()), "{skips}");
    assert!(world.error_m(1, &observations) < 0.02, "the others are not drawn along");
}

#[test]
fn the_nearest_base_with_a_fresh_epoch_serves() {
    let world = World::new(208_800.0, 12.0);
    let options = DifferentialOptions { maximum_age_s: 5.0, ..DifferentialOptions::default() };
    let mut differential = world.differential(options);
    // One whose position is wrong by 20 m and farther off, and one near that falls silent.
    let SimulatedEpoch { epoch, truth, .. } = &world.base[0];
    differential.add(1, epoch.clone(), truth.position);
    let away = (truth.position - world.rover[0].truth.position).0.normalize();
    for SimulatedEpoch { epoch, truth, .. } in &world.base {
        differential.add(0, epoch.clone(), Ecef(truth.position.0 + 20.0 * away));
    }
    let (observations, _) = world.apply(&mut differential, 3);
    assert!(world.error_m(3, &observations) < 0.1);
    let (observations, applied) = world.apply(&mut differential, 8);
    assert_eq!(applied.counts.too_old, 0);
    assert!((world.error_m(8, &observations) - 20.0).abs() < 0.1, "the other one's error is ours");
}

#[test]
fn a_base_that_is_elsewhere_is_not_used() {
    let world = World::new(208_800.0, 2.0);
    let mut differential = world.differential(DifferentialOptions::default());
    let SimulatedEpoch { epoch, truth, .. } = &world.base[1];
    differential.add(0, epoch.clone(), Ecef(truth.position.0 * 1.000_1));
    let (observations, applied) = world.apply(&mut differential, 1);
    assert_eq!(observations, world.observations(1));
    assert_eq!(applied.counts.missing, observations.len() as u64);
    let skips = differential.skips();
    assert!(skips.iter().any(|(reason, _)| reason.contains("contradict its position")), "{skips}");
}

/// The nearest base contradicts its position; the next one is as good as if it were alone.
#[test]
fn where_the_nearest_base_corrects_nothing_the_next_one_serves() {
    let world = World::new(208_800.0, 2.0);
    let SimulatedEpoch { epoch, truth, .. } = &world.base[1];
    let mut alone = world.differential(DifferentialOptions::default());
    alone.add(0, epoch.clone(), truth.position);
    let mut both = world.differential(DifferentialOptions::default());
    both.add(0, epoch.clone(), truth.position);
    // Said to be where the rover is, with pseudoranges that do not fit.
    let rover = &world.rover[1].truth;
    let mut wrong = epoch.clone();
    for observation in &mut wrong.observations {
        let off_m = 80.0 * f64::from(observation.satellite.number).sin();
        observation.pseudorange_m = observation.pseudorange_m.map(|p| p + off_m);
    }
    both.add(1, wrong, rover.position);
    assert_eq!(world.apply(&mut both, 1).0, world.apply(&mut alone, 1).0);
    let skips = both.skips();
    assert!(skips.iter().any(|(reason, _)| reason.contains("contradict its position")), "{skips}");
}

/// A stream whose date was wrong for a while does not hide what comes after it, nor do epochs that come late.
#[test]
fn epochs_of_a_base_may_come_in_any_order() {
    let world = World::new(208_800.0, 6.0);
    let mut differential = world.differential(DifferentialOptions::default());
    for k in 0..5 {
        let SimulatedEpoch { epoch, truth, .. } = &world.base[0];
        let mut ahead = epoch.clone();
        ahead.time_gps = ahead.time_gps + 3_600.0 + f64::from(k);
        differential.add(0, ahead, truth.position);
    }
    world.add_base(&mut differential, 5);
    world.add_base(&mut differential, 4);
    let (observations, applied) = world.apply(&mut differential, 5);
    assert_eq!(applied.counts.corrected, observations.len() as u64, "{}", applied.skips);
    assert!(world.error_m(5, &observations) < 0.005, "by the latest epoch");
}

/// A single signal of a band cannot be told from the base's clock.
#[test]
fn a_signal_without_fellows_at_the_base_is_named() {
    let world = World::new(208_800.0, 2.0);
    let SimulatedEpoch { epoch, truth, .. } = &world.base[1];
    let mut kept = None;
    let mut lone = epoch.clone();
    lone.observations.retain(|o| {
        let is_galileo = o.satellite.constellation == Constellation::Galileo;
        !is_galileo || *kept.get_or_insert(o.satellite) == o.satellite
    });
    let mut differential = world.differential(DifferentialOptions::default());
    differential.add(0, lone, truth.position);
    world.apply(&mut differential, 1);
    let skips = differential.skips();
    let named = skips.iter().find(|(reason, _)| reason.contains("alone"));
    assert!(named.is_some_and(|(_, skip)| skip.first.contains(&kept.unwrap().to_string())), "{skips}");
}
