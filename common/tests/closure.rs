//! Observations made from known states, clocks and delays, corrected with each combination of products: within a
//! constellation and band nothing may be left but the receiver's clock, to a millimetre.
//!
//! The path and the group delays are computed here from their definitions, not with the corrector's rules. Transmission and
//! reception lie on both sides of a change of week, and receiver clocks are off by up to a millisecond.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use cofix_common::atmosphere::{
    Ionex, KlobucharCoefficients, STANDARD_RELATIVE_HUMIDITY, Troposphere, TroposphereMapping,
    klobuchar_delay_l1_m,
};
use cofix_common::constants::{EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS};
use cofix_common::frames::{Ecef, EcefVector, Geodetic, LocalFrame};
use cofix_common::gnss::{
    Constellation, EpochFlag, LossOfLock, Observation, ObservationEpoch, SatelliteId, SignalCode,
};
use cofix_common::measurement::{
    CorrectedObservation, CorrectionOptions, Corrector, Differential, DifferentialOptions, Ionosphere,
};
use cofix_common::orbit::{
    BiasFile, ClockFile, ClockRecord, CodeBias, GlonassEphemeris, KeplerEphemeris, NavigationMessage,
    Products, SatelliteState, Sp3, Sp3Position,
};
use cofix_common::orbit::{IonosphereTerms, NavigationFile};
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;
use nalgebra::Vector3;

use Constellation::{Beidou, Galileo, Glonass, Gps};

const C: f64 = SPEED_OF_LIGHT_MPS;
/// What a network's convention adds to all biases of a system, s.
const DATUM_S: f64 = 8e-9;
const KLOBUCHAR: KlobucharCoefficients = KlobucharCoefficients {
    alpha: [1.3e-8, 1.5e-8, -6.0e-8, -6.0e-8],
    beta: [1.05e5, 4.9e4, -1.3e5, -2.6e5],
};
const TEC_TECU: f64 = 23.0;

/// The first instant of a week: signals received soon after it were sent in the week before.
fn week_start() -> GpsTime {
    GpsTime::from_week_tow(2_212, 0.0)
}

fn toe() -> GpsTime {
    week_start() - 600.0
}

/// Bands that are observed, with the attribute.
const fn signals(constellation: Constellation) -> &'static [[u8; 2]] {
    match constellation {
        Gps => &[[b'1', b'C'], [b'2', b'L'], [b'5', b'Q']],
        Galileo => &[[b'1', b'C'], [b'5', b'Q'], [b'7', b'Q']],
        Beidou => &[[b'2', b'I'], [b'5', b'P'], [b'6', b'I'], [b'7', b'I']],
        _ => &[[b'1', b'C'], [b'2', b'C']],
    }
}

/// The pair that precise clocks refer to.
const fn reference_pair(constellation: Constellation) -> (u8, u8) {
    match constellation {
        Galileo => (b'1', b'5'),
        Beidou => (b'2', b'6'),
        _ => (b'1', b'2'),
    }
}

#[derive(Clone, Copy)]
enum Orbit {
    Kepler(KeplerEphemeris),
    Glonass(GlonassEphemeris),
}

impl Orbit {
    fn satellite(&self) -> SatelliteId {
        match self {
            Self::Kepler(ephemeris) => ephemeris.satellite,
            Self::Glonass(ephemeris) => ephemeris.satellite,
        }
    }

    /// The truth: position, and the clock that no signal's delay belongs to.
    fn state(&self, time: GpsTime) -> SatelliteState {
        match self {
            Self::Kepler(ephemeris) => ephemeris.state(time),
            Self::Glonass(ephemeris) => ephemeris.state(time),
        }
    }

    fn channel(&self) -> Option<i8> {
        match self {
            Self::Kepler(_) => None,
            Self::Glonass(ephemeris) => Some(ephemeris.frequency_channel),
        }
    }

