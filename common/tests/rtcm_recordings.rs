//! The raw stream of the car's module gives the observations that another program wrote into a RINEX file.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod beside;

use beside::required;
use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::rinex::ObservationFile;
use cofix_common::formats::rtcm::{RtcmDecoder, RtcmOptions};
use cofix_common::gnss::{Observation, ObservationEpoch};
use cofix_common::skips::{Reason, Skips};

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
            Record::Glonass(e) => panic!("no ephemerides in this stream, but {}", e.satellite),
            Record::Event(event) => panic!("no events in this stream, but {event:?}"),
        })
        .collect()
}

/// A value as the RINEX file prints it, thousandths.
fn printed(value: Option<f64>) -> Option<i64> {
    #[allow(clippy::cast_possible_truncation)]
    value.map(|v| (v * 1e3).round() as i64)
}

/// Code and phase agree to the millimetre and the thousandth of a cycle that RINEX prints, for every satellite and epoch.
///
/// The other program begins three epochs and one message later than the stream, and leaves out a last epoch of which only one
/// message was recorded. Its loss-of-lock
/// digits are a sum of 1 for a slip and 3 for a half cycle: 3 is a half cycle alone and 4 is both, of which RINEX readers
/// see nothing. It compares lock times only with zero and the last one, not with the time that has passed.
#[test]
#[ignore = "needs the reference data"]
fn the_streams_observations_are_those_of_the_rinex_files() {
    for (session, epochs, observations) in [("WH-3-08", 706, 12_514), ("WH-3-09", 497, 8_820)] {
        let path = |name: &str| format!("data/whu-wuhan-2020-08-13/{session}/{name}");
        let (stream, rinex) = (required(&path("MXT.rtcm3")), required(&path("MXT.rnx")));
        let (ours, skips) = decode(&stream, stream.len());
        let theirs = ObservationFile::parse(&rinex).unwrap().epochs;
        println!("{session}: {} epochs against {}; skipped: {skips}", ours.len(), theirs.len());
        assert_eq!(ours.len(), epochs);
        assert_eq!(
            skips.count(Reason::ByteOutsideAnyFrame) + cut_off(&skips) + lacking(&skips),
            skips.total(),
            "{skips}"
        );
        let mut compared = Compared::default();
        for epoch in &theirs {
            let mine = ours.iter().find(|o| o.time_gps == epoch.time_gps).expect("every epoch of theirs");
            for observation in &epoch.observations {
                let same =
                    |o: &&Observation| (o.satellite, o.signal) == (observation.satellite, observation.signal);
                let mine = mine.observations.iter().find(same).expect("every observation of theirs");
                compared.add(mine, observation);
            }
        }
        println!("{compared:?}");
        assert_eq!(
            compared,
            Compared { observations, other_slips: compared.other_slips, ..Compared::default() }
        );
        assert!(compared.other_slips * 100 < observations, "{compared:?}");
        let (first, last) = (theirs.first().unwrap().time_gps, theirs.last().unwrap().time_gps);
        let total = |epochs: &[ObservationEpoch], after| -> usize {
            epochs
                .iter()
                .filter(|e| e.time_gps > after && e.time_gps <= last)
                .map(|e| e.observations.len())
                .sum()
        };
        assert_eq!(
            total(&ours, first),
            total(&theirs, first),
            "what is ours alone comes before their second epoch"
        );
    }
}

/// How often a stream ended within a frame.
fn cut_off(skips: &Skips) -> u64 {
    skips.count(Reason::FrameCutOff)
}

/// How often the last epoch came without its last message.
fn lacking(skips: &Skips) -> u64 {
    skips.count(Reason::LastEpochLacksMessages)
}

#[derive(Debug, Default, PartialEq)]
struct Compared {
    observations: usize,
    other_codes: usize,
    other_phases: usize,
    other_half_cycles: usize,
    other_slips: usize,
}

impl Compared {
    fn add(&mut self, mine: &Observation, other: &Observation) {
        self.observations += 1;
        self.other_codes += usize::from(printed(mine.pseudorange_m) != printed(other.pseudorange_m));
        self.other_phases +=
            usize::from(printed(mine.carrier_phase_cycles) != printed(other.carrier_phase_cycles));
        let flags = |o: &Observation| (o.loss_of_lock.cycle_slip, o.loss_of_lock.half_cycle);
        match (flags(mine), flags(other)) {
            (mine, other) if mine == other => {}
            // their 3 and 4
            ((false, true), (true, true)) | ((true, true), (false, false)) => {}
            ((mine, same), (other, also)) if mine != other && same == also => self.other_slips += 1,
            _ => self.other_half_cycles += 1,
        }
    }
}

#[test]
#[ignore = "needs the reference data"]
fn portions_of_the_recording_do_not_change_what_comes_out() {
    let stream = required("data/whu-wuhan-2020-08-13/WH-3-09/MXT.rtcm3");
    let whole = decode(&stream, stream.len());
    for portion in [1, 7, 1_000] {
        assert!(decode(&stream, portion) == whole, "portions of {portion}");
    }
}
