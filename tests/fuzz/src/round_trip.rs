//! What is written reads back as it was.

use cofix_common::formats::decode::Record;
use cofix_common::formats::rinex::{
    ObservationFile, ObservationLayout, ObservationWriter, RecordingInfo, glonass_record, navigation_header,
    navigation_record,
};
use cofix_common::gnss::{CycleSlip, Event, Observation, ObservationEpoch};
use cofix_common::orbit::{IonosphereTerms, NavigationFile};
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;

use crate::checks;
use crate::file_records::into_records;

/// Longer steps the reader believes only when they are confirmed, s.
const MAX_STEP_S: f64 = 86_400.0;
/// Times closer than this are printed alike, s.
const MIN_STEP_S: f64 = 1e-6;
/// Half of the last digit that is written.
const HALF_DIGIT: f64 = 0.000_5;

/// Epochs and events written as RINEX: the same to the digits of the format, and exactly the same when written again.
pub(crate) fn observations(records: &[Record]) {
    let records: Vec<Record> = records.iter().cloned().map(possible).filter(has_any).collect();
    if !is_written(&records) {
        return;
    }
    let (text, left_out) = written(&records);
    let mut again = read(&text);
    if left_out == 0 {
        assert_eq!(again.len(), records.len(), "{text}");
        for pair in again.iter().zip(&records) {
            match pair {
                (Record::Epoch(epoch), Record::Epoch(before)) => alike(epoch, before),
                (Record::Event(event), Record::Event(before)) => same_event(event, before),
                _ => assert_eq!(pair.0, pair.1),
            }
        }
    }
    // Of an epoch all values may have rounded to zero.
    again.retain(has_any);
    if is_written(&again) {
        let (second, left_out) = written(&again);
        assert_eq!((left_out, read(&second)), (0, again), "{text}");
    }
}

/// Without signals that their satellites cannot send: streams bring them, and no file has them.
fn possible(mut record: Record) -> Record {
    match &mut record {
        Record::Epoch(epoch) => epoch.observations.retain(|o| o.satellite.cannot_send(o.signal).is_none()),
        Record::Event(event) => event.slips.retain(|slip| slip.satellite.cannot_send(slip.signal).is_none()),
        Record::Ephemeris(_) | Record::Glonass(_) => {}
    }
    record
}

fn has_any(record: &Record) -> bool {
    match record {
        Record::Epoch(epoch) => !epoch.observations.is_empty(),
        Record::Event(_) => true,
        Record::Ephemeris(_) | Record::Glonass(_) => false,
    }
}

/// Whether there are epochs, whose times can be told apart in a file, and are believed.
fn is_written(records: &[Record]) -> bool {
    let times: Vec<_> = records.iter().filter_map(checks::epoch).map(|epoch| epoch.time_gps).collect();
    let mut steps = times.iter().zip(times.iter().skip(1)).map(|(a, b)| *b - *a);
    !times.is_empty() && steps.all(|step_s| (MIN_STEP_S..=MAX_STEP_S).contains(&step_s))
}

fn written(records: &[Record]) -> (String, u64) {
    let mut layout = ObservationLayout::default();
    for record in records {
        match record {
            Record::Epoch(epoch) => layout.include(epoch),
            Record::Event(event) => layout.include_event(event),
            Record::Ephemeris(_) | Record::Glonass(_) => {}
        }
    }
    let mut writer = ObservationWriter::new(layout);
    let header = writer.header(&RecordingInfo::default());
    let body: String = records
        .iter()
        .map(|record| match record {
            Record::Epoch(epoch) => writer.epoch(epoch),
            Record::Event(event) => writer.event(event),
            Record::Ephemeris(_) | Record::Glonass(_) => String::new(),
        })
        .collect();
    (header + &body, writer.skips().total())
}

fn read(text: &str) -> Vec<Record> {
    match ObservationFile::parse(text.as_bytes()) {
        Ok(file) => {
            let odd: Vec<_> = file.skips.iter().collect();
            assert!(odd.is_empty(), "{odd:?} in\n{text}");
            into_records(file)
        }
        Err(error) => unreadable(&error.to_string(), text),
    }
}

fn same_event(event: &Event, before: &Event) {
    let apart = |(a, b): (GpsTime, GpsTime)| (a - b).abs() < MIN_STEP_S;
    assert_eq!(event.time_gps.is_some(), before.time_gps.is_some(), "{event:?} was {before:?}");
    assert!(event.time_gps.zip(before.time_gps).is_none_or(apart), "{event:?} was {before:?}");
    assert_eq!((event.kind, &event.lines), (before.kind, &before.lines));
    assert_eq!(event.slips.len(), before.slips.len(), "{event:?} was {before:?}");
    for slip in &before.slips {
        let name = |s: &&CycleSlip| (s.satellite, s.signal) == (slip.satellite, slip.signal);
        let other = event.slips.iter().find(name).map(|other| other.slip_cycles);
        assert!(close(other, Some(slip.slip_cycles)), "{event:?} was {before:?}");
    }
}

fn unreadable(error: &str, text: &str) -> Vec<Record> {
    assert!(text.is_empty(), "{error} in\n{text}");
    Vec::new()
}

fn alike(epoch: &ObservationEpoch, before: &ObservationEpoch) {
    assert!((epoch.time_gps - before.time_gps).abs() < MIN_STEP_S && epoch.flag == before.flag);
    assert_eq!(epoch.observations.len(), before.observations.len(), "{}", epoch.time_gps);
    for one in &epoch.observations {
        let name = |o: &&Observation| (o.satellite, o.signal) == (one.satellite, one.signal);
        let other = before.observations.iter().find(name);
        let same = other.is_some_and(|other| {
            close(one.pseudorange_m, other.pseudorange_m)
                && close(one.carrier_phase_cycles, other.carrier_phase_cycles)
                && close(one.doppler_hz, other.doppler_hz)
                && close(one.cn0_dbhz, other.cn0_dbhz)
                && one.loss_of_lock == other.loss_of_lock
        });
        assert!(same, "{one:?} was {other:?}");
    }
}

fn close(one: Option<f64>, other: Option<f64>) -> bool {
    match (one, other) {
        (Some(one), Some(other)) => (one - other).abs() <= HALF_DIGIT + 1e-15 * other.abs(),
        (None, None) => true,
        _ => false,
    }
}

/// Ephemerides written as RINEX: none is lost, and they are the same when written again.
pub(crate) fn navigation(file: &NavigationFile) {
    let (text, count) = navigation_text(file);
    let again = read_navigation(&text);
    assert_eq!(again.ephemerides.len() + again.glonass.len(), count, "{text}");
    let (second, _) = navigation_text(&again);
    let twice = read_navigation(&second);
    let shown = |file: &NavigationFile| format!("{:?} {:?}", file.ephemerides, file.glonass);
    assert_eq!(shown(&twice), shown(&again), "{text}");
}

fn navigation_text(file: &NavigationFile) -> (String, usize) {
    let mut records: Vec<String> = file.ephemerides.iter().filter_map(navigation_record).collect();
    records.extend(file.glonass.iter().filter_map(|ephemeris| glonass_record(ephemeris, None)));
    (navigation_header("", &IonosphereTerms::default(), None) + &records.concat(), records.len())
}

fn read_navigation(text: &str) -> NavigationFile {
    let file = NavigationFile::parse(text.as_bytes()).unwrap_or_default();
    // What a record never told, reading notes again.
    let noted = file.skips.count(Reason::GlonassHealthUnknown);
    assert_eq!(file.skips.total(), noted, "{} in\n{text}", file.skips);
    file
}
