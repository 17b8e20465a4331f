//! Events between epochs (flags 2 to 6) of RINEX 2, 3 and Compact RINEX, and written again.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)] // helpers of tests

mod beside;
mod file_records;
mod hatanaka_encoder;

use beside::required;
use cofix_common::formats::decode::Record;
use cofix_common::formats::rinex::{ObservationFile, ObservationLayout, ObservationWriter, RecordingInfo};
use cofix_common::gnss::{Constellation, CycleSlip, Event, EventKind, SatelliteId, SignalCode};
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;
use file_records::into_records;
use hatanaka_encoder::encode;
use proptest::prelude::*;

fn header(content: &str, label: &str) -> String {
    format!("{content:<60}{label}\n")
}

fn parse(text: &str) -> ObservationFile {
    ObservationFile::parse(text.as_bytes()).unwrap()
}

fn time(text: &str) -> GpsTime {
    text.parse().unwrap()
}

fn event(kind: EventKind, time_gps: Option<GpsTime>, lines: &[&str]) -> Event {
    let lines = lines.iter().map(|line| line.trim_end().to_owned()).collect();
    Event { kind, time_gps, lines, slips: Vec::new() }
}

fn slip(satellite: &str, band: u8, attribute: u8, slip_cycles: f64) -> CycleSlip {
    CycleSlip { satellite: satellite.parse().unwrap(), signal: SignalCode::new(band, attribute), slip_cycles }
}

fn head_3() -> String {
    header("     3.04           OBSERVATION DATA    M", "RINEX VERSION / TYPE")
        + &header("FIRST SITE", "MARKER NAME")
        + &header("G    3 C1C L1C S1C", "SYS / # / OBS TYPES")
        + &header("  2020     8    13    14    19    2.0000000     GPS", "TIME OF FIRST OBS")
        + &header("", "END OF HEADER")
}

fn epoch_3(second: u32) -> String {
    format!("> 2020 08 13 14 19 {second:2}.0000000  0  1\nG10  21111612.436   291795067.814\n")
}

/// All events between two epochs, and what they must read as.
fn all_3() -> (String, Vec<(usize, Event)>) {
    let (site, types) =
        (header("SECOND SITE", "MARKER NAME"), header("G    2 C1C L1C", "SYS / # / OBS TYPES"));
    let text = head_3()
        + "> 2020 08 13 14 19  1.5000000  5  0\n"
        + &epoch_3(2)
        + ">                              2  0\n"
        + "> 2020 08 13 14 19  2.7654321  5  0\n"
        + "> 2020 08 13 14 19  2.8000000  3  1\n"
        + &site
        + ">                              4  2\n"
        + &types
        + &header("> A COMMENT THAT BEGINS LIKE AN EPOCH", "COMMENT")
        + "> 2020 08 13 14 19  2.9000000  6  2\nG03                        -2.000\nG05                         0.500\n"
        + &epoch_3(3)
        + ">                              4  1\n"
        + &header("THE END", "COMMENT");
    let slips = Event {
        slips: vec![slip("G03", b'1', b'C', -2.0), slip("G05", b'1', b'C', 0.5)],
        ..event(EventKind::CycleSlips, Some(time("2020-08-13T14:19:02.9")), &[])
    };
    let comment = header("> A COMMENT THAT BEGINS LIKE AN EPOCH", "COMMENT");
    let end = header("THE END", "COMMENT");
    let events = vec![
        (0, event(EventKind::External, Some(time("2020-08-13T14:19:01.5")), &[])),
        (1, event(EventKind::AntennaMoves, None, &[])),
        (1, event(EventKind::External, Some(time("2020-08-13T14:19:02.7654321")), &[])),
        (1, event(EventKind::NewSite, Some(time("2020-08-13T14:19:02.8")), &[&site])),
        (1, event(EventKind::Header, None, &[&types, &comment])),
        (1, slips),
        (2, event(EventKind::Header, None, &[&end])),
    ];
    (text, events)
}

