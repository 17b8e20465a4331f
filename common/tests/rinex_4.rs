//! RINEX 4 navigation and observation files, written here, and RINEX 3.05 GLONASS.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod beside;
#[macro_use]
mod navigation_records;

use beside::required;
use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::rinex::{NavigationDecoder, ObservationFile};
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::Products;
use cofix_common::skips::Reason;

const GPS: &str = gps!();
const GLONASS: &str = glonass!();
const GALILEO: &str = galileo!();

fn header(content: &str, label: &str) -> String {
    format!("{content:<60}{label}\n")
}

fn navigation(version: &str, body: &str) -> String {
    header(&format!("     {version}           NAVIGATION DATA     M"), "RINEX VERSION / TYPE")
        + &header("    18    18  1929     7", "LEAP SECONDS")
        + &header("", "END OF HEADER")
        + body
}

/// All kinds of records.
fn mixed() -> String {
    let klobuchar = "    2020 06 25 00 00 00 4.656600000000e-09 1.490100000000e-08-5.960500000000e-08
    -1.192100000000e-07 8.192000000000e+04 9.830400000000e+04-6.553600000000e+04
    -5.242900000000e+05
";
    let body = [
        "> STO G01 LNAV\n    2020 06 25 00 00 00 GPUT\n     1.0e+00-9.3e-10 0.0e+00 0.0e+00\n",
        "> EPH G01 LNAV\n",
        GPS,
        "> EPH G01 CNAV\n",
        &GPS.replace("5.8000", "5.9000"),
        "> EPH R01 FDMA\n",
        GLONASS,
        "> EPH C20 CNV1\n",
        &GPS.replace("G01", "C20"),
        "> EPH E01 INAV\n",
        GALILEO,
        "> EPH E01 FNAV\n",
        &GALILEO.replace("5.170000000000e+02", "2.580000000000e+02"),
        "> EPH S23 SBAS\n",
        &GLONASS.replace("R01", "S23"),
        "> EOP G01 CNAV\n    2020 06 25 00 00 00 1.0e-01 1.0e-03 1.0e-05\n",
        "> ION G01 LNAV\n",
        klobuchar,
        "> ION J01 LNAV\n",
        klobuchar,
        "> ION E01 IFNV\n    2020 06 25 00 00 00 3.500000000000e+01 5.000000000000e-01 4.000000000000e-03\n",
        "     0.000000000000e+00\n",
        "> EPH I03 L1NV\n",
        &GPS.replace("G01", "I03"),
    ];
    navigation("4.00", &body.concat())
}

#[test]
fn records_of_all_types_are_used_or_counted() {
    let file = NavigationFile::parse(mixed().as_bytes()).unwrap();
    let satellites: Vec<String> = file.ephemerides.iter().map(|e| e.satellite.to_string()).collect();
    assert_eq!(satellites, ["E01", "E01", "G01"], "{}", file.skips);
    assert_eq!(file.ephemerides[2].issue_of_data, 58);
    assert_eq!(file.glonass.len(), 1);
    let gps = file.ionosphere.gps.unwrap();
    assert_eq!((gps.alpha[3], gps.beta[0], gps.beta[3]), (-1.1921e-7, 81_920.0, -524_290.0));
    assert_eq!(file.ionosphere.galileo, Some([35.0, 0.5, 0.004]));
    for reason in [
        Reason::CnavEphemeris.text(),
        Reason::Cnav1Ephemeris.text(),
        Reason::SbasRecord.text(),
        Reason::EarthOrientationRecord.text(),
        Reason::SystemTimeOffsetRecord.text(),
        Reason::IonosphereRecordNotUsed.text(),
        Reason::EphemerisOfOtherMessageType.text(),
    ] {
        assert_eq!(file.skips.count(reason), 1, "{reason}: {}", file.skips);
    }
    assert_eq!(file.skips.total(), 7, "{}", file.skips);
}

