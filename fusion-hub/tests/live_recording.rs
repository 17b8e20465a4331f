//! What a live recording holds when the hub is killed.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod support;

use std::time::Duration;

use cofix_hub::outputs::recorder::Recorder;

use support::Session;

#[test]
fn epochs_that_are_old_enough_are_written_before_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let session = Session { epochs: 20, phones: 2, satellites: 6, seed: 1 };
    let written = |name: &str, age: Option<Duration>| {
        let path = folder.path().join(name);
        let mut recorder = Recorder::to_file(&path, &session.config()).unwrap();
        if let Some(age) = age {
            recorder.write_after(age);
        }
        let mut sizes = Vec::new();
        for epoch in session.epochs() {
            recorder.record(&epoch, &[]).unwrap();
            recorder.tick().unwrap();
            sizes.push(std::fs::metadata(&path).unwrap().len());
        }
        sizes
    };
    let at_once = written("at-once.rrd", Some(Duration::ZERO));
    assert!(at_once.windows(2).all(|pair| pair[0] < pair[1]), "{at_once:?}");
    for age in [None, Some(Duration::from_hours(1))] {
        let later = written("later.rrd", age);
        assert!(later.windows(2).all(|pair| pair[0] == pair[1]), "{later:?}");
    }
}