#[test]
fn every_event_of_rinex_3_is_kept_in_its_place() {
    let (text, events) = all_3();
    let file = parse(&text);
    assert!(file.skips.is_empty(), "{}", file.skips);
    assert_eq!(file.events, events);
    assert_eq!(file.epochs.len(), 2);
    // Header lines hold from then on; the slips were repaired.
    assert_eq!(file.header.marker_name, "SECOND SITE");
    assert!(file.epochs.iter().all(|e| !e.observations[0].loss_of_lock.cycle_slip));
}

#[test]
fn compact_rinex_has_the_same_events() {
    let (text, events) = all_3();
    let file = parse(&encode(&text, |epoch| epoch == 0));
    assert!(file.skips.is_empty(), "{}", file.skips);
    assert_eq!((file.events, file.epochs), (events, parse(&text).epochs));
}

const VALUES_2: &str = "  55923622.16055  43647388.24243  24767686.375    24767684.822          45.000
     -2520.506    24767686.125\n";

fn head_2() -> String {
    header("     2.11           OBSERVATION DATA    G (GPS)", "RINEX VERSION / TYPE")
        + &header("     7    L1    L2    C1    P2    S1    D1    P1", "# / TYPES OF OBSERV")
        + &header("  2005     4     2     0     0   30.0000000     GPS", "TIME OF FIRST OBS")
        + &header("", "END OF HEADER")
}

/// Slips of thirteen satellites with seven types: a list over two lines, two lines for each.
fn all_2() -> (String, Vec<(usize, Event)>) {
    let list = (1..=12).map(|n| format!("G{n:2}")).collect::<Vec<_>>().concat();
    let one = format!("{:14.3}  {:14.3}\n\n", 2.0, -3.0);
    let text = head_2()
        + &format!(" 05  4  2  0  0 30.0000000  0  1G 3\n{VALUES_2}")
        + &format!(" 05  4  2  0  1  0.0000000  6 13{list}\n{}G13\n{}", " ".repeat(32), one.repeat(13))
        + "                            4  2\n"
        + &header(" 05  4  2  0  0 30.0000000  0  1G 3", "COMMENT")
        + "TEXT WITHOUT A LABEL\n"
        + " 05  4  2  0  1  0.1234567  5  0\n"
        + " 05  4  2  0  1  2.0000000  2  1\n"
        + &header("     2    C1    L1", "# / TYPES OF OBSERV")
        + " 05  4  2  0  1 30.0000000  1  1G 3\n  24767686.375    55923622.1607\n";
    let slips = (1..=13).flat_map(|n| {
        let satellite = format!("G{n:02}");
        [slip(&satellite, b'1', b'C', 2.0), slip(&satellite, b'2', b'W', -3.0)]
    });
    let quoted = header(" 05  4  2  0  0 30.0000000  0  1G 3", "COMMENT");
    let types = header("     2    C1    L1", "# / TYPES OF OBSERV");
    let at = |second: &str| Some(time(&format!("2005-04-02T00:01:{second}")));
    let events = vec![
        (1, Event { slips: slips.collect(), ..event(EventKind::CycleSlips, at("00"), &[]) }),
        (1, event(EventKind::Header, None, &[&quoted, "TEXT WITHOUT A LABEL"])),
        (1, event(EventKind::External, at("00.1234567"), &[])),
        (1, event(EventKind::AntennaMoves, at("02"), &[&types])),
    ];
    (text, events)
}

