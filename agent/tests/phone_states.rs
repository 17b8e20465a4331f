//! Logs of phones that state the satellites themselves, and of weeks that were not rolled over, through the agent's pipeline.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

use std::fmt::Write as _;
use std::sync::Arc;

use cofix_agent::settings::{LogOptions, Masks};
use cofix_agent::source::{Reading, open_file, survey};
use cofix_agent::{Source, Stop};
use cofix_common::constants::{EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS};
use cofix_common::formats::decode::Record;
use cofix_common::frames::{Ecef, Enu, Geodetic, LocalFrame};
use cofix_common::orbit::Products;
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;

const HEADER: &str = "# Raw,TimeNanos,FullBiasNanos,BiasNanos,Svid,State,ReceivedSvTimeNanos,Cn0DbHz,ConstellationType,\
    SvPositionEcefXMeters,SvPositionEcefYMeters,SvPositionEcefZMeters,SvVelocityEcefXMetersPerSecond,\
    SvVelocityEcefYMetersPerSecond,SvVelocityEcefZMetersPerSecond,SvClockBiasMeters,SvClockDriftMetersPerSecond,\
    IonosphericDelayMeters,TroposphericDelayMeters\n";
const WEEK_NS: i64 = 604_800_000_000_000;
const SATELLITE_CLOCK_M: f64 = -40_000.0;

fn site() -> Ecef {
    Geodetic::from_degrees(37.42, -122.09, 10.0).geodetic_to_ecef()
}

/// Three epochs of six satellites without an atmosphere, whose states the phone gives; the week `late` weeks too low.
fn log(late: i64) -> String {
    let frame = LocalFrame::at(site());
    let mut text = HEADER.to_owned();
    let start = "2023-11-07T12:00:00".parse::<GpsTime>().unwrap().nanos();
    for second in 0..3_i64 {
        let gps_ns = start + second * 1_000_000_000;
        let directions =
            [(10.0, 70.0), (60.0, 20.0), (130.0, 45.0), (200.0, 30.0), (280.0, 55.0), (330.0, 15.0)];
        for ((azimuth_deg, elevation_deg), number) in directions.into_iter().zip(1..) {
            let (azimuth, elevation) = (f64::to_radians(azimuth_deg), f64::to_radians(elevation_deg));
            let range_m = 22.0e6_f64;
            let (flat, up) = (range_m * elevation.cos(), range_m * elevation.sin());
            let seen = frame.enu_to_ecef(Enu { east: flat * azimuth.sin(), north: flat * azimuth.cos(), up });
            // Back into the frame of the transmission.
            let (sin, cos) = (EARTH_ROTATION_RADPS * range_m / SPEED_OF_LIGHT_MPS).sin_cos();
            let (x, y, z) = (cos * seen.0.x - sin * seen.0.y, cos * seen.0.y + sin * seen.0.x, seen.0.z);
            #[allow(clippy::cast_possible_truncation)] // below 0.1 s
            let travel_ns = ((range_m - SATELLITE_CLOCK_M) / SPEED_OF_LIGHT_MPS * 1e9).round() as i64;
            let received = (gps_ns - travel_ns).rem_euclid(WEEK_NS);
            let (time_ns, full_bias_ns) = (5_000 + gps_ns - start, 5_000 - start + late * WEEK_NS);
            writeln!(
                text,
                "Raw,{time_ns},{full_bias_ns},0.0,{number},16431,{received},40.0,1,{x:.4},{y:.4},{z:.4},100.0,-200.0,\
                 300.0,{SATELLITE_CLOCK_M},0.0,0.0,0.0"
            )
            .unwrap();
        }
    }
    text
}

/// The last position of a log without products, and what was skipped on the way.
fn position(text: &str, options: &LogOptions) -> (Option<Ecef>, Skips) {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), text).unwrap();
    let reading = Reading { log: options.with(&Masks::default()).unwrap(), ..Reading::default() };
    let mut pipeline = PhonePipeline::new("p", Arc::new(Products::default()), PipelineOptions::default());
    let mut records = open_file(file.path(), &reading).unwrap();
    while let Some(record) = records.next(&Stop::default()).unwrap() {
        let Record::Epoch(epoch) = record else { continue };
        pipeline.process_last(&epoch, records.decoder());
    }
    let mut skips = pipeline.skips();
    skips.merge(&records.skips());
    (pipeline.position(), skips)
}

#[test]
fn states_that_the_phone_gives_stand_in_for_products() {
    let (position, skips) = position(&log(0), &LogOptions::default());
    let error_m = position.unwrap().distance_m(site());
    // Times of transmission are whole nanoseconds.
    assert!(error_m < 1.0, "{error_m} m");
    assert_eq!(skips.count(Reason::RecordedSatelliteStateUsed), 18, "{skips}");
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), log(0)).unwrap();
    let survey = survey(
        &Source::File { path: file.path().to_owned(), near: None },
        &Reading::default(),
        &Stop::default(),
    )
    .unwrap();
    assert!(survey.has_phone_states && survey.has_corrections);
}

#[test]
fn a_week_that_was_not_rolled_over_is_shifted() {
    let (none, skips) = position(&log(1_024), &LogOptions::default());
    assert!(none.is_none() && skips.to_string().contains("--shift-weeks 1024"), "{skips}");
    let shifted = LogOptions { shift_weeks: Some(1_024), ..LogOptions::default() };
    let (found, skips) = position(&log(1_024), &shifted);
    assert!(found.unwrap().distance_m(site()) < 1.0, "{skips}");
}
