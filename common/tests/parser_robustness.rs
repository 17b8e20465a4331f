//! Parsers on damaged and on arbitrary bytes: they count, they do not panic, and what they give is in bounds.

#![allow(clippy::unwrap_used)] // helpers of tests

#[macro_use]
mod navigation_records;

use std::fmt::Write as _;

use cofix_common::formats::rinex::ObservationFile;
use cofix_common::gnss::{Observation, SatelliteId};
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::{Products, Sp3};
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;
use proptest::prelude::*;

const OBSERVATIONS: &str = "     3.04           OBSERVATION DATA    M: MIXED            RINEX VERSION / TYPE
TEST                                                        MARKER NAME
G    8 C1C L1C D1C S1C C5X L5X D5X S5X                      SYS / # / OBS TYPES
C    4 C2I L2I D2I S2I                                      SYS / # / OBS TYPES
  2020     8    13    14    19    1.9997590     GPS         TIME OF FIRST OBS
  2 R01  1 R02 -4                                           GLONASS SLOT / FRQ #
                                                            END OF HEADER
> 2020 08 13 14 19  1.9997590  0  3
G10  21111612.436   291795067.81411     -2520.506          37.000    21111615.124       12459.633       -1882.131          35.000
G22  25058881.092                        2908.803          39.000
C21  22485627.521      -12667.326        1459.825          46.000
>                              4  1
A COMMENT                                                   COMMENT
> 2020 08 13 14 19  2.9997590  0  2
G10  21112095.389   291797586.507       -2517.655          37.000    21112093.888       14340.728       -1880.021          33.000
C21  22485348.405      -14126.501        1457.760          45.000
> 2020 08 13 14 19  3.9997590  1  1
C21  22485069.124      -15585.111        1455.912          45.000
";

const NAVIGATION: &str = concat!(
    "     3.04           N: GNSS NAV DATA    M: MIXED            RINEX VERSION / TYPE
GPSA   4.6566e-09  1.4901e-08 -5.9605e-08 -1.1921E-07       IONOSPHERIC CORR
GPSB   8.1920e+04  9.8304e+04 -6.5536e+04 -5.2429E+05       IONOSPHERIC CORR
    18                                                      LEAP SECONDS
                                                            END OF HEADER
",
    gps!(),
    glonass_304!(),
    "C05 2020 06 24 22 00 00-5.154609680176e-04-6.708145150469e-11 0.000000000000e+00
     1.000000000000e+00-4.142968750000e+02-3.141559429989e-09-1.101749161212e+00
    -1.366203650832e-05 3.830116475001e-04-1.177610829473e-05 6.493378950119e+03
     3.384000000000e+05-6.146728992462e-08 2.697580724014e+00 6.146728992462e-08
     1.136268367853e-01 3.549843750000e+02-1.027125663175e+00 4.100527946305e-09
     3.321566928024e-10 0.000000000000e+00 7.550000000000e+02
     2.000000000000e+00 0.000000000000e+00 1.000000000000e-10-9.300000000000e-09
     3.384276000000e+05 0.000000000000e+00
",
    galileo!(),
);

/// Eleven epochs of one satellite.
fn sp3_text() -> String {
    let mut text = String::from(
        "#dP2020  8 13 14  0  0.00000000      11 __u+U IGS14 FIT  TST\n\
         ## 2118 396000.00000000   900.00000000 59074 0.5833333333358\n\
         +    1   G10\n\
         %c M  cc GPS ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc\n\
         /* A COMMENT\n",
    );
    for epoch in 0..11_u32 {
        let angle = 0.13 * f64::from(epoch);
        let (x, y) = (26_560.0 * angle.cos(), 26_560.0 * angle.sin());
        let (hour, minute) = (14 + epoch / 4, epoch % 4 * 15);
        writeln!(text, "*  2020  8 13 {hour:2} {minute:2}  0.00000000").unwrap();
        writeln!(text, "PG10{x:14.6}{y:14.6}{:14.6}{:14.6}", 120.5, -426.558_701).unwrap();
    }
    text + "EOF\n"
}

