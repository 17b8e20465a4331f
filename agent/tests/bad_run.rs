//! A recording with several defects through the whole agent, and on the command line: one summary at the end names each.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod recordings;

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use assert_cmd::Command;
use cofix_agent::pipeline::PipelineOptions;
use cofix_agent::{AgentConfig, ProductSource, Source, Speed, Stop, link, run};
use cofix_common::wire::{PhoneStatus, StatusMessage, all_receipts_key, decode, epoch_key, status_key};
use recordings::{Recording, compact, log, rinex_2, rinex_3, rtcm, table};
use zenoh::{Session, Wait};

/// Of ten epochs one is damaged, one comes twice, one has a line of a million columns before it, and one has invalid text
/// behind it; the file ends within a line. What each format must name.
fn spoiled(format: fn(i64) -> Recording) -> (Recording, [&'static str; 2]) {
    let mut recording = format(10);
    recording.epochs.insert(4, recording.epochs[3].clone());
    let long = [vec![b'9'; 1_000_000], b"\n".to_vec()].concat();
    recording.epochs[6].extend(long);
    recording.epochs[8].extend(b"\xff\xfe\x80\n");
    let due = match recording.name {
        "RINEX 2" | "RINEX 3" | "Compact RINEX" => ["epoch repeats the time", "line too long"],
        "GnssLogger" => ["signal repeated in its epoch", "line too long"],
        "challenge table" => ["signal twice in one epoch", "line too long"],
        _ => ["message repeated", "byte outside any frame"],
    };
    (recording, due)
}

/// Plays the hub: counts epochs, confirms them, and keeps the statuses.
fn listen(session: &Session) -> Arc<Mutex<Vec<PhoneStatus>>> {
    let count = Arc::new(AtomicU64::new(0));
    let counted = Arc::clone(&count);
    let epochs = session.declare_subscriber(epoch_key("g", "p").unwrap());
    let add = move |_| {
        counted.fetch_add(1, Ordering::SeqCst);
    };
    epochs.callback(add).background().wait().unwrap();
    let statuses = Arc::new(Mutex::new(Vec::new()));
    let heard = Arc::clone(&statuses);
    let status = session.declare_subscriber(status_key("g", "p").unwrap());
    let keep = move |sample: zenoh::sample::Sample| {
        let message: StatusMessage = decode(&sample.payload().to_bytes()).unwrap();
        heard.lock().unwrap().push(message.status);
    };
    status.callback(keep).background().wait().unwrap();
    let receipts = session.declare_queryable(all_receipts_key("g").unwrap());
    let confirm = move |query: zenoh::query::Query| {
        query.reply(query.key_expr().clone(), count.load(Ordering::SeqCst).to_string()).wait().unwrap();
    };
    receipts.callback(confirm).background().wait().unwrap();
    statuses
}

#[test]
fn the_hub_hears_what_was_skipped() {
    let folder = tempfile::tempdir().unwrap();
    for format in [rinex_2, rinex_3, compact, log, table, rtcm] {
        let (recording, due) = spoiled(format);
        let path = folder.path().join("spoiled");
        std::fs::write(&path, recording.bytes()).unwrap();
        let session = link::listen(&["tcp/127.0.0.1:0".to_owned()]).unwrap();
        let statuses = listen(&session);
        let config = AgentConfig {
            group: "g".to_owned(),
            phone: "p".to_owned(),
            source: Source::DatedFile { path, near: "2020-08-13T14:00:00".parse().unwrap() },
            products: ProductSource::Loaded(Arc::default()),
            connect: session.info().locators().wait().iter().map(ToString::to_string).collect(),
            speed: Speed::Maximum,
            pipeline: PipelineOptions::default(),
            patience: Duration::from_secs(20),
            kept_messages: 100,
        };
        let report = run(&config, &Stop::default()).unwrap();
        assert_eq!(report.epochs_published, 10, "{}: {}", recording.name, report.skips);
        let statuses = statuses.lock().unwrap();
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
            command.current_dir(folder.path()).args(arguments).args(["--date", "2020-08-13T14:00:00"]);
            let output = command.assert().success().get_output().clone();
            String::from_utf8([output.stdout, output.stderr].concat()).unwrap()
        };
        let inspected = output(&["inspect", "spoiled"]);
        let converted = output(&["convert", "spoiled", "--observations", "out.rnx"]);
        assert!(converted.contains("wrote 10 epochs"), "{}: {converted}", recording.name);
        for (said, reason) in [&inspected, &converted].into_iter().flat_map(|said| due.map(|due| (said, due)))
        {
            assert_eq!(said.matches(reason).count(), 1, "{}: '{reason}' in {said}", recording.name);
        }
    }
}
