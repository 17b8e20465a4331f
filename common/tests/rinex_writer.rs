//! What is written as RINEX reads back as it was, to the digits of the format.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod beside;

use beside::required;
use cofix_common::formats::rinex::{
    ObservationFile, ObservationLayout, ObservationWriter, RecordingInfo, glonass_record, navigation_header,
    navigation_record,
};
use cofix_common::frames::{Ecef, EcefVector};
use cofix_common::gnss::{
    Constellation, EpochFlag, LossOfLock, Observation, ObservationEpoch, SatelliteId, SignalCode,
};
use cofix_common::orbit::{GlonassEphemeris, KeplerEphemeris, UNKNOWN_ACCURACY_M};
use cofix_common::orbit::{IonosphereTerms, NavigationFile};
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;
use nalgebra::Vector3;
use proptest::prelude::*;

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
#[ignore = "needs the reference data"]
fn recordings_come_back_exactly() {
    for path in [
        "whu-wuhan-2020-08-13/WH-3-08/HP30.rnx",
        "whu-wuhan-2020-08-13/WH-4-06/XIM8.rnx",
        "pixel6-2023/pixel6.23o",
    ] {
        let bytes = required(&format!("data/{path}"));
        let file = ObservationFile::parse(&bytes).unwrap();
        let info = RecordingInfo {
            marker_name: file.header.marker_name.clone(),
            equipment: file.header.equipment.clone(),
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
        assert_eq!(again.header.equipment, file.header.equipment);
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

fn by_time(ephemerides: &[GlonassEphemeris]) -> Vec<GlonassEphemeris> {
    let mut sorted = ephemerides.to_vec();
    let key =
        |e: &GlonassEphemeris| (e.toe, e.satellite, e.health, e.tau_s.to_bits(), e.position.0.x.to_bits());
    sorted.sort_by_key(key);
    sorted
}

#[test]
#[ignore = "needs the reference data"]
fn navigation_files_come_back_exactly() {
    for path in [
        "data/ESBC00DNK_R_20201770000_01D_MN.rnx.gz",
        "oracle/inputs/BRD400DLR_20230710000_as_rnx305_GRECJI.rnx.gz",
        "data/google-static-2016/hour1820.16n",
    ] {
        let bytes = required(path);
        let file = NavigationFile::parse(&bytes).unwrap();
        let mut text = navigation_header("", &file.ionosphere, file.leap_seconds);
        for ephemeris in &file.ephemerides {
            text += &navigation_record(ephemeris).unwrap();
        }
        for ephemeris in &file.glonass {
            text += &glonass_record(ephemeris, file.leap_seconds).unwrap();
        }
        let again = NavigationFile::parse(text.as_bytes()).unwrap();
        let unknown = again.skips.count(Reason::GlonassHealthUnknown);
        assert_eq!(again.skips.total(), unknown, "{path}: {}", again.skips);
        assert_eq!(again.ionosphere, file.ionosphere, "{path}");
        assert_eq!(by_time(&again.glonass), by_time(&file.glonass), "{path}");
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
    assert_eq!(writer.skips().count(Reason::ValueBeyondF14), 2);
    assert_eq!(writer.skips().count(Reason::ValueRoundsZero), 1);
    let again = ObservationFile::parse(text.as_bytes()).unwrap();
    let only = Observation { carrier_phase_cycles: None, doppler_hz: None, cn0_dbhz: None, ..observation };
    assert_eq!(again.epochs[0].observations, [only]);
    assert_eq!(again.epochs[0].flag, EpochFlag::PowerFailure);
    assert_eq!(again.epochs[0].time_gps, "2020-08-13T14:20:00".parse().unwrap());
}

fn glonass(utc_quarter: i64, leap_seconds: i64) -> GlonassEphemeris {
    let midnight: GpsTime = "2016-12-31T00:00:00".parse().unwrap();
    GlonassEphemeris {
        satellite: "R07".parse().unwrap(),
        toe: midnight + (900 * utc_quarter + leap_seconds) as f64,
        position: Ecef(Vector3::new(10_234.567_871_09, -12_345.678_710_94, 19_876.543_457_03) * 1e3),
        velocity: EcefVector(Vector3::new(-1.234_567_642_21, 2.345_678_329_47, -0.901_234_626_77) * 1e3),
        acceleration: EcefVector(Vector3::new(-1.862_645_149_23e-9, 0.0, 9.313_225_746_15e-10) * 1e3),
        tau_s: -3.456_789_627_67e-5,
        gamma: 9.094_947_017_73e-13,
        l2_delay_s: Some(-2.793_967_723_85e-9),
        frequency_channel: -4,
        health: Some(0),
        health_flags: Some(3),
        age_days: 1.0,
        accuracy_m: 7.0,
    }
}

/// An accuracy that nobody stated is not made one of ten metres.
#[test]
#[ignore = "needs the reference data"]
fn unknown_accuracy_is_written_as_unknown() {
    for (path, unknown) in
        [("oracle/inputs/07590920.05n", 0.0), ("data/ESBC00DNK_R_20201770000_01D_MN.rnx.gz", -1.0)]
    {
        let bytes = required(path);
        let mut file = NavigationFile::parse(&bytes).unwrap();
        file.ephemerides.retain(|e| unknown == 0.0 || e.satellite.constellation == Constellation::Galileo);
        let mut ephemeris = file.ephemerides[0];
        ephemeris.accuracy_m = UNKNOWN_ACCURACY_M;
        let record = navigation_record(&ephemeris).unwrap();
        let line = record.lines().nth(6).unwrap();
        assert_eq!(line[4..23].trim().parse::<f64>(), Ok(unknown), "{record}");
        let again =
            NavigationFile::parse((navigation_header("", &file.ionosphere, None) + &record).as_bytes());
        assert_eq!(again.unwrap().ephemerides[0].accuracy_m, UNKNOWN_ACCURACY_M);
    }
}

/// Through the leap second at the end of 2016: 17 s before, 18 s from then on.
#[test]
fn glonass_comes_back_exactly() {
    let plain = glonass(95, 17);
    let after = glonass(96, 18);
    let unknown = GlonassEphemeris { l2_delay_s: None, health: None, health_flags: None, ..glonass(94, 17) };
    let mut text = navigation_header("", &IonosphereTerms::default(), None);
    for ephemeris in [&unknown, &plain, &after] {
        text += &glonass_record(ephemeris, None).unwrap();
    }
    assert!(text.lines().all(|line| line.len() <= 80), "{text}");
    assert!(text.contains("R07 2017 01 01 00 00 00"), "{text}");
    let again = NavigationFile::parse(text.as_bytes()).unwrap();
    assert_eq!(again.glonass, [unknown, plain, after]);
    // The date tells the leap seconds of each message, whatever the header says.
    let mut text = navigation_header("", &IonosphereTerms::default(), Some(18));
    for ephemeris in [&plain, &after] {
        text += &glonass_record(ephemeris, Some(18)).unwrap();
    }
    assert_eq!(NavigationFile::parse(text.as_bytes()).unwrap().glonass, [plain, after]);
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
        any::<(bool, bool, bool)>(),
    );
    values.prop_map(move |(pseudorange, phase, doppler, cn0, (cycle_slip, half_cycle, noisier))| {
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
                noisier: noisier && with_phase,
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
        loss_of_lock: LossOfLock { cycle_slip: true, ..LossOfLock::default() },
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
