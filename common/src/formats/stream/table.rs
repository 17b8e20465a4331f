//! The table of formats, with the sign by which each is recognised.

use crate::formats::format::Format;
use crate::formats::gnsslogger::{self, GnssLoggerDecoder, is_log_line};
use crate::formats::gsdc::{DerivedDecoder, is_table_header};
use crate::formats::rinex::{ObservationDecoder, is_compact_first_line, is_first_line};
use crate::formats::rtcm::{RtcmDecoder, RtcmOptions, StreamDates};
use crate::formats::text::content;
use crate::formats::whu::{SpareLogDecoder, is_spare_log_line};
use crate::time::GpsTime;

use super::ObservationStream;

/// Lines of a log that are searched for one of its kind.
const LINES_TO_RECOGNISE: usize = 100;

/// Conditions under which decoders begin.
#[derive(Clone, Debug)]
pub(super) struct Opening {
    /// An instant within three days of the stream's beginning.
    pub(super) near: GpsTime,
    /// The dates of a recording of RTCM 3, where they have been found.
    pub(super) dates: Option<StreamDates>,
    /// How GnssLogger text is read.
    pub(super) log: gnsslogger::Options,
}

/// Sign by which a format is recognised.
enum Sign {
    /// Its first line with content.
    FirstLine(fn(&[u8]) -> bool),
    /// Any of the first lines.
    Line(fn(&[u8]) -> bool),
    /// Its frames, in the judgement of its decoder ([`ObservationStream::is_recognised`]).
    Frames,
}

/// A format, its sign, and its decoder.
pub(in crate::formats) struct Row {
    pub(in crate::formats) format: Format,
    sign: Sign,
    pub(super) open: fn(&Opening) -> Box<dyn ObservationStream>,
}

impl std::fmt::Debug for Row {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.format.fmt(f)
    }
}

static TABLE: [Row; 6] = [
    Row {
        format: Format::Rinex,
        sign: Sign::FirstLine(is_first_line),
        open: |_| Box::new(ObservationDecoder::default()),
    },
    Row {
        format: Format::CompactRinex,
        sign: Sign::FirstLine(is_compact_first_line),
        open: |_| Box::new(ObservationDecoder::default()),
    },
    Row {
        format: Format::ChallengeTable,
        sign: Sign::FirstLine(is_table_header),
        open: |opening| {
            let decoder = DerivedDecoder::new(opening.log.masks.clone());
            Box::new(decoder.with_shift(opening.log.shift_weeks))
        },
    },
    Row {
        format: Format::GnssLogger,
        sign: Sign::Line(is_log_line),
        open: |opening| Box::new(GnssLoggerDecoder::new(opening.log.clone())),
    },
    Row {
        format: Format::SpareLog,
        sign: Sign::Line(is_spare_log_line),
        open: |_| Box::new(SpareLogDecoder::default()),
    },
    Row { format: Format::Rtcm3, sign: Sign::Frames, open: |opening| Box::new(rtcm(opening)) },
];

fn rtcm(opening: &Opening) -> RtcmDecoder {
    let decoder = RtcmDecoder::new(RtcmOptions::near(opening.near));
    match &opening.dates {
        Some(dates) => decoder.with_dates(dates),
        None => decoder,
    }
}

/// Decoders of all formats that are known by their frames.
pub(super) fn probes(opening: &Opening) -> Vec<(&'static Row, Box<dyn ObservationStream>)> {
    let by_frames = TABLE.iter().filter(|row| matches!(row.sign, Sign::Frames));
    by_frames.map(|row| (row, (row.open)(opening))).collect()
}

/// The text format whose beginning this is, if it can be told yet. `ended`: nothing more will come.
pub(in crate::formats) fn recognise_text(start: &[u8], ended: bool) -> Option<&'static Row> {
    let start = content(start);
    let complete = start.iter().rposition(|byte| *byte == b'\n');
    let lines = if ended { start } else { start.get(..complete?)? };
    let mut lines = lines.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii_end);
    let first = lines.next().unwrap_or_default();
    let by_first = TABLE.iter().find(|row| matches!(row.sign, Sign::FirstLine(is_it) if is_it(first)));
    let by_line = |line: &[u8]| TABLE.iter().find(|row| matches!(row.sign, Sign::Line(is_it) if is_it(line)));
    by_first.or_else(|| std::iter::once(first).chain(lines).take(LINES_TO_RECOGNISE).find_map(by_line))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recognised(start: &[u8], ended: bool) -> Option<Format> {
        recognise_text(start, ended).map(|row| row.format)
    }

    #[test]
    fn text_formats_are_known_by_their_lines() {
        let rinex = format!("{:<20}{:<20}{:<20}RINEX VERSION / TYPE\n", "     3.04", "OBSERVATION DATA", "M");
        let compact = format!("{:<20}{:<40}CRINEX VERS   / TYPE\n", "3.0", "COMPACT RINEX FORMAT");
        let (marked, after_blank_lines) = (format!("\u{feff}{rinex}"), format!("\r\n  \n{compact}"));
        let lower_case = rinex.to_lowercase();
        for (start, format) in [
            (rinex.as_str(), Format::Rinex),
            (compact.as_str(), Format::CompactRinex),
            ("# \n# Header Description:\n# \n", Format::GnssLogger),
            ("# \r\n\r\n#Raw,ElapsedRealtimeMillis\r\n", Format::GnssLogger),
            ("Raw,1,2,3\n", Format::GnssLogger),
            ("\u{feff}Fix,gps,37.4\n", Format::GnssLogger),
            (&marked, Format::Rinex),
            (&after_blank_lines, Format::CompactRinex),
            (&lower_case, Format::Rinex),
            ("\r\n\u{feff}phoneName, millisSinceGpsEpoch,svid\n", Format::ChallengeTable),
            ("phoneName, millisSinceGpsEpoch,svid\n", Format::ChallengeTable),
            ("MessageType,ArrivalTimeNanosSinceGpsEpoch\n", Format::ChallengeTable),
            ("current_Start_Timestamp:2020_08_13_22_19_00.000\n", Format::SpareLog),
            ("\r\n{\"gga\":\"\",\"obsd_t\":{}}\r\n", Format::SpareLog),
        ] {
            assert_eq!(recognised(start.as_bytes(), false), Some(format), "{start}");
            let cut = &start.as_bytes()[..start.len() - 1];
            assert_eq!(recognised(cut, true), Some(format), "{start} without line end");
        }
        assert_eq!(recognised(&rinex.as_bytes()[..79], false), None);
        assert_eq!(recognised(b"Raw,1,2", false), None, "the line may go on");
        assert_eq!(recognised(b"name,value\n1,2\n", true), None);
    }

    #[test]
    fn a_log_is_searched_for_a_hundred_lines() {
        let log = |before: usize| format!("{}Raw,1\n", "x\n".repeat(before));
        assert_eq!(recognised(log(99).as_bytes(), false), Some(Format::GnssLogger));
        assert_eq!(recognised(log(100).as_bytes(), false), None);
    }
}
