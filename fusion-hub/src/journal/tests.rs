use std::io::{Seek, SeekFrom, Write};

use cofix_common::filter::PhoneState;
use cofix_common::fusion::engine::{FusedEpoch, FusedPhone};
use cofix_common::skips::{Reason, Skips};
use cofix_common::wire::encode;
use nalgebra::{SMatrix, SVector};
use prost::Message as _;

use super::*;
use crate::network::intake::Arrival;
use crate::testing::{names, numbered};

fn at(second: f64) -> GpsTime {
    GpsTime::from_week_tow(2118, 397_000.0) + second
}

fn header() -> Header {
    Header {
        group: "g".to_owned(),
        phones: vec!["a".to_owned(), "b".to_owned()],
        latency: Duration::from_millis(2_500),
        session_path: PathBuf::from("drive.toml"),
        data: None,
    }
}

fn epoch(phone: &str, sender: Option<&str>, sequence: u64) -> Event {
    let bytes = encode(&numbered("a", sequence, at(sequence as f64))).unwrap();
    Event::Epoch(Arrival { phone: phone.to_owned(), sender: sender.map(str::to_owned), bytes })
}

fn refused(phone: Option<&str>, reason: Reason) -> Event {
    let mut skips = Skips::default();
    skips.add(reason, || "the first".to_owned());
    Event::Refused { phone: phone.map(str::to_owned), skips }
}

/// Events of all kinds, also of no phone of the group and without a sender.
fn events() -> Vec<Event> {
    let arrival = |phone: &str, bytes: &[u8]| Arrival {
        phone: phone.to_owned(),
        sender: Some("x".to_owned()),
        bytes: bytes.to_vec(),
    };
    vec![
        Event::Alive { phone: "a".to_owned(), alive: true },
        epoch("a", Some("x"), 0),
        epoch("b", Some("y"), 0),
        epoch("a", None, 1),
        refused(Some("b"), Reason::MessageUnreadable),
        refused(None, Reason::PhoneUnknown),
        Event::Status(arrival("a", b"status")),
        Event::History(arrival("b", b"")),
        Event::Answered { phone: "a".to_owned(), sender: "x".to_owned() },
        Event::Shed { phone: "a".to_owned(), count: 70_000 },
    ]
}

fn text(entries: impl Iterator<Item = Entry>) -> Vec<String> {
    entries.map(|entry| format!("{entry:?}")).collect()
}

/// A step with all events, at a time.
fn write(journal: &mut Journal, second: u32) {
    for event in events() {
        journal.event(&event).unwrap();
    }
    journal.step(Duration::from_secs(u64::from(second)), at(f64::from(second))).unwrap();
}

fn expected(second: u32) -> Vec<String> {
    let step = Entry::Step { now: Duration::from_secs(u64::from(second)), wall_gps: at(f64::from(second)) };
    text(events().into_iter().map(Entry::Event).chain([step]))
}

#[test]
fn what_is_written_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let mut journal = Journal::create(&path, header(), "group = 'g'", at(0.0)).unwrap();
    write(&mut journal, 1);
    write(&mut journal, 2);
    journal.end().unwrap();
    journal.finish().unwrap();
    let mut reader = JournalReader::open(&path).unwrap();
    let origin = Origin { header: header(), session: Some("group = 'g'".to_owned()) };
    assert_eq!(*reader.origin().unwrap(), origin);
    let found = text(reader.by_ref());
    assert_eq!(found, [expected(1), expected(2), vec!["Ended".to_owned()]].concat());
    assert_eq!((reader.segments(), reader.damages()), (1, &[][..]));
    assert!(Journal::create(&path, header(), "", at(0.0)).is_err(), "never replaced");
}

