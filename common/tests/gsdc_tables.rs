//! Challenge tables written here: both generations, and what can be wrong with them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

use std::fmt::Write as _;
use std::sync::Arc;

use cofix_common::constants::{EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS};
use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::gnsslogger::Masks;
use cofix_common::formats::gsdc::{DerivedDecoder, DerivedFile, ground_truth, is_ground_truth};
use cofix_common::formats::stream::ObservationStream;
use cofix_common::frames::{Ecef, EcefVector, Enu, Geodetic, LocalFrame};
use cofix_common::measurement::{CorrectionOptions, Corrector, Ionosphere, RecordedEpoch, without_position};
use cofix_common::orbit::Products;
use cofix_common::skips::Reason;
use cofix_common::solve::solve_position;
use cofix_common::time::GpsTime;
use proptest::prelude::*;

const HEADER_2021: &str = ",collectionName,phoneName,millisSinceGpsEpoch,constellationType,svid,signalType,\
    receivedSvTimeInGpsNanos,xSatPosM,ySatPosM,zSatPosM,xSatVelMps,ySatVelMps,zSatVelMps,satClkBiasM,satClkDriftMps,\
    rawPrM,rawPrUncM,isrbM,ionoDelayM,tropoDelayM\n";

const HEADER_2022: &str = "MessageType,utcTimeMillis,ConstellationType,Svid,Cn0DbHz,PseudorangeRateMetersPerSecond,\
    AccumulatedDeltaRangeState,AccumulatedDeltaRangeMeters,CarrierFrequencyHz,CodeType,ArrivalTimeNanosSinceGpsEpoch,\
    RawPseudorangeMeters,RawPseudorangeUncertaintyMeters,SignalType,ReceivedSvTimeNanosSinceGpsEpoch,\
    SvPositionXEcefMeters,SvPositionYEcefMeters,SvPositionZEcefMeters,SvVelocityXEcefMetersPerSecond,\
    SvVelocityYEcefMetersPerSecond,SvVelocityZEcefMetersPerSecond,SvClockBiasMeters,SvClockDriftMetersPerSecond,\
    IsrbMeters,IonosphericDelayMeters,TroposphericDelayMeters\n";

const START_MS: i64 = 1_273_529_463_442;
const CLOCK_M: f64 = 1_000.0;
const SATELLITE_CLOCK_M: f64 = -3_793.067;
const BIAS_M: f64 = 12.5;
const IONOSPHERE_M: f64 = 7.5;
const TROPOSPHERE_M: f64 = 5.25;

fn site() -> Ecef {
    Geodetic::from_degrees(37.42, -122.09, 10.0).geodetic_to_ecef()
}

/// A satellite of the sky at transmission, and the raw pseudorange at the site.
#[derive(Clone, Copy)]
struct Sat {
    number: u32,
    position: Ecef,
    velocity: EcefVector,
    pseudorange_m: f64,
    rate_mps: f64,
}

fn sky() -> Vec<Sat> {
    let frame = LocalFrame::at(site());
    [(10.0, 70.0), (60.0, 20.0), (130.0, 45.0), (200.0, 30.0), (280.0, 55.0), (330.0, 15.0)]
        .into_iter()
        .zip(1..)
        .map(|((azimuth_deg, elevation_deg), number): ((f64, f64), u32)| {
            let (azimuth, elevation) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
            let range_m = 22.0e6;
            let up = range_m * elevation.sin();
            let flat = range_m * elevation.cos();
            let seen = frame.enu_to_ecef(Enu { east: flat * azimuth.sin(), north: flat * azimuth.cos(), up });
            // Back into the frame of the transmission: the Earth turned while the signal travelled.
            let (sin, cos) = (EARTH_ROTATION_RADPS * range_m / SPEED_OF_LIGHT_MPS).sin_cos();
            let p = seen.0;
            let position = Ecef::new(cos * p.x - sin * p.y, cos * p.y + sin * p.x, p.z);
            let pseudorange_m = range_m + CLOCK_M - SATELLITE_CLOCK_M + BIAS_M + IONOSPHERE_M + TROPOSPHERE_M;
            Sat {
                number,
                position,
                velocity: EcefVector::new(100.0, -200.0, 300.0),
                pseudorange_m,
                rate_mps: 50.0,
            }
        })
        .collect()
}

fn transmission_ns(arrival_ms: i64, sat: &Sat) -> i64 {
    #[allow(clippy::cast_possible_truncation)] // below 0.1 s
    let travel_ns = (sat.pseudorange_m / SPEED_OF_LIGHT_MPS * 1e9).round() as i64;
    arrival_ms * 1_000_000 - travel_ns
}

fn row_2021(time_ms: i64, sat: &Sat) -> String {
    let (p, v) = (sat.position.0, sat.velocity.0);
    format!(
        "0,2020-05-14-US-MTV-1,Pixel4,{time_ms},1,{},GPS_L1,{},{:.4},{:.4},{:.4},{},{},{},{SATELLITE_CLOCK_M},0.001,{:.4},3.0,{BIAS_M},\
         {IONOSPHERE_M},{TROPOSPHERE_M}\n",
        sat.number,
        transmission_ns(time_ms, sat),
        p.x,
        p.y,
        p.z,
        v.x,
        v.y,
        v.z,
        sat.pseudorange_m
    )
}

