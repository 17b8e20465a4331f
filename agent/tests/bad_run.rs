//! A recording with several defects through the whole agent, and on the command line: one summary at the end names each.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod hub_support;
mod limits;
mod recordings;

use std::sync::Arc;

use assert_cmd::Command;
use cofix_agent::{AgentConfig, ProductSource, Source, Stop, run};
use cofix_common::simulation::{Scenario, Simulation};
use cofix_common::skips::Reason;
use cofix_common::wire::{PhoneStatus, WIRE_VERSION};

use hub_support::Hub;
use recordings::{Recording, compact, log, rinex_2, rinex_3, rtcm, table};

/// Of ten epochs one is damaged, one comes twice, one has a line of a million columns before it, and one has invalid text
/// behind it; the file ends within a line. What each format must name.
fn spoiled(format: fn(i64) -> Recording) -> (Recording, [&'static str; 2]) {
    let mut recording = format(10);
    recording.epochs.insert(4, recording.epochs[3].clone());
    let long = [vec![b'9'; 1_000_000], b"\n".to_vec()].concat();
    recording.epochs[6].extend(long);
    recording.epochs[8].extend(b"\xff\xfe\x80\n");
    let due = match recording.name {
        "RINEX 2" | "RINEX 3" | "Compact RINEX" => ["epoch repeats the time", Reason::LineTooLong.text()],
        "GnssLogger" => [Reason::SignalRepeated.text(), Reason::LineTooLong.text()],
        "challenge table" => [Reason::SignalTwice.text(), Reason::LineTooLong.text()],
        _ => [Reason::MessageRepeated.text(), Reason::ByteOutsideAnyFrame.text()],
    };
    (recording, due)
}

#[test]
fn the_hub_hears_what_was_skipped() {
    let folder = tempfile::tempdir().unwrap();
    // Of another day: nothing is solved, which is not what is tested here.
    let orbits = Simulation::new(Scenario::default()).unwrap();
    for format in [rinex_2, rinex_3, compact, log, table, rtcm] {
        let (recording, due) = spoiled(format);
        let path = folder.path().join("spoiled");
        std::fs::write(&path, recording.bytes()).unwrap();
        let hub = Hub::listen();
        let source = Source::File { path, near: "2020-08-13T14:00:00".parse().ok() };
        let products = ProductSource::Loaded(Arc::new(orbits.products()));
        let config = AgentConfig { products, ..hub.agent(source) };
        let report = run(&config, &Stop::default()).unwrap();
        assert_eq!(report.epochs_published, 10, "{}: {}", recording.name, report.skips);
        let statuses = hub.statuses.lock().unwrap();
        let Some(PhoneStatus::Finished { epochs_published: 10, skips, error: None }) = statuses.last() else {
            panic!("{}: {statuses:?}", recording.name)
        };
        for reason in due {
            let (said, reported) = (skips.to_string(), report.skips.to_string());
            assert!(said.contains(reason) && reported.contains(reason), "{}: {said}", recording.name);
        }
    }
}

#[test]
fn the_command_line_names_what_was_skipped() {
    let folder = tempfile::tempdir().unwrap();
    for format in [rinex_2, rinex_3, compact, log, table, rtcm] {
        let (recording, due) = spoiled(format);
        std::fs::write(folder.path().join("spoiled"), recording.bytes()).unwrap();
        let output = |arguments: &[&str]| {
            let program = env!("CARGO_BIN_EXE_cofix-agent");
            let mut command = Command::new(program);
            command
                .timeout(limits::LIMIT)
                .current_dir(folder.path())
                .args(arguments)
                .args(["--date", "2020-08-13T14:00:00"]);
            let output = command.assert().success().get_output().clone();
            String::from_utf8([output.stdout, output.stderr].concat()).unwrap()
        };
        let inspected = output(&["inspect", "spoiled"]);
        let converted = output(&["convert", "spoiled", "--output-observations", "out.rnx", "--overwrite"]);
        assert!(converted.contains("wrote 10 epochs"), "{}: {converted}", recording.name);
        for (said, reason) in [&inspected, &converted].into_iter().flat_map(|said| due.map(|due| (said, due)))
        {
            assert_eq!(said.matches(reason).count(), 1, "{}: '{reason}' in {said}", recording.name);
        }
    }
}

#[test]
fn a_hub_of_another_version_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("good");
    std::fs::write(&path, rinex_3(10).bytes()).unwrap();
    let orbits = Simulation::new(Scenario::default()).unwrap();
    let answers: [fn(u64) -> Vec<u8>; 2] =
        [|received| received.to_string().into(), |_| b"CX\x63\0\x04".into()];
    for (answer, due) in answers.into_iter().zip(["1 bytes is shorter", "wire version 99"]) {
        let hub = Hub::listen_and_answer(answer);
        let products = ProductSource::Loaded(Arc::new(orbits.products()));
        let config = AgentConfig { products, ..hub.agent(Source::File { path: path.clone(), near: None }) };
        let error = run(&config, &Stop::default()).unwrap_err().to_string();
        assert!(
            error.contains(due) && error.contains(&format!("this agent speaks wire version {WIRE_VERSION}")),
            "{error}"
        );
    }
}