#[test]
fn fused_positions_stand_beside_and_are_not_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let mut journal = Journal::create(&path, header(), "", at(0.0)).unwrap();
    write(&mut journal, 1);
    let state = PhoneState { mean: SVector::repeat(3e6), covariance: SMatrix::identity() };
    let fused = FusedPhone { state: Some(state), ..FusedPhone::default() };
    let phones = vec![FusedPhone::default(), fused];
    journal.fused(&FusedEpoch { time_gps: at(0.5), phones, ..fused_epoch() }).unwrap();
    journal.end().unwrap();
    journal.finish().unwrap();
    assert_eq!(text(JournalReader::open(&path).unwrap()), [expected(1), vec!["Ended".to_owned()]].concat());
    let bytes = std::fs::read(&path).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let is_fix = |message: &mcap::Message<'_>| message.channel.topic == "cofix/g/fused/b";
    let fixes: Vec<_> = messages.filter(is_fix).collect();
    let [fix] = fixes.as_slice() else { panic!("{fixes:?}") };
    let schema = fix.channel.schema.as_ref().unwrap();
    assert_eq!((schema.name.as_str(), schema.encoding.as_str()), ("foxglove.LocationFix", "protobuf"));
    let decoded = LocationFix::decode(&*fix.data).unwrap();
    assert_eq!((decoded.frame_id.as_str(), decoded.position_covariance.len()), ("b", 9));
    assert_eq!(i64::try_from(fix.publish_time).unwrap(), at(0.5).as_unix_calendar_nanos());
}

fn fused_epoch() -> FusedEpoch {
    let (actions, distances, events) = Default::default();
    FusedEpoch { time_gps: at(0.0), phones: Vec::new(), actions, distances, events }
}

#[test]
fn segments_follow_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let mut journal = Journal::create(&path, header(), "", at(0.0)).unwrap().with_segments_of(1);
    (1..=3).for_each(|second| write(&mut journal, second));
    drop(journal);
    let mut journal = Journal::go_on(&path, header(), 4, at(9.0)).unwrap();
    write(&mut journal, 9);
    journal.end().unwrap();
    journal.finish().unwrap();
    let files = (1..=5).map(|number| segment(Path::new("drive.mcap"), number).display().to_string());
    let mut files: Vec<String> = files.collect();
    files.sort_unstable();
    assert_eq!(names(folder.path()), files);
    let mut reader = JournalReader::open(&path).unwrap();
    let found = text(reader.by_ref());
    let resumed = vec!["Resumed".to_owned()];
    let ended = vec!["Ended".to_owned()];
    assert_eq!(found, [expected(1), expected(2), expected(3), resumed, expected(9), ended].concat());
    assert_eq!(reader.segments(), 5);
}

#[test]
fn a_torn_end_costs_its_chunk_and_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let mut journal = Journal::create(&path, header(), "", at(0.0)).unwrap();
    let mut ends = Vec::new();
    for second in 1..=4 {
        write(&mut journal, second);
        journal.write_out().unwrap();
        ends.push(path.metadata().unwrap().len());
    }
    // A killed hub ends nothing.
    std::mem::forget(journal);
    let whole = std::fs::read(&path).unwrap();
    for cut in (ends[1]..=ends[3]).step_by(7) {
        std::fs::write(&path, &whole[..usize::try_from(cut).unwrap()]).unwrap();
        let mut reader = JournalReader::open(&path).unwrap();
        let found = text(reader.by_ref());
        let whole_chunks = ends.iter().filter(|end| **end <= cut).count();
        // An index follows each chunk, so the last one may be whole although its end is cut off.
        let chunks = found.len() / expected(1).len();
        assert!((whole_chunks..=whole_chunks + 1).contains(&chunks), "cut at {cut}: {chunks}");
        let all: Vec<String> = (1..=4).flat_map(expected).collect();
        assert_eq!(found, all[..chunks * expected(1).len()], "cut at {cut}");
    }
    // A damaged byte within a chunk: what is before counts, and the damage is named.
    std::fs::write(&path, &whole).unwrap();
    let mut file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
    file.seek(SeekFrom::Start(ends[1] + 100)).unwrap();
    file.write_all(&[0x55; 16]).unwrap();
    let mut reader = JournalReader::open(&path).unwrap();
    assert_eq!(text(reader.by_ref()), [expected(1), expected(2)].concat());
    assert_eq!(reader.damages().len(), 1, "{:?}", reader.damages());
}

#[test]
fn what_is_no_journal_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let error = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        JournalReader::open(&path).err().unwrap().to_string()
    };
    assert!(error(b"").contains("no journal of cofix-hub"));
    assert!(error(b"RINEX VERSION").contains("no journal of cofix-hub"));
    let missing = JournalReader::open(Path::new("nowhere.mcap")).err().unwrap().to_string();
    assert!(missing.contains("nowhere.mcap: cannot read the journal"), "{missing}");
}
