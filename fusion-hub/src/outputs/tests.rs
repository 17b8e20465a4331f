//! Sinks fail alone.

use std::sync::{Arc, Mutex};

use anyhow::bail;
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;

use super::*;

/// Takes down what happens to it, and fails at the epoch of this number.
struct Noting {
    title: &'static str,
    fails_at: Option<usize>,
    epochs: usize,
    log: Arc<Mutex<Vec<String>>>,
}

impl Noting {
    fn note(&self, what: &str) {
        self.log.lock().unwrap().push(format!("{}: {what}", self.title));
    }
}

impl Sink for Noting {
    fn epoch(&mut self, fused: &Fused<'_>) -> anyhow::Result<()> {
        self.epochs += 1;
        if self.fails_at == Some(self.epochs) {
            bail!("{}: the disk is full", self.title);
        }
        self.note(&format!("{} of {}", self.epochs, fused.phones.join(" ")));
        Ok(())
    }

    fn tick(&mut self, _moment: Moment) -> anyhow::Result<()> {
        self.note("tick");
        Ok(())
    }

    fn finish(self: Box<Self>, text: &str) -> Result<Option<Written>, String> {
        self.note(text);
        Ok(Some(Written {
            title: self.title,
            path: PathBuf::new(),
            figures: String::new(),
            skips: Skips::default(),
        }))
    }

    fn remove(self: Box<Self>) {
        self.note("removed");
    }
}

/// Outputs with two sinks beside the publisher, the first of which fails at the second epoch.
fn outputs() -> (Outputs, Arc<Mutex<Vec<String>>>) {
    let names = ["a".to_owned()];
    let scores = Scores::new(vec![("a".to_owned(), None)], vec![1]);
    let mut outputs = Outputs::new(&names, FusedPublisher::nowhere(), scores);
    let log = Arc::default();
    for (title, fails_at) in [("first", Some(2)), ("second", None)] {
        outputs.sinks.push(Box::new(Noting { title, fails_at, epochs: 0, log: Arc::clone(&log) }));
    }
    (outputs, log)
}

fn epoch(second: f64) -> FusedEpoch {
    let time_gps = GpsTime::from_week_tow(2118, second);
    FusedEpoch {
        time_gps,
        phones: Vec::new(),
        actions: Vec::new(),
        distances: Vec::new(),
        events: Vec::new(),
    }
}

#[test]
fn a_sink_that_fails_ends_alone_and_is_told_of() {
    let (mut outputs, log) = outputs();
    outputs.push(&epoch(1.0));
    assert_eq!(outputs.failure(), None);
    outputs.push(&epoch(2.0));
    outputs.tick(Moment { now: std::time::Duration::ZERO, wall_gps: GpsTime::from_week_tow(2118, 2.0) });
    outputs.push(&epoch(3.0));
    assert_eq!(outputs.failure(), Some("first: the disk is full"));
    let whole: Vec<_> = outputs.finish("text").iter().map(|written| written.title).collect();
    assert_eq!(whole, ["second"]);
    let expected = [
        "first: 1 of a",
        "second: 1 of a",
        "second: 2 of a",
        "second: tick",
        "second: 3 of a",
        "second: text",
    ];
    assert_eq!(*log.lock().unwrap(), expected);
    assert_eq!(outputs.tally.epochs, 3);
}

#[test]
fn what_is_removed_is_not_finished() {
    let (mut outputs, log) = outputs();
    outputs.remove();
    assert!(outputs.finish("text").is_empty());
    assert_eq!(*log.lock().unwrap(), ["first: removed", "second: removed"]);
}

#[test]
fn every_file_is_named_for_the_checks() {
    let path = |name: &str| Some(PathBuf::from(name));
    let files = OutputFiles {
        recording: path("a.rrd"),
        report: path("a.json"),
        positions: path("a.csv"),
        ..OutputFiles::default()
    };
    let named: Vec<_> = files.named().iter().map(|named| named.what.clone()).collect();
    assert_eq!(named, ["the recording", "the positions", "the report"]);
}
