//! Clock files and biases together with SP3 orbits and navigation messages, on satellites made here.

#![allow(clippy::unwrap_used)] // helpers of tests

use cofix_common::constants::SPEED_OF_LIGHT_MPS;
use cofix_common::frames::Ecef;
use cofix_common::gnss::{Constellation, SatelliteId, SignalCode};
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::{
    BiasFile, ClockFile, ClockRecord, ClockReference, CodeBias, KeplerEphemeris, NavigationMessage, Products,
    Sp3, Sp3Position,
};
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;

const L1: SignalCode = SignalCode::new(b'1', b'C');
const L1P: SignalCode = SignalCode::new(b'1', b'W');
const L2P: SignalCode = SignalCode::new(b'2', b'W');
const L5: SignalCode = SignalCode::new(b'5', b'Q');
/// What the network's convention adds to every bias, ns.
const DATUM_NS: f64 = 8.0;

fn start() -> GpsTime {
    GpsTime::from_week_tow(2_118, 345_600.0)
}

fn gps(number: u8) -> SatelliteId {
    SatelliteId::new(Constellation::Gps, number)
}

/// The TGD of a satellite, ns.
fn tgd_ns(number: u8) -> f64 {
    -10.0 + 2.0 * f64::from(number)
}

fn ephemeris(number: u8) -> KeplerEphemeris {
    KeplerEphemeris {
        satellite: gps(number),
        message: NavigationMessage::Lnav,
        toe: start() + 7_200.0,
        toe_own_tow_s: (start() + 7_200.0).tow_s(),
        toc: start() + 7_200.0,
        sqrt_a: 5_153.7,
        eccentricity: 0.01,
        i0_rad: 0.96,
        i_dot_radps: 0.0,
        omega0_rad: f64::from(number),
        omega_dot_radps: 0.0,
        omega_rad: 1.1,
        m0_rad: 0.3,
        delta_n_radps: 0.0,
        cuc_cus_rad: (0.0, 0.0),
        crc_crs_m: (0.0, 0.0),
        cic_cis_rad: (0.0, 0.0),
        clock: (1e-4, 0.0, 0.0),
        group_delays_s: (tgd_ns(number) * 1e-9, 0.0),
        accuracy_m: 2.0,
        health: 0.0,
        issue_of_data: 1,
        issue_of_clock: 1,
    }
}

fn navigation(numbers: std::ops::RangeInclusive<u8>) -> NavigationFile {
    NavigationFile { ephemerides: numbers.map(ephemeris).collect(), ..NavigationFile::default() }
}

/// SP3 orbits of two hours; the clocks of its positions are 100 µs, or missing.
fn sp3(numbers: std::ops::RangeInclusive<u8>, clock_s: Option<f64>) -> Sp3 {
    let positions: Vec<Sp3Position> = (0..9)
        .flat_map(|epoch| numbers.clone().map(move |number| (start() + 900.0 * f64::from(epoch), number)))
        .map(|(time, number)| {
            let position: Ecef = ephemeris(number).state(time).position;
            Sp3Position { satellite: gps(number), time, position, clock_s }
        })
        .collect();
    Sp3 { interval_s: 900.0, epochs: 9, positions, skips: Skips::default() }
}

fn bias(number: u8, signal: SignalCode, bias_ns: f64) -> CodeBias {
    CodeBias {
        satellite: gps(number),
        signal,
        start: start(),
        end: Some(start() + 86_400.0),
        bias_s: bias_ns * 1e-9,
    }
}

fn bias_file(biases: Vec<CodeBias>) -> BiasFile {
    BiasFile { biases, skips: Skips::default() }
}

fn correction_m(
    products: &Products,
    number: u8,
    signal: SignalCode,
    reference: ClockReference,
) -> Option<f64> {
    products.group_delay_correction_m(gps(number), signal, reference, start() + 3_600.0)
}

/// (f1/f2)² of GPS.
fn gamma() -> f64 {
    (1_575.42_f64 / 1_227.60).powi(2)
}

/// Biases that say what the TGDs say: of the reference pair the ionosphere-free combination is the datum.
fn consistent(number: u8) -> [CodeBias; 2] {
    // IS-GPS-200: with the group delays T1 and T2 against the pair, TGD = T1 and T2 = γ T1.
    let (first, second) = (tgd_ns(number), gamma() * tgd_ns(number));
    let pair = (gamma() * first - second) / (gamma() - 1.0);
    assert!(pair.abs() < 1e-12, "the pair that the clock refers to has no bias");
    [bias(number, L1P, first + DATUM_NS), bias(number, L2P, second + DATUM_NS)]
}

