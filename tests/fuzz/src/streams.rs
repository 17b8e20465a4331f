//! Streams of observations: the same records however they are cut into portions, all of them sound.

use cofix_common::formats::gnsslogger::{GnssLoggerDecoder, Masks, Options};
use cofix_common::formats::gsdc::{DerivedDecoder, DerivedFile};
use cofix_common::formats::rinex::{ObservationDecoder, ObservationFile};
use cofix_common::formats::rtcm::{RtcmDecoder, RtcmOptions};
#[cfg(feature = "agent")]
use cofix_common::formats::stream::StreamDecoder;
use cofix_common::formats::whu::SpareLogDecoder;
#[cfg(feature = "agent")]
use cofix_common::formats::{decode::Decoder, format::Format};
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;

use crate::file_records::into_records;
use crate::portions::{Outcome, feed, feed_both_ways, random_portions, same};
use crate::{checks, round_trip};

/// An instant for streams that carry the time of week only: 2020-08-13.
pub(crate) fn near() -> GpsTime {
    GpsTime::from_week_tow(2118, 396_000.0)
}

fn check(outcome: &Outcome, bytes: &[u8]) {
    checks::records(&outcome.records, bytes.len());
    checks::in_bounds(&outcome.records);
    // A stream of RTCM 3 whose clock is set back goes on.
    if outcome.skips.count(Reason::StreamTimeSteppedBack) == 0 {
        checks::in_order(&outcome.records);
        round_trip::observations(&outcome.records);
    }
}

/// RINEX 2, 3 and 4 observations.
pub fn observations(bytes: &[u8]) {
    let outcome = feed_both_ways(ObservationDecoder::default, bytes);
    check(&outcome, bytes);
    if checks::is_packed(bytes) {
        return;
    }
    let file = ObservationFile::parse(bytes);
    assert_eq!(file.is_ok(), outcome.end.is_ok(), "{file:?}");
    let Ok(file) = file else { return };
    assert_eq!(file.skips, outcome.skips);
    assert!(same(&into_records(file), &outcome.records), "a file and a stream");
}

/// Compact RINEX 1 and 3: what stands before the two first lines of plain files.
pub fn compact_rinex(bytes: &[u8]) {
    let first = if bytes.len().is_multiple_of(2) { "3.0" } else { "1.0" };
    if bytes.get(60..71) == Some(b"CRINEX VERS") {
        return observations(bytes);
    }
    let head = format!("{first:20}{:40}CRINEX VERS   / TYPE\n", "COMPACT RINEX FORMAT");
    observations(&[head.as_bytes(), bytes].concat());
}

/// GnssLogger text, with the usual masks and with none.
pub fn gnsslogger(bytes: &[u8]) {
    let outcome = feed_both_ways(GnssLoggerDecoder::default, bytes);
    check(&outcome, bytes);
    let options = Options { masks: Masks::none(), keep_invalid_phase: true, ..Options::default() };
    let outcome = feed_both_ways(|| GnssLoggerDecoder::new(options.clone()), bytes);
    checks::records(&outcome.records, bytes.len());
    checks::in_bounds(&outcome.records);
    checks::in_order(&outcome.records);
    said_by_the_phone(bytes);
}

/// `Fix` and `Status` lines, which are no records.
fn said_by_the_phone(bytes: &[u8]) {
    let (mut whole, mut cut) = (GnssLoggerDecoder::default(), GnssLoggerDecoder::default());
    let outcome = feed(&mut whole, [bytes]);
    feed(&mut cut, random_portions(bytes));
    let (fixes, statuses) = (whole.take_fixes(), whole.take_statuses());
    // As in `feed_both_ways`: of another kind of stream, what follows the end may be read.
    assert!(outcome.end.is_err() || cut.take_fixes() == fixes, "in portions and at once");
    assert!(outcome.end.is_err() || cut.take_statuses() == statuses, "in portions and at once");
    fixes.iter().for_each(checks::fix);
    statuses.iter().for_each(checks::status);
}

/// RTCM 3, with its frames.
pub fn rtcm_stream(bytes: &[u8]) {
    let outcome = feed_both_ways(|| RtcmDecoder::new(RtcmOptions::near(near())), bytes);
    check(&outcome, bytes);
}

/// Challenge tables of both generations.
pub fn challenge_table(bytes: &[u8]) {
    let outcome = feed_both_ways(DerivedDecoder::default, bytes);
    check(&outcome, bytes);
    let Ok(file) = DerivedFile::parse(bytes) else { return };
    for given in file.epochs.iter().flat_map(|epoch| &epoch.observations).filter_map(|o| o.given.as_ref()) {
        assert!(!format!("{given:?}").contains("NaN"), "{given:?}");
    }
}

/// Spare logs of the WHU-Smartphone dataset.
pub fn spare_log(bytes: &[u8]) {
    let outcome = feed_both_ways(SpareLogDecoder::default, bytes);
    check(&outcome, bytes);
}

/// A stream of any format, which is recognised first.
#[cfg(feature = "agent")]
pub fn stream(bytes: &[u8]) {
    let mut whole = StreamDecoder::new(near());
    let at_once = feed(&mut whole, [bytes]);
    check_loosely(&at_once, bytes);
    let mut cut = StreamDecoder::new(near());
    let in_portions = feed(&mut cut, random_portions(bytes));
    // RTCM 3 is recognised by its first frame, text by its lines: of a mixture, whichever comes first.
    if whole.format() == cut.format() && whole.format() != Some(Format::Rtcm3) {
        assert!(same(&at_once.records, &in_portions.records), "{:?}", whole.format());
        assert_eq!(whole.skips(), cut.skips());
    } else {
        check_loosely(&in_portions, bytes);
        let either = [whole.format(), cut.format()];
        assert!(either.contains(&Some(Format::Rtcm3)) || either.contains(&None), "{either:?}");
    }
    // A connection is lost in the middle.
    let mut interrupted = StreamDecoder::new(near());
    let (before, after) = bytes.split_at(bytes.len() / 2);
    if interrupted.feed(before).is_ok() && interrupted.interrupt().is_ok() {
        check_loosely(&feed(&mut interrupted, [after]), bytes);
    }
}

/// Of a log and of RTCM 3 epochs may come again; the agent's records put them in order.
#[cfg(feature = "agent")]
fn check_loosely(outcome: &Outcome, bytes: &[u8]) {
    checks::records(&outcome.records, bytes.len());
}