    fn frequency_hz(&self, band: u8) -> f64 {
        SignalCode::new(band, b'X').frequency_hz(self.satellite().constellation, self.channel()).unwrap()
    }

    /// How much later than by the clock a signal leaves, s.
    fn delay_s(&self, band: u8) -> f64 {
        let SatelliteId { constellation, number } = self.satellite();
        let seed = f64::from(number) * 1.7 + f64::from(band) * 3.1 + f64::from(constellation.letter() as u32);
        1e-8 * (seed * seed).sin()
    }

    /// The same of the ionosphere-free combination of two bands.
    fn pair_delay_s(&self, (a, b): (u8, u8)) -> f64 {
        let gamma = (self.frequency_hz(a) / self.frequency_hz(b)).powi(2);
        (gamma * self.delay_s(a) - self.delay_s(b)) / (gamma - 1.0)
    }

    fn precise_delay_s(&self) -> f64 {
        self.pair_delay_s(reference_pair(self.satellite().constellation))
    }
}

fn kepler(constellation: Constellation, number: u8) -> KeplerEphemeris {
    let (message, axis_m, inclination_deg) = match constellation {
        Galileo => (NavigationMessage::GalileoInav, 2.96e7, 56.0),
        Beidou => (NavigationMessage::BeidouD1D2, 2.79e7, 55.0),
        _ => (NavigationMessage::Lnav, 2.656e7, 55.0),
    };
    let (plane, place) = (f64::from(number / 6), f64::from(number % 6));
    let behind_s = if constellation == Beidou { 14.0 } else { 0.0 };
    KeplerEphemeris {
        satellite: SatelliteId::new(constellation, number),
        message,
        toe: toe(),
        toe_own_tow_s: (toe() - behind_s).tow_s(),
        toc: toe(),
        sqrt_a: f64::sqrt(axis_m),
        eccentricity: 0.01,
        i0_rad: f64::to_radians(inclination_deg),
        i_dot_radps: 0.0,
        omega0_rad: plane * PI / 3.0 + f64::from(constellation as u8),
        omega_dot_radps: 0.0,
        omega_rad: 0.4,
        m0_rad: place * PI / 3.0 + plane * 0.3,
        delta_n_radps: 0.0,
        cuc_cus_rad: (0.0, 0.0),
        crc_crs_m: (0.0, 0.0),
        cic_cis_rad: (0.0, 0.0),
        clock: (3e-4 * f64::sin(f64::from(number)), 2e-11, 0.0),
        group_delays_s: (0.0, 0.0),
        accuracy_m: 2.0,
        health: 0.0,
        issue_of_data: 1,
        issue_of_clock: 1,
    }
}

fn glonass(number: u8) -> GlonassEphemeris {
    let (plane, place) = (f64::from(number / 8) * 2.0 * PI / 3.0, f64::from(number % 8) * PI / 4.0);
    let (radius_m, inclination) = (2.551e7, 64.8_f64.to_radians());
    let at = |angle: f64| {
        let (x, y) = (angle.cos(), angle.sin() * inclination.cos());
        let (sin, cos) = plane.sin_cos();
        Vector3::new(x * cos - y * sin, x * sin + y * cos, angle.sin() * inclination.sin())
    };
    let position = radius_m * at(place);
    let inertial = (3.986_004_418e14 / radius_m).sqrt() * at(place + PI / 2.0);
    let carried = Vector3::new(-position.y, position.x, 0.0) * EARTH_ROTATION_RADPS;
    GlonassEphemeris {
        satellite: SatelliteId::new(Glonass, number),
        toe: toe(),
        position: Ecef(position),
        velocity: EcefVector(inertial - carried),
        acceleration: EcefVector::new(1e-6, -2e-6, 1e-6),
        tau_s: 1e-4 * f64::cos(f64::from(number)),
        gamma: 1e-12,
        l2_delay_s: None,
        frequency_channel: i8::try_from(number % 14).unwrap() - 7,
        health: Some(0),
        health_flags: None,
        age_days: 0.0,
        accuracy_m: 5.0,
    }
}

