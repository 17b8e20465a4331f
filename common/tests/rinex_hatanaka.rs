//! Compact RINEX: an encoder of our own, whose output must come back as what went in, and examples written by hand.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)] // helpers of tests

mod beside;
mod file_records;
mod hatanaka_encoder;

use std::collections::BTreeMap;
use std::fmt::Write as _;

use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::packing::decompress;
use cofix_common::formats::rinex::{ObservationDecoder, ObservationFile};
use cofix_common::skips::Reason;
use file_records::into_records;
use hatanaka_encoder::encode;
use proptest::prelude::*;

#[test]
#[ignore = "needs the reference data"]
fn recordings_come_back() {
    for path in [
        "oracle/inputs/mat_rover.obs.gz",
        "oracle/inputs/07590920.05o",
        "oracle/inputs/30400920.05o",
        "data/whu-wuhan-2020-08-13/WH-3-08/XIM8.rnx",
        "data/pixel6-2023/pixel6.23o",
    ] {
        let packed = beside::required(path);
        let bytes = decompress(&packed).unwrap();
        let plain = ObservationFile::parse(&bytes).unwrap();
        let compact = encode(std::str::from_utf8(&bytes).unwrap(), |epoch| epoch % 100 == 0);
        let restored = ObservationFile::parse(compact.as_bytes()).unwrap();
        println!("{path}: {} to {} bytes, {} epochs", bytes.len(), compact.len(), plain.epochs.len());
        assert!(compact.len() < bytes.len() && plain.epochs.len() > 40);
        assert!(restored.epochs == plain.epochs && restored.header == plain.header, "{}", restored.skips);
        // The same is skipped, if on other lines.
        let counts = |file: &ObservationFile| -> Vec<(String, u64)> {
            file.skips.iter().map(|(reason, skip)| (reason.to_owned(), skip.count)).collect()
        };
        assert_eq!(counts(&restored), counts(&plain));
    }
}

fn header(content: &str, label: &str) -> String {
    format!("{content:<60}{label}\n")
}

/// A difference of text with changes at some columns.
fn changes(at: &[(usize, &str)]) -> String {
    at.iter().fold(String::new(), |text, (column, new)| format!("{text:column$}{new}"))
}

/// Worked out by hand from the description: first values, differences up to the second order, a lost and a found
/// satellite, blanks, indicators.
#[test]
fn an_example_by_hand() {
    let text = header("3.0                 COMPACT RINEX FORMAT", "CRINEX VERS   / TYPE")
        + &header("by hand", "CRINEX PROG / DATE")
        + &header("     3.04           OBSERVATION DATA    M", "RINEX VERSION / TYPE")
        + &header("G    3 C1C D1C S1C", "SYS / # / OBS TYPES")
        + &header("E    3 C1X D1X S1X", "SYS / # / OBS TYPES")
        + &header("", "END OF HEADER");
    let body = [
        "> 2010 10 24 22 14 30.0000000  0  2      G05E11\n\n".to_owned(),
        "3&21111612436 3&-1500 3&45000\n3&24000000000  3&40000\n".to_owned(),
        // One second later.
        changes(&[(20, "1")]) + "\n\n-1000000 500 0\n10  1000\n",
        // E11 and G05 go, G07 comes.
        changes(&[(20, "2"), (34, "1"), (43, "7"), (44, "&&&")]) + "\n\n3&21000000000  3&30000\n",
        // They are back and begin anew.
        changes(&[(20, "3"), (34, "2"), (43, "5E11")]) + "\n\n",
        "3&21110612436 3&-1000 3&45000\n3&23999999000 3&70 3&41000\n".to_owned(),
        changes(&[(20, "4")]) + "\n\n5 50 10\n-1000 -1 -500\n",
        changes(&[(20, "5")]) + "\n\n1 -10 20\n1 2 -3\n",
    ]
    .concat();
    let file = ObservationFile::parse((text + &body).as_bytes()).unwrap();
    let seen: Vec<Vec<String>> = file
        .epochs
        .iter()
        .map(|epoch| {
            let values = |o: &cofix_common::gnss::Observation| {
                format!("{} {:?} {:?} {:?}", o.satellite, o.pseudorange_m, o.doppler_hz, o.cn0_dbhz)
            };
            epoch.observations.iter().map(values).collect()
        })
        .collect();
    println!("{seen:#?}\n{}", file.skips);
    assert_eq!(
        seen[0],
        ["G05 Some(21111612.436) Some(-1.5) Some(45.0)", "E11 Some(24000000.0) None Some(40.0)"]
    );
    assert_eq!(
        seen[1],
        ["G05 Some(21110612.436) Some(-1.0) Some(45.0)", "E11 Some(24000000.01) None Some(41.0)"]
    );
    assert_eq!(seen[2], ["G07 Some(21000000.0) None Some(30.0)"]);
    assert_eq!(
        seen[3],
        ["G05 Some(21110612.436) Some(-1.0) Some(45.0)", "E11 Some(23999999.0) Some(0.07) Some(41.0)"]
    );
    assert_eq!(
        seen[4],
        ["G05 Some(21110612.441) Some(-0.95) Some(45.01)", "E11 Some(23999998.0) Some(0.069) Some(40.5)"]
    );
    // Second differences: 5 + 1, 50 − 10, 10 + 20; −1000 + 1, −1 + 2, −500 − 3.
    assert_eq!(
        seen[5],
        ["G05 Some(21110612.447) Some(-0.91) Some(45.04)", "E11 Some(23999997.001) Some(0.07) Some(39.997)"]
    );
    assert!(file.skips.is_empty(), "{}", file.skips);
}