fn row_2022(time_ms: i64, sat: &Sat, state: u32, orbit: bool) -> String {
    let (p, v) = (sat.position.0, sat.velocity.0);
    let orbit = if orbit {
        format!(
            "{:.4},{:.4},{:.4},{},{},{},{SATELLITE_CLOCK_M},0.001,{BIAS_M},{IONOSPHERE_M},{TROPOSPHERE_M}",
            p.x, p.y, p.z, v.x, v.y, v.z
        )
    } else {
        ",,,,,,,,,,".to_owned()
    };
    format!(
        "Raw,{},1,{},38.5,{},{state},-1000.0,1575420030.0,C,{},{:.4},3.0,GPS_L1_CA,{},{orbit}\n",
        time_ms + 315_964_800_000 - 18_000,
        sat.number,
        sat.rate_mps,
        time_ms * 1_000_000,
        sat.pseudorange_m,
        transmission_ns(time_ms, sat)
    )
}

fn table_2021(epochs: i64) -> String {
    let rows =
        (0..epochs).flat_map(|i| sky().into_iter().map(move |sat| row_2021(START_MS + i * 1_000, &sat)));
    rows.fold(HEADER_2021.to_owned(), |table, row| table + &row)
}

fn solve(epoch: &RecordedEpoch) -> Ecef {
    solve_with(epoch, Ionosphere::Model)
}

fn solve_with(epoch: &RecordedEpoch, ionosphere: Ionosphere) -> Ecef {
    let options = CorrectionOptions { ionosphere, ..CorrectionOptions::default() };
    let mut corrector = Corrector::new(Arc::new(Products::default()), options);
    let prepared = epoch.prepare(&mut corrector);
    let rough = solve_position(&without_position(&prepared), Ecef::new(0.0, 0.0, 0.0)).unwrap().position();
    let (corrected, _) = corrector.finish(&prepared, rough, epoch.time_gps);
    solve_position(&corrected, rough).unwrap().position()
}

#[test]
fn a_table_of_2021_gives_the_position() {
    let file = DerivedFile::parse(table_2021(3).as_bytes()).unwrap();
    assert!(file.skips.is_empty(), "{}", file.skips);
    assert_eq!(file.epochs.len(), 3);
    assert!((file.epochs[1].time_gps - GpsTime::from_nanos((START_MS + 1_000) * 1_000_000)).abs() < 2e-9);
    for epoch in &file.epochs {
        let error_m = solve(epoch).distance_m(site());
        assert!(error_m < 0.01, "{error_m} m");
    }
    let raw = file.epochs[0].to_observations();
    assert_eq!(raw.observations[0].satellite.to_string(), "G01");
    assert_eq!(raw.observations[0].cn0_dbhz, None);
    assert_eq!(raw.observations[0].doppler_hz, None);
}

#[test]
fn the_phones_own_uncertainty_weighs_where_no_strength_was_recorded() {
    let file = DerivedFile::parse(table_2021(1).as_bytes()).unwrap();
    let mut corrector = Corrector::new(Arc::new(Products::default()), CorrectionOptions::default());
    let prepared = file.epochs[0].prepare(&mut corrector);
    let (corrected, _) = corrector.finish(&prepared, site(), file.epochs[0].time_gps);
    assert_eq!(corrected.len(), 6);
    assert!(corrected.iter().all(|o| (o.pseudorange_sigma_m - 3.0_f64.hypot(0.5)).abs() < 1e-9));
}

#[test]
fn a_table_since_2022_gives_position_rates_and_phases() {
    let sky = sky();
    let mut table = HEADER_2022.to_owned();
    for (sat, state) in sky.iter().zip([1, 1 | 4, 1 | 2, 1 | 16, 1 | 8 | 16, 0]) {
        table += &row_2022(START_MS, sat, state, true);
    }
    table += &row_2022(START_MS, &Sat { number: 20, ..sky[0] }, 1, false);
    let file = DerivedFile::parse(table.as_bytes()).unwrap();
    let [epoch] = file.epochs.as_slice() else { panic!("{}", file.skips) };
    assert_eq!((file.skips.total(), file.skips.count(Reason::NoCorrectionsInRow)), (1, 1));
    assert!(solve(epoch).distance_m(site()) < 0.01);
    let raw = epoch.to_observations();
    assert_eq!(raw.observations.len(), 7);
    let frequency = 1_575.42e6;
    let first = raw.observations[0];
    assert!((first.doppler_hz.unwrap() + 50.0 * frequency / SPEED_OF_LIGHT_MPS).abs() < 1e-9);
    assert!((first.carrier_phase_cycles.unwrap() + 1_000.0 * frequency / SPEED_OF_LIGHT_MPS).abs() < 1e-6);
    assert_eq!(first.cn0_dbhz, Some(38.5));
    let flags: Vec<_> =
        raw.observations.iter().map(|o| (o.loss_of_lock.cycle_slip, o.loss_of_lock.half_cycle)).collect();
    assert_eq!(
        flags[..6],
        [(false, false), (true, false), (true, false), (false, true), (false, false), (false, false)]
    );
    assert_eq!(raw.observations[5].carrier_phase_cycles, None);
    let mut corrector = Corrector::new(Arc::new(Products::default()), CorrectionOptions::default());
    let prepared = epoch.prepare(&mut corrector);
    let (corrected, _) = corrector.finish(&prepared, site(), epoch.time_gps);
    assert_eq!(corrected.len(), 6, "only those with corrections");
    assert_eq!(corrector.skips().count(Reason::NoSatelliteState), 1, "and no products for the other");
    assert!((corrected[0].range_rate.unwrap().range_rate_mps - 50.001).abs() < 1e-9);
}

