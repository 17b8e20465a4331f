//! The date of an RTCM 3 recording by the weeks of its ephemerides, by the file's last change, and by what the user says; each said where they differ.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod recordings;

use std::fs::File;
use std::time::{Duration, UNIX_EPOCH};

use cofix_agent::inspect::{InspectOptions, Inspection, inspect};
use cofix_agent::source::Reading;
use cofix_agent::{Source, Stop};
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;
use flate2::Compression;
use flate2::write::GzEncoder;
use rtcm_rs::msg::Msg1019T;
use rtcm_rs::{Message, MessageBuilder};

use recordings::{frame, msm4};

const BEGIN: &str = "2020-06-27T23:59:58";
const NO_DATE: &str = Reason::NoDateGiven.text();
const OTHER_CHANGE: &str = Reason::FileLastChangeNotWeekStreamEphemerides.text();
const OTHER_DATE: &str = Reason::DateGiven.text();

fn begin() -> GpsTime {
    BEGIN.parse().unwrap()
}

/// Four epochs over the end of a week, and ephemerides of two satellites in the midst.
fn stream(has_ephemerides: bool) -> Vec<u8> {
    let epoch = |second: u64| frame(&msm4(1_074, (604_798_000 + second * 1_000) % 604_800_000, &[7, 8], 74));
    let ephemeris = |gps_satellite_id| {
        let message = Message::Msg1019(Msg1019T {
            gps_satellite_id,
            gps_week_number: 2_111 % 1_024,
            toc_s: 597_600.0,
            toe_s: 597_600.0,
            sqrt_a_sqrt_m: 5_153.7,
            ..Msg1019T::default()
        });
        MessageBuilder::new().build_message(&message).unwrap().to_vec()
    };
    let ephemerides = if has_ephemerides { [ephemeris(7), ephemeris(8)].concat() } else { Vec::new() };
    [epoch(0), epoch(1), ephemerides, epoch(2), epoch(3)].concat()
}

struct Bench(tempfile::TempDir);

impl Bench {
    /// Inspects a file that was last changed some days after its beginning.
    fn inspect(&self, bytes: &[u8], changed_days: f64, date: Option<GpsTime>) -> Inspection {
        let path = self.0.path().join("recording.rtcm3");
        std::fs::write(&path, bytes).unwrap();
        // 2020-06-27T23:59:40 UTC.
        let changed = UNIX_EPOCH + Duration::from_secs_f64(1_593_302_380.0 + changed_days * 86_400.0);
        File::options().write(true).open(&path).unwrap().set_modified(changed).unwrap();
        let reading = Reading { near: date, ..Reading::default() };
        inspect(&path, &InspectOptions { reading, ..InspectOptions::default() }, &Stop::default()).unwrap()
    }
}

#[test]
fn known_weeks_beat_last_changes_and_dates() {
    let bench = Bench(tempfile::tempdir().unwrap());
    let stream = stream(true);
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    std::io::Write::write_all(&mut encoder, &stream).unwrap();
    for bytes in [stream.clone(), encoder.finish().unwrap()] {
        for (days, said) in [
            (0.001, false),
            (3.0, false),
            (6.0, false),
            (8.0, true),
            (400.0, true),
            (-18_000.0, true),
            (36_000.0, true),
        ] {
            let inspection = bench.inspect(&bytes, days, None);
            let skips = &inspection.skips;
            assert_eq!(inspection.first_gps.as_deref(), Some("2020-06-27T23:59:58.000"), "{days}: {skips}");
            assert_eq!(inspection.last_gps.as_deref(), Some("2020-06-28T00:00:01.000"), "{days}: {skips}");
            assert_eq!((skips.count(OTHER_CHANGE) > 0, skips.count(NO_DATE)), (said, 0), "{days}: {skips}");
        }
        for (days, said) in [(-3.0, false), (3.0, false), (-4.0, true), (4.0, true), (1_000.0, true)] {
            let inspection = bench.inspect(&bytes, 0.0, Some(begin() + days * 86_400.0));
            let skips = &inspection.skips;
            assert_eq!(inspection.first_gps.as_deref(), Some("2020-06-27T23:59:58.000"), "{days}: {skips}");
            assert_eq!(skips.count(OTHER_DATE) > 0, said, "{days}: {skips}");
        }
    }
}

#[test]
fn without_ephemerides_a_recording_ends_before_its_last_change() {
    let bench = Bench(tempfile::tempdir().unwrap());
    for days in [0.0001, 0.5, 3.0, 5.0, 6.0] {
        let inspection = bench.inspect(&stream(false), days, None);
        let skips = &inspection.skips;
        assert_eq!(inspection.first_gps.as_deref(), Some("2020-06-27T23:59:58.000"), "{days}: {skips}");
        assert_eq!(skips.count(NO_DATE), 1, "{days}: {skips}");
    }
}

/// A survey and what follows it agree, whatever the file is.
#[test]
fn surveys_date_as_readings_do() {
    let bench = Bench(tempfile::tempdir().unwrap());
    bench.inspect(&stream(true), 30.0, None);
    let source = Source::File { path: bench.0.path().join("recording.rtcm3"), near: None };
    let survey = cofix_agent::source::survey(&source, &Reading::default(), &Stop::default()).unwrap();
    assert_eq!((survey.epochs, survey.navigation.file.ephemerides.len()), (4, 2));
    let toe = GpsTime::from_week_tow(2_111, 597_600.0);
    assert!(survey.navigation.file.ephemerides.iter().all(|ephemeris| ephemeris.toe == toe));
}
