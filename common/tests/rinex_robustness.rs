//! Every RINEX parser on damaged and on arbitrary bytes, as a whole file and as a stream: they count, they do not panic,
//! what they give is in bounds, and portions do not matter.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)] // helpers of tests

mod file_records;
#[macro_use]
mod navigation_records;

use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::rinex::{NavigationDecoder, ObservationDecoder, ObservationFile};
use cofix_common::gnss::Observation;
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::{GlonassEphemeris, KeplerEphemeris};
use cofix_common::skips::{Reason, Skips};
use file_records::into_records;
use proptest::prelude::*;

const OBSERVATIONS_2: &str =
    "     2.11           OBSERVATION DATA    M (MIXED)           RINEX VERSION / TYPE
     6    L1    C1    L2    P2    D1    S1                  # / TYPES OF OBSERV
  2005     4     2     0     0    0.0000000     GPS         TIME OF FIRST OBS
                                                            END OF HEADER
 05  4  2  0  0  0.0000000  0  2G 3R 7
  55923622.160    24767686.375    43647388.2424   24767684.8224       -691.177
        45.000
   -691177.898    24361933.475     -537007.1404   24361930.5994       -537.007
        37.000
                            4  1
A COMMENT                                                   COMMENT
 05  4  2  0  0 30.0000000  0 13  1  2  3  4  5  6  7  8  9 10 11 12
                                 13
";

const COMPACT_1: &str = "1.0                 COMPACT RINEX FORMAT                    CRINEX VERS   / TYPE
BY HAND                                                     CRINEX PROG / DATE
     2.11           OBSERVATION DATA    G (GPS)             RINEX VERSION / TYPE
     2    C1    L1                                          # / TYPES OF OBSERV
                                                            END OF HEADER
&05  4  2  0  0  0.0000000  0  2G 3G 7

3&24767686375 3&55923622160  1
3&24361933475 3&-691177898
                3

28244296 148426281  &
-2041349 -10730547
&                           4  1
A COMMENT                                                   COMMENT
&05  4  2  0  1  0.0000000  0  2G 3G 7

3&24824193270 3&56220567922
3&24357843816 3&-712671320
";

const COMPACT_3: &str = "3.0                 COMPACT RINEX FORMAT                    CRINEX VERS   / TYPE
BY HAND                                                     CRINEX PROG / DATE
     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE
G    2 C1C L1C                                              SYS / # / OBS TYPES
E    2 C1X L1X                                              SYS / # / OBS TYPES
                                                            END OF HEADER
> 2020 08 13 14 19  2.0000000  0  2      G10E07

3&21111612436 3&291795067814  4
3&24000000000
                    3

483 -2518 5

                    4

5 3
1&24000000100 0&7
";

const NAVIGATION_2: &str = concat!(
    "     2.10           N: GPS NAV DATA                         RINEX VERSION / TYPE
    1.1180D-08  1.4900D-08 -5.9600D-08 -5.9600D-08          ION ALPHA
    8.8060D+04  1.6380D+04 -1.9660D+05 -1.3110D+05          ION BETA
    13                                                      LEAP SECONDS
                                                            END OF HEADER
",
    gps_2!(),
);

const GLONASS_2: &str = glonass_file_2!();

const NAVIGATION_4: &str = concat!(
    "     4.00           NAVIGATION DATA     M                   RINEX VERSION / TYPE
                                                            END OF HEADER
> EPH R01 FDMA
",
    glonass!(),
    "> EPH G01 CNAV
G01 2020 06 25 04 00 00 1.604342833161e-05 7.048583938740e-12 0.000000000000e+00
     5.800000000000e+01-3.968750000000e+01 4.304822170265e-09 6.342094507864e-01
> ION G01 LNAV
    2020 06 25 00 00 00 4.656600000000e-09 1.490100000000e-08-5.960500000000e-08
    -1.192100000000e-07 8.192000000000e+04 9.830400000000e+04-6.553600000000e+04
    -5.242900000000e+05
> EPH E01 INAV
",
    galileo!(),
);

const OBSERVATION_TEXTS: [&str; 3] = [OBSERVATIONS_2, COMPACT_1, COMPACT_3];
const NAVIGATION_TEXTS: [&str; 3] = [NAVIGATION_2, GLONASS_2, NAVIGATION_4];