/// Ionosphere-free pairs of a table's signals have no use for its ionosphere, right or wrong.
#[test]
fn pairs_of_a_table_do_not_need_its_ionosphere() {
    let ratio = (1_575.42_f64 / 1_176.45).powi(2);
    let mut table = HEADER_2022.to_owned();
    for (sat, wrong_m) in sky().iter().zip([0.0, 9.0, 3.0, 7.0, 1.0, 20.0]) {
        let first = Sat { pseudorange_m: sat.pseudorange_m + wrong_m, ..*sat };
        let second =
            Sat { pseudorange_m: sat.pseudorange_m + (ratio - 1.0) * IONOSPHERE_M + ratio * wrong_m, ..*sat };
        table += &row_2022(START_MS, &first, 1, true);
        table += &row_2022(START_MS, &second, 1, true)
            .replace("GPS_L1_CA", "GPS_L5_Q")
            .replace("1575420030.0,C", "1176450000.0,Q");
    }
    let file = DerivedFile::parse(table.as_bytes()).unwrap();
    assert!(file.skips.is_empty(), "{}", file.skips);
    assert!(solve_with(&file.epochs[0], Ionosphere::Model).distance_m(site()) > 1.0);
    for ionosphere in [Ionosphere::Pair, Ionosphere::PairOnly] {
        let error_m = solve_with(&file.epochs[0], ionosphere).distance_m(site());
        assert!(error_m < 0.01, "{ionosphere:?}: {error_m} m");
    }
}

#[test]
fn missing_columns_are_named() {
    let table = table_2021(1).replacen("satClkBiasM", "something", 1).replacen("isrbM", "", 1);
    let error = DerivedFile::parse(table.as_bytes()).unwrap_err().to_string();
    assert!(error.contains("2021") && error.contains("satClkBiasM, isrbM"), "{error}");
    let error = DerivedFile::parse(HEADER_2022.replacen("Svid,", "", 1).as_bytes()).unwrap_err().to_string();
    assert!(error.contains("2022") && error.contains("Svid"), "{error}");
    for other in ["", "a,b,c\n1,2,3\n", "\u{1f}\u{8b}\n", "no line end"] {
        assert!(DerivedFile::parse(other.as_bytes()).is_err(), "{other:?}");
    }
}

#[test]
fn bad_rows_are_counted_and_the_good_ones_used() {
    let sky = sky();
    let good = row_2021(START_MS, &sky[0]);
    let other = row_2021(START_MS, &sky[1]);
    for (bad, reason) in [
        (other.replace(&format!("{:.4}", sky[1].pseudorange_m), "nan"), Reason::ValueMissing.text()),
        (other.replace(&format!("{:.4}", sky[1].pseudorange_m), "12.0"), Reason::ImpossibleValue.text()),
        (other.replace(&format!("{START_MS}"), "soon"), Reason::TimeMissing.text()),
        (
            other.replace(&format!("{START_MS}"), &format!("{}", START_MS + 60_000)),
            Reason::EpochContradictsPseudorange.text(),
        ),
        (other.replace("Pixel4,", "Pixel4,,"), Reason::SatelliteNotUsed.text()),
        (other.replace(",1,2,GPS_L1", ",2,131,SBS_L1"), Reason::SatelliteNotUsed.text()),
        (other.replace("GPS_L1", "GPS_L9"), Reason::SignalNotUsed.text()),
        (other.replace("-3793.067", "inf"), Reason::NoCorrectionsInRow.text()),
        (other.replace("-3793.067", ""), Reason::NoCorrectionsInRow.text()),
        (good.clone(), Reason::SignalTwice.text()),
        ("x".repeat(70_000) + "\n", Reason::LineTooLong.text()),
        (",".repeat(60_000) + "1\n", Reason::TimeMissing.text()),
        (other.chars().take(40).collect::<String>() + "\n", Reason::SatelliteNotUsed.text()),
        (other.trim_end().to_owned(), Reason::LastLineCutOff.text()),
    ] {
        let bytes = format!("{HEADER_2021}{good}{bad}");
        let file = DerivedFile::parse(bytes.as_bytes()).unwrap();
        let expected = if reason == Reason::TimeMissing.text() && bad.starts_with(',') {
            Reason::SatelliteNotUsed.text()
        } else {
            reason
        };
        assert_eq!((file.skips.count(expected), file.skips.total()), (1, 1), "{reason}: {}", file.skips);
        assert_eq!(file.epochs[0].observations[0].observation.satellite.to_string(), "G01");
    }
}