#[test]
fn every_event_of_rinex_2_is_kept_in_its_place() {
    let (text, events) = all_2();
    let file = parse(&text);
    assert!(file.skips.is_empty(), "{}", file.skips);
    assert_eq!(file.events, events);
    let (first, last) = (&file.epochs[0].observations[0], &file.epochs[1].observations[0]);
    // The indicator 5: slip and anti-spoofing; 7: the half cycle, too.
    let bits = |o: &cofix_common::gnss::Observation| {
        let lock = o.loss_of_lock;
        (lock.cycle_slip, lock.half_cycle, lock.noisier)
    };
    assert_eq!((bits(first), bits(last)), ((true, false, true), (true, true, true)));
    assert_eq!((file.epochs.len(), last.pseudorange_m), (2, Some(24_767_686.375)));
}

/// An example by hand: slips of version 1 have as many lines as an epoch's satellites.
#[test]
fn compact_rinex_1_has_the_same_events() {
    let (text, events) = all_2();
    let (head, body) = text.split_once("END OF HEADER\n").unwrap();
    let at = body.find(" 05  4  2  0  1  0.0000000  6").unwrap();
    let last = body.find(" 05  4  2  0  1 30").unwrap();
    let lines_of_events = [
        " 05  4  2  0  1  0.0000000  6",
        "                            4  2",
        " 05  4  2  0  1  0.1234567  5",
        " 05  4  2  0  1  2.0000000  2",
    ];
    let plain = lines_of_events
        .iter()
        .fold(body[at..last].to_owned(), |text, line| text.replacen(line, &format!("&{}", &line[1..]), 1));
    let compact = header("1.0                 COMPACT RINEX FORMAT", "CRINEX VERS   / TYPE")
        + &header("by hand", "CRINEX PROG / DATE")
        + head
        + "END OF HEADER\n&05  4  2  0  0 30.0000000  0  1G 3\n\n"
        + "3&55923622160 3&43647388242 3&24767686375 3&24767684822 3&45000 3&-2520506 3&24767686125 5543\n"
        + &plain
        + "&05  4  2  0  1 30.0000000  1  1G 3\n\n3&24767686375 3&55923622160   7\n";
    let file = parse(&compact);
    assert!(file.skips.is_empty(), "{}\n{compact}", file.skips);
    assert_eq!(file.events, events, "{compact}");
    assert_eq!(file.epochs, parse(&text).epochs);
}

#[test]
fn what_cannot_be_read_is_counted_and_costs_only_itself() {
    let body = [
        epoch_3(2),
        "> 2020 08 13 14 19  x.0000000  5  1\n".to_owned() + &header("WHEN", "COMMENT"),
        ">                              5  0\n".to_owned(),
        "> 2020 13 13 14 19  2.0000000  4  1\n".to_owned() + &header("NO SUCH MONTH", "COMMENT"),
        "> 2020 08 13 14 19  2.0000000  6  2\nG03                         2.000\nX03  2.000\n".to_owned(),
        "> 2020 08 13 14 19  2.5000000  6  2\nG03  21111612.436           2.000\n".to_owned(),
        ">                              4  9\n".to_owned() + &header("ONE OF NINE", "COMMENT"),
        epoch_3(3),
        header("A COMMENT OUTSIDE", "COMMENT"),
        format!(">                              4  1\n{}\u{e4}\u{7}\n", "x".repeat(78)),
        format!(">                              4  1\n{}\n", "y".repeat(200)),
        "> 2020 08 13 14 19  4.0000000  7  0\n".to_owned(),
        ">                              4  2\n".to_owned() + &header("CUT", "COMMENT"),
    ];
    let file = parse(&(head_3() + &body.concat()));
    let kinds: Vec<_> = file.events.iter().map(|(before, event)| (*before, event.kind)).collect();
    let (header, slips) = (EventKind::Header, EventKind::CycleSlips);
    assert_eq!(kinds, [(1, header), (1, slips), (1, slips), (1, header), (2, header), (2, header)]);
    assert_eq!(file.epochs.len(), 2);
    assert_eq!((file.events[0].1.time_gps, file.events[0].1.lines.len()), (None, 1));
    assert_eq!(file.events[3].1.lines.len(), 1);
    assert_eq!(file.events[4].1.lines[0], "x".repeat(78) + "\u{e4}");
    assert_eq!(file.events[5].1.lines[0], "y".repeat(80));
    for (reason, count) in [
        (Reason::TimeEventUnreadable.text(), 2),
        (Reason::ExternalEventWithoutTime.text(), 2),
        (Reason::CommentOutsideAnyEvent.text(), 2),
        (Reason::UnknownSatellite.text(), 1),
        (Reason::CycleSlipValueOfNoPhase.text(), 1),
        (Reason::EpochLacksSatellites.text(), 1),
        (Reason::EventLacksLines.text(), 1),
        (Reason::EventLineCut.text(), 1),
        (Reason::EpochLineUnreadable.text(), 1),
        (Reason::LastEventCutOff.text(), 1),
    ] {
        assert_eq!(file.skips.count(reason), count, "{reason}: {}", file.skips);
    }
    assert_eq!(file.skips.total(), 13, "{}", file.skips);
}

