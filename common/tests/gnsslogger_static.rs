//! Two static logs of 2016, the first public version of the app.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod beside;

use std::collections::BTreeMap;

use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::gnsslogger::{BiasReference, FixProvider, GnssLoggerDecoder, Masks, Options};
use cofix_common::gnss::ObservationEpoch;
use cofix_common::skips::Reason;

const JUNE: &str = "pseudoranges_log_2016_06_30_21_26_07.txt";
const AUGUST: &str = "pseudoranges_log_2016_08_22_14_45_50.txt";

fn read(name: &str, options: Options) -> (Vec<ObservationEpoch>, GnssLoggerDecoder) {
    let text = beside::required(&format!("data/google-static-2016/{name}"));
    let mut decoder = GnssLoggerDecoder::new(options);
    decoder.feed(&text).unwrap();
    decoder.finish().unwrap();
    let mut epochs = Vec::new();
    while let Some(record) = decoder.next_record() {
        match record {
            Record::Epoch(epoch) => epochs.push(epoch),
            other => panic!("{other:?}: these logs have no Nav lines"),
        }
    }
    (epochs, decoder)
}

fn per_signal(epochs: &[ObservationEpoch]) -> Vec<(String, usize)> {
    let mut counts = BTreeMap::new();
    for o in epochs.iter().flat_map(|e| &e.observations) {
        *counts.entry(format!("{} {}", o.satellite, o.signal)).or_insert(0) += 1;
    }
    counts.into_iter().collect()
}

fn named(counts: &[(&str, usize)]) -> Vec<(String, usize)> {
    counts.iter().map(|(name, count)| ((*name).to_owned(), *count)).collect()
}

#[test]
#[ignore = "needs the reference data"]
fn june() {
    let (epochs, mut decoder) = read(JUNE, Options::default());
    assert_eq!(epochs.len(), 223);
    // 1379 lines, of which three of G03 are too uncertain.
    assert_eq!(
        per_signal(&epochs),
        named(&[
            ("G02 1C", 223),
            ("G03 1C", 6),
            ("G06 1C", 223),
            ("G12 1C", 223),
            ("G17 1C", 223),
            ("G19 1C", 223),
            ("G24 1C", 223),
            ("G25 1C", 25),
            ("G28 1C", 7),
        ])
    );
    assert_eq!(decoder.skips().count(Reason::MaskReceivedTimeUncertainty), 3);
    assert_eq!(decoder.skips().total(), 3, "{}", decoder.skips());
    // The chip has no carrier phase; every line has a Doppler.
    assert!(epochs.iter().flat_map(|e| &e.observations).all(|o| o.carrier_phase_cycles.is_none()));
    assert!(epochs.iter().flat_map(|e| &e.observations).all(|o| o.doppler_hz.is_some()));
    let fixes = decoder.take_fixes();
    let fix = fixes[0];
    assert_eq!((fixes.len(), fix.provider), (216, FixProvider::Gnss));
    assert_eq!(fix.time_gps.to_string(), "2016-06-30T21:26:26.000 GPS", "17 leap seconds");
    assert!((fix.latitude_rad.to_degrees() - 37.422541).abs() < 1e-9);
    assert_eq!((fix.height_m, fix.accuracy_m), (Some(-33.0), Some(3.0)));
}

#[test]
#[ignore = "needs the reference data"]
fn august() {
    let (epochs, decoder) = read(AUGUST, Options::default());
    assert_eq!(epochs.len(), 207);
    assert_eq!(
        per_signal(&epochs),
        named(&[
            ("C07 2I", 201),
            ("E22 1C", 161),
            ("E30 1C", 191),
            ("G02 1C", 203),
            ("G05 1C", 180),
            ("G12 1C", 206),
            ("G13 1C", 93),
            ("G15 1C", 206),
            ("G18 1C", 155),
            ("G20 1C", 207),
            ("G21 1C", 207),
            ("G25 1C", 206),
            ("G26 1C", 204),
            ("G29 1C", 206),
            ("G31 1C", 195),
        ])
    );
    let count = |reason: &str| decoder.skips().count(reason);
    // All 1833 GLONASS lines name their satellite by frequency channel (Svid 93 to 106); none has its time of day.
    assert_eq!(count(Reason::GlonassSatelliteByChannelOnly.text()), 1_833);
    assert_eq!(count(Reason::MaskStateBits.text()), 286);
    assert_eq!((count(Reason::MaskCn0.text()), count(Reason::MaskMultipath.text())), (74, 27));
    assert_eq!(decoder.skips().total(), 1_833 + 286 + 74 + 27, "{}", decoder.skips());
    assert_eq!(5_041 - 1_833 - 286 - 74 - 27, epochs.iter().map(|e| e.observations.len()).sum::<usize>());
    let phases = epochs.iter().flat_map(|e| &e.observations).filter(|o| o.carrier_phase_cycles.is_some());
    let slips = phases.clone().filter(|o| o.loss_of_lock.cycle_slip).count();
    // Losses of lock are declared on 1,028 lines of these systems, most with a phase that is not valid; the next ones tell them.
    assert_eq!((phases.count(), slips), (2_129, 113));
}

/// Masks that are off count nothing and give what they took.
#[test]
#[ignore = "needs the reference data"]
fn august_without_masks() {
    let options = Options { masks: Masks::none(), ..Options::default() };
    let (epochs, decoder) = read(AUGUST, options);
    let used: usize = epochs.iter().map(|e| e.observations.len()).sum();
    assert_eq!(used, 5_041 - 1_833 - 286);
    assert_eq!(decoder.skips().count(Reason::MaskStateBits), 286);
    assert_eq!(decoder.skips().count(Reason::MaskMultipath), 0);
}

/// With the first epoch's bias, tags and pseudoranges move together with the oscillator, and by the same for all
/// satellites: t_rx is another, t_rx − P/c is the same.
#[test]
#[ignore = "needs the reference data"]
fn the_bias_reference_moves_tags_and_pseudoranges_together() {
    let first = Options { bias_reference: BiasReference::FirstEpoch, ..Options::default() };
    let ((each, _), (first, _)) = (read(AUGUST, Options::default()), read(AUGUST, first));
    assert_eq!(each.len(), first.len());
    let mut widest = 0_i64;
    for (a, b) in each.iter().zip(&first) {
        let shift_ns = b.time_gps.nanos() - a.time_gps.nanos();
        widest = widest.max(shift_ns.abs());
        assert_eq!(a.observations.len(), b.observations.len());
        for (x, y) in a.observations.iter().zip(&b.observations) {
            let longer = y.pseudorange_m.unwrap() - x.pseudorange_m.unwrap();
            assert!((longer - shift_ns as f64 * 0.299_792_458).abs() < 1e-6, "{longer} {shift_ns}");
            assert_eq!(x.doppler_hz, y.doppler_hz);
        }
    }
    println!("up to {widest} ns");
    assert!(widest > 1_000, "{widest}");
}

/// The first log's chip counts a clock discontinuity with every epoch, so the first bias never lasts.
#[test]
#[ignore = "needs the reference data"]
fn a_discontinuity_takes_a_new_reference() {
    let first = Options { bias_reference: BiasReference::FirstEpoch, ..Options::default() };
    let ((each, _), (first, _)) = (read(JUNE, Options::default()), read(JUNE, first));
    assert_eq!(each, first);
}
