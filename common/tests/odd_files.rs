//! Files that are right but begin oddly, leave out a blank, or are of formats long superseded: byte order marks, empty lines, line
//! ends, lower case, SP3-a and SP3-b, time systems.

#![allow(clippy::unwrap_used, clippy::indexing_slicing)] // helpers of tests

mod hatanaka_encoder;

use std::io::Write as _;

use cofix_common::accuracy::Truth;
use cofix_common::atmosphere::Ionex;
use cofix_common::formats::decode::Decoder;
use cofix_common::formats::gnsslogger::GnssLoggerDecoder;
use cofix_common::formats::rinex::ObservationFile;
use cofix_common::formats::sp3::Sp3Error;
use cofix_common::formats::stream::ObservationStream;
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::Sp3;
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;
use flate2::{Compression, write::GzEncoder};
use hatanaka_encoder::encode;

/// What editors and writers put before a text.
const BEFORE: [&str; 7] =
    ["\u{feff}", "\n", "\r\n   \r\n", "\u{feff}\r\n", "\n\u{feff}", "\u{feff}\u{feff}", " \n\n\n"];

fn header(content: &str, label: &str) -> String {
    format!("{content:<60}{label}\n")
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn observations_3(version: &str) -> String {
    header(&format!("     {version}           OBSERVATION DATA    M"), "RINEX VERSION / TYPE")
        + &header("G    3 C1C L1C D1C", "SYS / # / OBS TYPES")
        + &header("  2020     8    13    14    19    2.0000000     GPS", "TIME OF FIRST OBS")
        + &header("", "END OF HEADER")
        + "> 2020 08 13 14 19  2.0000000  0  2\n"
        + "G10  21111612.436   291795067.81413     -2520.506\nG12  22111612.436   291795067.814         150.000\n"
        + "> 2020 08 13 14 19  3.0000000  0  1\nG10  21111613.436   291795068.81413     -2520.506\n"
}

fn observations_2(version: &str) -> String {
    header(&format!("     {version}           OBSERVATION DATA    G"), "RINEX VERSION / TYPE")
        + &header("     3    C1    L1    D1", "# / TYPES OF OBSERV")
        + &header("  2020     8    13    14    19    2.0000000     GPS", "TIME OF FIRST OBS")
        + &header("", "END OF HEADER")
        + " 20  8 13 14 19  2.0000000  0  2G10G12\n"
        + "  21111612.436   291795067.814       -2520.506\n  22111612.436   291795067.814         150.000\n"
        + " 20  8 13 14 19  3.0000000  0  1G10\n  21111613.436   291795068.814       -2520.506\n"
}

const EPHEMERIS: &str = "\
G05 2020 06 24 12 00 00-1.527462154627E-05-1.136868377216E-12 0.000000000000E+00
     4.200000000000E+01-5.350000000000E+01 4.649479382520E-09 2.114405521410E+00
    -2.721324563026E-06 6.019054679200E-03 8.247792720795E-06 5.153669506073E+03
     3.024000000000E+05 6.146728992462E-08 1.013406539140E+00-1.303851604462E-08
     9.540934791461E-01 2.212187500000E+02 8.093154155441E-01-8.160697048210E-09
     3.507288949806E-10 1.000000000000E+00 2.111000000000E+03 0.000000000000E+00
     2.000000000000E+00 0.000000000000E+00-1.117587089539E-08 4.200000000000E+01
     2.952180000000E+05 4.000000000000E+00
";

fn navigation(version: &str) -> String {
    let body = match version.as_bytes()[0] {
        b'2' => EPHEMERIS
            .lines()
            .map(|line| match line.strip_prefix("G05 2020") {
                Some(rest) => format!(" 5 20{}.0{}\n", rest[..15].replace(" 0", "  "), &rest[15..]),
                None => format!("{}\n", &line[1..]),
            })
            .collect(),
        b'4' => format!("> EPH G05 LNAV\n{EPHEMERIS}"),
        _ => EPHEMERIS.to_owned(),
    };
    header(&format!("     {version}           NAVIGATION DATA     G"), "RINEX VERSION / TYPE")
        + &header("    18", "LEAP SECONDS")
        + &header("", "END OF HEADER")
        + &body
}

/// As it is, with line ends of Windows, and with each oddity before it; plain and packed.
fn variants(text: &str) -> Vec<Vec<u8>> {
    let windows = text.replace('\n', "\r\n");
    let mut all = vec![windows.clone().into_bytes(), gzip(windows.as_bytes())];
    for before in BEFORE {
        all.push(format!("{before}{text}").into_bytes());
        all.push(gzip(format!("{before}{windows}").as_bytes()));
    }
    all
}

#[test]
fn observation_files_begin_as_they_will() {
    for version in ["2.10", "2.11", "2.12", "3.00", "3.01", "3.02", "3.03", "3.04", "3.05", "4.00", "4.02"] {
        let text = if version < "3" { observations_2(version) } else { observations_3(version) };
        let plain = ObservationFile::parse(text.as_bytes()).unwrap();
        assert_eq!((plain.epochs.len(), plain.epochs[0].observations.len()), (2, 2), "{version}");
        assert!(plain.skips.is_empty(), "{version}: {}", plain.skips);
        for text in [encode(&text, |_| false), text] {
            for variant in variants(&text) {
                let file = ObservationFile::parse(&variant).unwrap();
                assert_eq!(file.epochs, plain.epochs, "{version}");
                assert!(file.skips.is_empty(), "{version}: {}", file.skips);
            }
        }
    }
}

#[test]
fn a_mark_of_a_joined_file_is_none_of_its_text() {
    let text = observations_3("3.04");
    let later = text.replace(" 14 19  ", " 15 19  ");
    let file = ObservationFile::parse(format!("{text}\u{feff}{later}").as_bytes()).unwrap();
    assert_eq!(file.epochs.len(), 4, "{}", file.skips);
    assert_eq!(file.skips.total(), 1, "{}", file.skips);
}

#[test]
fn letters_may_be_of_either_case() {
    for text in [observations_2("2.11"), observations_3("3.04")] {
        let plain = ObservationFile::parse(text.as_bytes()).unwrap();
        let lower = ObservationFile::parse(text.to_lowercase().as_bytes()).unwrap();
        assert_eq!(lower.epochs, plain.epochs);
        assert!(lower.skips.is_empty(), "{}", lower.skips);
    }
    for version in ["2.11", "3.04"] {
        let plain = NavigationFile::parse(navigation(version).as_bytes()).unwrap();
        let lower = NavigationFile::parse(navigation(version).to_lowercase().as_bytes()).unwrap();
        assert_eq!(
            (lower.ephemerides.len(), lower.leap_seconds),
            (1, Some(18)),
            "{version}: {}",
            lower.skips
        );
        assert_eq!(lower.ephemerides[0].toe, plain.ephemerides[0].toe);
    }
}

#[test]
fn navigation_files_begin_as_they_will() {
    for version in ["2.10", "2.11", "3.00", "3.02", "3.04", "3.05", "4.00", "4.01"] {
        let text = navigation(version);
        let plain = NavigationFile::parse(text.as_bytes()).unwrap();
        assert_eq!((plain.ephemerides.len(), plain.skips.total()), (1, 0), "{version}: {}", plain.skips);
        for variant in variants(&text) {
            let file = NavigationFile::parse(&variant).unwrap();
            assert_eq!(file.ephemerides, plain.ephemerides, "{version}");
            assert!(file.skips.is_empty() && file.leap_seconds == Some(18), "{version}: {}", file.skips);
        }
    }
}

/// The year directly after the `>`; all else is then a column farther to the left.
#[test]
fn epoch_lines_may_lack_their_blank() {
    let text = observations_3("3.04") + "> 2020 08 13 14 19  4.0000000  4  1\n" + &header("x", "COMMENT");
    let plain = ObservationFile::parse(text.as_bytes()).unwrap();
    let without = text.replace("> 2020", ">2020");
    for form in [encode(&text, |_| true).replace("> 2020", ">2020"), without] {
        let file = ObservationFile::parse(form.as_bytes()).unwrap();
        assert_eq!((&file.epochs, &file.events), (&plain.epochs, &plain.events), "{form}");
        assert!(file.skips.is_empty(), "{}", file.skips);
    }
}

/// Weeks of BeiDou from 2006 on, and as some writers count them, from 1980.
#[test]
fn beidou_records_may_count_weeks_from_1980() {
    let of_week = |week: &str| {
        let record = EPHEMERIS.replacen("G05", "C07", 1).replacen("2.111000000000E+03", week, 1);
        let text = header("     3.04           NAVIGATION DATA     C", "RINEX VERSION / TYPE")
            + &header("", "END OF HEADER")
            + &record;
        NavigationFile::parse(text.as_bytes()).unwrap()
    };
    let reason = Reason::BeidouWeekFrom1980.text();
    let right = of_week("7.550000000000E+02");
    assert_eq!((right.ephemerides.len(), right.skips.total()), (1, 0), "{}", right.skips);
    let other = of_week("2.111000000000E+03");
    // As text, for an unknown group delay is NaN.
    assert_eq!(format!("{:?}", other.ephemerides), format!("{:?}", right.ephemerides));
    assert_eq!(other.skips.count(reason), 1, "{}", other.skips);
    assert_eq!(other.skips.total(), 1);
    for week in ["1.500000000000E+03", "1.000000000000E+02"] {
        let wrong = of_week(week);
        assert_eq!(wrong.skips.count(Reason::RecordImpossible), 1, "{week}: {}", wrong.skips);
    }
}

#[test]
fn a_system_whose_weeks_were_not_rolled_over_is_named() {
    let old = EPHEMERIS.replacen("G05 2020 06 24", "J02 2000 11 08", 1).replacen(
        "2.111000000000E+03",
        "1.087000000000E+03",
        1,
    );
    let file = NavigationFile::parse((navigation("3.04") + &old).as_bytes()).unwrap();
    assert_eq!(file.ephemerides.len(), 2, "{}", file.skips);
    let reason = Reason::WeeksNotRolledOver.text();
    assert_eq!(file.skips.count(reason), 1, "{}", file.skips);
    let (_, skip) = file.skips.iter().find(|(found, _)| *found == reason).unwrap();
    assert!(skip.first.starts_with("1 records of J up to 2000-11-08"), "{}", skip.first);
    assert!(skip.first.contains("1024 weeks"), "{}", skip.first);
}

#[test]
fn leap_seconds_of_a_header_that_cannot_be_are_named() {
    let reason = Reason::HeaderLeapSecondsWrong.text();
    let with = |seconds: &str| {
        let text = observations_3("3.04").replace(
            &header("", "END OF HEADER"),
            &(header(seconds, "LEAP SECONDS") + &header("", "END OF HEADER")),
        );
        ObservationFile::parse(text.replace("     GPS   ", "     GLO   ").as_bytes()).unwrap()
    };
    let time: GpsTime = "2020-08-13T14:19:20".parse().unwrap();
    for (seconds, count) in [("    18", 0), ("    17", 1), ("    19", 1), ("     0", 1)] {
        let file = with(seconds);
        assert_eq!((file.epochs[0].time_gps, file.skips.count(reason)), (time, count), "{}", file.skips);
        assert_eq!(file.header.leap_seconds, Some(18));
    }
}

const SP3: &str = "\
#dP2020  6 25  0  0  0.00000000       2 ORBIT IGS14 HLM  IGS
## 2111 345600.00000000   900.00000000 59025 0.0000000000000
+    2   G01G02  0  0  0  0  0  0  0  0  0  0  0  0  0  0  0
++         2  2  0  0  0  0  0  0  0  0  0  0  0  0  0  0  0
%c M  cc GPS ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc
%c cc cc ccc ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc
%f  1.2500000  1.025000000  0.00000000000  0.000000000000000
/* A COMMENT
*  2020  6 25  0  0  0.00000000
PG01 -17272.048721  -5232.888934  19492.703813    307.266012
PG02 -19434.880972 -14052.824383  12325.795382   -130.438915
*  2020  6 25  0 15  0.00000000
PG01 -18272.048721  -6232.888934  18492.703813    307.266012
PG02 -20434.880972 -13052.824383  11325.795382   -130.438915
EOF
";

#[test]
fn sp3_of_every_version_is_read() {
    let plain = Sp3::parse(SP3.as_bytes()).unwrap();
    assert_eq!((plain.epochs, plain.positions.len(), plain.skips.total()), (2, 4, 0), "{}", plain.skips);
    // Version a has GPS alone, in bare numbers, velocities if it likes, and no time system.
    let bare = |text: &str| {
        let text =
            text.replace("PG0", "P  ").replace("G01G02", "  1  2").replace("%c M  cc GPS", "%c cc cc ccc");
        let velocity = "V  1  -8880.949046 -23142.274905 -14050.679881      0.089376\n";
        text.replace("P  2", &format!("{velocity}P  2"))
    };
    for version in ["a", "b", "c", "d"] {
        for text in [SP3.to_owned(), bare(SP3)] {
            let text = text.replacen("#d", &format!("#{version}"), 1);
            for variant in variants(&text).into_iter().chain([text.into_bytes()]) {
                let file = Sp3::parse(&variant).unwrap();
                assert_eq!(file.positions, plain.positions, "{version}");
                assert!(file.skips.is_empty(), "{version}: {}", file.skips);
            }
        }
    }
    for version in ["#e", "#", "%c", "# a"] {
        let other = SP3.replacen("#d", version, 1);
        assert!(matches!(Sp3::parse(other.as_bytes()), Err(Sp3Error::NotSp3 { .. })), "{version}");
    }
}

#[test]
fn sp3_times_of_every_system_become_gps_time() {
    let first = |system: &str| {
        let text = SP3.replacen("cc GPS", &format!("cc {system}"), 1);
        Sp3::parse(text.as_bytes()).map(|file| file.positions[0].time)
    };
    let own: GpsTime = "2020-06-25T00:00:00".parse().unwrap();
    for (system, seconds) in [
        ("GPS", 0.0),
        ("GAL", 0.0),
        ("QZS", 0.0),
        ("IRN", 0.0),
        ("ccc", 0.0),
        ("   ", 0.0),
        ("BDT", 14.0),
        ("UTC", 18.0),
        ("GLO", 18.0),
        ("TAI", -19.0),
    ] {
        assert_eq!(first(system).unwrap() - own, seconds, "{system}");
    }
    assert_eq!(first("XYZ"), Err(Sp3Error::TimeSystem { found: "XYZ".to_owned() }));
    // Through the leap second at the end of 2016: the day has one second more.
    let text = SP3.replacen("cc GPS", "cc UTC", 1).replace("2020  6 25  0  0", "2016 12 31 23 45");
    let file = Sp3::parse(text.replace("2020  6 25  0 15", "2017  1  1  0  0").as_bytes()).unwrap();
    assert_eq!(file.positions[2].time - file.positions[0].time, 901.0);
}

#[test]
fn sp3_headers_may_be_odd() {
    let plain = Sp3::parse(SP3.as_bytes()).unwrap();
    let (first, rest) = SP3.split_once('\n').unwrap();
    for text in [
        format!("{first}\n\n{rest}"),
        format!("{first}\n/* BEFORE ITS TIME\n{rest}"),
        SP3.replace("%c cc", "\n%c cc"),
        SP3.replace("EOF", ""),
    ] {
        let file = Sp3::parse(text.as_bytes()).unwrap();
        assert_eq!(file.positions, plain.positions, "{text}");
        assert!(file.skips.is_empty(), "{}", file.skips);
    }
    assert!(matches!(Sp3::parse(first.as_bytes()), Err(Sp3Error::Interval { .. })));
}

#[test]
fn maps_and_truths_begin_as_they_will() {
    // A header that is cut after its first line is refused for the rest, not for its beginning.
    let first = header("     1.0            IONOSPHERE MAPS     GNSS", "IONEX VERSION / TYPE");
    let expected = Ionex::parse(first.as_bytes()).unwrap_err();
    let truth = "gps_week,gps_tow_s,latitude_deg,longitude_deg,ellipsoidal_height_m,velocity_north_mps,\
                 velocity_east_mps,velocity_up_mps,quality\n2118,397141.0,30.5,114.4,30.0,0,0,0,1\n\
                 2118,397142.0,30.5,114.4,30.0,0,0,0,1\n";
    let plain = Truth::parse_csv(truth.as_bytes()).unwrap();
    for before in BEFORE {
        assert_eq!(Ionex::parse(format!("{before}{first}").as_bytes()).unwrap_err(), expected);
        assert_eq!(Truth::parse_csv(format!("{before}{truth}").as_bytes()).unwrap(), plain, "{before:?}");
    }
}

/// A mark before the header of the columns: they are known all the same.
#[test]
fn phone_logs_begin_as_they_will() {
    let log = "# Fix,Provider,Latitude,Longitude,Altitude,Speed,Accuracy,(UTC)TimeInMs\n\
               # Version: 3 Platform: 14 Manufacturer: A Model: B\n\
               Fix,fused,31.5,114.4,30.0,0.0,5.0,1597328343000\nFix,gps,30.5,114.4,30.0,0.0,5.0,1597328342000\n\
               Fix,gps,32.5,114.4,30.0,0.0,5.0,1597328344000\n";
    for before in BEFORE.into_iter().chain([""]) {
        let mut decoder = GnssLoggerDecoder::default();
        decoder.feed(format!("{before}{log}").as_bytes()).unwrap();
        decoder.finish().unwrap();
        assert!(decoder.next_record().is_none());
        assert!(decoder.skips().is_empty(), "{before:?}: {}", decoder.skips());
        assert_eq!(decoder.equipment().receiver_type, "A B");
        // The GNSS chip's first position goes before the fused one.
        let place = decoder.approximate_position().unwrap().ecef_to_geodetic();
        assert!((place.latitude_deg() - 30.5).abs() < 1e-9);
    }
}
