//! A whole agent with corrections: a recorded rover, a base behind a caster or in a file, ephemerides from a server, against a listener on
//! loopback that plays the hub. The session is simulated, without noise; the agents are told wrong orbits and no ionosphere.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod hub_support;
mod limits;

use std::io::{Read, Write};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use cofix_agent::input::{Backoff, LiveSource};
use cofix_agent::{
    AgentConfig, AgentReport, CorrectionSource, Corrections, ProductSource, Source, Stop, run,
};
use cofix_common::formats::rinex::{ObservationLayout, ObservationWriter, RecordingInfo};
use cofix_common::frames::Ecef;
use cofix_common::gnss::{Constellation, ObservationEpoch};
use cofix_common::orbit::IonosphereTerms;
use cofix_common::orbit::{KeplerEphemeris, Products};
use cofix_common::simulation::{PhoneOptions, Scenario, SimulatedEpoch, Simulation};
use cofix_common::skips::Reason;
use cofix_common::wire::EpochMessage;
use rtcm_rs::msg::Msg1019T;
use rtcm_rs::{Message, MessageBuilder};

use hub_support::Hub;

/// Runs an agent to the end of its recording.
fn run_agent(hub: &Hub, source: Source, products: ProductSource, corrections: Corrections) -> AgentReport {
    let config = AgentConfig { products, corrections, ..hub.agent(source) };
    run(&config, &Stop::default()).unwrap()
}

const EPOCHS: usize = 12;

struct World {
    products: Arc<Products>,
    ephemerides: Vec<KeplerEphemeris>,
    base: Vec<SimulatedEpoch>,
    rover: Vec<SimulatedEpoch>,
}

impl World {
    fn new() -> Self {
        let phone = |rank| PhoneOptions {
            starts_after_s: 0.0,
            stops_before_s: 0.0,
            epoch_offset_s: 0.0,
            ..PhoneOptions::of_vehicle(rank)
        };
        let simulation = Simulation::new(Scenario {
            duration_s: EPOCHS as f64,
            phones: vec![phone(0), phone(1)],
            canyons: Vec::new(),
            noise_free: true,
            ..Scenario::default()
        })
        .unwrap();
        let mut wrong = simulation.navigation();
        for ephemeris in &mut wrong.ephemerides {
            ephemeris.clock.0 += 1e-8 * f64::from(ephemeris.satellite.number).sin();
        }
        wrong.ionosphere = IonosphereTerms::default();
        Self {
            products: Arc::new(Products::new(Vec::new(), vec![wrong])),
            ephemerides: simulation.ephemerides().to_vec(),
            base: simulation.epochs(0).take(EPOCHS).collect(),
            rover: simulation.epochs(1).take(EPOCHS).collect(),
        }
    }

    /// The rover's recording as a file.
    fn recording(&self, folder: &Path) -> Source {
        let epochs: Vec<_> = self.rover.iter().map(|simulated| simulated.epoch.clone()).collect();
        Source::File { path: write(folder, "rover.rnx", &rinex(&epochs, None)), near: None }
    }

    /// The base's first epoch, from where it is said to stand.
    fn base_rinex(&self, header_position: Option<Ecef>) -> String {
        rinex(&[self.base[0].epoch.clone()], header_position)
    }

    fn wrong_products(&self) -> ProductSource {
        ProductSource::Loaded(self.products.clone())
    }

    /// Errors of the epoch-wise positions, m.
    fn errors_m(&self, messages: &[EpochMessage]) -> Vec<f64> {
        let error = |(message, simulated): (&EpochMessage, &SimulatedEpoch)| {
            message.wls.as_ref().unwrap().position.distance_m(simulated.truth.position)
        };
        messages.iter().zip(&self.rover).map(error).collect()
    }
}

fn rinex(epochs: &[ObservationEpoch], approximate_position: Option<Ecef>) -> String {
    let mut layout = ObservationLayout::default();
    for epoch in epochs {
        layout.include(epoch);
    }
    let mut writer = ObservationWriter::new(layout);
    let header = writer.header(&RecordingInfo { approximate_position, ..RecordingInfo::default() });
    header + &epochs.iter().map(|epoch| writer.epoch(epoch)).collect::<String>()
}

fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

