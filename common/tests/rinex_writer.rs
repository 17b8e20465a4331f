//! What is written as RINEX reads back as it was, to the digits of the format.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

use std::path::PathBuf;

use cofix_common::gnss::{
    Constellation, EpochFlag, LossOfLock, Observation, ObservationEpoch, SatelliteId, SignalCode,
};
use cofix_common::orbit::KeplerEphemeris;
use cofix_common::rinex::{
    NavigationFile, ObservationFile, ObservationLayout, ObservationWriter, RecordingInfo, navigation_header,
    navigation_record,
};
use cofix_common::time::GpsTime;
use proptest::prelude::*;

fn shared(path: &str) -> Option<Vec<u8>> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared")).join(path);
    let bytes = std::fs::read(&path).ok();
    if bytes.is_none() {
        println!("skipped: {} is not here", path.display());
    }
    bytes
}

fn written(epochs: &[ObservationEpoch], info: &RecordingInfo) -> (String, ObservationWriter) {
    let mut layout = ObservationLayout::default();
    for epoch in epochs {
        layout.include(epoch);
    }
    let mut writer = ObservationWriter::new(layout);
    let mut text = writer.header(info);
    for epoch in epochs {
        text += &writer.epoch(epoch);
    }
    let header = text.split_once("END OF HEADER").unwrap().0;
    assert!(header.lines().all(|line| line.len() <= 80), "{header}");
    (text, writer)
}

/// Order of signals within a satellite is the file's own.
fn sorted(mut epochs: Vec<ObservationEpoch>) -> Vec<ObservationEpoch> {
    for epoch in &mut epochs {
        epoch.observations.sort_by_key(|o| (o.satellite, o.signal));
    }
    epochs
}

#[test]
fn recordings_come_back_exactly() {
    for path in [
        "whu-wuhan-2020-08-13/WH-3-08/HP30.rnx",
        "whu-wuhan-2020-08-13/WH-4-06/XIM8.rnx",
        "pixel6-2023/pixel6.23o",
    ] {
        let Some(bytes) = shared(&format!("data/{path}")) else { return };
        let file = ObservationFile::parse(&bytes).unwrap();
        let info = RecordingInfo {
            marker_name: file.header.marker_name.clone(),
            receiver_type: file.header.receiver_type.clone(),
            interval_s: file.header.interval_s,
            approximate_position: file.header.approximate_position,
            glonass_channels: file.header.glonass_channels.clone(),
            leap_seconds: file.header.leap_seconds,
            created: String::new(),
        };
        let (text, writer) = written(&file.epochs, &info);
        assert!(writer.skips().is_empty(), "{path}: {}", writer.skips());
        let again = ObservationFile::parse(text.as_bytes()).unwrap();
        assert!(again.skips.is_empty(), "{path}: {}", again.skips);
        assert_eq!(again.header.version, 305);
        assert_eq!(again.header.glonass_channels, file.header.glonass_channels);
        assert_eq!(again.header.receiver_type, file.header.receiver_type);
        assert_eq!(again.header.interval_s, file.header.interval_s);
        assert_eq!(sorted(again.epochs), sorted(file.epochs), "{path}");
    }
}

/// Unknown group delays are not numbers, which equal nothing.
fn comparable(ephemeris: &KeplerEphemeris) -> (KeplerEphemeris, bool, bool) {
    let (first, second) = ephemeris.group_delays_s;
    let known = |delay: f64| if delay.is_nan() { 0.0 } else { delay };
    let ephemeris = KeplerEphemeris { group_delays_s: (known(first), known(second)), ..*ephemeris };
    (ephemeris, first.is_nan(), second.is_nan())
}

#[test]
fn navigation_files_come_back_exactly() {
    for path in [
        "data/ESBC00DNK_R_20201770000_01D_MN.rnx.gz",
        "oracle/inputs/BRD400DLR_20230710000_as_rnx305_GRECJI.rnx.gz",
        "data/google-static-2016/hour1820.16n",
    ] {
        let Some(bytes) = shared(path) else { return };
        let file = NavigationFile::parse(&bytes).unwrap();
        let mut text = navigation_header("", file.ionosphere.gps.as_ref(), file.leap_seconds);
        for ephemeris in &file.ephemerides {
            text += &navigation_record(ephemeris).unwrap();
        }
        let again = NavigationFile::parse(text.as_bytes()).unwrap();
        assert!(again.skips.is_empty(), "{path}: {}", again.skips);
        assert_eq!(again.ionosphere.gps, file.ionosphere.gps, "{path}");
        assert_eq!(again.leap_seconds, file.leap_seconds);
        let key = |e: &KeplerEphemeris| {
            (
                e.satellite,
                e.toe,
                e.toc,
                e.issue_of_data,
                e.health.to_bits(),
                e.message as u8,
                e.m0_rad.to_bits(),
                e.accuracy_m.to_bits(),
            )
        };
        let all = |file: &NavigationFile| {
            let mut ephemerides = file.ephemerides.clone();
            ephemerides.sort_by_key(key);
            ephemerides.iter().map(comparable).collect::<Vec<_>>()
        };
        assert_eq!(all(&again), all(&file), "{path}");
    }
}