fn orbits() -> Vec<Orbit> {
    let kepler = [Gps, Galileo, Beidou]
        .into_iter()
        .flat_map(|constellation| (1..=30).map(move |number| (constellation, number)))
        .filter(|(constellation, number)| *constellation != Beidou || *number > 5)
        .map(|(constellation, number)| Orbit::Kepler(kepler(constellation, number)));
    kepler.chain((1..=24).map(|number| Orbit::Glonass(glonass(number)))).collect()
}

// Products, as they would be published.

/// Messages: their clocks are those of the signals that the ICDs name, with the group delays that go with them.
fn navigation() -> NavigationFile {
    let mut file = NavigationFile {
        ionosphere: IonosphereTerms { gps: Some(KLOBUCHAR), ..IonosphereTerms::default() },
        ..NavigationFile::default()
    };
    for orbit in orbits() {
        let of = |band: u8| orbit.delay_s(band);
        match orbit {
            Orbit::Kepler(mut message) => {
                let (clock_delay_s, delays) = match message.satellite.constellation {
                    Galileo => {
                        let (a, b) = (orbit.pair_delay_s((b'1', b'5')), orbit.pair_delay_s((b'1', b'7')));
                        (b, (of(b'1') - a, of(b'1') - b))
                    }
                    Beidou => (of(b'6'), (of(b'2') - of(b'6'), of(b'7') - of(b'6'))),
                    _ => {
                        let pair = orbit.pair_delay_s((b'1', b'2'));
                        (pair, (of(b'1') - pair, 0.0))
                    }
                };
                message.clock.0 -= clock_delay_s;
                message.group_delays_s = delays;
                file.ephemerides.push(message);
            }
            Orbit::Glonass(mut message) => {
                message.tau_s += of(b'1');
                message.l2_delay_s = Some(of(b'2') - of(b'1'));
                file.glonass.push(message);
            }
        }
    }
    file
}

/// Clock of the reference pair without the periodic relativistic term, which is −2 r·v/c² in either frame.
fn precise_clock_s(orbit: &Orbit, time: GpsTime) -> f64 {
    let state = orbit.state(time);
    let relativity_s = -2.0 * state.position.0.dot(&state.velocity.0) / (C * C);
    state.clock_s - relativity_s - orbit.precise_delay_s()
}

fn sp3() -> Sp3 {
    sp3_between(-12, 12, 300.0)
}

fn sp3_between(first: i32, last: i32, interval_s: f64) -> Sp3 {
    let times = (first..=last).map(|k| week_start() + interval_s * f64::from(k));
    let positions = times
        .flat_map(|time| {
            orbits().into_iter().map(move |orbit| Sp3Position {
                satellite: orbit.satellite(),
                time,
                position: orbit.state(time).position,
                clock_s: Some(precise_clock_s(&orbit, time)),
            })
        })
        .collect();
    Sp3 { interval_s, epochs: usize::try_from(last - first + 1).unwrap(), positions, skips: Skips::default() }
}

/// The same orbits with clocks that a network has on another time scale.
fn sp3_without_clocks() -> Sp3 {
    let mut file = sp3();
    for position in &mut file.positions {
        position.clock_s = None;
    }
    file
}

fn clock_file() -> ClockFile {
    let records = (-4..=4)
        .map(|k| week_start() + 30.0 * f64::from(k))
        .flat_map(|time| {
            orbits().into_iter().map(move |orbit| ClockRecord {
                satellite: orbit.satellite(),
                time,
                clock_s: precise_clock_s(&orbit, time),
            })
        })
        .collect();
    ClockFile { interval_s: 30.0, records, skips: Skips::default() }
}