/// A caster with one connection, on which it sends `body` in chunks and then nothing until the client goes; it hands back what it heard.
fn caster(body: String) -> (String, limits::Running<String>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let thread = limits::spawn(move || {
        let (mut connection, _) = listener.accept().unwrap();
        let mut heard = Vec::new();
        let mut byte = [0];
        while !heard.ends_with(b"\r\n\r\n") {
            connection.read_exact(&mut byte).unwrap();
            heard.push(byte[0]);
        }
        connection.write_all(b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n").unwrap();
        for chunk in body.as_bytes().chunks(700) {
            connection.write_all(format!("{:X}\r\n", chunk.len()).as_bytes()).unwrap();
            connection.write_all(chunk).unwrap();
            connection.write_all(b"\r\n").unwrap();
        }
        let _ = connection.read_to_end(&mut heard);
        String::from_utf8(heard).unwrap()
    });
    (address, thread)
}

fn corrections(source: CorrectionSource, base_position: Option<Ecef>) -> Corrections {
    Corrections { sources: vec![source], base_position, ..Corrections::default() }
}

#[test]
fn a_caster_of_a_base_takes_away_what_base_and_rover_share() {
    let (world, folder) = (World::new(), tempfile::tempdir().unwrap());
    let hub = Hub::listen();
    let plain =
        run_agent(&hub, world.recording(folder.path()), world.wrong_products(), Corrections::default());
    let errors = world.errors_m(&hub.receive(EPOCHS));
    assert!(errors.iter().all(|error| *error > 1.2), "{errors:?}");
    assert_eq!(plain.corrections.corrected, 0);

    let (address, casting) = caster(world.base_rinex(None));
    let source = format!("ntrip://me:secret@{address}/BASE").parse().unwrap();
    let corrections = corrections(source, Some(world.base[0].truth.position));
    let hub = Hub::listen();
    let report = run_agent(&hub, world.recording(folder.path()), world.wrong_products(), corrections);
    let messages = hub.receive(EPOCHS);
    let errors = world.errors_m(&messages);
    println!("{errors:.3?} m, {:?}; {}", report.corrections, report.skips);
    assert!(errors.iter().all(|error| *error < 0.2), "{errors:?}");
    let observations: usize = messages.iter().map(|message| message.observations.len()).sum();
    assert_eq!(report.corrections.corrected, observations as u64, "{:?}", report.corrections);
    assert!(!report.skips.to_string().contains("secret"));
    let heard = casting.join().unwrap();
    assert!(heard.starts_with("GET /BASE HTTP/1.1"), "{heard}");
}

#[test]
fn a_recorded_base_corrects_what_comes_after_it() {
    let (world, folder) = (World::new(), tempfile::tempdir().unwrap());
    // The base begins with the rover's sixth epoch.
    let late = ObservationEpoch { time_gps: world.rover[5].epoch.time_gps, ..world.base[5].epoch.clone() };
    let path = write(folder.path(), "base.rnx", &rinex(&[late], Some(world.base[5].truth.position)));
    let hub = Hub::listen();
    let corrections = corrections(CorrectionSource::File(path), None);
    let report = run_agent(&hub, world.recording(folder.path()), world.wrong_products(), corrections);
    let errors = world.errors_m(&hub.receive(EPOCHS));
    println!("{errors:.3?} m, {:?}; {}", report.corrections, report.skips);
    assert!(errors[..5].iter().all(|error| *error > 1.2), "nothing is known before: {errors:?}");
    assert!(errors[5..].iter().all(|error| *error < 0.2), "{errors:?}");
    assert_eq!(report.skips.count(Reason::EpochWithoutCorrections), 5, "{}", report.skips);
}

#[test]
fn a_base_without_a_position_and_a_caster_that_refuses_are_told() {
    let (world, folder) = (World::new(), tempfile::tempdir().unwrap());
    let path = write(folder.path(), "base.rnx", &world.base_rinex(None));
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let refusing = limits::spawn(move || {
        let mut connection = listener.accept().unwrap().0;
        let mut request = [0; 1_000];
        let _ = connection.read(&mut request).unwrap();
        connection.write_all(b"HTTP/1.1 401 Unauthorized\r\n\r\n").unwrap();
    });
    let caster = format!("ntrip://me:secret@{address}/BASE").parse().unwrap();
    let corrections =
        Corrections { sources: vec![CorrectionSource::File(path), caster], ..Corrections::default() };
    let hub = Hub::listen();
    let report = run_agent(&hub, world.recording(folder.path()), world.wrong_products(), corrections);
    refusing.join().unwrap();
    assert_eq!(report.epochs_published, EPOCHS as u64, "the rover goes on without");
    let skips = report.skips.to_string();
    for said in [
        "without a position of the base, not used: --base-position",
        "corrections: source failed",
        "refuses user 'me'",
    ] {
        assert!(skips.contains(said), "expected '{said}' in: {skips}");
    }
    assert!(!skips.contains("secret"), "{skips}");
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // weeks, issues and what the message type rounds
fn message_1019(ephemeris: &KeplerEphemeris) -> Vec<u8> {
    let semicircles = |rad: f64| rad / std::f64::consts::PI;
    let message = Message::Msg1019(Msg1019T {
        gps_satellite_id: ephemeris.satellite.number,
        gps_week_number: (ephemeris.toe.week() % 1024) as u16,
        ura_index: 0,
        idot_sc_s: semicircles(ephemeris.i_dot_radps),
        iode: ephemeris.issue_of_data as u8,
        toc_s: ephemeris.toc.tow_s() as f32,
        af2_s_s2: ephemeris.clock.2 as f32,
        af1_s_s: ephemeris.clock.1 as f32,
        af0_s: ephemeris.clock.0,
        iodc: ephemeris.issue_of_data as u16,
        crs_m: ephemeris.crc_crs_m.1 as f32,
        delta_n_sc_s: semicircles(ephemeris.delta_n_radps) as f32,
        m0_sc: semicircles(ephemeris.m0_rad),
        cuc_rad: ephemeris.cuc_cus_rad.0 as f32,
        eccentricity: ephemeris.eccentricity,
        cus_rad: ephemeris.cuc_cus_rad.1 as f32,
        sqrt_a_sqrt_m: ephemeris.sqrt_a,
        toe_s: ephemeris.toe.tow_s() as f32,
        cic_rad: ephemeris.cic_cis_rad.0 as f32,
        omega0_sc: semicircles(ephemeris.omega0_rad),
        cis_rad: ephemeris.cic_cis_rad.1 as f32,
        i0_sc: semicircles(ephemeris.i0_rad),
        crc_m: ephemeris.crc_crs_m.0 as f32,
        omega_sc: semicircles(ephemeris.omega_rad),
        omegadot_sc_s: semicircles(ephemeris.omega_dot_radps),
        tgd_s: ephemeris.group_delays_s.0 as f32,
        ..Msg1019T::default()
    });
    MessageBuilder::new().build_message(&message).unwrap().to_vec()
}

/// The rover has no orbits of its own; a server sends them and closes.
#[test]
fn ephemerides_of_a_server_are_enough_for_positions() {
    let (world, folder) = (World::new(), tempfile::tempdir().unwrap());
    let is_gps = |e: &&KeplerEphemeris| e.satellite.constellation == Constellation::Gps;
    let stream: Vec<u8> = world.ephemerides.iter().filter(is_gps).flat_map(message_1019).collect();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let serving = limits::spawn(move || listener.accept().unwrap().0.write_all(&stream).unwrap());
    let millisecond = Duration::from_millis(1);
    let backoff =
        Backoff { first: millisecond, longest: millisecond, attempts: 1, silence: Duration::from_hours(1) };
    let server = LiveSource::Tcp { address, backoff };
    let Source::File { path, .. } = world.recording(folder.path()) else { panic!("a file") };
    let near = world.rover[0].epoch.time_gps;
    let hub = Hub::listen();
    let none = ProductSource::default();
    let report = run_agent(
        &hub,
        Source::File { path, near: Some(near) },
        none,
        corrections(CorrectionSource::Live(server), None),
    );
    serving.join().unwrap();
    let errors = world.errors_m(&hub.receive(EPOCHS));
    println!("{errors:.1?} m; {}", report.skips);
    // No ionosphere is known.
    assert!(errors.iter().all(|error| *error < 20.0), "{errors:?}");
}
