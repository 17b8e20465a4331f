//! Precise and broadcast orbits on satellites made here, whose motion is known exactly.

#![allow(clippy::unwrap_used)] // helpers of tests

use std::fmt::Write as _;

use cofix_common::gnss::{Constellation, SatelliteId, SignalCode};
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::{ClockReference, KeplerEphemeris, NavigationMessage, OrbitError, Products, Sp3};
use cofix_common::time::GpsTime;
use proptest::prelude::*;

const START_S: f64 = 1_280_000_000.0 - 1_280_000_000.0 % 86_400.0;

fn start() -> GpsTime {
    GpsTime::default() + START_S
}

/// A satellite on a pure Kepler orbit.
fn satellite(sqrt_a: f64, eccentricity: f64, i0_rad: f64, m0_rad: f64) -> KeplerEphemeris {
    KeplerEphemeris {
        satellite: SatelliteId::new(Constellation::Gps, 7),
        message: NavigationMessage::Lnav,
        toe: start() + 43_200.0,
        toe_own_tow_s: (start() + 43_200.0).tow_s(),
        toc: start() + 43_200.0,
        sqrt_a,
        eccentricity,
        i0_rad,
        i_dot_radps: 0.0,
        omega0_rad: 0.7,
        omega_dot_radps: 0.0,
        omega_rad: 1.1,
        m0_rad,
        delta_n_radps: 0.0,
        cuc_cus_rad: (0.0, 0.0),
        crc_crs_m: (0.0, 0.0),
        cic_cis_rad: (0.0, 0.0),
        clock: (1e-4, 3e-12, 0.0),
        group_delays_s: (0.0, 0.0),
        accuracy_m: 2.0,
        health: 0.0,
        issue_of_data: 1,
        issue_of_clock: 1,
    }
}

/// SP3 text of the orbit at 15 min; the epochs in `missing` are marked as such.
fn sp3_text(ephemeris: &KeplerEphemeris, epochs: std::ops::Range<u32>, missing: &[u32]) -> String {
    let first = (start() + 900.0 * f64::from(epochs.start)).calendar();
    let mut text = format!(
        "#dP{:4} {:2} {:2}  0  0  0.00000000      96 u+U   IGS14 FIT TEST\n",
        first.year, first.month, first.day
    );
    text.push_str("## 2118 345600.00000000   900.00000000 59073 0.0000000000000\n");
    text.push_str("%c G  cc GPS ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc\n");
    for epoch in epochs {
        let time = start() + 900.0 * f64::from(epoch);
        let state = ephemeris.state(time);
        let c = time.calendar();
        let km = if missing.contains(&epoch) { nalgebra::Vector3::zeros() } else { state.position.0 / 1e3 };
        // The file's clock has no relativistic term.
        let clock_us = (ephemeris.clock.0 + ephemeris.clock.1 * (time - ephemeris.toc)) * 1e6;
        writeln!(
            text,
            "*  {:4} {:2} {:2} {:2} {:2} {:11.8}",
            c.year, c.month, c.day, c.hour, c.minute, c.second
        )
        .unwrap();
        writeln!(text, "P{}{:14.6}{:14.6}{:14.6}{clock_us:14.6}", ephemeris.satellite, km.x, km.y, km.z)
            .unwrap();
    }
    text + "EOF\n"
}

fn sp3(ephemeris: &KeplerEphemeris, epochs: std::ops::Range<u32>, missing: &[u32]) -> Sp3 {
    Sp3::parse(sp3_text(ephemeris, epochs, missing).as_bytes()).unwrap()
}

