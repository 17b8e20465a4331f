//! A whole agent on a log with the phone's own `Nav` lines and nothing else, against the same agent with the broadcast file
//! that the messages come from.
//!
//! The recorded log has no `Nav` lines; here they are made from the file: its numbers as the messages' integers, with parity.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

#[path = "../../common/tests/beside/mod.rs"]
mod beside;
mod hub_support;
#[path = "../../common/tests/navbits_encoder/mod.rs"]
mod navbits_encoder;

use std::fmt::Write as _;
use std::path::PathBuf;

use beside::required;
use cofix_agent::{AgentConfig, ProductFiles, ProductSource, Source, Stop, run};
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;
use hub_support::Hub;
use navbits_encoder::{Bits, LnavFields, fields, rinex2};

const LOG: &str = "pseudoranges_log_2016_06_30_21_26_07.txt";
const NAVIGATION: &str = "hour1820.16n";
/// Where a RINEX 2 record has the time of transmission.
const TRANSMISSION: usize = 27;

/// All messages of an agent's run.
fn published(log: PathBuf, navigation: Vec<PathBuf>) -> Vec<EpochMessage> {
    let hub = Hub::listen();
    let products = ProductSource::Files(ProductFiles { navigation, ..ProductFiles::default() });
    let config = AgentConfig { products, ..hub.agent(Source::File { path: log, near: None }) };
    let report = run(&config, &Stop::default()).unwrap();
    hub.receive(usize::try_from(report.epochs_published).unwrap())
}

fn nav_line(satellite: u8, subframe: usize, words: &[u32; 10]) -> String {
    let mut line = format!("Nav,{satellite},257,1,-1,{subframe}");
    for byte in words.iter().flat_map(|word| word.to_be_bytes()) {
        write!(line, ",{}", byte.cast_signed()).unwrap();
    }
    line + "\n"
}

/// Page 18 of subframe 4 with the coefficients of the file's header, and 17 leap seconds.
fn ionosphere_page(text: &str, tow_s: f64) -> [u32; 10] {
    let numbers = |label: &str| -> Vec<f64> {
        let line = text.lines().find(|line| line.contains(label)).unwrap();
        (0..4).map(|k| line[2 + 12 * k..14 + 12 * k].trim().replace('D', "E").parse().unwrap()).collect()
    };
    #[allow(clippy::cast_possible_truncation)]
    let rounded = |value: f64| value.round() as i64;
    let mut bits = Bits::default();
    bits.put(0x8b, 8).put(0, 16).put(rounded(tow_s / 6.0) + 1, 17).put(0, 2).put(4, 3).put(0, 2);
    bits.put(1, 2).put(56, 6);
    let exponents = [-30, -27, -24, -24, 11, 14, 16, 16];
    for (value, exponent) in numbers("ION ALPHA").into_iter().chain(numbers("ION BETA")).zip(exponents) {
        // The file has four digits of them: the nearest multiple.
        bits.put(rounded(value / 2_f64.powi(exponent)), 8);
    }
    bits.put(0, 24).put(0, 32).put(0, 16).put(17, 8).put(0, 40);
    bits.words()
}

/// The file's messages as `Nav` lines; the ionosphere's where it has them.
fn nav_lines(text: &str) -> String {
    let mut lines = String::new();
    for (satellite, values) in rinex2(text) {
        let Some((message, toe_based)) = fields(&values) else { continue };
        // Sent when the file says, at the beginning of a frame.
        let tow_s = values[TRANSMISSION].rem_euclid(604_800.0);
        let tow_s = tow_s - tow_s % 30.0;
        let near: GpsTime = toe_based;
        let sent = GpsTime::from_week_tow(near.week(), tow_s);
        if lines.is_empty() && text.contains("ION ALPHA") {
            lines = nav_line(satellite, 4, &ionosphere_page(text, tow_s));
        }
        let message = LnavFields { week: sent.week(), tow_s, ..message };
        for (number, words) in (1..).zip(&message.subframes()) {
            lines += &nav_line(satellite, number, words);
        }
    }
    lines
}

/// Distances of the positions of all epochs, m, sorted.
fn differences(log: &str, navigation: &str) -> Vec<f64> {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    // The header, some epochs, the messages, the rest.
    let at = log.match_indices("\nRaw,").nth(60).unwrap().0 + 1;
    let alone = format!("{}{}{}", &log[..at], nav_lines(navigation), &log[at..]);
    let with_file = published(write("log.txt", log), vec![write("nav.16n", navigation)]);
    let with_own = published(write("alone.txt", &alone), Vec::new());
    assert_eq!((with_file.len(), with_own.len()), (223, 223));
    let mut differences = Vec::new();
    for (a, b) in with_file.iter().zip(&with_own) {
        assert_eq!(a.time_gps, b.time_gps);
        assert_eq!(a.observations.len(), b.observations.len(), "{}", a.time_gps);
        let (Some(a), Some(b)) = (&a.wls, &b.wls) else { panic!("{} has no position", a.time_gps) };
        differences.push((a.position.0 - b.position.0).norm());
    }
    differences.sort_by(f64::total_cmp);
    differences
}

/// The file has 12 digits of angles (half a unit of the last is 0.13 mm at the satellite's distance), rates that went through
/// single precision (0.1 mm after two hours), and four digits of the ionosphere terms; the message's integers are exact. So the
/// positions cannot agree to more than a few tenths of a millimetre, and do.
#[test]
#[ignore = "needs the reference data"]
fn own_messages_serve_as_well_as_the_file_they_make() {
    let read = |name: &str| String::from_utf8(required(&format!("data/google-static-2016/{name}"))).unwrap();
    let (log, with) = (read(LOG), read(NAVIGATION));
    let without: String = with
        .split_inclusive('\n')
        .filter(|line| !line.contains("ION ALPHA") && !line.contains("ION BETA"))
        .collect();
    for (name, navigation, limit_m) in [("with the ionosphere", &with, 1e-3), ("without", &without, 5e-4)] {
        let differences = differences(&log, navigation);
        let (median, largest) = (differences[differences.len() / 2], differences[differences.len() - 1]);
        println!("{name}: positions differ by {median:.1e} m in the median, {largest:.1e} m at most");
        assert!(largest < limit_m, "{name}: {largest} m");
    }
}