/// A wrong number of lines must not take the epochs that follow.
#[test]
fn an_event_of_rinex_2_ends_with_the_next_time() {
    let text = head_2()
        + "                            4 99\n"
        + &header("ONE LINE", "COMMENT")
        + &format!(" 05  4  2  0  0 30.0000000  0  1G 3\n{VALUES_2}");
    let file = parse(&text);
    assert_eq!((file.epochs.len(), file.events.len(), file.skips.total()), (1, 1, 1), "{}", file.skips);
}

#[test]
#[ignore = "needs the reference data"]
fn recorded_comments_are_kept() {
    for path in ["oracle/inputs/07590920.05o", "oracle/inputs/30400920.05o"] {
        let bytes = required(path);
        let file = ObservationFile::parse(&bytes).unwrap();
        println!("{path}: {} events, {}", file.events.len(), file.skips);
        assert!(!file.events.is_empty() && file.skips.is_empty(), "{}", file.skips);
        let lines = file.events.iter().flat_map(|(_, event)| &event.lines);
        assert!(lines.filter(|line| line.ends_with("COMMENT")).count() >= file.events.len());
    }
}

fn written(records: &[Record]) -> (String, ObservationWriter) {
    let mut layout = ObservationLayout::default();
    for record in records {
        match record {
            Record::Epoch(epoch) => layout.include(epoch),
            Record::Event(event) => layout.include_event(event),
            other => panic!("{other:?}"),
        }
    }
    let mut writer = ObservationWriter::new(layout);
    let mut text = writer.header(&RecordingInfo::default());
    for record in records {
        match record {
            Record::Epoch(epoch) => text += &writer.epoch(epoch),
            Record::Event(event) => text += &writer.event(event),
            other => panic!("{other:?}"),
        }
    }
    (text, writer)
}