#[test]
fn the_undamaged_texts_are_read_in_full() {
    // The last epoch of the first is cut off; the others are complete.
    for (text, epochs, skipped) in [(OBSERVATIONS_2, 1, 1), (COMPACT_1, 3, 0), (COMPACT_3, 3, 0)] {
        let file = ObservationFile::parse(text.as_bytes()).unwrap();
        assert_eq!((file.epochs.len() as u64, file.skips.total()), (epochs, skipped), "{}", file.skips);
    }
    for (text, kepler, glonass, skipped) in
        [(NAVIGATION_2, 1, 0, 0), (GLONASS_2, 0, 1, 0), (NAVIGATION_4, 1, 1, 1)]
    {
        let file = NavigationFile::parse(text.as_bytes()).unwrap();
        assert_eq!(
            (file.ephemerides.len(), file.glonass.len(), file.skips.total()),
            (kepler, glonass, skipped),
            "{}",
            file.skips
        );
    }
}

/// Some bytes of a text lost, and others put in their place.
#[derive(Clone, Debug)]
struct Damage {
    at: usize,
    lost: usize,
    new: Vec<u8>,
}

fn damages() -> impl Strategy<Value = Vec<Damage>> {
    let new = prop_oneof![
        proptest::collection::vec(any::<u8>(), 0..20),
        "[0-9 .>&\r\n-]{0,8}".prop_map(String::into_bytes),
    ];
    let lost = prop_oneof![Just(0), 1..4_usize, 1..100_usize];
    let one = (any::<usize>(), lost, new).prop_map(|(at, lost, new)| Damage { at, lost, new });
    proptest::collection::vec(one, 1..6)
}

fn damaged(text: &str, damages: &[Damage]) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    for Damage { at, lost, new } in damages {
        let at = at % (bytes.len() + 1);
        let end = (at + lost).min(bytes.len());
        bytes.splice(at..end, new.iter().copied());
    }
    bytes
}

/// Feeds a decoder; `None` when the stream is of another kind.
fn streamed(decoder: &mut impl Decoder, bytes: &[u8], size: usize) -> Option<(Vec<Record>, Skips)> {
    let mut records = Vec::new();
    for portion in bytes.chunks(size) {
        decoder.feed(portion).ok()?;
        records.extend(std::iter::from_fn(|| decoder.next_record()));
    }
    decoder.finish().ok()?;
    records.extend(std::iter::from_fn(|| decoder.next_record()));
    Some((records, decoder.skips().clone()))
}

fn in_bounds(observation: &Observation) -> bool {
    observation.pseudorange_m.is_none_or(|p| (1e6..=1e9).contains(&p))
        && observation.doppler_hz.is_none_or(|d| d.abs() <= 5e4)
        && observation.cn0_dbhz.is_none_or(|c| (0.0..=70.0).contains(&c))
        && observation.carrier_phase_cycles.is_none_or(f64::is_finite)
}

fn check_observations(bytes: &[u8], size: usize) {
    let file = ObservationFile::parse(bytes).ok();
    if let Some(file) = &file {
        assert!(file.epochs.is_sorted_by(|a, b| a.time_gps < b.time_gps));
        assert!(file.epochs.iter().flat_map(|e| &e.observations).all(in_bounds));
    }
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        let whole = file.map(|f| (into_records(f.clone()), f.skips));
        assert_eq!(streamed(&mut ObservationDecoder::default(), bytes, size), whole);
    }
}

fn finite_kepler(ephemeris: &KeplerEphemeris) -> bool {
    let state = ephemeris.state(ephemeris.toe + 600.0);
    state.position.is_finite() && state.velocity.is_finite() && state.clock_s.is_finite()
}

fn finite_glonass(ephemeris: &GlonassEphemeris) -> bool {
    let state = ephemeris.state(ephemeris.toe + 600.0);
    (2e7..3e7).contains(&state.position.0.norm()) && state.velocity.is_finite() && state.clock_s.abs() < 0.1
}