#[test]
fn the_glonass_record_of_3_05_has_flags_and_may_miss_its_delay() {
    let read = |text: &str| NavigationFile::parse(navigation("3.05", text).as_bytes()).unwrap();
    let r01 = read(GLONASS).glonass[0];
    assert_eq!((r01.l2_delay_s, r01.health_flags, r01.accuracy_m), (Some(8.381903171539e-9), Some(3), 2.5));
    assert!(r01.is_healthy());
    let missing = read(&GLONASS.replace(" 8.381903171539e-09", " .999999999999e+09 ")).glonass[0];
    assert_eq!(missing.l2_delay_s, None);
    let unknown = read(&GLONASS.replace("-1.862645149231e-09 0.000000000000e+00", "-1.862645149231e-09"));
    assert_eq!(unknown.glonass[0].health, None);
    assert_eq!(unknown.skips.count(Reason::GlonassHealthUnknown), 1, "{}", unknown.skips);
    // The orbit serves, whatever of this is missing.
    for text in [GLONASS.to_owned(), GLONASS.replace(" 8.381903171539e-09", " .999999999999e+09 ")] {
        let toe = r01.toe;
        let products = Products::new(vec![], vec![read(&text)]);
        assert!(products.satellite_state(r01.satellite, toe + 600.0).is_ok());
        assert_eq!(products.glonass_channel(r01.satellite, toe + 1e6), Some(1));
    }
    // A message says more than an observation header.
    let mut products = Products::new(vec![], vec![read(GLONASS)]);
    products.set_glonass_channels(&std::collections::BTreeMap::from([(1, -7), (2, -4)]));
    let channel = |text: &str| products.glonass_channel(text.parse().unwrap(), r01.toe);
    assert_eq!(
        (channel("R01"), channel("R02"), channel("R03"), channel("G02")),
        (Some(1), Some(-4), None, None)
    );
    for (from, to) in [
        ("1.000000000000e+00\n     2.288", "2.100000000000e+01\n     2.288"),
        (" 1.090894238281e+04", " 9.090894238281e+04"),
        ("23 15 00", "23 11 00"),
        ("6.355904042721e-05", "6.355904042721e-01"),
    ] {
        let file = read(&GLONASS.replacen(from, to, 1));
        assert_eq!(file.skips.count(Reason::RecordImpossible), 1, "{from}: {}", file.skips);
    }
    // Some writers give the channel without its sign.
    let byte = read(&GLONASS.replacen("1.000000000000e+00\n     2.288", "2.520000000000e+02\n     2.288", 1));
    assert_eq!(byte.glonass[0].frequency_channel, -4);
}

#[test]
fn leap_seconds_that_contradict_the_date_are_named() {
    let text = navigation("3.04", GLONASS).replace("    18    18", "    17    18");
    let file = NavigationFile::parse(text.as_bytes()).unwrap();
    assert_eq!(file.glonass[0].toe, "2020-06-24T23:15:18".parse().unwrap());
    assert_eq!(file.leap_seconds, Some(18));
    assert_eq!(file.skips.total(), 1, "{}", file.skips);
}

#[test]
fn observations_of_version_4_are_read_as_those_of_3() {
    let text = header("     4.01           OBSERVATION DATA    M", "RINEX VERSION / TYPE")
        + &header("G    2 C1C L1C", "SYS / # / OBS TYPES")
        + &header("", "END OF HEADER")
        + "> 2020 08 13 14 19  2.0000000  0  1\nG10  21111612.436   291795067.81413\n";
    let file = ObservationFile::parse(text.as_bytes()).unwrap();
    assert_eq!(file.header.version, 401);
    assert_eq!(file.epochs[0].observations[0].pseudorange_m, Some(21_111_612.436));
}

fn records(portions: impl Iterator<Item = Vec<u8>>) -> Vec<Record> {
    let (mut decoder, mut records) = (NavigationDecoder::default(), Vec::new());
    for portion in portions {
        decoder.feed(&portion).unwrap();
        records.extend(std::iter::from_fn(|| decoder.next_record()));
    }
    Decoder::finish(&mut decoder).unwrap();
    records.extend(std::iter::from_fn(|| decoder.next_record()));
    records
}

#[test]
fn a_stream_gives_the_same_in_any_portions() {
    let text = mixed().into_bytes();
    let whole = records(std::iter::once(text.clone()));
    assert_eq!(whole.len(), 4);
    for size in [1, 7, 81, 4_096] {
        // As text, for an unknown group delay is NaN.
        assert_eq!(format!("{:?}", records(text.chunks(size).map(<[u8]>::to_vec))), format!("{whole:?}"));
    }
}

#[test]
fn the_wrong_stream_is_an_error_and_stays_one() {
    let mut decoder = NavigationDecoder::default();
    assert!(decoder.feed(b"Raw,1,2\n").is_err());
    assert!(decoder.feed(mixed().as_bytes()).is_err());
    assert!(Decoder::finish(&mut decoder).is_err() && decoder.next_record().is_none());
}

#[test]
#[ignore = "needs the reference data"]
fn a_broadcast_file_of_a_day_has_all_systems() {
    for name in ["BRD400DLR_20230710000_as_rnx305_GRECJI.rnx.gz", "CORD00ARG_R_20240920000_01D_MN.rnx.gz"] {
        let bytes = required(&format!("oracle/inputs/{name}"));
        let file = NavigationFile::parse(&bytes).unwrap();
        println!("{name}: {} + {} GLONASS, {}", file.ephemerides.len(), file.glonass.len(), file.skips);
        let missing = file.glonass.iter().filter(|e| e.l2_delay_s.is_none()).count();
        println!("{missing} without L2 delay");
        assert!(file.glonass.len() > 100);
        assert!(file.skips.iter().all(|(reason, _)| reason.contains("not supported")), "{}", file.skips);
    }
}