#[test]
fn what_the_format_cannot_hold_is_counted() {
    let observation = Observation {
        satellite: "G07".parse().unwrap(),
        signal: SignalCode::new(b'1', b'C'),
        pseudorange_m: Some(2.2e7),
        carrier_phase_cycles: Some(1e11),
        doppler_hz: Some(0.0),
        cn0_dbhz: Some(f64::NAN),
        loss_of_lock: LossOfLock::default(),
    };
    let epoch = ObservationEpoch {
        time_gps: "2020-08-13T14:19:59.99999997".parse().unwrap(),
        flag: EpochFlag::PowerFailure,
        observations: vec![observation],
    };
    let (text, writer) = written(std::slice::from_ref(&epoch), &RecordingInfo::default());
    assert_eq!(writer.skips().count("value does not fit F14.3, left out"), 2);
    assert_eq!(writer.skips().count("value rounds to zero, which RINEX reads as missing"), 1);
    let again = ObservationFile::parse(text.as_bytes()).unwrap();
    let only = Observation { carrier_phase_cycles: None, doppler_hz: None, cn0_dbhz: None, ..observation };
    assert_eq!(again.epochs[0].observations, [only]);
    assert_eq!(again.epochs[0].flag, EpochFlag::PowerFailure);
    assert_eq!(again.epochs[0].time_gps, "2020-08-13T14:20:00".parse().unwrap());
}

/// A number of thousandths that is not zero.
fn thousandths(low: i64, high: i64) -> impl Strategy<Value = Option<f64>> {
    proptest::option::of((low..high).prop_filter("zero is missing", |v| *v != 0).prop_map(|v| v as f64 / 1e3))
}

fn observation(satellite: SatelliteId, signal: SignalCode) -> impl Strategy<Value = Observation> {
    let values = (
        (1_000_000_000_i64..100_000_000_000).prop_map(|v| v as f64 / 1e3),
        thousandths(-999_999_999_999, 9_999_999_999_999),
        thousandths(-50_000_000, 50_000_000),
        thousandths(1, 70_000),
        any::<(bool, bool)>(),
    );
    values.prop_map(move |(pseudorange, phase, doppler, cn0, (cycle_slip, half_cycle))| {
        let with_phase = phase.is_some();
        Observation {
            satellite,
            signal,
            pseudorange_m: Some(pseudorange),
            carrier_phase_cycles: phase,
            doppler_hz: doppler,
            cn0_dbhz: cn0,
            loss_of_lock: LossOfLock {
                cycle_slip: cycle_slip && with_phase,
                half_cycle: half_cycle && with_phase,
            },
        }
    })
}

const SIGNALS: [(Constellation, u8, u8); 9] = [
    (Constellation::Gps, b'1', b'C'),
    (Constellation::Gps, b'5', b'Q'),
    (Constellation::Gps, b'2', b'L'),
    (Constellation::Gps, b'2', b'W'),
    (Constellation::Glonass, b'1', b'C'),
    (Constellation::Galileo, b'1', b'C'),
    (Constellation::Beidou, b'2', b'I'),
    (Constellation::Beidou, b'1', b'P'),
    (Constellation::Sbas, b'1', b'C'),
];

fn epoch() -> impl Strategy<Value = Vec<Observation>> {
    proptest::sample::subsequence(SIGNALS.to_vec(), 1..SIGNALS.len()).prop_flat_map(|signals| {
        signals
            .into_iter()
            .map(|(system, band, attribute)| {
                observation(SatelliteId::new(system, 11), SignalCode::new(band, attribute))
            })
            .collect::<Vec<_>>()
    })
}

proptest! {
    #[test]
    fn observations_come_back(epochs in proptest::collection::vec((epoch(), any::<bool>(), 1_i64..20_000_000), 1..6)) {
        let mut time_ns = GpsTime::from_week_tow(2118, 0.0).nanos();
        let epochs: Vec<_> = epochs.into_iter().map(|(observations, failed, step)| {
            time_ns += step * 100;
            ObservationEpoch {
                time_gps: GpsTime::from_nanos(time_ns),
                flag: if failed { EpochFlag::PowerFailure } else { EpochFlag::Ok },
                observations,
            }
        }).collect();
        let (text, writer) = written(&epochs, &RecordingInfo::default());
        prop_assert!(writer.skips().is_empty(), "{}", writer.skips());
        let again = ObservationFile::parse(text.as_bytes()).unwrap();
        prop_assert!(again.skips.is_empty(), "{}", again.skips);
        prop_assert_eq!(sorted(again.epochs), sorted(epochs));
    }
}

/// A phase that rounds to zero is left out, but the loss of lock stays, also when no other phase is there.
#[test]
fn loss_of_lock_without_a_phase_comes_back() {
    let observation = Observation {
        satellite: "E11".parse().unwrap(),
        signal: SignalCode::new(b'1', b'C'),
        pseudorange_m: Some(2.4e7),
        carrier_phase_cycles: Some(1e-6),
        doppler_hz: None,
        cn0_dbhz: None,
        loss_of_lock: LossOfLock { cycle_slip: true, half_cycle: false },
    };
    let epoch = ObservationEpoch {
        time_gps: "2023-11-07T12:00:00".parse().unwrap(),
        flag: EpochFlag::Ok,
        observations: vec![observation],
    };
    let info = RecordingInfo::default();
    let once = ObservationFile::parse(written(&[epoch], &info).0.as_bytes()).unwrap().epochs;
    assert_eq!(once[0].observations[0].loss_of_lock, observation.loss_of_lock);
    let twice = ObservationFile::parse(written(&once, &info).0.as_bytes()).unwrap().epochs;
    assert_eq!(twice, once);
}