fn disagreement(products: &Products, ephemeris: &KeplerEphemeris, time: GpsTime) -> [f64; 4] {
    let found = products.satellite_state(ephemeris.satellite, time).unwrap();
    let exact = ephemeris.state(time);
    assert_eq!(found.clock_reference, ClockReference::IonosphereFree);
    [
        found.position.distance_m(exact.position),
        (found.velocity.0 - exact.velocity.0).norm(),
        (found.clock_s - exact.clock_s).abs(),
        (found.clock_drift_sps - exact.clock_drift_sps).abs(),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn interpolation_reproduces_a_known_orbit(
        // From the lowest GLONASS-like orbit in use to geosynchronous ones, as eccentric as E14.
        sqrt_a in 5_050.0..6_500.0_f64,
        eccentricity in 0.0..0.17,
        i0_rad in 0.0..1.2,
        m0_rad in -3.1..3.1,
        elapsed_s in 4_500.0..81_900.0,
    ) {
        let ephemeris = satellite(sqrt_a, eccentricity, i0_rad, m0_rad);
        let products = Products::new(vec![sp3(&ephemeris, 0..97, &[])], vec![]);
        let [position, velocity, clock, drift] = disagreement(&products, &ephemeris, start() + elapsed_s);
        prop_assert!(position < 0.05, "{position} m");
        prop_assert!(velocity < 5e-4, "{velocity} m/s");
        prop_assert!(clock < 2e-12, "{clock} s");
        prop_assert!(drift < 3e-15, "{drift} s/s");
    }
}

#[test]
fn eight_nodes_serve_from_the_first_to_the_last() {
    let ephemeris = satellite(5_153.6, 0.01, 0.96, 0.3);
    let products = Products::new(vec![sp3(&ephemeris, 10..18, &[])], vec![]);
    let mut worst = 0.0_f64;
    for step in 0..=700 {
        let time = start() + 9_000.0 + f64::from(step) * 9.0;
        worst = worst.max(disagreement(&products, &ephemeris, time)[0]);
    }
    println!("worst {worst} m");
    assert!(worst < 0.1, "{worst} m");
    for outside in [9_000.0 - 1e-6, 15_300.0 + 1e-6] {
        let result = products.satellite_state(ephemeris.satellite, start() + outside);
        assert!(matches!(result, Err(OrbitError::NotCovered { .. })), "{result:?}");
    }
    let seven = Products::new(vec![sp3(&ephemeris, 10..17, &[])], vec![]);
    let error = seven.satellite_state(ephemeris.satellite, start() + 12_000.0).unwrap_err();
    assert!(matches!(error, OrbitError::TooFewNodes { nodes: 7, .. }), "{error}");
    assert!(
        error.to_string().contains("have 7 positions around it without a gap, and 8 are needed"),
        "{error}"
    );
    let error = seven.satellite_state(ephemeris.satellite, start() + 15_000.0).unwrap_err();
    assert!(matches!(error, OrbitError::NotCovered { .. }) && !error.to_string().contains("gap"), "{error}");
}

#[test]
fn a_missing_clock_is_told_from_a_missing_position() {
    let ephemeris = satellite(5_153.6, 0.01, 0.96, 0.3);
    let text = sp3_text(&ephemeris, 0..20, &[]);
    let without = |line: &str| {
        if line.starts_with('P') { format!("{} 999999.999999\n", &line[..46]) } else { format!("{line}\n") }
    };
    let file = Sp3::parse(text.lines().map(without).collect::<String>().as_bytes()).unwrap();
    let error =
        Products::new(vec![file], vec![]).satellite_state(ephemeris.satellite, start() + 900.0).unwrap_err();
    assert!(matches!(error, OrbitError::NoClock { .. }) && error.to_string().contains("no clock"), "{error}");
}

#[test]
fn a_missing_node_is_not_bridged() {
    let ephemeris = satellite(5_153.6, 0.01, 0.96, 0.3);
    let products = Products::new(vec![sp3(&ephemeris, 0..97, &[40])], vec![]);
    let at = |epoch: f64| products.satellite_state(ephemeris.satellite, start() + 900.0 * epoch);
    assert!(at(38.9).is_ok() && at(41.1).is_ok());
    for epoch in [39.1, 40.0, 40.9] {
        let error = at(epoch).unwrap_err();
        assert!(
            matches!(error, OrbitError::NotCovered { .. }) && error.to_string().contains("in a gap"),
            "{error}"
        );
    }
}

#[test]
fn files_of_successive_days_join_in_any_order() {
    let ephemeris = satellite(5_153.6, 0.01, 0.96, 0.3);
    let (first, second) = (sp3(&ephemeris, 0..49, &[]), sp3(&ephemeris, 48..97, &[]));
    for files in [vec![first.clone(), second.clone()], vec![second, first]] {
        let products = Products::new(files, vec![]);
        assert_eq!(products.coverage(), Some((start(), start() + 86_400.0)));
        assert!(disagreement(&products, &ephemeris, start() + 43_200.0 - 400.0)[0] < 0.01);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn absurd_times_and_orbits_never_panic(nanos: i64, sqrt_a: f64, eccentricity: f64, m0: f64) {
        let time = GpsTime::from_nanos(nanos);
        let sane = satellite(5_153.6, 0.01, 0.96, 0.3);
        let products = Products::new(vec![sp3(&sane, 0..20, &[])], vec![]);
        if let Ok(state) = products.satellite_state(sane.satellite, time) {
            prop_assert!(state.position.is_finite() && state.velocity.is_finite() && state.clock_s.is_finite());
        }
        let _ = satellite(sqrt_a, eccentricity, m0, m0).state(time);
        let _ = products.satellite_state(SatelliteId::new(Constellation::Sbas, 255), time);
        let _ = products.group_delay_age_s(time);
    }
}

fn navigation(ephemerides: Vec<KeplerEphemeris>) -> NavigationFile {
    NavigationFile { ephemerides, leap_seconds: Some(18), ..NavigationFile::default() }
}

#[test]
fn precise_orbits_come_first_and_messages_serve_elsewhere() {
    let ephemeris = satellite(5_153.6, 0.01, 0.96, 0.3);
    let id = ephemeris.satellite;
    let products = Products::new(vec![sp3(&ephemeris, 40..50, &[])], vec![navigation(vec![ephemeris])]);
    let reference =
        |elapsed_s: f64| products.satellite_state(id, start() + elapsed_s).map(|s| s.clock_reference);
    assert_eq!(reference(43_200.0), Ok(ClockReference::IonosphereFree));
    assert_eq!(reference(45_000.0), Ok(ClockReference::Broadcast));
    assert!(matches!(reference(60_000.0), Err(OrbitError::NotCovered { .. })));
    let other = SatelliteId::new(Constellation::Gps, 8);
    let unknown = Products::new(vec![], vec![]).satellite_state(other, start());
    assert_eq!(unknown, Err(OrbitError::Unknown { satellite: other }));
    assert_eq!(Products::default().satellite_state(other, start()), unknown);
}

#[test]
fn an_unhealthy_satellite_is_refused_by_the_message_in_force() {
    let healthy = satellite(5_153.6, 0.01, 0.96, 0.3);
    let unhealthy = KeplerEphemeris { toe: healthy.toe + 7_200.0, health: 63.0, ..healthy };
    let products = Products::new(vec![], vec![navigation(vec![healthy, unhealthy])]);
    let at = |elapsed_s: f64| products.satellite_state(healthy.satellite, healthy.toe + elapsed_s);
    assert!(at(3_000.0).is_ok());
    assert!(matches!(at(4_000.0), Err(OrbitError::Unhealthy { health: 63.0, .. })));
}

#[test]
fn galileo_takes_the_latest_message_before_and_prefers_inav() {
    let inav = KeplerEphemeris {
        satellite: SatelliteId::new(Constellation::Galileo, 11),
        message: NavigationMessage::GalileoInav,
        group_delays_s: (1e-9, 2e-9),
        ..satellite(5_440.6, 0.0, 0.97, 0.3)
    };
    let fnav = KeplerEphemeris {
        message: NavigationMessage::GalileoFnav,
        toe: inav.toe + 3_600.0,
        group_delays_s: (1e-9, f64::NAN),
        ..inav
    };
    let products = Products::new(vec![], vec![navigation(vec![fnav, inav])]);
    let in_force =
        |elapsed_s: f64| products.ephemeris(inav.satellite, inav.toe + elapsed_s).map(|e| e.message);
    assert_eq!(in_force(-60.0), None);
    assert_eq!(in_force(14_000.0), Some(NavigationMessage::GalileoInav));
    assert_eq!(in_force(15_000.0), Some(NavigationMessage::GalileoFnav));
    let e1 = |elapsed_s: f64| {
        let time = inav.toe + elapsed_s;
        let signal = SignalCode::new(b'1', b'X');
        let metres =
            products.group_delay_correction_m(inav.satellite, signal, ClockReference::Broadcast, time);
        (metres.unwrap() / 0.299_792_458).round()
    };
    // I/NAV's clock takes BGD E1-E5b, F/NAV's E1-E5a; seven weeks later the nearest message still serves.
    assert_eq!((e1(100.0), e1(15_000.0), e1(4_233_600.0)), (-2.0, -1.0, -2.0));
    assert_eq!(products.group_delay_age_s(inav.toe + 4_233_600.0), Some(4_233_600.0));
}
