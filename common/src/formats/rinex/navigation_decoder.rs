//! Navigation files line by line.

use std::collections::VecDeque;

use super::RinexError;
use super::glonass_record::glonass_ephemeris;
use super::navigation_header::NavigationHeader;
use super::navigation_record::{Fault, Record, ephemeris};
use super::stream::{Line, LineDecoder, Stream, kept};
use crate::formats::decode;
use crate::formats::lines::each_line;
use crate::formats::text::{columns, is_blank, shorten, trim_end, without_mark};
use crate::gnss::Constellation;
use crate::orbit::{GlonassEphemeris, IonosphereTerms, KeplerEphemeris};
use crate::skips::{Reason, Skips};
use crate::time::{GpsTime, corrected_leap_seconds};

/// Decodes a navigation file (RINEX 2, 3, 4) from bytes in any portions, by [`crate::formats::decode::Decoder`].
///
/// In RINEX 3 and 4 a line that begins with a letter begins a record, in RINEX 2 one with a number in its first two
/// columns; one that begins with a blank continues it. Records of any length stay in step that way.
#[derive(Clone, Debug, Default)]
pub struct NavigationDecoder {
    header: NavigationHeader,
    in_records: bool,
    /// Whether there were records: in a file that is joined to another, a header may come again.
    has_begun: bool,
    kind: Kind,
    record: Option<Record>,
    skips: Skips,
    stream: Stream,
}

/// Kind of the record by the type line of RINEX 4; in RINEX 2 and 3 always an ephemeris.
#[derive(Clone, Debug, Default)]
enum Kind {
    #[default]
    Ephemeris,
    Ionosphere {
        system: u8,
        message: Vec<u8>,
    },
    /// Counted under this reason.
    Unused(Reason),
}

/// An ephemeris that a line completed.
#[derive(Clone, Debug)]
pub(super) enum Found {
    /// With its time of transmission.
    Kepler(GpsTime, KeplerEphemeris),
    Glonass(GlonassEphemeris),
}

impl NavigationDecoder {
    /// The ionosphere terms so far.
    pub fn ionosphere(&self) -> IonosphereTerms {
        self.header.terms()
    }

    /// Seconds that GPS time is ahead of UTC, where the header says so.
    pub const fn leap_seconds(&self) -> Option<i64> {
        self.header.leap_seconds
    }

    /// Counts of skipped records so far.
    pub const fn skips(&self) -> &Skips {
        &self.skips
    }

    /// Takes a line and gives the ephemeris that the line before completed, if any. Errors only in the header.
    pub(super) fn line(&mut self, number: u64, line: &[u8]) -> Result<Option<Found>, RinexError> {
        let line = without_mark(trim_end(line));
        if !self.in_records {
            if self.header.lines == 0 && is_blank(line) {
                return Ok(None);
            }
            self.in_records = self.header.line(number, line)?;
            self.has_begun |= self.in_records;
            return Ok(None);
        }
        if line.iter().all(|b| *b == b' ') {
            return Ok(None);
        }
        if line.get(60..).is_some_and(|label| label.starts_with(b"RINEX VERSION / TYPE")) {
            let found = self.record_done();
            self.begin_again(number, line);
            return Ok(found);
        }
        if self.continues(line) {
            match &mut self.record {
                Some(record) => record.continuation(line),
                None if matches!(self.kind, Kind::Unused(_)) => {}
                None => self
                    .skips
                    .add(Reason::LineOutsideAnyRecord, || format!("line {number}: '{}'", shorten(line))),
            }
            return Ok(None);
        }
        let found = self.record_done();
        self.begin(number, line);
        Ok(found)
    }

    /// A file that is joined to another has a header of its own.
    fn begin_again(&mut self, number: u64, line: &[u8]) {
        self.skips.add(Reason::AnotherHeaderHolds, || format!("line {number}: '{}'", shorten(line)));
        match self.header.begin_again(number, line) {
            Ok(()) => {
                self.in_records = false;
                self.kind = Kind::Ephemeris;
            }
            Err(error) => {
                self.skips.add(Reason::AnotherHeaderUnusable, || error.to_string());
                self.kind = Kind::Unused(Reason::RecordAfterUnusableHeader);
            }
        }
    }

    /// The input has ended: the last record.
    pub(super) fn end(&mut self) -> Result<Option<Found>, RinexError> {
        if !self.in_records && !self.has_begun {
            return Err(RinexError::HeaderIncomplete { lines: self.header.lines });
        }
        Ok(self.record_done())
    }

    fn continues(&self, line: &[u8]) -> bool {
        let blanks = if self.header.version.is_2() { 2 } else { 1 };
        // The records of RINEX 4 that belong to no satellite begin with a line of blanks and the epoch.
        let opens = self.record.is_none() && matches!(self.kind, Kind::Ionosphere { .. });
        columns(line, 0, blanks).iter().all(|b| *b == b' ') && !opens
    }

    fn begin(&mut self, number: u64, line: &[u8]) {
        if self.header.version.number >= 400 && line.starts_with(b"> ") {
            self.kind = type_line(line);
            if let Kind::Unused(reason) = self.kind {
                self.skips.add(reason, || format!("line {number}: '{}'", shorten(line)));
            }
            return;
        }
        self.record = match &self.kind {
            Kind::Unused(_) => return,
            Kind::Ionosphere { .. } => Some(Record::begin_without_satellite(number, line)),
            Kind::Ephemeris if self.header.version.is_2() => {
                Record::begin_2(number, line, self.header.version.navigation_system_2())
            }
            Kind::Ephemeris => Record::begin(number, line),
        };
        if self.record.is_none() {
            self.skips.add(Reason::RecordWithoutSatellite, || format!("line {number}: '{}'", shorten(line)));
        }
    }

