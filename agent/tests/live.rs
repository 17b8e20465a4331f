//! A whole agent on live sources, against a listener on loopback that plays the hub.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

use std::io::Write;
use std::net::TcpListener;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use cofix_agent::input::{Backoff, LiveSource};
use cofix_agent::pipeline::PipelineOptions;
use cofix_agent::{
    AgentConfig, AgentReport, Corrections, ProductFiles, ProductSource, Source, Speed, Stop, link, run,
};
use cofix_common::wire::{
    EpochMessage, PhoneStatus, StatusMessage, all_receipts_key, decode, epoch_key, status_key,
};
use zenoh::{Session, Wait};

const HEADER: &str = "     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE
G    4 C1C L1C D1C S1C                                      SYS / # / OBS TYPES
                                                            END OF HEADER
";

fn epoch(second: u32) -> String {
    format!(
        "> 2020 08 13 14 19 {second:2}.0000000  0  1\nG07  22100000.000 8 116000000.000 8     -1200.000 8        45.000 8\n"
    )
}

/// What the agent said.
struct Hub {
    session: Session,
    epochs: Receiver<EpochMessage>,
    statuses: Arc<Mutex<Vec<PhoneStatus>>>,
}

impl Hub {
    fn listen() -> Self {
        let session = link::listen(&["tcp/127.0.0.1:0".to_owned()]).unwrap();
        let (sender, epochs) = channel();
        let sender = Mutex::new(sender);
        let received = Arc::new(AtomicU64::new(0));
        let counted = Arc::clone(&received);
        session
            .declare_subscriber(epoch_key("g", "p").unwrap())
            .callback(move |sample| {
                let message: EpochMessage = decode(&sample.payload().to_bytes()).unwrap();
                counted.fetch_add(1, Ordering::SeqCst);
                let _ = sender.lock().unwrap().send(message);
            })
            .background()
            .wait()
            .unwrap();
        let statuses = Arc::new(Mutex::new(Vec::new()));
        let heard = Arc::clone(&statuses);
        session
            .declare_subscriber(status_key("g", "p").unwrap())
            .callback(move |sample| {
                let message: StatusMessage = decode(&sample.payload().to_bytes()).unwrap();
                heard.lock().unwrap().push(message.status);
            })
            .background()
            .wait()
            .unwrap();
        session
            .declare_queryable(all_receipts_key("g").unwrap())
            .callback(move |query| {
                let count = received.load(Ordering::SeqCst).to_string();
                query.reply(query.key_expr().clone(), count).wait().unwrap();
            })
            .background()
            .wait()
            .unwrap();
        Self { session, epochs, statuses }
    }

    fn config(&self, source: LiveSource) -> AgentConfig {
        AgentConfig {
            group: "g".to_owned(),
            phone: "p".to_owned(),
            source: Source::Live { from: source, near: None },
            products: ProductSource::Files(ProductFiles::default()),
            corrections: Corrections::default(),
            connect: self.session.info().locators().wait().iter().map(ToString::to_string).collect(),
            // Would take a day for each epoch, were it obeyed.
            speed: Speed::Times(1e-5),
            log: cofix_common::gnsslogger::Options::default(),
            pipeline: PipelineOptions::default(),
            patience: Duration::from_secs(20),
            kept_messages: 100,
        }
    }

    /// Receives so many epochs; they are numbered without a gap.
    fn receive(&self, sequence: std::ops::Range<u64>) {
        for number in sequence {
            assert_eq!(self.epochs.recv_timeout(Duration::from_secs(20)).unwrap().sequence, number);
        }
    }

    /// Checks the agent's first and last words.
    fn check(&self, report: &AgentReport, epochs: u64) {
        assert_eq!(report.epochs_published, epochs);
        let statuses = self.statuses.lock().unwrap();
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
}

#[test]
fn a_growing_file_is_published_as_it_grows_until_a_stop() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.rnx");
    std::fs::write(&path, HEADER.to_owned() + &epoch(1) + &epoch(2)).unwrap();
    let hub = Hub::listen();
    let config = hub.config(LiveSource::Follow(path.clone()));
    let asked = Stop::default();
    let stop = asked.clone();
    let agent = std::thread::spawn(move || run(&config, &stop));
    hub.receive(0..2);
    let mut file = std::fs::OpenOptions::new().append(true).open(&path).unwrap();
    file.write_all((epoch(3) + &epoch(4)).as_bytes()).unwrap();
    hub.receive(2..4);
    asked.request();
    let report = agent.join().unwrap().unwrap();
    assert!(report.stopped);
    hub.check(&report, 4);
}

#[test]
fn a_server_that_drops_the_connection_costs_no_later_epoch() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let serving = std::thread::spawn(move || {
        let mut first = listener.accept().unwrap().0;
        first.write_all((HEADER.to_owned() + &epoch(1) + &epoch(2)).as_bytes()).unwrap();
        drop(first);
        let mut second = listener.accept().unwrap().0;
        second.write_all(("noise\n".to_owned() + &epoch(3) + &epoch(4)).as_bytes()).unwrap();
    });
    let hub = Hub::listen();
    let millisecond = Duration::from_millis(1);
    let backoff =
        Backoff { first: millisecond, longest: millisecond, attempts: 3, silence: Duration::from_hours(1) };
    let config = hub.config(LiveSource::Tcp { address, backoff });
    let report = run(&config, &Stop::default()).unwrap();
    serving.join().unwrap();
    hub.receive(0..4);
    hub.check(&report, 4);
    assert!(!report.stopped);
    assert_eq!(report.skips.count("connection lost and opened again, or file written anew"), 1);
    assert_eq!(report.skips.count("source ended before its end"), 1, "{}", report.skips);
}
