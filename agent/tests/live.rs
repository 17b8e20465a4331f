//! A whole agent on live sources, against a listener on loopback that plays the hub.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod hub_support;
mod limits;
mod recordings;

use std::io::Write;
use std::net::TcpListener;
use std::time::Duration;

use cofix_agent::input::{Backoff, LiveSource};
use cofix_agent::{AgentConfig, AgentReport, Source, Speed, Stop, run};
use cofix_common::skips::Reason;
use cofix_common::wire::PhoneStatus;

use hub_support::Hub;
use recordings::{ONE_SATELLITE_HEADER, one_satellite_epoch};

fn config(hub: &Hub, source: LiveSource) -> AgentConfig {
    // Would take a day for each epoch, were the speed obeyed.
    AgentConfig { speed: Speed::Times(1e-5), ..hub.agent(Source::Live { from: source, near: None }) }
}

/// Receives this range of epochs, numbered without a gap.
fn receive(hub: &Hub, sequence: std::ops::Range<u64>) {
    for number in sequence {
        assert_eq!(hub.receive(1)[0].sequence, number);
    }
}

/// Checks the agent's first and last status.
fn check(hub: &Hub, report: &AgentReport, epochs: u64) {
    assert_eq!(report.epochs_published, epochs);
    let statuses = hub.statuses.lock().unwrap();
    let [
        PhoneStatus::Started { summary, epochs_expected: None },
        PhoneStatus::Finished { epochs_published, error: None, .. },
    ] = &statuses[..]
    else {
        panic!("{statuses:?}")
    };
    assert!(summary.contains("live"), "{summary}");
    assert_eq!(*epochs_published, epochs);
}

#[test]
fn a_growing_file_is_published_as_it_grows_until_a_stop() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.rnx");
    std::fs::write(
        &path,
        ONE_SATELLITE_HEADER.to_owned() + &one_satellite_epoch(1) + &one_satellite_epoch(2),
    )
    .unwrap();
    let hub = Hub::listen();
    let config = config(&hub, LiveSource::Follow(path.clone()));
    let asked = Stop::default();
    let stop = asked.clone();
    let agent = limits::spawn(move || run(&config, &stop));
    receive(&hub, 0..2);
    let mut file = std::fs::OpenOptions::new().append(true).open(&path).unwrap();
    file.write_all((one_satellite_epoch(3) + &one_satellite_epoch(4)).as_bytes()).unwrap();
    receive(&hub, 2..4);
    asked.request();
    let report = agent.join().unwrap().unwrap();
    assert!(report.stopped);
    check(&hub, &report, 4);
}

/// The last epoch of a log is complete when another one begins, or with the end.
#[test]
fn a_request_to_stop_leaves_no_epoch_behind() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.txt");
    std::fs::write(&path, recordings::log(5).bytes()).unwrap();
    let hub = Hub::listen();
    let config = config(&hub, LiveSource::Follow(path));
    let asked = Stop::default();
    let stop = asked.clone();
    let agent = limits::spawn(move || run(&config, &stop));
    receive(&hub, 0..4);
    asked.request();
    let report = agent.join().unwrap().unwrap();
    receive(&hub, 4..5);
    check(&hub, &report, 5);
}

#[test]
fn a_server_that_drops_the_connection_costs_no_later_epoch() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let serving = limits::spawn(move || {
        let mut first = listener.accept().unwrap().0;
        first
            .write_all(
                (ONE_SATELLITE_HEADER.to_owned() + &one_satellite_epoch(1) + &one_satellite_epoch(2))
                    .as_bytes(),
            )
            .unwrap();
        drop(first);
        let mut second = listener.accept().unwrap().0;
        second
            .write_all(("noise\n".to_owned() + &one_satellite_epoch(3) + &one_satellite_epoch(4)).as_bytes())
            .unwrap();
    });
    let hub = Hub::listen();
    let millisecond = Duration::from_millis(1);
    let backoff =
        Backoff { first: millisecond, longest: millisecond, attempts: 3, silence: Duration::from_hours(1) };
    let config = config(&hub, LiveSource::Tcp { address, backoff });
    let report = run(&config, &Stop::default()).unwrap();
    serving.join().unwrap();
    receive(&hub, 0..4);
    check(&hub, &report, 4);
    assert!(!report.stopped);
    assert_eq!(report.skips.count(Reason::ConnectionOpenedAgain), 1);
    assert_eq!(report.skips.count(Reason::SourceEndedEarly), 1, "{}", report.skips);
}

/// A server that sends a header and goes.
#[test]
fn a_live_source_that_ends_without_an_epoch_is_a_failure_and_says_so_to_the_hub() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let serving = std::thread::spawn(move || {
        listener
            .accept()
            .unwrap()
            .0
            .write_all((ONE_SATELLITE_HEADER.to_owned() + "> 2020 13 41 14 19  2.0  0  1\n").as_bytes())
            .unwrap();
    });
    let hub = Hub::listen();
    let millisecond = Duration::from_millis(1);
    let backoff =
        Backoff { first: millisecond, longest: millisecond, attempts: 2, silence: Duration::from_hours(1) };
    let config = config(&hub, LiveSource::Tcp { address, backoff });
    let error = run(&config, &Stop::default()).unwrap_err().to_string();
    serving.join().unwrap();
    assert!(error.contains("it ended without one epoch; skipped: "), "{error}");
    let statuses = hub.statuses.lock().unwrap();
    let Some(PhoneStatus::Finished { error: Some(told), .. }) = statuses.last() else {
        panic!("{statuses:?}")
    };
    assert_eq!(*told, error);
}