    fn record_done(&mut self) -> Option<Found> {
        let record = self.record.take()?;
        let (line, satellite) = (record.line, record.satellite);
        if let Kind::Ionosphere { system, message } = &self.kind {
            if !self.header.ionosphere_record(*system, message, &record) {
                let message = String::from_utf8_lossy(message).into_owned();
                self.skips.add(Reason::IonosphereRecordNotUsed, || format!("line {line}: {message}"));
            }
            return None;
        }
        let reason = match satellite.constellation {
            Constellation::Sbas => Reason::SbasRecord,
            Constellation::Navic => Reason::NavicRecord,
            _ => match self.ephemeris(&record) {
                Ok(found) => return Some(found),
                Err(fault) => {
                    self.skips.add(fault.reason, || format!("line {line}: {satellite}: {}", fault.detail));
                    return None;
                }
            },
        };
        self.skips.add(reason, || format!("line {line}: {satellite}"));
        None
    }

    fn ephemeris(&mut self, record: &Record) -> Result<Found, Fault> {
        self.check_leap_seconds(record);
        if record.satellite.constellation != Constellation::Glonass {
            return ephemeris(record, &mut self.skips)
                .map(|(sent, ephemeris)| Found::Kepler(sent, ephemeris));
        }
        glonass_ephemeris(record, self.header.leap_seconds, &mut self.skips).map(Found::Glonass)
    }

    /// A header whose leap seconds cannot be those of the records is named and not believed: a second is 3 km of GLONASS orbit.
    fn check_leap_seconds(&mut self, record: &Record) {
        let (Some(stated), Ok(epoch)) = (self.header.leap_seconds, record.own_epoch()) else { return };
        if let Some(known) = corrected_leap_seconds(stated, epoch) {
            self.skips.add(Reason::HeaderLeapSecondsWrong, || {
                format!("line {}: {stated} s, but {known} s held at {epoch}", record.line)
            });
            self.header.leap_seconds = Some(known);
        }
    }
}

impl From<Found> for decode::Record {
    fn from(found: Found) -> Self {
        match found {
            Found::Kepler(_, ephemeris) => Self::Ephemeris(Box::new(ephemeris)),
            Found::Glonass(ephemeris) => Self::Glonass(Box::new(ephemeris)),
        }
    }
}

impl NavigationDecoder {
    /// Decodes a whole file.
    pub(super) fn whole(&mut self, bytes: &[u8], mut take: impl FnMut(Found)) -> Result<(), RinexError> {
        each_line(bytes, |line| self.take(line).map(|found| found.map_or((), &mut take)))?;
        self.end().map(|found| found.map_or((), take))
    }

    fn take(&mut self, line: Line<'_>) -> Result<Option<Found>, RinexError> {
        let text = kept(line, &mut self.skips);
        self.line(line.number, text)
    }
}

impl LineDecoder for NavigationDecoder {
    fn stream(&mut self) -> &mut Stream {
        &mut self.stream
    }

    fn skips(&self) -> &Skips {
        Self::skips(self)
    }

    fn take_line(&mut self, line: Line<'_>, ready: &mut VecDeque<decode::Record>) -> Result<(), RinexError> {
        self.take(line).map(|found| ready.extend(found.map(decode::Record::from)))
    }

    fn end_of_lines(&mut self, ready: &mut VecDeque<decode::Record>) -> Result<(), RinexError> {
        self.end().map(|found| ready.extend(found.map(decode::Record::from)))
    }
}

/// The kind that a type line of RINEX 4 announces: `> EPH G01 LNAV`, `> ION G01 LNAV`.
fn type_line(line: &[u8]) -> Kind {
    let mut words = line.split(|b| *b == b' ').filter(|word| !word.is_empty()).skip(1);
    let (kind, source) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let message = words.next().unwrap_or_default();
    match (kind, message) {
        (b"EPH", b"LNAV" | b"INAV" | b"FNAV" | b"D1" | b"D2" | b"D1D2" | b"FDMA" | b"SBAS") => {
            Kind::Ephemeris
        }
        (b"EPH", b"CNAV") => Kind::Unused(Reason::CnavEphemeris),
        (b"EPH", b"CNV1") => Kind::Unused(Reason::Cnav1Ephemeris),
        (b"EPH", b"CNV2") => Kind::Unused(Reason::Cnav2Ephemeris),
        (b"EPH", b"CNV3") => Kind::Unused(Reason::Cnav3Ephemeris),
        (b"EPH", _) => Kind::Unused(Reason::EphemerisOfOtherMessageType),
        (b"ION", _) => {
            Kind::Ionosphere { system: source.first().copied().unwrap_or(b' '), message: message.to_vec() }
        }
        (b"STO", _) => Kind::Unused(Reason::SystemTimeOffsetRecord),
        (b"EOP", _) => Kind::Unused(Reason::EarthOrientationRecord),
        _ => Kind::Unused(Reason::RecordOfUnknownType),
    }
}