/// The same of version 1: `&` starts anew, indicators, more than one line per satellite.
#[test]
fn an_example_of_version_1_by_hand() {
    let text = header("1.0                 COMPACT RINEX FORMAT", "CRINEX VERS   / TYPE")
        + &header("by hand", "CRINEX PROG / DATE")
        + &header("     2.11           OBSERVATION DATA    G (GPS)", "RINEX VERSION / TYPE")
        + &header("     6    L1    C1    L2    P2    D1    S1", "# / TYPES OF OBSERV")
        + &header("", "END OF HEADER")
        + "&05  4  2  0  0  0.0000000  0  1G 3

3&55923622160 3&24767686375   3&-1500 3&45000 1
                3

148426281 28244296   0 -1000 & 15
";
    let file = ObservationFile::parse(text.as_bytes()).unwrap();
    assert!(file.skips.is_empty(), "{}", file.skips);
    let at = |epoch: usize| {
        let o = file.epochs[epoch].observations.iter().find(|o| o.signal.to_string() == "1C").unwrap();
        (o.carrier_phase_cycles, o.pseudorange_m, o.doppler_hz, o.cn0_dbhz, o.loss_of_lock.cycle_slip)
    };
    let first = (Some(55_923_622.160), Some(24_767_686.375), Some(-1.5), Some(45.0), true);
    let second = (Some(56_072_048.441), Some(24_795_930.671), Some(-1.5), Some(44.0), false);
    assert_eq!((at(0), at(1)), (first, second));
    assert_eq!(file.epochs[1].time_gps, "2005-04-02T00:00:30".parse().unwrap());
}

/// An event between: its lines are plain, it may bring other types, and what follows must start anew.
#[test]
fn events_change_the_types_and_want_a_new_start() {
    let head = header("3.0                 COMPACT RINEX FORMAT", "CRINEX VERS   / TYPE")
        + &header("by hand", "CRINEX PROG / DATE")
        + &header("     3.04           OBSERVATION DATA    M", "RINEX VERSION / TYPE")
        + &header("G    2 C1C D1C", "SYS / # / OBS TYPES")
        + &header("", "END OF HEADER")
        + "> 2010 10 24 22 14 30.0000000  0  1      G05\n\n3&21111612436 3&-1500\n"
        + ">                              4  1\n"
        + &header("G    1 S1C", "SYS / # / OBS TYPES");
    let anew = "&reserved\n> 2010 10 24 22 14 31.0000000  0  1      G05\n\n3&45000\n";
    let file = ObservationFile::parse((head.clone() + anew).as_bytes()).unwrap();
    assert_eq!(file.epochs[1].observations[0].cn0_dbhz, Some(45.0), "{}", file.skips);
    assert_eq!((file.skips.count(Reason::HatanakaEscapeLine), file.skips.total()), (1, 1));
    // A difference to what was before the event has no meaning.
    let file = ObservationFile::parse((head + "                    1\n\n5\n" + anew).as_bytes()).unwrap();
    assert_eq!((file.epochs.len(), file.events.len()), (2, 1), "{}", file.skips);
    assert!(file.skips.total() > 1, "{}", file.skips);
}

/// One satellite of one epoch: values and indicators by type.
type Row = Vec<Option<(i64, u8)>>;