#[test]
fn mixed_line_ends_invalid_text_and_blank_lines_cost_nothing_else() {
    let table = table_2021(2).replace('\n', "\r\n").replacen("\r\n", "\n\r\n\n", 2);
    let file = DerivedFile::parse(table.as_bytes()).unwrap();
    assert_eq!((file.epochs.len(), file.skips.total()), (2, 0), "{}", file.skips);
    let mut bytes = table_2021(1).into_bytes();
    bytes.extend_from_slice(&[0xff, 0xfe, b',', 0x80, b'\n']);
    let file = DerivedFile::parse(&bytes).unwrap();
    assert_eq!((file.epochs.len(), file.skips.total()), (1, 1), "{}", file.skips);
}

#[test]
fn epochs_need_not_be_in_order_within_a_minute() {
    let row = |second: i64, sat: usize| row_2021(START_MS + second * 1_000, &sky()[sat]);
    let table = [row(2, 0), row(0, 0), row(1, 0), row(2, 1), row(100, 0), row(101, 0), row(1, 1)].concat();
    let file = DerivedFile::parse(format!("{HEADER_2021}{table}").as_bytes()).unwrap();
    let times: Vec<_> = file.epochs.iter().map(|e| e.time_gps.nanos() / 1_000_000 - START_MS).collect();
    assert_eq!(times, [0, 1_000, 2_000, 100_000, 101_000]);
    assert_eq!(file.epochs[2].observations.len(), 2);
    assert_eq!((file.skips.total(), file.skips.count(Reason::RowOutOfOrder)), (1, 1), "{}", file.skips);
    // One wrong date does not close all epochs before it.
    let table = [row(0, 0), row(100_000_000, 0), row(1, 0), row(2, 0)].concat();
    let file = DerivedFile::parse(format!("{HEADER_2021}{table}").as_bytes()).unwrap();
    assert_eq!(file.epochs.len(), 3);
    // Nor does an epoch of wrong dates, in a table of any order; a gap costs nothing.
    for wrong in [400, 18_000, 100_000_000] {
        let table =
            [row(0, 0), row(wrong, 0), row(wrong, 1), row(0, 1), row(1, 0), row(70, 0), row(71, 0)].concat();
        let file = DerivedFile::parse(format!("{HEADER_2021}{table}").as_bytes()).unwrap();
        let sizes: Vec<_> = file.epochs.iter().map(|epoch| epoch.observations.len()).collect();
        assert_eq!(sizes, [2, 1, 1, 1], "{wrong} s: {}", file.skips);
        assert_eq!(file.skips.count(Reason::EpochFarFromThoseAround), 1, "{}", file.skips);
        assert_eq!(file.skips.total(), 1);
    }
    for (last, kept) in [(400, 2), (100_000_000, 1)] {
        let table = [row(0, 0), row(last, 0)].concat();
        let file = DerivedFile::parse(format!("{HEADER_2021}{table}").as_bytes()).unwrap();
        assert_eq!((file.epochs.len(), file.skips.total()), (kept, 2 - kept as u64), "{last} s");
    }
}

/// The tables of 2021 cut times to milliseconds, in which satellites go metres; the arrival has the rest.
#[test]
fn receive_times_are_whole_again() {
    let mut sat = sky()[0];
    let row = row_2021(START_MS, &sat);
    sat.pseudorange_m += 433_600e-9 * SPEED_OF_LIGHT_MPS;
    let late = row_2021(START_MS, &sat);
    // The same transmission as before, received later within the millisecond.
    let transmission = |text: &str| text.split(',').nth(7).unwrap().to_owned();
    let late = late.replacen(&transmission(&late), &transmission(&row), 1);
    let file = DerivedFile::parse(format!("{HEADER_2021}{late}").as_bytes()).unwrap();
    let cut_ns = file.epochs[0].time_gps.nanos() - START_MS * 1_000_000;
    assert!((cut_ns - 433_600).abs() <= 2, "{cut_ns} ns");
    assert!(file.skips.is_empty(), "{}", file.skips);
}

