//! Positions from logs of 2016 with the orbits that came over the log itself, by plain weighted least squares.
//!
//! The recorded logs have no `Nav` lines. Here the hourly broadcast file's messages are put into the log as the subframes that
//! they were made of, so that the whole way from text to position is walked.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod beside;
mod log_lines;
mod navbits_encoder;

use std::fmt::Write as _;
use std::sync::Arc;

use beside::required;
use cofix_common::formats::stream::ObservationStream;
use cofix_common::frames::{Ecef, Geodetic, LocalFrame};
use cofix_common::gnss::{Constellation, ObservationEpoch};
use cofix_common::measurement::{CorrectionOptions, Corrector, without_position};
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::Products;
use cofix_common::skips::Skips;
use cofix_common::solve::solve_position;
use cofix_common::time::GpsTime;
use log_lines::{Decoded, decode};
use navbits_encoder::{Bits, fields, rinex2};

/// A `Nav` line of type GPS L1 C/A.
fn nav_line(satellite: u8, subframe: usize, words: &[u32; 10]) -> String {
    let mut line = format!("Nav,{satellite},257,1,-1,{subframe}");
    for byte in words.iter().flat_map(|word| word.to_be_bytes()) {
        write!(line, ",{}", byte.cast_signed()).unwrap();
    }
    line + "\n"
}

/// Page 18 of subframe 4 with the coefficients of a RINEX 2 header.
fn ionosphere_page(text: &str, sent: GpsTime) -> [u32; 10] {
    let numbers = |label: &str| -> Vec<f64> {
        let line = text.lines().find(|line| line.contains(label)).unwrap();
        (0..4).map(|k| line[2 + 12 * k..14 + 12 * k].trim().replace('D', "E").parse().unwrap()).collect()
    };
    let mut bits = Bits::default();
    #[allow(clippy::cast_possible_truncation)]
    let count = (sent.tow_s() / 6.0) as i64 + 1;
    bits.put(0x8b, 8).put(0, 16).put(count, 17).put(0, 2).put(4, 3).put(0, 2).put(1, 2).put(56, 6);
    for (values, exponents) in
        [(numbers("ION ALPHA"), [-30, -27, -24, -24]), (numbers("ION BETA"), [11, 14, 16, 16])]
    {
        for (value, exponent) in values.into_iter().zip(exponents) {
            // Four printed digits: the nearest multiple.
            #[allow(clippy::cast_possible_truncation)]
            let multiple = (value / 2_f64.powi(exponent)).round() as i64;
            bits.put(multiple, 8);
        }
    }
    bits.put(0, 24).put(0, 32).put(0, 16).put(17, 8).put(0, 40);
    bits.words()
}

/// Horizontal errors of all epochs that have a position, m, sorted, and the number of epochs.
fn errors(log: &str, navigation: &str, middle: &str) -> (Vec<f64>, usize) {
    let read = |name: &str| String::from_utf8(required(&format!("data/google-static-2016/{name}"))).unwrap();
    let (log, text) = (read(log), read(navigation));
    let middle: GpsTime = middle.parse().unwrap();
    let mut all = nav_line(1, 4, &ionosphere_page(&text, middle - middle.tow_s() % 30.0));
    for (satellite, values) in rinex2(&text) {
        let Some((fields, sent)) = fields(&values) else { continue };
        // In force within the two hours before and after.
        if (sent + 5_400.0 - middle).abs() > 7_200.0 {
            continue;
        }
        for (number, words) in (1..).zip(&fields.subframes()) {
            all += &nav_line(satellite, number, words);
        }
    }
    let Decoded { epochs, ephemerides, skips, decoder } = decode(&(all + &log));
    assert!(skips.iter().all(|(reason, _)| !reason.contains("LNAV")), "{skips}");
    println!("{} ephemerides, {} epochs", ephemerides.len(), epochs.len());
    let file = NavigationFile {
        glonass: Vec::new(),
        ephemerides,
        ionosphere: decoder.ionosphere(),
        leap_seconds: decoder.leap_seconds(),
        skips: Skips::default(),
    };
    let mut corrector =
        Corrector::new(Arc::new(Products::new(vec![], vec![file])), CorrectionOptions::default());
    let frame = LocalFrame::at(Geodetic::from_degrees(37.422_578, -122.081_678, -28.0).geodetic_to_ecef());
    let positions = epochs.iter().filter_map(|epoch| position(epoch, &mut corrector));
    let mut errors: Vec<f64> = positions.map(|p| frame.ecef_to_enu(p).horizontal()).collect();
    errors.sort_by(f64::total_cmp);
    (errors, epochs.len())
}

/// GPS only: from nowhere, then with corrections for the position found.
fn position(epoch: &ObservationEpoch, corrector: &mut Corrector) -> Option<Ecef> {
    let mut prepared = epoch.clone();
    prepared.observations.retain(|o| o.satellite.constellation == Constellation::Gps);
    let prepared = corrector.prepare(&prepared);
    let mut position = solve_position(&without_position(&prepared), Ecef::new(0.0, 0.0, 0.0))
        .ok()?
        .to_solution(None)?
        .position;
    for _ in 0..2 {
        let corrected = corrector.finish(&prepared, position, epoch.time_gps);
        position = solve_position(&corrected.0, position).ok()?.to_solution(None)?.position;
    }
    Some(position)
}

fn check(log: &str, navigation: &str, middle: &str, (limit_m, least): (f64, usize)) {
    let (errors, epochs) = errors(log, navigation, middle);
    let at = |share: usize| errors[errors.len() * share / 100];
    println!("{log}: {} of {epochs} epochs, p50 {:.2} m, p95 {:.2} m", errors.len(), at(50), at(95));
    assert!(errors.len() >= least && at(50) <= limit_m, "{} epochs, p50 {} m", errors.len(), at(50));
}

#[test]
#[ignore = "needs the reference data"]
fn june_from_its_own_messages() {
    check("pseudoranges_log_2016_06_30_21_26_07.txt", "hour1820.16n", "2016-06-30T21:28:00", (8.1, 223));
}

#[test]
#[ignore = "needs the reference data"]
fn august_from_its_own_messages() {
    check("pseudoranges_log_2016_08_22_14_45_50.txt", "hour2350.16n", "2016-08-22T21:48:00", (5.5, 195));
}
