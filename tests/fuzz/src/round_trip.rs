//! What is written reads back as it was.

use cofix_common::decode::Record;
use cofix_common::gnss::{Observation, ObservationEpoch};
use cofix_common::rinex::{
    IonosphereTerms, NavigationFile, ObservationFile, ObservationLayout, ObservationWriter, RecordingInfo,
    glonass_record, navigation_header, navigation_record,
};

use crate::checks;

/// Longer steps the reader believes only when they are confirmed, s.
const MAX_STEP_S: f64 = 86_400.0;
/// Times closer than this are printed alike, s.
const MIN_STEP_S: f64 = 1e-6;
/// Half of the last digit that is written.
const HALF_DIGIT: f64 = 0.000_5;

/// Epochs written as RINEX: the same to the digits of the format, and exactly the same when written again.
pub(crate) fn observations(records: &[Record]) {
    let epochs: Vec<ObservationEpoch> =
        records.iter().filter_map(checks::epoch).filter(|epoch| has_any(epoch)).cloned().collect();
    if epochs.is_empty() || !is_in_steps(&epochs) {
        return;
    }
    let (text, left_out) = written(&epochs);
    let mut again = read(&text);
    if left_out == 0 {
        assert_eq!(again.len(), epochs.len(), "{text}");
        for (epoch, before) in again.iter().zip(&epochs) {
            alike(epoch, before);
        }
    }
    // Of an epoch all values may have rounded to zero.
    again.retain(has_any);
    if !again.is_empty() && is_in_steps(&again) {
        let (second, left_out) = written(&again);
        assert_eq!((left_out, read(&second)), (0, again), "{text}");
    }
}

fn has_any(epoch: &ObservationEpoch) -> bool {
    !epoch.observations.is_empty()
}

/// Whether the times can be told apart in a file, and are believed.
fn is_in_steps(epochs: &[ObservationEpoch]) -> bool {
    let mut steps = epochs.iter().zip(epochs.iter().skip(1)).map(|(a, b)| b.time_gps - a.time_gps);
    steps.all(|step_s| (MIN_STEP_S..=MAX_STEP_S).contains(&step_s))
}

fn written(epochs: &[ObservationEpoch]) -> (String, u64) {
    let mut layout = ObservationLayout::default();
    for epoch in epochs {
        layout.include(epoch);
    }
    let mut writer = ObservationWriter::new(layout);
    let header = writer.header(&RecordingInfo::default());
    let body: String = epochs.iter().map(|epoch| writer.epoch(epoch)).collect();
    (header + &body, writer.skips().total())
}

fn read(text: &str) -> Vec<ObservationEpoch> {
    match ObservationFile::parse(text.as_bytes()) {
        Ok(file) => {
            let odd: Vec<_> = file.skips.iter().collect();
            assert!(odd.is_empty(), "{odd:?} in\n{text}");
            file.epochs
        }
        Err(error) => unreadable(&error.to_string(), text),
    }
}

fn unreadable(error: &str, text: &str) -> Vec<ObservationEpoch> {
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
    let noted = file.skips.count("GLONASS health unknown, record kept");
    assert_eq!(file.skips.total(), noted, "{} in\n{text}", file.skips);
    file
}
