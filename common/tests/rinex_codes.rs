//! Observation codes that their system, version or satellite cannot have: what comes of them in every RINEX version and in
//! Compact RINEX.

#![allow(clippy::unwrap_used, clippy::indexing_slicing)] // helpers of tests

mod hatanaka_encoder;

use std::fmt::Write as _;

use cofix_common::formats::rinex::ObservationFile;
use cofix_common::skips::Reason;
use hatanaka_encoder::encode;

const MISNAMED: &str = Reason::BeidouBand1TakenForB1i.text();
const UNCLEAR: &str = Reason::BeidouBand1Unclear.text();

fn header(content: &str, label: &str) -> String {
    format!("{content:<60}{label}\n")
}

/// An epoch of satellites that have a pseudorange in each of their system's columns, twice.
fn file(version: &str, types: &[&str], satellites: &[&str]) -> String {
    let mut text = header(&format!("     {version}           OBSERVATION DATA    M"), "RINEX VERSION / TYPE");
    for line in types {
        text += &header(line, "SYS / # / OBS TYPES");
    }
    text += &header("  2020     6    25    12     0    0.0000000     GPS", "TIME OF FIRST OBS");
    text += &header("", "END OF HEADER");
    for second in 0..2 {
        let _ = writeln!(text, "> 2020 06 25 12 00 {second:2}.0000000  0 {:2}", satellites.len());
        for satellite in satellites {
            let line = types.iter().find(|line| line.starts_with(&satellite[..1])).unwrap();
            let count: usize = line[3..6].trim().parse().unwrap();
            text += satellite;
            for column in 0..count {
                text += &format!("{:14}.{column}00  ", 22_000_000 + column).split_off(4);
            }
            text += "\n";
        }
    }
    text
}

/// Names of the first epoch's signals, and the file's skips.
fn read(text: &str) -> (Vec<String>, ObservationFile) {
    let file = ObservationFile::parse(text.as_bytes()).unwrap();
    let name = |o: &cofix_common::gnss::Observation| format!("{} {}", o.satellite, o.signal);
    (file.epochs[0].observations.iter().map(name).collect(), file)
}

#[test]
fn what_cannot_be_is_refused_or_taken_for_what_it_is_and_named() {
    for (version, types, satellite, expected, reason, count) in [
        // B2a written as B2I; B2I itself.
        ("3.04", "C    2 C2I C7Q", "C19", vec!["C19 2I"], Reason::BeidouSignalOfOtherGeneration.text(), 2),
        ("3.04", "C    2 C2I C7Q", "C18", vec!["C18 2I", "C18 7Q"], "", 0),
        ("4.02", "C    2 C2I C7X", "C62", vec!["C62 2I"], Reason::BeidouSignalOfOtherGeneration.text(), 2),
        ("3.05", "C    2 C2I C7D", "C40", vec!["C40 2I", "C40 7D"], "", 0),
        ("3.05", "C    2 C2I C7Z", "C05", vec!["C05 2I"], Reason::BeidouSignalOfOtherGeneration.text(), 2),
        // B1I by names of others.
        ("3.04", "C    1 C1C", "C30", vec![], Reason::SignalNotOfSystem.text(), 2),
        ("3.02", "C    1 C1C", "C05", vec![], Reason::SignalNotOfSystem.text(), 2),
        ("4.01", "C    2 C1C C6I", "C05", vec!["C05 6I"], Reason::SignalNotOfSystem.text(), 2),
        ("3.03", "C    1 C1X", "C30", vec!["C30 2X"], MISNAMED, 1),
        ("3.02", "C    1 C1X", "C30", vec!["C30 2X"], "", 0),
        ("3.02", "C    1 C1I", "C30", vec!["C30 2I"], "", 0),
        ("3.04", "C    1 C1I", "C30", vec!["C30 2I"], MISNAMED, 1),
        ("3.03", "C    2 C2I C1X", "C30", vec!["C30 2I"], UNCLEAR, 2),
        ("3.04", "C    2 C2I C1X", "C30", vec!["C30 2I", "C30 1X"], "", 0),
        (
            "3.03",
            "C    2 C2I C1P",
            "C30",
            vec!["C30 2I", "C30 1P"],
            Reason::ObservationCodeNewerThanFile.text(),
            1,
        ),
        // Blank attributes.
        ("3.04", "C    2 C2  C7 ", "C19", vec!["C19 2 ", "C19 7 "], "", 0),
        ("3.04", "E    2 C1  C5 ", "E05", vec!["E05 1 ", "E05 5 "], "", 0),
        ("3.04", "E    2 C1  C2 ", "E05", vec!["E05 1 "], Reason::SignalNotOfSystem.text(), 2),
        // Other systems.
        ("3.04", "G    3 C1C C7X C5C", "G05", vec!["G05 1C"], Reason::SignalNotOfSystem.text(), 4),
        ("3.04", "R    2 C1C C1X", "R05", vec!["R05 1C"], Reason::SignalNotOfSystem.text(), 2),
        ("3.04", "J    2 C1C C1W", "J02", vec!["J02 1C"], Reason::SignalNotOfSystem.text(), 2),
        (
            "3.04",
            "I    2 C5A C1P",
            "I02",
            vec!["I02 5A", "I02 1P"],
            Reason::ObservationCodeNewerThanFile.text(),
            1,
        ),
        ("3.04", "S    2 C1C C1X", "S20", vec!["S20 1C"], Reason::SignalNotOfSystem.text(), 2),
    ] {
        let text = file(version, &[types], &[satellite]);
        for form in [text.clone(), encode(&text, |_| false)] {
            let (found, read) = read(&form);
            assert_eq!(found, expected, "{version} {types}");
            assert_eq!(read.skips.total(), count, "{version} {types}: {}", read.skips);
            assert!(reason.is_empty() || read.skips.count(reason) == count, "{types}: {}", read.skips);
        }
    }
}

