//! The raw stream of the car's module gives the observations that another program wrote into a RINEX file.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

use std::path::PathBuf;

use cofix_common::decode::{Decoder, Record};
use cofix_common::gnss::{Observation, ObservationEpoch};
use cofix_common::rinex::ObservationFile;
use cofix_common::rtcm::{RtcmDecoder, RtcmOptions};
use cofix_common::skips::Skips;

fn shared(path: &str) -> Option<Vec<u8>> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared")).join(path);
    let bytes = std::fs::read(&path).ok();
    if bytes.is_none() {
        println!("skipped: {} is not here", path.display());
    }
    bytes
}

fn decode(bytes: &[u8], portion: usize) -> (Vec<ObservationEpoch>, Skips) {
    let mut decoder = RtcmDecoder::new(RtcmOptions::near("2020-08-12T00:00:00".parse().unwrap()));
    let mut epochs = Vec::new();
    for chunk in bytes.chunks(portion) {
        decoder.feed(chunk).unwrap();
        epochs.extend(take(&mut decoder));
    }
    decoder.finish().unwrap();
    epochs.extend(take(&mut decoder));
    (epochs, decoder.skips().clone())
}

fn take(decoder: &mut RtcmDecoder) -> Vec<ObservationEpoch> {
    std::iter::from_fn(|| decoder.next_record())
        .map(|record| match record {
            Record::Epoch(epoch) => epoch,
            Record::Ephemeris(e) => panic!("no ephemerides in this stream, but {}", e.satellite),
        })
        .collect()
}

/// A value as the RINEX file prints it, thousandths.
fn printed(value: Option<f64>) -> Option<i64> {
    #[allow(clippy::cast_possible_truncation)]
    value.map(|v| (v * 1e3).round() as i64)
}

#[test]
fn the_streams_observations_are_those_of_the_rinex_files() {
    for session in ["WH-3-08", "WH-3-09"] {
        let path = |name: &str| format!("data/whu-wuhan-2020-08-13/{session}/{name}");
        let (Some(stream), Some(rinex)) = (shared(&path("MXT.rtcm3")), shared(&path("MXT.rnx"))) else {
            return;
        };
        let (ours, skips) = decode(&stream, stream.len());
        let theirs = ObservationFile::parse(&rinex).unwrap().epochs;
        println!("{session}: {} epochs and {}; skipped: {skips}", ours.len(), theirs.len());
        let mut counts = Counts::default();
        for epoch in &theirs {
            let Some(mine) = ours.iter().find(|o| o.time_gps == epoch.time_gps) else {
                println!("missing {}", epoch.time_gps);
                continue;
            };
            for observation in &epoch.observations {
                let same =
                    |o: &&Observation| (o.satellite, o.signal) == (observation.satellite, observation.signal);
                match mine.observations.iter().find(same) {
                    Some(mine) => counts.compare(epoch, mine, observation),
                    None => println!("missing {} {} {observation:?}", epoch.time_gps, observation.satellite),
                }
            }
            counts.extra += mine.observations.len() - epoch.observations.len();
        }
        println!("{counts:?}");
    }
}

#[derive(Debug, Default)]
struct Counts {
    observations: usize,
    codes: usize,
    phases: usize,
    slips: [[usize; 2]; 2],
    halves: [[usize; 2]; 2],
    extra: usize,
}

impl Counts {
    fn compare(&mut self, epoch: &ObservationEpoch, mine: &Observation, other: &Observation) {
        self.observations += 1;
        let (code, phase) = (printed(mine.pseudorange_m), printed(mine.carrier_phase_cycles));
        if code == printed(other.pseudorange_m) {
            self.codes += 1
        } else if self.observations - self.codes < 10 {
            println!("{} {mine:?} {other:?}", epoch.time_gps)
        }
        if phase == printed(other.carrier_phase_cycles) {
            self.phases += 1
        } else if self.observations - self.phases < 10 {
            println!("{} {mine:?} {other:?}", epoch.time_gps)
        }
        self.slips[usize::from(mine.loss_of_lock.cycle_slip)][usize::from(other.loss_of_lock.cycle_slip)] +=
            1;
        self.halves[usize::from(mine.loss_of_lock.half_cycle)][usize::from(other.loss_of_lock.half_cycle)] +=
            1;
    }
}