fn rinex_3(epochs: &[BTreeMap<u8, Row>]) -> String {
    let mut text = header("     3.04           OBSERVATION DATA    G", "RINEX VERSION / TYPE")
        + &header("G    3 L1C D1C L5X", "SYS / # / OBS TYPES")
        + &header("", "END OF HEADER");
    for (second, epoch) in epochs.iter().enumerate() {
        if second == 5 {
            text += ">                              4  1\n";
            text += &header("SOMETHING HAPPENED", "COMMENT");
        }
        writeln!(text, "> 2020 08 13 14 {:02} {:2}.0000000  0{:3}", second / 60, second % 60, epoch.len())
            .unwrap();
        for (number, row) in epoch {
            let field = |value: &Option<(i64, u8)>| match value {
                Some((v, flag)) => {
                    format!(
                        "{:>14}{} ",
                        format!("{:.3}", *v as f64 / 1e3),
                        ["", "1", "2"][usize::from(*flag)]
                    )
                }
                None => " ".repeat(16),
            };
            let values: Vec<String> = row.iter().map(|v| format!("{:<16}", field(v))).collect();
            writeln!(text, "G{number:02}{}", values.concat().trim_end()).unwrap();
        }
    }
    text
}

fn epochs() -> impl Strategy<Value = Vec<BTreeMap<u8, Row>>> {
    let value = prop_oneof![
        1 => Just(None),
        6 => (-40_000_000_i64..40_000_000, 0..3_u8).prop_map(Some),
        1 => (-999_999_999_999_i64..9_999_999_999_999, 0..3_u8).prop_map(Some),
    ];
    let row = proptest::collection::vec(value, 3);
    let epoch = proptest::collection::btree_map(1..6_u8, row, 1..5);
    proptest::collection::vec(epoch, 1..12)
}

fn streamed(text: &str, size: usize) -> Vec<Record> {
    let (mut decoder, mut records) = (ObservationDecoder::default(), Vec::new());
    for portion in text.as_bytes().chunks(size) {
        decoder.feed(portion).unwrap();
        records.extend(std::iter::from_fn(|| decoder.next_record()));
    }
    Decoder::finish(&mut decoder).unwrap();
    records.extend(std::iter::from_fn(|| decoder.next_record()));
    records
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(500) })]

    #[test]
    fn what_was_encoded_comes_back(epochs in epochs(), every in 1..6_usize, size in 1..200_usize) {
        let text = rinex_3(&epochs);
        let plain = ObservationFile::parse(text.as_bytes()).unwrap();
        let compact = encode(&text, |epoch| epoch % every == 0);
        let restored = ObservationFile::parse(compact.as_bytes()).unwrap();
        prop_assert_eq!(&plain.epochs, &restored.epochs);
        prop_assert_eq!(plain.epochs.len(), epochs.len());
        let records = into_records(plain);
        prop_assert_eq!(streamed(&compact, size), records);
    }

    #[test]
    fn damage_never_panics(epochs in epochs(), at: usize, byte: u8, gap in 0..60_usize) {
        let mut text = encode(&rinex_3(&epochs), |epoch| epoch % 4 == 0).into_bytes();
        let at = at % text.len();
        text[at] = byte;
        text.drain(at..(at + gap).min(text.len()));
        let _ = ObservationFile::parse(&text);
    }
}

/// After damage nothing is believed until the next epoch that starts anew.
#[test]
fn the_next_full_epoch_ends_the_damage() {
    let row = |second: i64| vec![Some((1_000_000 + second * 1_000, 0)), Some((500, 0)), None];
    let epochs: Vec<BTreeMap<u8, Row>> =
        (0..10).map(|s| BTreeMap::from([(7, row(s)), (8, row(s))])).collect();
    let text = rinex_3(&epochs).replace(
        &format!(">                              4  1\n{}", header("SOMETHING HAPPENED", "COMMENT")),
        "",
    );
    let plain = ObservationFile::parse(text.as_bytes()).unwrap();
    let compact = encode(&text, |epoch| epoch % 5 == 0);
    // The second epoch's line is lost its time by a stray byte.
    let damaged = compact.replacen("                    1\n", "                 x  1\n", 1);
    assert_ne!(damaged, compact);
    let file = ObservationFile::parse(damaged.as_bytes()).unwrap();
    println!("{}", file.skips);
    assert_eq!(file.epochs[0], plain.epochs[0]);
    assert_eq!(file.epochs[1..], plain.epochs[5..]);
    assert!(!file.skips.is_empty());
}