fn check_navigation(bytes: &[u8], size: usize) {
    let file = NavigationFile::parse(bytes).ok();
    if let Some(file) = &file {
        assert!(file.ephemerides.iter().all(finite_kepler) && file.glonass.iter().all(finite_glonass));
    }
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        let stream = streamed(&mut NavigationDecoder::default(), bytes, size);
        let count = |f: NavigationFile| (f.ephemerides.len() + f.glonass.len(), f.skips);
        assert_eq!(stream.map(|(records, skips)| (records.len(), skips)), file.map(count));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1_000) })]

    #[test]
    fn damaged_files_never_panic(damages in damages(), size in 1..300_usize) {
        for text in OBSERVATION_TEXTS {
            check_observations(&damaged(text, &damages), size);
        }
        for text in NAVIGATION_TEXTS {
            check_navigation(&damaged(text, &damages), size);
        }
    }

    #[test]
    fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..2_000)) {
        for text in OBSERVATION_TEXTS {
            check_observations(&[text.as_bytes(), &bytes].concat(), 64);
        }
        for text in NAVIGATION_TEXTS {
            check_navigation(&[text.as_bytes(), &bytes].concat(), 64);
        }
    }
}

/// Damage at random seldom meets a number's sign or exponent; here every byte of a record is tried.
#[test]
fn every_single_byte_may_be_wrong() {
    for text in NAVIGATION_TEXTS {
        for at in 0..text.len() {
            for new in [b'9', b'-', b'D', 0xff] {
                check_navigation(&damaged(text, &[Damage { at, lost: 1, new: vec![new] }]), 1_000);
            }
        }
    }
}

#[test]
fn a_line_of_a_million_columns_is_left_out() {
    for text in OBSERVATION_TEXTS {
        let (header, body) = text.split_once("END OF HEADER\n").unwrap();
        let good = ObservationFile::parse(text.as_bytes()).unwrap();
        let long = format!("{header}{}\n{:60}END OF HEADER\n{body}", "x".repeat(1_000_000), "");
        let file = ObservationFile::parse(long.as_bytes()).unwrap();
        assert_eq!(file.epochs, good.epochs);
        assert_eq!(file.skips.count(Reason::LineTooLong), 1, "{}", file.skips);
    }
}

#[test]
fn line_ends_may_be_mixed() {
    for text in OBSERVATION_TEXTS {
        let mixed: Vec<String> = text
            .lines()
            .enumerate()
            .map(|(index, line)| format!("{line}{}", if index % 2 == 0 { "\r\n" } else { "\n" }))
            .collect();
        let (mixed, plain) = (mixed.concat(), text.as_bytes());
        assert_eq!(ObservationFile::parse(mixed.as_bytes()).unwrap(), ObservationFile::parse(plain).unwrap());
    }
    for text in NAVIGATION_TEXTS {
        let mixed = text.replace('\n', "\r\n");
        let (mixed, plain) =
            (NavigationFile::parse(mixed.as_bytes()), NavigationFile::parse(text.as_bytes()));
        assert_eq!(mixed.unwrap().skips, plain.unwrap().skips);
    }
}

/// The room of a huge epoch is not set aside again for each of those after it, which may be many and small.
#[test]
fn a_huge_epoch_does_not_cost_the_others() {
    use std::fmt::Write as _;

    let codes = ('A'..='Z').map(|attribute| format!(" C1{attribute}")).collect::<Vec<_>>().concat();
    let (first, second) = codes.split_at(13 * 4);
    let mut text = format!("{:<60}RINEX VERSION / TYPE\n", "     3.04           OBSERVATION DATA    M");
    writeln!(text, "{:<60}SYS / # / OBS TYPES", format!("G   26{first}")).unwrap();
    writeln!(text, "{:<60}SYS / # / OBS TYPES\n{:60}END OF HEADER", format!("      {second}"), "").unwrap();
    writeln!(text, "> 2020 08 13 14 19  0.0000000  0 99").unwrap();
    for number in 1..=99 {
        writeln!(text, "G{number:02}{}", "  22100000.000  ".repeat(26)).unwrap();
    }
    for second in 1..50 {
        writeln!(text, "> 2020 08 13 14 19 {second:2}.0000000  0  2\nG01  22100000.000").unwrap();
    }
    let epochs = ObservationFile::parse(text.as_bytes()).unwrap().epochs;
    // Of the 26 letters, nine are attributes of GPS on L1.
    assert_eq!((epochs.len(), epochs[0].observations.len()), (49, 99 * 9));
    let room: usize = epochs[1..].iter().map(|epoch| epoch.observations.capacity()).sum();
    assert!(room <= 48 * 512, "{room}");
}