/// One damage to a text.
#[derive(Clone, Debug)]
enum Damage {
    Flip(usize, u8),
    Delete(usize, usize),
    Insert(usize, Vec<u8>),
    Cut(usize),
}

fn damages() -> impl Strategy<Value = Vec<Damage>> {
    let at = 0..4_000_usize;
    let one = prop_oneof![
        (at.clone(), any::<u8>()).prop_map(|(at, mask)| Damage::Flip(at, mask)),
        (at.clone(), 1..90_usize).prop_map(|(at, length)| Damage::Delete(at, length)),
        (at.clone(), proptest::collection::vec(any::<u8>(), 1..20)).prop_map(|(at, b)| Damage::Insert(at, b)),
        (at.clone(), "[0-9 .>\n-]{1,8}").prop_map(|(at, text)| Damage::Insert(at, text.into_bytes())),
        at.prop_map(Damage::Cut),
    ];
    proptest::collection::vec(one, 1..6)
}

fn damaged(text: &str, damages: &[Damage]) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    for damage in damages {
        let length = bytes.len().max(1);
        match damage {
            Damage::Flip(at, mask) => {
                if let Some(byte) = bytes.get_mut(at % length) {
                    *byte ^= mask;
                }
            }
            Damage::Delete(at, count) => {
                let from = (at % length).min(bytes.len());
                let to = (from + count).min(bytes.len());
                bytes.drain(from..to);
            }
            Damage::Insert(at, new) => {
                let at = (at % length).min(bytes.len());
                bytes.splice(at..at, new.iter().copied());
            }
            Damage::Cut(at) => bytes.truncate(at % length),
        }
    }
    bytes
}

fn in_bounds(observation: &Observation) -> bool {
    observation.pseudorange_m.is_none_or(|p| (1e6..=1e9).contains(&p))
        && observation.doppler_hz.is_none_or(|d| d.abs() <= 2e5)
        && observation.cn0_dbhz.is_none_or(|c| (0.0..=70.0).contains(&c))
        && observation.carrier_phase_cycles.is_none_or(f64::is_finite)
}

fn check_observations(bytes: &[u8]) {
    let Ok(file) = ObservationFile::parse(bytes) else { return };
    assert!(file.epochs.is_sorted_by(|a, b| a.time_gps < b.time_gps));
    assert!(file.epochs.iter().flat_map(|e| &e.observations).all(in_bounds));
}

fn check_products(sp3: Option<Sp3>, navigation: Option<NavigationFile>, time: GpsTime) {
    let times: Vec<GpsTime> = sp3
        .iter()
        .flat_map(|file| file.positions.iter().map(|p| p.time + 400.0))
        .chain(navigation.iter().flat_map(|file| file.ephemerides.iter().map(|e| e.toe + 600.0)))
        .chain(navigation.iter().flat_map(|file| file.glonass.iter().map(|e| e.toe + 600.0)))
        .chain([time])
        .collect();
    let products = Products::new(sp3.into_iter().collect(), navigation.into_iter().collect());
    for satellite in ["G10", "G01", "R01", "E01", "C05"].map(|text| text.parse::<SatelliteId>().unwrap()) {
        for time in &times {
            if let Ok(state) = products.satellite_state(satellite, *time) {
                assert!(state.position.is_finite() && state.velocity.is_finite());
                assert!(
                    state.clock_s.is_finite() && state.clock_drift_sps.is_finite() && state.sigma_m > 0.0
                );
            }
        }
    }
}

#[test]
fn the_undamaged_texts_are_read_in_full() {
    let file = ObservationFile::parse(OBSERVATIONS.as_bytes()).unwrap();
    assert_eq!((file.epochs.len(), file.events.len(), file.skips.total()), (3, 1, 0), "{}", file.skips);
    let file = NavigationFile::parse(NAVIGATION.as_bytes()).unwrap();
    assert_eq!((file.ephemerides.len(), file.skips.total()), (3, 0), "{}", file.skips);
    assert_eq!(file.glonass.len(), 1);
    assert_eq!(file.leap_seconds, Some(18));
    let file = Sp3::parse(sp3_text().as_bytes()).unwrap();
    assert_eq!((file.epochs, file.skips.total()), (11, 0), "{}", file.skips);
}