/// Since 2022 the tables have every row of the log, with what the phone says about it.
#[test]
fn rows_that_the_phone_itself_doubts_are_masked() {
    let row = |number: usize, more: &str| {
        let row = row_2022(START_MS, &sky()[number], 1, true);
        format!("{},{more}\n", row.trim_end())
    };
    let header = format!(
        "{},State,MultipathIndicator,BiasUncertaintyNanos,ReceivedSvTimeUncertaintyNanos\n",
        HEADER_2022.trim_end()
    );
    let good = 1 | 1 << 3 | 1 << 14;
    let table = [
        row(0, &format!("{good},0,10.0,20.0")),
        row(1, "1,0,10.0,20.0"),
        row(2, &format!("{good},1,10.0,20.0")),
        row(3, &format!("{good}.0,0,1.1e7,20.0")),
        row(4, &format!("{good},2,10.0,501.0")),
        row(5, ",,,"),
    ];
    let file = DerivedFile::parse(format!("{header}{}", table.concat()).as_bytes()).unwrap();
    assert_eq!(file.epochs[0].observations.len(), 2, "{}", file.skips);
    for reason in ["state bits", "multipath indicator", "clock bias uncertainty", "received time uncertainty"]
    {
        assert_eq!(file.skips.count(format!("mask: {reason}")), 1, "{reason}: {}", file.skips);
    }
    // State bits are asked for all the same.
    let mut decoder = DerivedDecoder::new(Masks::none());
    decoder.feed(format!("{header}{}", table.concat()).as_bytes()).unwrap();
    decoder.finish().unwrap();
    decoder.next_record();
    assert_eq!(decoder.recorded_epoch().unwrap().observations.len(), 5, "{}", decoder.skips());
}

/// The tables of 2021 carry the time of the next epoch.
#[test]
fn epochs_a_second_late_are_set_right() {
    let sat = sky()[0];
    let late = row_2021(START_MS, &sat).replacen(&START_MS.to_string(), &(START_MS + 1_000).to_string(), 1);
    let file = DerivedFile::parse(format!("{HEADER_2021}{late}").as_bytes()).unwrap();
    assert!((file.epochs[0].time_gps - GpsTime::from_nanos(START_MS * 1_000_000)).abs() < 2e-9);
    assert_eq!(file.skips.count(Reason::EpochCorrectedByWholeSeconds), 1, "{}", file.skips);
}

/// A row of satellite `number` at the start whose epoch is written so much later.
fn tagged(tag_ms: i64, number: usize) -> String {
    row_2021(START_MS, &sky()[number]).replacen(&START_MS.to_string(), &(START_MS + tag_ms).to_string(), 1)
}

/// Where the phone's clock was set between two epochs, the time of the next one is off by no whole number of seconds.
#[test]
fn epochs_of_an_irregular_step_have_the_time_of_arrival() {
    for tag_ms in [1_192, 991, -9, 4_790, 30_003] {
        let rows =
            [tagged(tag_ms, 0), row_2021(START_MS + 60_000, &sky()[0]), tagged(tag_ms, 1), tagged(tag_ms, 2)];
        let file = DerivedFile::parse(format!("{HEADER_2021}{}", rows.concat()).as_bytes()).unwrap();
        let [first, _] = file.epochs.as_slice() else { panic!("{tag_ms}: {}", file.skips) };
        assert_eq!(first.observations.len(), 3, "{tag_ms}: {}", file.skips);
        assert!((first.time_gps - GpsTime::from_nanos(START_MS * 1_000_000)).abs() < 2e-9, "{tag_ms}");
        assert_eq!(file.skips.count(Reason::EpochCorrectedByArrival), 3, "{}", file.skips);
    }
    // A single row may be damaged.
    let file = DerivedFile::parse(format!("{HEADER_2021}{}", tagged(1_192, 0)).as_bytes()).unwrap();
    assert!(file.epochs.is_empty());
    assert_eq!(file.skips.count(Reason::EpochContradictsPseudorange), 1, "{}", file.skips);
    // Beside an epoch of the same arrival one row suffices.
    let rows = [row_2021(START_MS, &sky()[0]), tagged(1_192, 1)].concat();
    let file = DerivedFile::parse(format!("{HEADER_2021}{rows}").as_bytes()).unwrap();
    assert_eq!((file.epochs.len(), file.epochs[0].observations.len()), (1, 2), "{}", file.skips);
}

/// Of one epoch, some rows may be written with its time and others with one that only their arrival corrects.
#[test]
fn rows_of_both_kinds_are_one_epoch() {
    let tags = [[0, 1_192, 1_192], [1_192, 1_192, 0], [1_192, 0, 1_192], [0, 0, 991]];
    for tags_ms in tags {
        let rows = tags_ms.iter().enumerate().map(|(number, tag_ms)| {
            // The epoch as it is written is cut to the millisecond.
            let sent_ns = transmission_ns(START_MS, &sky()[number]);
            tagged(*tag_ms, number).replacen(&sent_ns.to_string(), &(sent_ns + 442_000).to_string(), 1)
        });
        let file =
            DerivedFile::parse(format!("{HEADER_2021}{}", rows.collect::<String>()).as_bytes()).unwrap();
        let [epoch] = file.epochs.as_slice() else { panic!("{tags_ms:?}: {:?}", file.epochs) };
        assert_eq!(epoch.observations.len(), 3, "{tags_ms:?}: {}", file.skips);
    }
}

