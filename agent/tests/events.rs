//! Events between epochs: inspected, converted, and no matter to positions.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::{Path, PathBuf};

use cofix_agent::Stop;
use cofix_agent::convert::{Outputs, convert};
use cofix_agent::inspect::{InspectOptions, inspect};
use cofix_agent::source::Reading;
use cofix_common::formats::rinex::ObservationFile;
use cofix_common::gnss::EventKind;
use cofix_common::skips::Reason;

fn header(content: &str, label: &str) -> String {
    format!("{content:<60}{label}\n")
}

fn epoch(second: u32) -> String {
    format!("> 2020 08 13 14 19 {second:2}.0000000  0  1\nG10  21111612.436   291795067.8144\n")
}

/// Of two sites, with one event of each kind and three of one.
fn recording(seconds: std::ops::Range<u32>) -> String {
    let mut text = header("     3.04           OBSERVATION DATA    M", "RINEX VERSION / TYPE")
        + &header("FIRST SITE", "MARKER NAME")
        + &header("G    2 C1C L1C", "SYS / # / OBS TYPES")
        + &header("", "END OF HEADER")
        + ">                              4  1\n"
        + &header("BEFORE ALL", "COMMENT");
    let middle = u32::midpoint(seconds.start, seconds.end);
    for second in seconds {
        text += &epoch(second);
        if second == middle {
            let time = |fraction: &str| format!("> 2020 08 13 14 19 {second:2}.{fraction}");
            text += &(time("2500000  5  0\n") + &time("5000000  3  1\n"));
            text += &header("SECOND SITE", "MARKER NAME");
            text += ">                              4  1\n";
            text += &header("G    2 L1C C1C", "SYS / # / OBS TYPES");
            text += ">                              4  1\n";
            text += &header("G    2 C1C L1C", "SYS / # / OBS TYPES");
            text += ">                              6  1\nG10                        -2.000\n";
        }
    }
    text
}

fn written(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn inspection_lists_events() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path(), "events.rnx", &recording(0..9));
    let inspection = inspect(&path, &InspectOptions::default(), &Stop::default()).unwrap();
    assert!(inspection.skips.is_empty(), "{}", inspection.skips);
    assert_eq!((inspection.epochs, inspection.events.count), (9, 6));
    assert_eq!(inspection.events.by_kind["header information"], 3);
    let text = inspection.to_string();
    for line in [
        "  events      1 × external event, 3 × header information, 1 × new site, 1 × repaired cycle slips\n",
        "header information before the first epoch: 'BEFORE ALL COMMENT'\n",
        "external event at 2020-08-13T14:19:04.250\n",
        "new site at 2020-08-13T14:19:04.500: 'SECOND SITE MARKER NAME'\n",
    ] {
        assert!(text.contains(line), "{line} in {text}");
    }
    let json = serde_json::to_value(&inspection).unwrap();
    let last = &json["events"]["first"][5];
    assert_eq!((last["slips"].as_u64(), last["at_gps"].as_str()), (Some(1), None));
    assert_eq!(last["after_gps"].as_str(), Some("2020-08-13T14:19:04.000"));
    // Slips that were repaired are none of the phases.
    assert_eq!(json["constellations"][0]["signals"][0]["slips"].as_u64(), Some(0));
}

/// However many there are, a few are listed.
#[test]
fn the_list_is_bounded() {
    let folder = tempfile::tempdir().unwrap();
    let many = recording(0..9) + &">                              2  0\n".repeat(1_000);
    let path = written(folder.path(), "many.rnx", &many);
    let events = inspect(&path, &InspectOptions::default(), &Stop::default()).unwrap().events;
    assert_eq!((events.count, events.first.len(), events.by_kind.len()), (1_006, 20, 5));
}

#[test]
fn conversion_writes_events_in_their_places() {
    let folder = tempfile::tempdir().unwrap();
    // The second begins within the first: what comes twice is left out, with its events.
    let files = [("a.rnx", 0..9), ("b.rnx", 3..30)]
        .map(|(name, seconds)| written(folder.path(), name, &recording(seconds)));
    let output = folder.path().join("out.rnx");
    let outputs = Outputs { observations: Some(output.clone()), ..Outputs::default() };
    let converted = convert(&files, &outputs, &Reading::default(), &Stop::default()).unwrap();
    let again = ObservationFile::parse(&std::fs::read(&output).unwrap()).unwrap();
    assert!(again.skips.is_empty(), "{}", again.skips);
    assert_eq!((converted.epochs, again.epochs.len()), (30, 30), "{}", converted.skips);
    assert_eq!((converted.events, again.events.len()), (8, 8), "{}", converted.skips);
    let at: Vec<_> = again.events.iter().map(|(before, event)| (*before, event.kind)).collect();
    let (text, external, site, slips) =
        (EventKind::Header, EventKind::External, EventKind::NewSite, EventKind::CycleSlips);
    let first = [(0, text), (5, external), (5, site), (5, slips)];
    assert_eq!(at, [&first[..], &[(9, text), (17, external), (17, site), (17, slips)]].concat());
    let layout = Reason::LayoutLineOfEvent.text();
    assert_eq!(converted.skips.count(layout), 4, "{}", converted.skips);
    // The header is that of the beginning.
    let text = std::fs::read_to_string(&output).unwrap();
    assert!(text.contains(&header("FIRST SITE", "MARKER NAME")), "{text}");
}