/// A file cut anywhere gives the epochs before the cut unchanged, and in the last one nothing that is wrong.
#[test]
fn a_cut_observation_file_keeps_what_came_before() {
    let whole = ObservationFile::parse(OBSERVATIONS.as_bytes()).unwrap().epochs;
    for cut in 0..OBSERVATIONS.len() {
        let Ok(file) = ObservationFile::parse(&OBSERVATIONS.as_bytes()[..cut]) else { continue };
        let Some((last, before)) = file.epochs.split_last() else { continue };
        assert_eq!(before, &whole[..before.len()], "cut at {cut}");
        for observation in &last.observations {
            let same =
                |o: &&Observation| (o.satellite, o.signal) == (observation.satellite, observation.signal);
            let full = whole[before.len()].observations.iter().find(same).unwrap();
            assert!(observation.pseudorange_m.is_none_or(|v| full.pseudorange_m == Some(v)), "cut at {cut}");
            assert!(observation.doppler_hz.is_none_or(|v| full.doppler_hz == Some(v)), "cut at {cut}");
            assert!(observation.cn0_dbhz.is_none_or(|v| full.cn0_dbhz == Some(v)), "cut at {cut}");
        }
    }
}

#[test]
fn a_cut_precise_file_is_noticed() {
    let text = sp3_text();
    let cut = text.rfind("PG10").unwrap();
    let file = Sp3::parse(&text.as_bytes()[..cut + 30]).unwrap();
    assert_eq!(file.positions.len(), 10);
    assert_eq!(file.skips.count(Reason::Sp3PositionUnreadable), 1);
    let file = Sp3::parse(&text.as_bytes()[..cut]).unwrap();
    assert_eq!(file.skips.count(Reason::Sp3FileCutOff), 1, "{}", file.skips);
}

#[test]
fn records_with_impossible_numbers_are_refused() {
    for (from, to) in [
        ("5.153707128525e+03", "5.153707128525e+13"),
        ("1.000394229777e-02", "1.000394229777e+02"),
        ("6.342094507864e-01", "               nan"),
        ("2.572838528869e+00", "                  "),
        ("2.111000000000e+03", "1.111000000000e+02"),
        ("G01 2020 06 25", "G01 2020 06 35"),
    ] {
        let file = NavigationFile::parse(NAVIGATION.replacen(from, to, 1).as_bytes()).unwrap();
        assert_eq!((file.ephemerides.len(), file.skips.total()), (2, 1), "{from} -> {to}: {}", file.skips);
        assert!(file.skips.iter().any(|(_, skip)| skip.first.starts_with("line 6: G01")), "{}", file.skips);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2_000) })]

    #[test]
    fn damaged_files_never_panic(damages in damages(), nanos: i64) {
        check_observations(&damaged(OBSERVATIONS, &damages));
        let navigation = NavigationFile::parse(&damaged(NAVIGATION, &damages)).ok();
        let sp3 = Sp3::parse(&damaged(&sp3_text(), &damages)).ok();
        check_products(sp3, navigation, GpsTime::from_nanos(nanos));
    }

    #[test]
    fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..2_000)) {
        for start in ["", "\u{1f}\u{8b}", OBSERVATIONS, NAVIGATION, "#dP\n## 2118 396000.00000000   900.00000000\n"] {
            let text = [start.as_bytes(), &bytes].concat();
            check_observations(&text);
            check_products(Sp3::parse(&text).ok(), NavigationFile::parse(&text).ok(), GpsTime::default());
        }
        let gzip = [&[0x1f, 0x8b, 8, 0][..], &bytes].concat();
        prop_assert!(ObservationFile::parse(&gzip).is_err());
    }
}
