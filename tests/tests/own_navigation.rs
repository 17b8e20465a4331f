//! Sessions without product files: recordings that carry their own ephemerides, as GnssLogger texts with `Nav` lines.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

#[path = "../../common/tests/navbits_encoder/mod.rs"]
mod navbits_encoder;

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::Path;

use cofix_agent::Stop;
use cofix_common::constants::SPEED_OF_LIGHT_MPS;
use cofix_common::gnss::{Constellation, ObservationEpoch};
use cofix_common::orbit::KeplerEphemeris;
use cofix_common::simulation::{PhoneOptions, Scenario, Simulation};
use cofix_hub::replay::{Outcome, Plan, ReplayOptions, replay};
use cofix_hub::session::Session;
use navbits_encoder::{LnavFields, unit};

const HEADER: &str = "# Raw,TimeNanos,FullBiasNanos,Svid,State,ReceivedSvTimeNanos,Cn0DbHz,PseudorangeRateMetersPerSecond,\
    CarrierFrequencyHz,ConstellationType\n";
const L1_HZ: f64 = 1_575.42e6;
const WEEK_NS: i64 = 604_800_000_000_000;

fn simulation() -> Simulation {
    let phone = |rank| PhoneOptions {
        starts_after_s: 0.0,
        stops_before_s: 0.0,
        dual_frequency: false,
        ..PhoneOptions::of_vehicle(rank)
    };
    let scenario = Scenario { duration_s: 30.0, phones: vec![phone(0), phone(1)], ..Scenario::default() };
    Simulation::new(scenario).unwrap()
}

/// The nearest multiple of a power of two.
fn multiple(value: f64, exponent: i32) -> i64 {
    #[allow(clippy::cast_possible_truncation)]
    let multiple = (value / unit(exponent)).round() as i64;
    multiple
}

/// An ephemeris as subframes 1 to 3.
fn nav_lines(e: &KeplerEphemeris) -> String {
    let angle = |rad: f64| multiple((rad + PI).rem_euclid(2.0 * PI) / PI - 1.0, -31);
    let rate = |radps: f64| multiple(radps / PI, -43);
    let [cuc, cus] = [e.cuc_cus_rad.0, e.cuc_cus_rad.1].map(|c| multiple(c, -29));
    let [crc, crs] = [e.crc_crs_m.0, e.crc_crs_m.1].map(|c| multiple(c, -5));
    let [cic, cis] = [e.cic_cis_rad.0, e.cic_cis_rad.1].map(|c| multiple(c, -29));
    let sent = e.toe - 5_400.0;
    let fields = LnavFields {
        week: sent.week(),
        tow_s: sent.tow_s() - sent.tow_s() % 30.0,
        issue: 7,
        ura: 0,
        health: 0,
        tgd: multiple(e.group_delays_s.0, -31),
        toc: multiple(e.toc.tow_s(), 4),
        af: [multiple(e.clock.0, -31), multiple(e.clock.1, -43), multiple(e.clock.2, -55)],
        toe: multiple(e.toe.tow_s(), 4),
        sqrt_a: multiple(e.sqrt_a, -19),
        e: multiple(e.eccentricity, -33),
        angles: [angle(e.i0_rad), angle(e.omega0_rad), angle(e.omega_rad), angle(e.m0_rad)],
        rates: [rate(e.delta_n_radps), rate(e.i_dot_radps), rate(e.omega_dot_radps)],
        harmonics: [cuc, cus, crc, crs, cic, cis],
    };
    let mut text = String::new();
    for (words, number) in fields.subframes().iter().zip(1..) {
        write!(text, "Nav,{},257,1,-1,{number}", e.satellite.number).unwrap();
        for byte in words.iter().flat_map(|word| word.to_be_bytes()) {
            write!(text, ",{}", byte.cast_signed()).unwrap();
        }
        text.push('\n');
    }
    text
}

/// The GPS part of an epoch as `Raw` lines.
fn raw_lines(epoch: &ObservationEpoch) -> String {
    // The phone's own clock began here.
    const START_NS: i64 = 1_200_000_000_000_000_000;
    let gps_ns = epoch.time_gps.nanos();
    let mut text = String::new();
    for o in epoch.observations.iter().filter(|o| o.satellite.constellation == Constellation::Gps) {
        #[allow(clippy::cast_possible_truncation)]
        let travel_ns = (o.pseudorange_m.unwrap() / SPEED_OF_LIGHT_MPS * 1e9).round() as i64;
        let received = (gps_ns - travel_ns).rem_euclid(WEEK_NS);
        let rate = -o.doppler_hz.unwrap() * SPEED_OF_LIGHT_MPS / L1_HZ;
        let cn0 = o.cn0_dbhz.unwrap();
        writeln!(
            text,
            "Raw,{},-{START_NS},{},16431,{received},{cn0},{rate},1575420030,1",
            gps_ns - START_NS,
            o.satellite.number
        )
        .unwrap();
    }
    text
}

/// Writes the phones' texts and a session of them; gives back the session as it is read.
fn session(folder: &Path, simulation: &Simulation, with_nav: &[bool], products: &str) -> Session {
    let middle = simulation.epochs(0).next().unwrap().epoch.time_gps + 15.0;
    let is_current = |e: &&KeplerEphemeris| {
        e.satellite.constellation == Constellation::Gps && (e.toe - middle).abs() <= 1_800.0
    };
    let nav: String = simulation.ephemerides().iter().filter(is_current).map(nav_lines).collect();
    let mut toml = format!("group = 'own'\n{products}");
    for (index, name) in simulation.phone_names().iter().enumerate() {
        let mut text = HEADER.to_owned();
        text.extend(simulation.epochs(index).map(|simulated| raw_lines(&simulated.epoch)));
        if with_nav[index] {
            text += &nav;
        }
        std::fs::write(folder.join(format!("{name}.txt")), text).unwrap();
        write!(toml, "[[phone]]\nname = '{name}'\nobservations = '{name}.txt'\n").unwrap();
    }
    let path = folder.join("session.toml");
    std::fs::write(&path, toml).unwrap();
    Session::read(&path, None).unwrap()
}

fn run(session: &Session) -> anyhow::Result<Outcome> {
    let mut plan = Plan::from_session(session)?;
    let simulated = cofix_hub::demo::plan(simulation().scenario().clone())?;
    for (phone, simulated) in plan.phones.iter_mut().zip(simulated.phones) {
        phone.truth = simulated.truth;
    }
    replay(&plan, &ReplayOptions::default(), &Stop::default())
}

#[test]
fn recordings_with_their_own_ephemerides_need_no_products() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = simulation();
    let report = run(&session(folder.path(), &simulation, &[true, true], "")).unwrap().report;
    for (index, name) in simulation.phone_names().into_iter().enumerate() {
        assert_eq!(report.phones[name].epochs, simulation.epochs(index).count() as u64, "{name}");
        for methods in [&report.methods.wls, &report.methods.joint] {
            let accuracy = methods[name].unwrap();
            assert!(accuracy.availability > 0.95 && accuracy.horizontal_p95_m < 20.0, "{name}: {accuracy:?}");
        }
    }
}

#[test]
fn a_recording_without_ephemerides_is_named_when_there_are_no_products() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = simulation();
    let session = session(folder.path(), &simulation, &[true, false], "[products]\nsp3 = []\n");
    let message = format!("{:#}", run(&session).expect_err("SIM2 has no orbits"));
    assert!(message.contains("SIM2: no orbits: name at least one SP3 or RINEX navigation file"), "{message}");
}