/// A file has one layout here; what an event says about another is left out, and an event of nothing else with it.
#[test]
fn header_lines_of_another_layout_are_not_written() {
    for (text, left_out) in [(all_3().0, 1), (all_2().0, 1)] {
        let records = into_records(parse(&text));
        let (text, writer) = written(&records);
        let reason = Reason::LayoutLineOfEvent.text();
        assert_eq!((writer.skips().count(reason), writer.skips().total()), (left_out, left_out));
        let again = parse(&text);
        assert!(again.skips.is_empty(), "{}", again.skips);
        let mut expected = records;
        for record in &mut expected {
            match record {
                Record::Event(event) => event.lines.retain(|line| !line.contains("TYPES")),
                Record::Epoch(epoch) => epoch.observations.sort_by_key(|o| (o.satellite, o.signal)),
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(into_records(again), expected, "{text}");
    }
    let only = event(EventKind::Header, None, &[&header("G    1 C1C", "SYS / # / OBS TYPES")]);
    let epoch = into_records(parse(&(head_3() + &epoch_3(2))));
    let mut writer = written(&epoch).1;
    assert_eq!(writer.event(&only), "");
    // Labels are read in small letters too.
    let small = event(EventKind::Header, None, &[&header("     2    C1    L1", "# / TYPeS OF OBSERV")]);
    assert_eq!(writer.event(&small), "");
    let quoting = event(EventKind::External, Some(time("2020-08-13T14:19:02")), &["> quoted", "kept"]);
    assert!(writer.event(&quoting).ends_with("  5  1\nkept\n"));
    assert_eq!(writer.skips().count(Reason::EventLineLikeEpoch), 1);
}

const KINDS: [EventKind; 4] =
    [EventKind::AntennaMoves, EventKind::NewSite, EventKind::Header, EventKind::External];

fn text_event() -> impl Strategy<Value = Event> {
    let line = prop_oneof![
        "[ -=?-~]{0,80}".prop_map(|text| text.trim_end().to_owned()),
        "[ -~]{0,60}".prop_map(|text| header(&text, "COMMENT").trim_end().to_owned()),
        "[ -~]{0,60}".prop_map(|text| header(&text, "MARKER NAME").trim_end().to_owned()),
        "[ä-ö ]{0,80}".prop_map(|text| text.trim_end().to_owned()),
    ];
    let line = line.prop_filter("no epoch line", |line| !line.starts_with('>') || line.ends_with("COMMENT"));
    let time_gps = proptest::option::of(0..10_000_000_000_i64);
    (proptest::sample::select(KINDS.to_vec()), time_gps, proptest::collection::vec(line, 0..5)).prop_map(
        |(kind, step, lines)| {
            let step = step.or((kind == EventKind::External).then_some(0));
            let start = time("2020-08-13T00:00:00").nanos();
            let time_gps = step.map(|step| GpsTime::from_nanos(start + 100 * step));
            Event { kind, time_gps, lines, slips: Vec::new() }
        },
    )
}

fn slips() -> impl Strategy<Value = Event> {
    let systems = vec![Constellation::Gps, Constellation::Galileo, Constellation::Qzss];
    let name = (proptest::sample::select(systems), 1..40_u8, proptest::sample::select(vec![b'1', b'5']));
    let cycles = (-9_999_999..9_999_999_i64).prop_filter("zero is missing", |v| *v != 0);
    proptest::collection::btree_map(name, cycles, 0..20).prop_map(|slips| {
        let slip = |((system, number, band), thousandths): ((Constellation, u8, u8), i64)| CycleSlip {
            satellite: SatelliteId::new(system, number),
            signal: SignalCode::new(band, b'X'),
            slip_cycles: thousandths as f64 / 1e3,
        };
        let slips = slips.into_iter().map(slip).collect();
        Event { slips, ..event(EventKind::CycleSlips, None, &[]) }
    })
}

proptest! {
    #[test]
    fn events_come_back(
        events in proptest::collection::vec((prop_oneof![3 => text_event(), 1 => slips()], any::<bool>()), 0..8),
    ) {
        let epoch = |second: usize| match into_records(parse(&(head_3() + &epoch_3(2)))).remove(0) {
            Record::Epoch(epoch) => {
                let time_gps = epoch.time_gps + second as f64;
                Record::Epoch(cofix_common::gnss::ObservationEpoch { time_gps, ..epoch })
            }
            other => other,
        };
        let mut records = vec![epoch(0)];
        for (index, (event, is_followed)) in events.into_iter().enumerate() {
            records.push(Record::Event(Box::new(event)));
            if is_followed {
                records.push(epoch(index + 1));
            }
        }
        let (text, writer) = written(&records);
        prop_assert!(writer.skips().is_empty(), "{}", writer.skips());
        let again = parse(&text);
        prop_assert!(again.skips.is_empty(), "{}\n{}", again.skips, text);
        prop_assert_eq!(into_records(again), records, "{}", text);
    }
}