/// Biases of all signals but those of every sixth satellite.
fn biases() -> BiasFile {
    let biases = orbits()
        .into_iter()
        .filter(|orbit| !orbit.satellite().number.is_multiple_of(6))
        .flat_map(|orbit| {
            signals(orbit.satellite().constellation).iter().map(move |[band, attribute]| CodeBias {
                satellite: orbit.satellite(),
                signal: SignalCode::new(*band, *attribute),
                start: week_start() - 43_200.0,
                end: Some(week_start() + 43_200.0),
                bias_s: orbit.delay_s(*band) - orbit.precise_delay_s() + DATUM_S,
            })
        })
        .collect();
    BiasFile { biases, skips: Skips::default() }
}

/// The same electron content everywhere.
fn ionosphere_maps() -> Ionex {
    let line = |content: &str, label: &str| format!("{content:<60}{label}\n");
    let mut text = line("     1.0            IONOSPHERE MAPS     GPS", "IONEX VERSION / TYPE")
        + &line("  6371.0", "BASE RADIUS")
        + &line("   450.0 450.0   0.0", "HGT1 / HGT2 / DHGT")
        + &line("    87.5 -87.5-175.0", "LAT1 / LAT2 / DLAT")
        + &line("  -180.0 180.0 180.0", "LON1 / LON2 / DLON")
        + &line("", "END OF HEADER");
    for (day, hour) in [(28, 23), (29, 1)] {
        text += &line("     1", "START OF TEC MAP");
        text += &line(&format!("  2022     5    {day}    {hour:2}     0     0"), "EPOCH OF CURRENT MAP");
        for latitude in ["87.5", "-87.5"] {
            text += &line(&format!("  {latitude:>6}-180.0 180.0 180.0 450.0"), "LAT/LON1/LON2/DLON/H");
            let value = format!("{:5}", (TEC_TECU * 10.0).round());
            text += &(value.repeat(3) + "\n");
        }
        text += &line("     1", "END OF TEC MAP");
    }
    Ionex::parse(text.as_bytes()).unwrap()
}

// Observations.

#[derive(Clone, Copy, PartialEq)]
enum Sky {
    Klobuchar,
    Map,
}

#[derive(Clone, Copy)]
struct Receiver {
    position: Ecef,
    /// Ahead of GPS time, s.
    clock_s: f64,
    tag: GpsTime,
    sky: Sky,
}

