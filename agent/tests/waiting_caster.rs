//! Casters of virtual reference stations send nothing before they know where the rover is.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod caster;
mod hub_support;
mod limits;
mod recordings;

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::time::Duration;

use cofix_agent::input::{Backoff, LiveSource};
use cofix_agent::{
    AgentConfig, AgentReport, CorrectionSource, Corrections, ProductSource, Source, Stop, run,
};
use cofix_common::frames::{Ecef, Geodetic};
use cofix_common::orbit::Products;

use caster::{head, read_head};
use hub_support::Hub;
use recordings::rinex_3;

/// A caster with one connection, on which it sends what it has after a GGA; it hands back the GGA, empty when none came.
fn waiting_caster(body: Vec<u8>) -> (LiveSource, limits::Running<String>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let mount = format!("ntrip://{}/VRS", listener.local_addr().unwrap());
    let thread = limits::spawn(move || {
        let (mut connection, _) = listener.accept().unwrap();
        connection.set_read_timeout(Some(Duration::from_mins(1))).unwrap();
        read_head(&mut connection);
        connection.write_all(&head("ICY 200 OK")).unwrap();
        let sentence = read_line(&mut connection);
        if !sentence.is_empty() {
            connection.write_all(&body).unwrap();
        }
        sentence
    });
    let LiveSource::Ntrip { mount, .. } = mount.parse().unwrap() else { panic!("a caster") };
    let millisecond = Duration::from_millis(1);
    let silence = Duration::from_millis(300);
    (
        LiveSource::Ntrip {
            mount,
            backoff: Backoff { first: millisecond, longest: millisecond, attempts: 1, silence },
        },
        thread,
    )
}

/// Reads until the line's end, or until the client goes.
fn read_line(connection: &mut TcpStream) -> String {
    let mut line = Vec::new();
    let mut byte = [0];
    while !line.ends_with(b"\r\n") && connection.read(&mut byte).is_ok_and(|count| count == 1) {
        line.push(byte[0]);
    }
    String::from_utf8(line).unwrap()
}

/// A recording of twelve epochs, with a position in its header or without.
fn recording(folder: &Path, position: Option<Ecef>) -> Source {
    let mut recording = rinex_3(12);
    if let Some(Ecef(p)) = position {
        let line = format!("{:14.4}{:14.4}{:14.4}{:18}APPROX POSITION XYZ \n", p.x, p.y, p.z, "");
        let header = String::from_utf8(recording.header).unwrap();
        let end = header.find("END OF HEADER").unwrap() - 60;
        recording.header = [&header[..end], &line, &header[end..]].concat().into_bytes();
    }
    let path = folder.join("phone.rnx");
    std::fs::write(&path, recording.bytes()).unwrap();
    Source::File { path, near: None }
}

fn base() -> Vec<u8> {
    recordings::rtcm(12).bytes()
}

/// Runs an agent without orbits, so that it never has a position of its own.
fn run_agent(config: AgentConfig) -> AgentReport {
    let products = ProductSource::Loaded(std::sync::Arc::new(Products::new(Vec::new(), Vec::new())));
    run(&AgentConfig { products, ..config }, &Stop::default()).unwrap()
}

#[test]
fn a_known_position_is_told_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let place = Geodetic::from_degrees(48.25, 11.5, 520.0).geodetic_to_ecef();
    for known_by in ["header", "base", "option"] {
        let (source, serving) = waiting_caster(base());
        let corrections = Corrections {
            sources: vec![CorrectionSource::Live(source)],
            base_position: (known_by == "base").then_some(place),
            ..Corrections::default()
        };
        let hub = Hub::listen();
        let config = AgentConfig {
            corrections,
            approximate_position: (known_by == "option").then_some(place),
            ..hub.agent(recording(folder.path(), (known_by == "header").then_some(place)))
        };
        let report = run_agent(config);
        let sentence = serving.join().unwrap();
        assert!(sentence.contains(",4815.00000,N,01130.00000,E,"), "{known_by}: '{sentence}'");
        assert_eq!(report.skips.count(NOTHING), 0, "{known_by}: {}", report.skips);
        assert_eq!(report.solutions, 0);
    }
}

const NOTHING: &str = "corrections: source brought neither an ephemeris nor an epoch of a base";

#[test]
fn without_a_position_it_is_said_why_nothing_comes() {
    let folder = tempfile::tempdir().unwrap();
    // Zeros in a header are no position.
    for position in [None, Some(Ecef::new(0.0, 0.0, 0.0))] {
        let (source, serving) = waiting_caster(base());
        let corrections =
            Corrections { sources: vec![CorrectionSource::Live(source)], ..Corrections::default() };
        let hub = Hub::listen();
        let config = AgentConfig { corrections, ..hub.agent(recording(folder.path(), position)) };
        let report = run_agent(config);
        assert_eq!(serving.join().unwrap(), "");
        assert_eq!(report.epochs_published, 12);
        assert_eq!(report.skips.count(NOTHING), 1, "{}", report.skips);
        assert!(report.skips.to_string().contains("--approximate-position"), "{}", report.skips);
    }
}

/// The phone's own observations come from such a caster, too.
#[test]
fn a_caster_of_the_phones_own_observations_hears_the_position() {
    let (from, serving) = waiting_caster(base());
    let hub = Hub::listen();
    let near = Some("2020-08-13T14:00:00".parse().unwrap());
    let config = AgentConfig {
        approximate_position: Some(Geodetic::from_degrees(-33.5, -70.5, 600.0).geodetic_to_ecef()),
        ..hub.agent(Source::Live { from, near })
    };
    let report = run_agent(config);
    assert!(serving.join().unwrap().contains(",3330.00000,S,07030.00000,W,"));
    assert_eq!(report.epochs_published, 12, "{}", report.skips);
}
