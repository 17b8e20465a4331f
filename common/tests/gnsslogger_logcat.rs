//! GnssLogger's lines in Android's system log.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod beside;
mod log_lines;

use beside::required;
use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::format::Format;
use cofix_common::formats::stream::{StreamDecoder, recognise_text};
use cofix_common::skips::{Reason, Skips};

/// What `logcat -v brief`, `time` and `threadtime` write in front of a message.
const PREFIXES: [&str; 3] = [
    "D/GpsOutputMeasure( 4321): ",
    "11-07 12:00:00.300 D/GpsOutputMeasure( 4321): ",
    "11-07 12:00:00.300  4321  4340 D GpsOutputMeasure: ",
];
const OTHER: &str =
    "11-07 12:00:00.300  1200  1201 I ActivityManager: Start proc 4321:com.android.gpstest/u0a99";

fn decode(text: &str) -> (Vec<Record>, Skips) {
    let near = "2023-11-07T12:00:00".parse().unwrap();
    let mut decoder = StreamDecoder::new(near);
    decoder.feed(text.as_bytes()).unwrap();
    decoder.finish().unwrap();
    assert_eq!(decoder.format(), Some(Format::GnssLogger));
    (std::iter::from_fn(|| decoder.next_record()).collect(), decoder.skips().clone())
}

#[test]
#[ignore = "needs the reference data"]
fn a_log_in_the_system_log_gives_the_same_records() {
    let plain = String::from_utf8(required("data/pixel6-2023/pixel6.txt")).unwrap();
    // As apps write it: no line of sensors, whose kinds are not known to be of a log.
    let own =
        |line: &&str| ["# Raw", "Raw,", "Fix,", "Nav,", "Status,"].iter().any(|kind| line.starts_with(kind));
    let lines: Vec<&str> = plain.lines().filter(own).collect();
    let (expected, skips) = decode(&(lines.join("\n") + "\n"));
    assert!(expected.len() > 5, "{}", expected.len());
    for prefix in PREFIXES {
        let mut logged = "--------- beginning of main\n".to_owned();
        for line in &lines {
            logged.extend([OTHER, "\r\n", prefix, line, "\r\n"]);
        }
        let (records, found) = decode(&logged);
        assert_eq!(format!("{records:?}"), format!("{expected:?}"), "{prefix}");
        assert_eq!(found.count(Reason::SystemLogLine), lines.len() as u64 + 1, "{found}");
        assert_eq!(found.total(), skips.total() + lines.len() as u64 + 1, "{found}");
    }
}

/// GPSTest's measurements as Android prints them have no receiver clock: no pseudorange can be formed of them.
#[test]
fn measurements_without_a_clock_are_named() {
    let mut text = String::new();
    for said in [
        "GnssMeasurement:",
        "   Svid                          = 5",
        "   Cn0DbHz                       = 38.5",
    ] {
        text.extend([PREFIXES[2], said, "\n"]);
    }
    let (records, skips) = decode(&text);
    assert!(records.is_empty());
    assert_eq!(skips.count(Reason::SystemLogMeasurementWithoutClock), 1, "{skips}");
    assert_eq!(skips.count(Reason::SystemLogLine), 2, "{skips}");
}

#[test]
fn a_system_log_without_any_line_of_a_log_is_not_recognised() {
    assert_eq!(recognise_text(format!("{OTHER}\n").as_bytes(), true), None);
    let line = log_lines::gps(0).text();
    assert_eq!(
        recognise_text(format!("{OTHER}\n{}{line}\n", PREFIXES[0]).as_bytes(), false),
        Some(Format::GnssLogger)
    );
    assert_eq!(decode(&format!("{}{line}\n", PREFIXES[0])).1.count(Reason::RawLineWithoutHeader), 1);
}