fn place(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> Ecef {
    Geodetic::from_degrees(latitude_deg, longitude_deg, height_m).geodetic_to_ecef()
}

fn rover() -> Receiver {
    Receiver {
        position: place(30.5, 114.3, 40.0),
        clock_s: -0.000_321_457_1,
        tag: week_start() + 0.03,
        sky: Sky::Klobuchar,
    }
}

/// 12 km away and 300 m higher, with another clock.
fn base() -> Receiver {
    Receiver {
        position: place(30.6, 114.25, 340.0),
        clock_s: 0.000_987_654_3,
        tag: week_start() + 0.03,
        ..rover()
    }
}

impl Receiver {
    /// Where the satellite was when it sent what arrives now, in the frame of the arrival, and when that was.
    fn path(&self, orbit: &Orbit) -> (Ecef, GpsTime) {
        let arrival = self.tag - self.clock_s;
        let mut travel_s = 0.07;
        for _ in 0..6 {
            travel_s = Self::seen(orbit, arrival, travel_s).distance_m(self.position) / C;
        }
        (Self::seen(orbit, arrival, travel_s), arrival - travel_s)
    }

    fn seen(orbit: &Orbit, arrival: GpsTime, travel_s: f64) -> Ecef {
        let Ecef(p) = orbit.state(arrival - travel_s).position;
        let angle = EARTH_ROTATION_RADPS * travel_s;
        let (sin, cos) = angle.sin_cos();
        Ecef(Vector3::new(cos * p.x + sin * p.y, cos * p.y - sin * p.x, p.z))
    }

    fn epoch(&self) -> ObservationEpoch {
        let frame = LocalFrame::at(self.position);
        let mapping = TroposphereMapping::default();
        let troposphere = Troposphere::at(frame.geodetic(), self.tag, mapping, STANDARD_RELATIVE_HUMIDITY);
        let mut observations = Vec::new();
        for orbit in orbits() {
            let satellite = orbit.satellite();
            let (seen, sent) = self.path(&orbit);
            let direction = frame.direction(&(seen - self.position).0.normalize());
            if direction.elevation_rad < 10_f64.to_radians() {
                continue;
            }
            let troposphere_m = troposphere.delay_m(direction);
            for [band, attribute] in signals(satellite.constellation) {
                let frequency_hz = orbit.frequency_hz(*band);
                let ionosphere_m = match self.sky {
                    Sky::Klobuchar => {
                        klobuchar_delay_l1_m(&KLOBUCHAR, frame.geodetic(), direction, self.tag)
                            * (1_575.42e6 / frequency_hz).powi(2)
                    }
                    Sky::Map => {
                        let zenith = (6_371.0 / 6_821.0 * direction.elevation_rad.cos()).asin();
                        40.3e16 * TEC_TECU / zenith.cos() / frequency_hz.powi(2)
                    }
                };
                let group_s = orbit.delay_s(*band) + f64::from(*band) * 1e-8;
                let pseudorange_m = seen.distance_m(self.position)
                    + C * (self.clock_s - orbit.state(sent).clock_s + group_s)
                    + ionosphere_m
                    + troposphere_m;
                observations.push(Observation {
                    satellite,
                    signal: SignalCode::new(*band, *attribute),
                    pseudorange_m: Some(pseudorange_m),
                    carrier_phase_cycles: None,
                    doppler_hz: None,
                    cn0_dbhz: Some(45.0),
                    loss_of_lock: LossOfLock::default(),
                });
            }
        }
        ObservationEpoch { time_gps: self.tag, flag: EpochFlag::Ok, observations }
    }

    fn corrected(&self, products: &Arc<Products>, ionosphere: Ionosphere) -> Vec<CorrectedObservation> {
        let options = CorrectionOptions { ionosphere, ..unbiased() };
        let mut corrector = Corrector::new(products.clone(), options);
        let prepared = corrector.prepare(&self.epoch());
        let (corrected, masked) = corrector.finish(&prepared, self.position, self.tag);
        assert!(masked.is_empty(), "{masked}");
        corrected
    }

    /// By constellation and band: how many satellites there are, and by how much what is left of them differs, m.
    fn spreads(&self, observations: &[CorrectedObservation]) -> BTreeMap<String, (usize, f64)> {
        let mut left: BTreeMap<String, Vec<f64>> = BTreeMap::new();
        for o in observations {
            let value = o.pseudorange_m - o.satellite_position.distance_m(self.position);
            left.entry(o.clock_group().to_string()).or_default().push(value);
        }
        left.into_iter()
            .map(|(group, values)| {
                let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let low = values.iter().copied().fold(f64::INFINITY, f64::min);
                (group, (values.len(), high - low))
            })
            .collect()
    }
}

fn check(
    name: &str,
    receiver: &Receiver,
    observations: &[CorrectedObservation],
    unknown: &[&str],
    groups: usize,
) {
    let spreads = receiver.spreads(observations);
    println!("{name}: {spreads:?}");
    assert_eq!(spreads.len(), groups, "{name}");
    for (group, (count, spread_m)) in &spreads {
        assert!(*count >= 4, "{name} {group}: {count} satellites");
        if unknown.contains(&group.as_str()) {
            assert!(*spread_m > 0.1, "{name} {group}: nothing told this delay");
        } else {
            assert!(*spread_m < 1e-3, "{name} {group}: {spread_m} m");
        }
    }
}

/// Products by name, and groups whose group delay they do not tell. Messages tell that of B2I, which BeiDou-3 does not send.
fn combinations() -> Vec<(&'static str, Products, &'static [&'static str])> {
    let unknown: &[&str] = &["G5", "C5", "C7"];
    let precise = || Products::new(vec![sp3()], vec![navigation()]);
    let mut with_clocks = Products::new(vec![sp3_without_clocks()], vec![navigation()]);
    with_clocks.add_clocks(vec![clock_file()]);
    let mut with_all = with_clocks.clone();
    with_all.add_biases(biases());
    let mut with_biases = precise();
    with_biases.add_biases(biases());
    let mut broadcast = Products::new(Vec::new(), vec![navigation()]);
    let broadcast_alone = broadcast.clone();
    broadcast.add_biases(biases());
    vec![
        ("SP3", precise(), unknown),
        ("SP3 and clocks", with_clocks, unknown),
        // Of L5 and B2a every sixth satellite has no bias and nothing else.
        ("SP3 and biases", with_biases, unknown),
        ("SP3, clocks and biases", with_all, unknown),
        ("broadcast", broadcast_alone, unknown),
        ("broadcast and biases", broadcast, unknown),
    ]
}

/// The default corrections for simulated satellites, whose code has no bias by elevation.
fn unbiased() -> CorrectionOptions {
    CorrectionOptions { beidou2_code_bias: false, ..CorrectionOptions::default() }
}

#[test]
fn every_combination_of_products_closes() {
    for (name, products, unknown) in combinations() {
        let products = Arc::new(products);
        for receiver in [rover(), base()] {
            let observations = receiver.corrected(&products, Ionosphere::Model);
            check(name, &receiver, &observations, unknown, 12);
        }
    }
}

#[test]
fn satellites_with_biases_close_on_every_band() {
    let mut products = Products::new(vec![sp3_without_clocks()], vec![navigation()]);
    products.add_clocks(vec![clock_file()]);
    products.add_biases(biases());
    let products = Arc::new(products);
    for (ionosphere, groups) in [(Ionosphere::Model, 12), (Ionosphere::PairOnly, 4)] {
        let mut observations = rover().corrected(&products, ionosphere);
        observations.retain(|o| !o.satellite.number.is_multiple_of(6));
        check("with a bias", &rover(), &observations, &[], groups);
    }
}

#[test]
fn ionosphere_maps_close() {
    for (name, mut products, unknown) in combinations() {
        products.add_ionosphere_maps(ionosphere_maps());
        let receiver = Receiver { sky: Sky::Map, ..rover() };
        let observations = receiver.corrected(&Arc::new(products), Ionosphere::Model);
        check(name, &receiver, &observations, unknown, 12);
    }
}

/// No model knows this ionosphere.
#[test]
fn pairs_close_without_a_model() {
    for (name, products, _) in combinations() {
        let receiver = Receiver { sky: Sky::Map, ..rover() };
        let observations = receiver.corrected(&Arc::new(products), Ionosphere::PairOnly);
        check(name, &receiver, &observations, &["G1+5", "C2+5"], 4);
    }
}

/// The base sees what no product tells: delays of L5, clocks that are off by metres.
#[test]
fn differential_corrections_close() {
    for ionosphere in [Ionosphere::Model, Ionosphere::PairOnly] {
        let groups = if ionosphere == Ionosphere::Model { 12 } else { 4 };
        for (name, products, _) in combinations() {
            let products = Arc::new(products);
            let options = CorrectionOptions { ionosphere, ..unbiased() };
            let mut differential =
                Differential::new(products.clone(), options, DifferentialOptions::default());
            differential.add(0, base().epoch(), base().position);
            let mut observations = rover().corrected(&products, ionosphere);
            let applied = differential.apply(&mut observations, rover().position, rover().tag);
            assert_eq!(applied.counts.corrected, observations.len() as u64, "{name}: {}", applied.skips);
            check(name, &rover(), &observations, &[], groups);
        }
    }
}

/// A base takes away what both receivers see, not their noise: that of a pair stays that of a pair, and biases between
/// GLONASS' channels are each receiver's own.
#[test]
fn differential_corrections_leave_the_receivers_own_variances() {
    let products = Arc::new(Products::new(Vec::new(), vec![navigation()]));
    let corrected = |ionosphere: Ionosphere| {
        let options = CorrectionOptions { ionosphere, ..unbiased() };
        let mut differential = Differential::new(products.clone(), options, DifferentialOptions::default());
        differential.add(0, base().epoch(), base().position);
        let mut observations = rover().corrected(&products, ionosphere);
        differential.apply(&mut observations, rover().position, rover().tag);
        observations
    };
    let single = corrected(Ionosphere::Model);
    for pair in corrected(Ionosphere::PairOnly) {
        let first = single.iter().find(|o| o.satellite == pair.satellite).unwrap();
        let ratio = pair.pseudorange_sigma_m / first.pseudorange_sigma_m;
        assert!((2.4..3.0).contains(&ratio), "{} {}: {ratio}", pair.satellite, pair.signal);
    }
    let bias_m = CorrectionOptions::default().glonass_bias_sigma_m;
    let of = |constellation| single.iter().filter(move |o| o.satellite.constellation == constellation);
    assert!(of(Glonass).count() > 8 && of(Glonass).all(|o| o.pseudorange_sigma_m > bias_m));
    assert!(of(Gps).any(|o| o.pseudorange_sigma_m < 0.6 * bias_m));
}

/// Messages of both kinds for Galileo, of which I/NAV comes to its greatest age between the epochs of base and rover.
fn navigation_that_changes_to_fnav(change: GpsTime) -> NavigationFile {
    let mut file = navigation();
    let mut fnav = Vec::new();
    for orbit in orbits() {
        let Orbit::Kepler(message) = orbit else { continue };
        if message.satellite.constellation != Galileo {
            continue;
        }
        let pair_s = orbit.pair_delay_s((b'1', b'5'));
        let (a0, a1, a2) = message.clock;
        fnav.push(KeplerEphemeris {
            message: NavigationMessage::GalileoFnav,
            clock: (a0 - pair_s, a1, a2),
            group_delays_s: (orbit.delay_s(b'1') - pair_s, f64::NAN),
            ..message
        });
    }
    for inav in file.ephemerides.iter_mut().filter(|e| e.satellite.constellation == Galileo) {
        let earlier_s = inav.toe - (change - 14_400.0);
        let mean_motion = (3.986_004_418e14_f64).sqrt() / inav.sqrt_a.powi(3);
        inav.m0_rad -= mean_motion * earlier_s;
        inav.clock.0 -= inav.clock.1 * earlier_s;
        (inav.toe, inav.toc) = (inav.toe - earlier_s, inav.toc - earlier_s);
        inav.toe_own_tow_s -= earlier_s;
    }
    file.ephemerides.extend(fnav);
    file
}

/// The clocks of the two messages differ by their group delays, and both are part of what a base corrects.
#[test]
fn differential_corrections_close_when_galileo_changes_to_another_message() {
    let file = navigation_that_changes_to_fnav(week_start() + 5.0);
    let products = Arc::new(Products::new(Vec::new(), vec![file]));
    let later = Receiver { tag: week_start() + 10.03, ..rover() };
    for (ionosphere, groups, unknown) in
        [(Ionosphere::Model, 12, &["G5", "C5", "C7"] as &[_]), (Ionosphere::PairOnly, 4, &["G1+5", "C2+5"])]
    {
        let options = CorrectionOptions { ionosphere, ..unbiased() };
        for receiver in [rover(), later] {
            let observations = receiver.corrected(&products, ionosphere);
            check("both messages", &receiver, &observations, unknown, groups);
        }
        let mut differential = Differential::new(products.clone(), options, DifferentialOptions::default());
        differential.add(0, base().epoch(), base().position);
        let mut observations = later.corrected(&products, ionosphere);
        differential.apply(&mut observations, later.position, later.tag);
        observations.retain(|o| o.satellite.constellation == Galileo);
        let spreads = later.spreads(&observations);
        println!("{spreads:?}");
        // The atmosphere changes by a little in ten seconds.
        assert!(spreads.values().all(|(_, spread_m)| *spread_m < 0.01), "{spreads:?}");
    }
}

/// In which order files are named changes nothing, when they do not contradict each other.
#[test]
fn the_order_of_files_does_not_matter() {
    let (early, late) = (sp3_between(-12, 0, 300.0), sp3_between(1, 12, 300.0));
    let half = |is_early: bool| {
        let mut file = clock_file();
        file.records.retain(|record| (record.time <= week_start()) == is_early);
        file
    };
    let mut forwards = Products::new(vec![early.clone(), late.clone()], vec![navigation()]);
    forwards.add_clocks(vec![half(true), half(false)]);
    let mut backwards = Products::new(vec![late, early], vec![navigation()]);
    backwards.add_clocks(vec![half(false), half(true)]);
    for orbit in orbits() {
        for at_s in [-70.0, -0.1, 0.0, 0.1, 17.0, 90.0] {
            let (satellite, time) = (orbit.satellite(), week_start() + at_s);
            let state = forwards.satellite_state(satellite, time).unwrap();
            assert_eq!(Ok(state), backwards.satellite_state(satellite, time));
            assert!(state.position.distance_m(orbit.state(time).position) < 1e-3, "{satellite} {at_s}");
        }
    }
}

/// The last quarter of an hour of a file, where all nodes lie to one side.
#[test]
fn orbits_of_a_quarter_of_an_hour_hold_to_their_ends() {
    let products = Products::new(vec![sp3_between(-16, 0, 900.0)], Vec::new());
    let mut worst_m = [0.0_f64; 2];
    for orbit in orbits() {
        for k in 1..30 {
            for (end, time) in
                [week_start() - 30.0 * f64::from(k), week_start() - 7_200.0 + 30.0 * f64::from(k)]
                    .into_iter()
                    .enumerate()
            {
                let state = products.satellite_state(orbit.satellite(), time).unwrap();
                worst_m[end] = worst_m[end].max(state.position.distance_m(orbit.state(time).position));
            }
        }
    }
    println!("at the end {:.4} m, in the middle {:.6} m", worst_m[0], worst_m[1]);
    assert!(worst_m[0] < 0.01 && worst_m[1] < 1e-3, "{worst_m:?}");
}

/// The precise orbits end, or begin, between the epochs of base and rover, and messages are off by metres.
#[test]
fn differential_corrections_close_where_precise_orbits_end_and_begin() {
    let mut file = navigation();
    for message in &mut file.ephemerides {
        message.clock.0 += 1e-8 * f64::from(message.satellite.number).cos();
    }
    for (sp3, name) in [(sp3_between(-12, 0, 300.0), "end"), (sp3_between(0, 12, 300.0), "begin")] {
        let products = Arc::new(Products::new(vec![sp3], vec![file.clone()]));
        let before = Receiver { tag: week_start() - 5.0, ..base() };
        let after = Receiver { tag: week_start() + 1.0, ..rover() };
        let (correction, options) = (unbiased(), DifferentialOptions::default());
        let mut differential = Differential::new(products.clone(), correction, options);
        differential.add(0, before.epoch(), before.position);
        let mut observations = after.corrected(&products, Ionosphere::Model);
        differential.apply(&mut observations, after.position, after.tag);
        for (group, (_, spread_m)) in after.spreads(&observations) {
            assert!(spread_m < 0.01, "{name} {group}: {spread_m} m");
        }
    }
}