#[test]
fn clocks_of_a_clock_file_take_the_place_of_the_orbits_own() {
    let record =
        |after_s: f64, clock_s: f64| ClockRecord { satellite: gps(1), time: start() + after_s, clock_s };
    let records = vec![record(3_600.0, 3e-4), record(3_630.0, 3.3e-4)];
    let file = ClockFile { interval_s: 30.0, records, skips: Skips::default() };
    for own in [Some(1e-4), None] {
        let mut products = Products::new(vec![sp3(1..=1, own)], Vec::new());
        let before = products.satellite_state(gps(1), start() + 3_615.0);
        assert_eq!(before.is_ok(), own.is_some());
        products.add_clocks(vec![file.clone()]);
        let state = products.satellite_state(gps(1), start() + 3_615.0).unwrap();
        // Only the clock differs; the relativistic term is the same.
        let relativity_s = ephemeris(1).state(start() + 3_615.0).clock_s - 1e-4;
        assert!((state.clock_s - relativity_s - 3.15e-4).abs() < 1e-11, "{}", state.clock_s);
        assert!((state.clock_drift_sps - 1e-6).abs() < 1e-11);
        assert_eq!(state.clock_reference, ClockReference::IonosphereFree);
        if let Ok(before) = before {
            assert_eq!((before.position, before.velocity), (state.position, state.velocity));
        }
        // Beyond the clock file the orbits' own.
        let after = products.satellite_state(gps(1), start() + 3_640.0);
        assert_eq!(after.is_ok(), own.is_some());
        assert!(after.map_or(true, |state| (state.clock_s - relativity_s - 1e-4).abs() < 1e-9));
    }
}

#[test]
fn biases_and_messages_agree_but_for_the_constant_of_the_network() {
    let mut products = Products::new(vec![sp3(1..=4, Some(1e-4))], vec![navigation(1..=4)]);
    let by_message: Vec<f64> =
        (1..=4).map(|n| correction_m(&products, n, L1, ClockReference::IonosphereFree).unwrap()).collect();
    products.add_biases(bias_file((1..=4).flat_map(consistent).collect()));
    for (number, by_message) in (1..=4).zip(by_message) {
        // No bias of C/A is in the file: the precise code's serves.
        for signal in [L1, L1P] {
            let by_bias = correction_m(&products, number, signal, ClockReference::IonosphereFree).unwrap();
            let constant_ns = (by_message - by_bias) / SPEED_OF_LIGHT_MPS * 1e9;
            assert!((constant_ns - DATUM_NS).abs() < 1e-9, "{number}: {constant_ns} ns");
        }
        // P − c·OSB of the pair: its combination is what the clock refers to, but for the constant.
        let [first, second] = [L1P, L2P]
            .map(|signal| correction_m(&products, number, signal, ClockReference::IonosphereFree).unwrap());
        let pair_ns = (gamma() * first - second) / (gamma() - 1.0) / SPEED_OF_LIGHT_MPS * 1e9;
        assert!((pair_ns + DATUM_NS).abs() < 1e-9, "{number}: {pair_ns} ns");
    }
}

#[test]
fn satellites_without_a_bias_are_brought_to_the_same_constant() {
    // The fifth satellite has no bias, the sixth only a broadcast orbit.
    let mut products = Products::new(vec![sp3(1..=5, Some(1e-4))], vec![navigation(1..=6)]);
    products.add_biases(bias_file((1..=4).flat_map(consistent).collect()));
    for (number, reference) in [(5, ClockReference::IonosphereFree), (6, ClockReference::Broadcast)] {
        let ns = correction_m(&products, number, L1, reference).unwrap() / SPEED_OF_LIGHT_MPS * 1e9;
        assert!((ns + tgd_ns(number) + DATUM_NS).abs() < 1e-9, "{number}: {ns} ns");
    }
    // Two in common are too few to tell the constant.
    let mut few = Products::new(vec![sp3(1..=5, Some(1e-4))], vec![navigation(1..=6)]);
    few.add_biases(bias_file((1..=2).flat_map(consistent).collect()));
    assert_eq!(correction_m(&few, 5, L1, ClockReference::IonosphereFree), None);
}

#[test]
fn biases_tell_what_messages_do_not_and_leave_the_rest_to_them() {
    let mut products = Products::new(vec![sp3(1..=4, Some(1e-4))], vec![navigation(1..=4)]);
    assert_eq!(correction_m(&products, 1, L5, ClockReference::IonosphereFree), None);
    let before_m = correction_m(&products, 1, L1, ClockReference::IonosphereFree);
    products.add_biases(bias_file(vec![bias(1, L5, 2.0)]));
    let l5_m = correction_m(&products, 1, L5, ClockReference::IonosphereFree).unwrap();
    assert!((l5_m + 2e-9 * SPEED_OF_LIGHT_MPS).abs() < 1e-12);
    // No satellite has a bias on L1: nothing is mixed, the messages serve as they are.
    assert_eq!(correction_m(&products, 1, L1, ClockReference::IonosphereFree), before_m);
    // A day later the biases have ended.
    let late = start() + 90_000.0;
    let of_late =
        |signal| products.group_delay_correction_m(gps(1), signal, ClockReference::IonosphereFree, late);
    assert_eq!((of_late(L5), of_late(L1)), (None, before_m));
}

#[test]
fn without_precise_clocks_biases_are_not_used() {
    let mut products = Products::new(Vec::new(), vec![navigation(1..=4)]);
    let before_m = correction_m(&products, 1, L1, ClockReference::Broadcast);
    products.add_biases(bias_file((1..=4).flat_map(consistent).collect()));
    assert!(before_m.is_some());
    assert_eq!(correction_m(&products, 1, L1, ClockReference::Broadcast), before_m);
}