/// Columns of whole numbers with blanks become doubles in many tools, which print them so.
#[test]
fn whole_numbers_may_be_written_as_floating_point() {
    let float = |ns: i64| format!("{:e}", ns as f64).replace('e', "e+");
    let mut whole = HEADER_2022.to_owned();
    let mut floating = HEADER_2022.to_owned();
    for second in 0..2 {
        for sat in &sky() {
            let row = row_2022(START_MS + second * 1_000, sat, 1, true);
            let fields: Vec<String> = row
                .trim_end()
                .split(',')
                .enumerate()
                .map(|(k, field)| match k {
                    1..=3 | 6 => format!("{field}.0"),
                    10 | 14 => float(field.parse().unwrap()),
                    _ => field.to_owned(),
                })
                .collect();
            floating += &(fields.join(",") + "\n");
            whole += &row;
        }
    }
    let parse = |table: &str| DerivedFile::parse(table.as_bytes()).unwrap();
    let (whole, floating) = (parse(&whole), parse(&floating));
    assert!(floating.skips.is_empty(), "{}", floating.skips);
    assert_eq!(floating.epochs.len(), 2);
    for (epoch, exact) in floating.epochs.iter().zip(&whole.epochs) {
        assert!((epoch.time_gps - exact.time_gps).abs() <= 256e-9);
        assert_eq!(epoch.observations, exact.observations, "the pseudoranges have a column of their own");
        assert!(solve(epoch).distance_m(site()) < 0.01);
    }
    // Rows of either kind are of one epoch: a double is up to 128 ns off.
    let rows = [0, 1].map(|number: usize| row_2022(START_MS, &sky()[number], 1, true));
    let ns = START_MS * 1_000_000;
    let mixed =
        format!("{HEADER_2022}{}{}", rows[0], rows[1].replace(&ns.to_string(), &format!("{}", ns + 128)));
    let epochs = parse(&mixed).epochs;
    assert_eq!((epochs.len(), epochs[0].observations.len()), (1, 2));
    // Of 2021, and truths.
    let table = table_2021(2);
    let first = START_MS.to_string();
    let floating = table.replace(&first, &float(START_MS)).replace(",1,2,GPS_L1", ",1.0,2.0,GPS_L1");
    assert_ne!(floating, table);
    assert_eq!(parse(&floating), parse(&table));
    let truth = |time: &str| {
        let header = "millisSinceGpsEpoch,latDeg,lngDeg,heightAboveWgs84EllipsoidM,speedMps,courseDegree\n";
        ground_truth(format!("{header}{time},37.42,-122.09,71.0,11.1,0.0\n").as_bytes()).unwrap().0
    };
    assert_eq!(
        truth(&float(START_MS)).times(&[1]).collect::<Vec<_>>(),
        truth(&first).times(&[1]).collect::<Vec<_>>()
    );
}

/// A slip that is declared on a row without a valid phase, or on one that is not used, is told by the next phase.
#[test]
fn a_slip_is_told_by_the_next_phase() {
    let header = format!("{},ReceivedSvTimeUncertaintyNanos\n", HEADER_2022.trim_end());
    let row = |second: i64, state: u32, uncertainty: &str| {
        let row = row_2022(START_MS + second * 1_000, &sky()[0], state, true);
        format!("{},{uncertainty}\n", row.trim_end())
    };
    let without_range = |row: String| row.replace(&format!("{:.4}", sky()[0].pseudorange_m), "");
    let without_times = |row: String| {
        let fields: Vec<&str> = row.trim_end().split(',').collect();
        let blank = |(k, field): (usize, &&str)| {
            if matches!(k, 10 | 11 | 14) { String::new() } else { (*field).to_owned() }
        };
        fields.iter().enumerate().map(blank).collect::<Vec<_>>().join(",") + "\n"
    };
    let (yes, no) = (Some(true), Some(false));
    for (middle, expected) in [
        (row(1, 4, ""), vec![no, None, yes, no]),
        (row(1, 2, ""), vec![no, None, yes, no]),
        (row(1, 18, ""), vec![no, None, yes, no]),
        (row(1, 29, "900"), vec![no, yes, no]),
        (without_range(row(1, 5, "")), vec![no, yes, no]),
        (without_times(row(1, 5, "")), vec![no, yes, no]),
        (without_times(row(1, 5, "")).replace("GPS_L1_CA", ""), vec![no, yes, no]),
        (row(0, 5, ""), vec![no, yes, no]),
        (row(1, 1, "900"), vec![no, no, no]),
        (row(1, 0, ""), vec![no, None, no, no]),
    ] {
        let table = [header.clone(), row(0, 1, ""), middle.clone(), row(2, 1, ""), row(3, 1, "")].concat();
        let file = DerivedFile::parse(table.as_bytes()).unwrap();
        let slip = |epoch: &RecordedEpoch| {
            let o = epoch.observations[0].observation;
            o.carrier_phase_cycles.map(|_| o.loss_of_lock.cycle_slip)
        };
        assert_eq!(file.epochs.iter().map(slip).collect::<Vec<_>>(), expected, "{middle}");
    }
    // Rows out of order within a minute: the order of time counts.
    let table = [header, row(0, 1, ""), row(2, 1, ""), row(1, 4, ""), row(3, 1, "")].concat();
    let file = DerivedFile::parse(table.as_bytes()).unwrap();
    let slips: Vec<_> =
        file.epochs.iter().map(|e| e.observations[0].observation.loss_of_lock.cycle_slip).collect();
    assert_eq!(slips, [false, false, true, false]);
}