/// B2a written as 7Q (some phones' loggers): what an epoch gives to BeiDou-3 under a code of BeiDou-2 is that code of no satellite.
#[test]
fn a_code_of_the_other_generation_is_used_of_no_satellite_of_the_epoch() {
    let (observed, parsed) = read(&file("3.04", &["C    2 C2I C7Q"], &["C05", "C18", "C24"]));
    assert_eq!(observed, ["C05 2I", "C18 2I", "C24 2I"]);
    assert_eq!(parsed.skips.count(Reason::BeidouSignalOfOtherGeneration), 2, "{}", parsed.skips);
    assert_eq!(parsed.skips.count(Reason::BeidouSignalOfBothGenerations), 4, "{}", parsed.skips);
}

#[test]
fn what_is_refused_is_named_with_line_satellite_and_code() {
    let (_, file) = read(&file("3.04", &["C    2 C2I C7Q", "G    1 C1C"], &["G01", "C05", "C24"]));
    let (_, skip) = file.skips.iter().next().unwrap();
    assert_eq!(skip.first, "line 9: C24 7Q");
    let (_, file) = read(&self::file("3.03", &["C    1 C1X"], &["C24"]));
    let (_, skip) = file.skips.iter().next().unwrap();
    assert_eq!(skip.first, "C Pseudorange 1X is 2X");
}

/// RINEX 2 has one name for B2I of both generations.
#[test]
fn rinex_2_goes_by_the_satellite_too() {
    let text = header("     2.12           OBSERVATION DATA    M", "RINEX VERSION / TYPE")
        + &header("     2    C2    C7", "# / TYPES OF OBSERV")
        + &header("", "END OF HEADER")
        + " 20  6 25 12  0  0.0000000  0  2C05C24\n"
        + "  39064856.934    39064859.731\n  26576535.202    26576535.739\n";
    let (found, file) = read(&text);
    assert_eq!(found, ["C05 2I", "C05 7I", "C24 2I"]);
    assert_eq!(
        (file.skips.count(Reason::BeidouSignalOfOtherGeneration), file.skips.total()),
        (1, 1),
        "{}",
        file.skips
    );
}

/// Codes that an event changes are judged, and named again only where they differ.
#[test]
fn codes_after_an_event_are_judged_anew() {
    let text = file("3.03", &["C    1 C1X"], &["C24"]);
    let event = |types: &str| {
        format!("> 2020 06 25 12 00  2.0000000  4  1\n{}", header(types, "SYS / # / OBS TYPES"))
    };
    let epoch = "> 2020 06 25 12 00  3.0000000  0  1\nC24  22000000.000\n";
    for (types, misnamed, refused) in [("C    1 C1X", 1, 0), ("C    1 C1I", 2, 0), ("C    1 C1C", 1, 1)] {
        let (_, file) = read(&(text.clone() + &event(types) + epoch));
        let counts = (file.skips.count(MISNAMED), file.skips.count(Reason::SignalNotOfSystem));
        assert_eq!(counts, (misnamed, refused), "{types}: {}", file.skips);
    }
}
