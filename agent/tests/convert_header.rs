//! What conversion writes into the header of the place, the receiver and the antenna, from every format that tells them; and
//! signals that satellites cannot send, which it leaves out.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod recordings;

use cofix_agent::Stop;
use cofix_agent::convert::{Converted, Outputs, convert};
use cofix_agent::source::Reading;
use cofix_common::formats::rinex::ObservationFile;
use cofix_common::frames::{Ecef, Geodetic};
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;

use recordings::{frame, log, msm4_of, rinex_3, rtcm};

/// Converts recordings, one after the other, into one file, which is read back.
fn converted(recordings: &[&[u8]]) -> (String, ObservationFile, Converted) {
    let folder = tempfile::tempdir().unwrap();
    let inputs: Vec<_> = recordings
        .iter()
        .enumerate()
        .map(|(index, bytes)| {
            let path = folder.path().join(format!("input{index}"));
            std::fs::write(&path, bytes).unwrap();
            path
        })
        .collect();
    let output = folder.path().join("output.rnx");
    let outputs = Outputs { observations: Some(output.clone()), ..Outputs::default() };
    let near = GpsTime::from_week_tow(2_118, 397_140.0);
    let reading = Reading { near: Some(near), ..Reading::default() };
    let converted = convert(&inputs, &outputs, &reading, &Stop::default()).unwrap();
    let text = std::fs::read_to_string(output).unwrap();
    let file = ObservationFile::parse(text.as_bytes()).unwrap();
    assert!(file.skips.is_empty(), "{}", file.skips);
    (text, file, converted)
}

/// Messages 1005 and 1033 of a station.
fn station() -> Vec<u8> {
    let mut bits: Vec<bool> = Vec::new();
    let mut put = |value: i64, count: u32| bits.extend((0..count).rev().map(|place| value >> place & 1 == 1));
    put(1_005, 12);
    put(7, 12);
    put(0, 6 + 4);
    put(-22_700_001_234, 38);
    put(0, 2);
    put(50_100_005_678, 38);
    put(0, 2);
    put(32_200_009_012, 38);
    let position: Vec<u8> = bits
        .chunks(8)
        .map(|byte| (0..8).fold(0, |sum, place| sum << 1 | u8::from(byte.get(place) == Some(&true))))
        .collect();
    let texts = |all: &[&str]| -> Vec<u8> {
        all.iter().flat_map(|text| [&[u8::try_from(text.len()).unwrap()], text.as_bytes()].concat()).collect()
    };
    let equipment =
        [vec![0x40, 0x90, 7], texts(&["ANTENNA 1"]), vec![0], texts(&["A77", "RECEIVER 2", "5.44", "R88"])];
    [frame(&position), frame(&equipment.concat())].concat()
}

#[test]
fn a_phone_log_gives_its_first_position_and_its_phone() {
    let mut bytes = b"# Version: v3.0.6.4 Platform: 14 Manufacturer: Example Model: Phone 7\n\
          # Fix,Provider,Latitude,Longitude,Altitude,Speed,Accuracy,(UTC)TimeInMs\n\
          Fix,network,31.5,114.4,40.0,0.0,5.0,1597328343000\nFix,gps,30.5,114.4,30.0,0.0,5.0,1597328344000\n"
        .to_vec();
    bytes.extend(log(3).bytes());
    let (_, file, _) = converted(&[&bytes]);
    let Ecef(position) = file.header.approximate_position.unwrap();
    let Ecef(expected) = Geodetic::from_degrees(30.5, 114.4, 30.0).geodetic_to_ecef();
    assert!((position - expected).norm() < 1e-3, "{position}");
    let equipment = &file.header.equipment;
    assert_eq!(equipment.receiver_type, "Example Phone 7");
    assert_eq!(equipment.receiver_version, "Android 14 v3.0.6.4");
}

#[test]
fn a_station_gives_its_position_receiver_and_antenna() {
    let (_, file, _) = converted(&[&[station(), rtcm(3).bytes()].concat()]);
    let position = file.header.approximate_position.unwrap();
    assert!((position.0 - Ecef::new(-2_270_000.123_4, 5_010_000.567_8, 3_220_000.901_2).0).norm() < 1e-3);
    let e = &file.header.equipment;
    assert_eq!((e.antenna_type.as_str(), e.antenna_number.as_str()), ("ANTENNA 1", "A77"));
    let receiver = (e.receiver_type.as_str(), e.receiver_version.as_str(), e.receiver_number.as_str());
    assert_eq!(receiver, ("RECEIVER 2", "5.44", "R88"));
}

#[test]
fn a_header_is_carried_over_and_the_first_file_counts() {
    let plain = String::from_utf8(rinex_3(3).bytes()).unwrap();
    let line = |text: &str, label: &str| format!("{text:<60}{label}\n");
    let with = |name: &str| {
        let lines = line(name, "MARKER NAME")
            + &line("13001M001", "MARKER NUMBER")
            + &line("GROUND_CRAFT", "MARKER TYPE")
            + &line("OBSERVER            AGENCY OF THE OBSERVER", "OBSERVER / AGENCY")
            + &line("R1                  RECEIVER            1.2", "REC # / TYPE / VERS")
            + &line("A1                  ANTENNA         NONE", "ANT # / TYPE")
            + &line("  4082000.1385  1410145.3094  4678053.6452", "APPROX POSITION XYZ")
            + &line("        1.5000        0.0100       -0.0200", "ANTENNA: DELTA H/E/N");
        plain.replacen(&line("", "END OF HEADER"), &(lines + &line("", "END OF HEADER")), 1)
    };
    let input = ObservationFile::parse(with("SITE 1").as_bytes()).unwrap();
    let later = with("SITE 2").replace(" 14 19 ", " 15 19 ").replace("RECEIVER  ", "RECEIVER 2");
    let (_, output, _) = converted(&[with("SITE 1").as_bytes(), later.as_bytes()]);
    assert_eq!(output.epochs.len(), 6);
    assert_eq!(output.header.marker_name, "SITE 1");
    assert_eq!(output.header.equipment, input.header.equipment);
    assert_eq!(output.header.approximate_position, input.header.approximate_position);
    assert_eq!(output.header.equipment.antenna_delta_hen_m, Some([1.5, 0.01, -0.02]));
}

/// Zeros would read as the Earth's centre.
#[test]
fn a_position_that_nobody_told_is_not_written() {
    for recording in [rinex_3(3), log(3), rtcm(3)] {
        let (text, file, _) = converted(&[&recording.bytes()]);
        assert!(!text.contains("APPROX POSITION XYZ"), "{}", recording.name);
        assert_eq!(file.header.approximate_position, None);
    }
}

/// BeiDou's signal 14 (B2I) of a satellite that has none.
#[test]
fn signals_of_other_satellites_are_left_out_and_counted() {
    let messages = (0..3)
        .map(|second| frame(&msm4_of((1_124, 14), 397_140_000 - 14_000 + 1_000 * second, &[7, 24], 74)));
    let (_, file, converted) = converted(&[&messages.flatten().collect::<Vec<u8>>()]);
    let names: Vec<String> =
        file.epochs[0].observations.iter().map(|o| format!("{} {}", o.satellite, o.signal)).collect();
    assert_eq!(names, ["C07 7I"]);
    assert!(converted.skips.count(Reason::BeidouSignalOfOtherGeneration) >= 3, "{}", converted.skips);
}