#[test]
fn satellites_of_qzss_have_either_number() {
    let row = |svid: &str| row_2021(START_MS, &sky()[0]).replace(",1,1,GPS_L1", &format!(",4,{svid},QZS_J1"));
    for (svid, name) in [("1", "J01"), ("193", "J01"), ("3.0", "J03"), ("10", "J10"), ("202", "J10")] {
        let file = DerivedFile::parse(format!("{HEADER_2021}{}", row(svid)).as_bytes()).unwrap();
        assert!(file.skips.is_empty(), "{svid}: {}", file.skips);
        assert_eq!(file.epochs[0].observations[0].observation.satellite.to_string(), name);
    }
    for svid in ["0", "11", "192", "203", "nan", ""] {
        let file = DerivedFile::parse(format!("{HEADER_2021}{}", row(svid)).as_bytes()).unwrap();
        assert_eq!(file.skips.count(Reason::SatelliteNotUsed), 1, "{svid}: {}", file.skips);
    }
}

#[test]
fn glonass_satellites_known_by_channel_are_kept_beside() {
    let sky = sky();
    let by_channel = |svid: &str, sat: &Sat| {
        row_2022(START_MS, sat, 1, true)
            .replace(&format!(",1,{},38.5", sat.number), &format!(",3,{svid},38.5"))
            .replace("1575420030.0,C", "1602562500.0,C")
            .replace("GPS_L1_CA", "GLO_G1_CA")
    };
    let rows =
        [row_2022(START_MS, &sky[0], 1, true), by_channel("101", &sky[1]), by_channel("101.0", &sky[2])];
    let file = DerivedFile::parse(format!("{HEADER_2022}{}", rows.concat()).as_bytes()).unwrap();
    let [epoch] = file.epochs.as_slice() else { panic!("{}", file.skips) };
    assert_eq!((epoch.observations.len(), epoch.by_channel.len()), (1, 1), "{}", file.skips);
    assert_eq!(epoch.by_channel[0].channel, 1);
    assert!(epoch.by_channel[0].observation.doppler_hz.is_some());
    assert_eq!(file.skips.count(Reason::GlonassSatelliteByChannelOnly), 1);
    assert_eq!(file.skips.count(Reason::SignalTwice), 1);
    let alone = DerivedFile::parse(format!("{HEADER_2022}{}", rows[1]).as_bytes()).unwrap();
    assert!(alone.epochs.is_empty());
}

#[test]
fn ambiguous_milliseconds_beside_a_known_time_are_used() {
    let header = format!("{},State\n", HEADER_2022.trim_end());
    for (state, used) in
        [("16409", 1), ("16409.0", 1), ("1.6409e+04", 1), ("17", 0), ("5", 1), ("21", 0), ("1", 0)]
    {
        let row = row_2022(START_MS, &sky()[0], 1, true);
        let table = format!("{header}{},{state}\n", row.trim_end());
        let file = DerivedFile::parse(table.as_bytes()).unwrap();
        assert_eq!(file.epochs.len(), used, "{state}: {}", file.skips);
        assert_eq!(file.skips.count(Reason::MaskStateBits), 1 - used as u64, "{state}");
    }
}

/// Products come first; a satellite that they do not know has the state that the table gives it.
#[test]
fn states_of_the_table_serve_where_no_product_does() {
    let file = DerivedFile::parse(table_2021(1).as_bytes()).unwrap();
    let mut corrector = Corrector::new(Arc::new(Products::default()), CorrectionOptions::default());
    let prepared = file.epochs[0].prepare_with_products(&mut corrector);
    let reason = Reason::RecordedSatelliteStateUsed.text();
    assert_eq!((corrector.skips().count(reason), corrector.skips().total()), (6, 6), "{}", corrector.skips());
    let (corrected, _) = corrector.finish(&prepared, site(), file.epochs[0].time_gps);
    assert!(solve_position(&corrected, site()).unwrap().position().distance_m(site()) < 0.01);
}

