//! A session of the WHU-Smartphone dataset as published, against the same as RINEX and CSV.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing)] // helpers of tests

mod beside;

use std::collections::BTreeMap;

use cofix_common::accuracy::Truth;
use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::packing::decompress;
use cofix_common::formats::rinex::ObservationFile;
use cofix_common::formats::whu::{SpareLogDecoder, truth_table};
use cofix_common::gnss::{Observation, ObservationEpoch, SatelliteId, SignalCode};
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;

const LOGS: [(&str, &str, usize); 4] = [
    ("XIM8", "2020_08_13_22_31_47.402_spare_log_XIM8", 13_514),
    ("HP30", "2020_08_13_22_31_50.443_spare_log_HP30", 15_184),
    ("HP20", "2020_08_13_22_31_50.844_spare_log_HP20", 8_640),
    ("VX30", "2020_08_13_22_31_52.210_spare_log_VX30", 11_386),
];
/// From here on a phase has too many digits for the program that made the RINEX files, cycles.
const LEFT_OUT_IN_RINEX_CYCLES: f64 = 1e9;

fn unpacked(name: &str) -> Vec<u8> {
    let packed = beside::required(&format!("data/whu-raw/{name}"));
    decompress(&packed).unwrap().into_owned()
}

fn decode(bytes: &[u8]) -> (Vec<ObservationEpoch>, SpareLogDecoder) {
    let mut decoder = SpareLogDecoder::default();
    decoder.feed(bytes).unwrap();
    decoder.finish().unwrap();
    let mut epochs = Vec::new();
    while let Some(record) = decoder.next_record() {
        let Record::Epoch(epoch) = record else { panic!("{record:?}") };
        epochs.push(epoch);
    }
    (epochs, decoder)
}

/// An epoch's values as F14.3, by satellite and signal: code, phase, Doppler, C/N0.
fn printed(epoch: &ObservationEpoch) -> BTreeMap<(SatelliteId, SignalCode), [String; 4]> {
    let digits = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.3}"));
    let values =
        |o: &Observation| [o.pseudorange_m, o.carrier_phase_cycles, o.doppler_hz, o.cn0_dbhz].map(digits);
    epoch.observations.iter().map(|o| ((o.satellite, o.signal), values(o))).collect()
}

#[test]
#[ignore = "needs the reference data"]
fn logs_equal_their_rinex_files_to_the_printed_digit() {
    let mut left_out = 0;
    for (phone, log, observations) in LOGS {
        let bytes = unpacked(&format!("{log}.txt.gz"));
        let (epochs, decoder) = decode(&bytes);
        let rinex = beside::required(&format!("data/whu-wuhan-2020-08-13/WH-3-09/{phone}.rnx"));
        let rinex = ObservationFile::parse(&rinex).unwrap();
        assert_eq!(epochs.len(), rinex.epochs.len(), "{phone}");
        for (ours, theirs) in epochs.iter().zip(&rinex.epochs) {
            // RINEX has seven digits of the second.
            assert!((ours.time_gps - theirs.time_gps).abs() <= 5e-8, "{phone}: {ours:?}");
            let (mut ours, theirs) = (printed(ours), printed(theirs));
            for (signal, values) in &mut ours {
                if theirs.get(signal).is_some_and(|theirs| theirs[1].is_empty()) && !values[1].is_empty() {
                    let phase: f64 = std::mem::take(&mut values[1]).parse().unwrap();
                    assert!(phase.abs() >= LEFT_OUT_IN_RINEX_CYCLES, "{phone} {signal:?}: {phase}");
                    left_out += 1;
                }
            }
            assert_eq!(ours, theirs, "{phone}");
        }
        let refused = decoder.skips().count(Reason::PhaseOutOfRange);
        assert_eq!(decoder.skips().total(), refused, "{phone}: {}", decoder.skips());
        left_out += refused;
        let count: usize = epochs.iter().map(|epoch| epoch.observations.len()).sum();
        assert_eq!(count, observations, "{phone}");
    }
    assert_eq!(left_out, 2_143, "phases that the RINEX files lack");
}

#[test]
#[ignore = "needs the reference data"]
fn the_truth_table_equals_the_csv() {
    let table = unpacked("20200813214030_XIM8.txt.gz");
    // The CSV has the names of the table's velocity columns.
    let csv = beside::required("data/whu-wuhan-2020-08-13/WH-3-09/XIM8.truth.csv");
    let csv = String::from_utf8(csv).unwrap();
    let csv = csv.replace("velocity_north_mps,velocity_east_mps", "velocity_east_mps,velocity_north_mps");
    let (csv, csv_skips) = Truth::parse_csv(csv.as_bytes()).unwrap();
    let (truth, skips) = truth_table(&table, GpsTime::from_week_tow(2118, 398_000.0)).unwrap();
    assert_eq!((skips.total(), csv_skips.total()), (1, 0), "the exchange: {skips}; {csv_skips}");
    let qualities: Vec<u8> = (0..=4).collect();
    for quality in &qualities {
        assert!(truth.times(&[*quality]).eq(csv.times(&[*quality])), "quality {quality}");
    }
    for time in csv.times(&qualities) {
        assert_eq!(truth.at(time, &qualities), csv.at(time, &qualities), "{time}");
    }
}
