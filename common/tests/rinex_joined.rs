//! Files joined to one another, each with its header, as people make them with `cat`; and line ends turned twice.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)] // helpers of tests

mod hatanaka_encoder;
#[macro_use]
mod navigation_records;

use cofix_common::formats::decode::Decoder;
use cofix_common::formats::rinex::{NavigationDecoder, ObservationFile};
use cofix_common::orbit::NavigationFile;
use cofix_common::skips::Reason;
use hatanaka_encoder::encode;

const AGAIN: &str = Reason::AnotherHeaderHolds.text();

fn header(content: &str, label: &str) -> String {
    format!("{content:<60}{label}\n")
}

/// A file of RINEX 3 with its own order of types.
fn file_3(types: &str, minute: u32, values: &str) -> String {
    header("     3.04           OBSERVATION DATA    M", "RINEX VERSION / TYPE")
        + &header(&format!("MINUTE {minute}"), "MARKER NAME")
        + &header(types, "SYS / # / OBS TYPES")
        + &header("  1 R01  1", "GLONASS SLOT / FRQ #")
        + &header("", "END OF HEADER")
        + &format!("> 2020 08 13 14 {minute:02}  2.0000000  0  1\nG10{values}\n")
}

fn file_2(minute: u32) -> String {
    header("     2.11           OBSERVATION DATA    G (GPS)", "RINEX VERSION / TYPE")
        + &header("     2    L1    C1", "# / TYPES OF OBSERV")
        + &header("", "END OF HEADER")
        + &format!(" 20  8 13 14 {minute:2}  2.0000000  0  1G10\n 291795067.814    21111612.436\n")
}

fn first() -> String {
    file_3("G    2 C1C S1C", 1, "  21111612.436          37.000")
}

fn second() -> String {
    file_3("G    2 S1C C1C", 2, "        37.000    21111612.436")
}

#[test]
fn each_file_is_read_by_its_own_header() {
    for joined in [
        first() + &second() + &file_2(3),
        encode(&first(), |_| true) + &encode(&second(), |_| true) + &encode(&file_2(3), |_| true),
        encode(&first(), |_| true) + &second() + &encode(&file_2(3), |_| true),
    ] {
        let file = ObservationFile::parse(joined.as_bytes()).unwrap();
        assert_eq!((file.skips.count(AGAIN), file.skips.total()), (2, 2), "{}", file.skips);
        assert_eq!(file.epochs.len(), 3);
        for epoch in &file.epochs {
            assert_eq!(epoch.observations[0].pseudorange_m, Some(21_111_612.436), "{joined}");
        }
        // What the first header told of satellites stays true.
        assert_eq!(file.header.glonass_channels.get(&1), Some(&1));
    }
}

#[test]
fn a_header_that_cannot_be_used_costs_what_follows_it() {
    let wrong = second().replace("3.04", "7.04");
    let file = ObservationFile::parse((first() + &wrong).as_bytes()).unwrap();
    assert_eq!(file.epochs.len(), 1);
    assert_eq!(file.skips.count(Reason::AnotherHeaderUnusable), 1, "{}", file.skips);
    let cut = second();
    let file = ObservationFile::parse((first() + &cut[..150]).as_bytes()).unwrap();
    assert_eq!((file.epochs.len(), file.skips.count(Reason::AnotherHeaderCutOff)), (1, 1), "{}", file.skips);
}

#[test]
fn line_ends_turned_again_and_again_are_line_ends() {
    let plain = ObservationFile::parse((first() + &file_2(3)).as_bytes()).unwrap();
    let turned = (first() + &file_2(3)).replace('\n', "\r\r\r\n");
    let file = ObservationFile::parse(turned.as_bytes()).unwrap();
    assert_eq!(file.epochs, plain.epochs);
}

const GLONASS_2: &str = glonass_file_2!();

const GPS_3: &str = "     3.04           N: GNSS NAV DATA    M: MIXED            RINEX VERSION / TYPE
                                                            END OF HEADER
G01 2005 04 02 02 00 00 3.966595977540E-04 1.705302565820E-12 0.000000000000E+00
     1.400000000000E+02-5.218750000000E+01 4.026596389650E-09 2.871534990340E+00
    -2.676621079440E-06 5.957618006510E-03 4.174187779430E-06 5.153636478420E+03
     5.256000000000E+05 1.061707735060E-07-2.493184817740E+00-9.313225746150E-08
     9.833919144490E-01 3.093750000000E+02-1.650496813270E+00-7.889971342930E-09
    -8.571785642400E-12 1.000000000000E+00 1.316000000000E+03 0.000000000000E+00
     0.000000000000E+00 0.000000000000E+00-3.259629011150E-09 3.960000000000E+02
     5.195760000000E+05
";

#[test]
fn navigation_files_are_joined_too() {
    for joined in [GLONASS_2.to_owned() + GPS_3, GPS_3.to_owned() + GLONASS_2] {
        let file = NavigationFile::parse(joined.as_bytes()).unwrap();
        let alone = NavigationFile::parse(GLONASS_2.as_bytes()).unwrap();
        assert_eq!((file.skips.count(AGAIN), file.skips.total()), (1, 1), "{}", file.skips);
        assert_eq!((file.ephemerides.len(), &file.glonass), (1, &alone.glonass));
    }
    let wrong = GPS_3.replace("3.04  ", "7.04  ");
    let file = NavigationFile::parse((GLONASS_2.to_owned() + &wrong).as_bytes()).unwrap();
    assert_eq!((file.glonass.len(), file.ephemerides.len()), (1, 0), "{}", file.skips);
    assert_eq!(file.skips.count(Reason::AnotherHeaderUnusable), 1);
    // A header that is cut off has cost nothing.
    let mut decoder = NavigationDecoder::default();
    decoder.feed((GPS_3.to_owned() + &GLONASS_2[..81]).as_bytes()).unwrap();
    assert!(decoder.finish().is_ok() && decoder.next_record().is_some());
}