#[test]
fn truths_of_both_generations() {
    let mut old = "collectionName,phoneName,millisSinceGpsEpoch,latDeg,lngDeg,heightAboveWgs84EllipsoidM,\
                   timeSinceFirstFixSeconds,hDop,vDop,speedMps,courseDegree\n"
        .to_owned();
    let mut new =
        "MessageType,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,\
                   BearingDegrees,UnixTimeMillis\n"
            .to_owned();
    for i in 0..3_i64 {
        let (time_ms, latitude) = (START_MS + i * 1_000, 37.42 + i as f64 * 1e-4);
        writeln!(old, "x,Pixel4,{time_ms},{latitude},-122.09,71.0,551.4,1.1,0,11.1,0.0").unwrap();
        writeln!(new, "Fix,GT,{latitude},-122.09,10.0,11.1,0.1,0.0,{}", time_ms + 315_964_800_000 - 18_000)
            .unwrap();
    }
    writeln!(old, "x,Pixel4,later,37,-122.09,71.0,551.4,1.1,0,11.1,0.0").unwrap();
    writeln!(new, "Fix,GT,137,-122.09,10.0,11.1,0.1,0.0,1600000000000").unwrap();
    assert!(!is_ground_truth(HEADER_2021.as_bytes()) && !is_ground_truth(HEADER_2022.as_bytes()));
    assert!(!is_ground_truth(b"gps_week,gps_tow_s,latitude_deg,longitude_deg\n") && !is_ground_truth(b""));
    for text in [old, new] {
        assert!(is_ground_truth(text.as_bytes()));
        let (truth, skips) = ground_truth(text.as_bytes()).unwrap();
        assert_eq!(skips.total(), 1, "{skips}");
        assert_eq!(truth.times(&[1]).count(), 3);
        let start = GpsTime::from_nanos(START_MS * 1_000_000);
        let first = truth.at(start, &[1]).unwrap();
        assert!(first.position.distance_m(site()) < 1e-3);
        let middle = LocalFrame::at(site()).ecef_to_enu(truth.at(start + 0.5, &[1]).unwrap().position);
        assert!((middle.north - 5.55).abs() < 0.05 && middle.east.abs() < 1e-3, "{middle:?}");
    }
    assert!(ground_truth(b"latDeg,lngDeg\n1,2\n").unwrap_err().to_string().contains("millisSinceGpsEpoch"));
    assert!(ground_truth(b"").is_err());
}

fn decode(portions: &[&[u8]]) -> (Vec<Record>, String) {
    let mut decoder = DerivedDecoder::default();
    let mut records = Vec::new();
    for portion in portions {
        if decoder.feed(portion).is_err() {
            break;
        }
        records.extend(std::iter::from_fn(|| decoder.next_record()));
    }
    let _ = decoder.finish();
    records.extend(std::iter::from_fn(|| decoder.next_record()));
    (records, decoder.skips().to_string())
}

#[test]
fn epochs_come_out_while_the_stream_goes_on() {
    let mut decoder = DerivedDecoder::default();
    decoder.feed(table_2021(100).as_bytes()).unwrap();
    let early = std::iter::from_fn(|| decoder.next_record()).count();
    assert_eq!(early, 39, "all that are more than a minute behind");
    decoder.finish().unwrap();
    assert_eq!(early + std::iter::from_fn(|| decoder.next_record()).count(), 100);
}

/// A table that stays within one minute for ever must not fill the memory.
#[test]
fn epochs_without_end_within_a_minute_come_out_too() {
    let sat = sky()[0];
    let table: String = (0..5_000).map(|ms| row_2021(START_MS + ms, &sat)).collect();
    let mut decoder = DerivedDecoder::default();
    decoder.feed(format!("{HEADER_2021}{table}").as_bytes()).unwrap();
    let early = std::iter::from_fn(|| decoder.next_record()).count();
    assert!((3_000..5_000).contains(&early), "{early}: {}", decoder.skips());
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn damaged_tables_never_panic_and_portions_do_not_matter(
        damages in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..4_u8), 0..8),
        size in 1..400_usize,
        newer: bool,
    ) {
        let mut table = if newer {
            sky().iter().fold(HEADER_2022.to_owned(), |t, sat| t + &row_2022(START_MS, sat, 1, true)).into_bytes()
        } else {
            table_2021(2).into_bytes()
        };
        for (at, value, kind) in damages {
            let at = at.index(table.len());
            match kind {
                0 => table[at] ^= value,
                1 => table.insert(at, value),
                2 => table.insert(at, b"0123456789.,-e\n"[usize::from(value) % 15]),
                _ => table.truncate(at.max(1)),
            }
        }
        let whole = decode(&[&table]);
        let portions: Vec<&[u8]> = table.chunks(size).collect();
        prop_assert_eq!(decode(&portions), whole);
        if let Ok(file) = DerivedFile::parse(&table) {
            prop_assert!(file.epochs.is_sorted_by(|a, b| a.time_gps < b.time_gps));
            let mut corrector = Corrector::new(Arc::new(Products::default()), CorrectionOptions::default());
            for epoch in &file.epochs {
                let prepared = epoch.prepare(&mut corrector);
                for o in corrector.finish(&prepared, site(), epoch.time_gps).0 {
                    prop_assert!(o.pseudorange_m.is_finite() && o.pseudorange_sigma_m > 0.0);
                    prop_assert!(o.satellite_position.is_finite() && o.satellite_velocity.is_finite());
                }
            }
        }
        let _ = ground_truth(&table);
    }
}
