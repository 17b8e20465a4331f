//! Sources of observations, recorded and live.
//!
//! A recorded file is read twice, each time in portions: first to survey it (how many epochs, what is skipped, which
//! navigation messages it carries), then epoch by epoch. So it need not fit into memory, and **its own navigation messages
//! serve the epochs before them too**, like those of a navigation file. A message of a live source serves from its arrival on.

mod dating;
pub(crate) mod error;
mod kinds;
pub mod products;
pub mod records;

use std::path::Path;
use std::slice;

use cofix_common::formats::decode::Record;
use cofix_common::formats::format::Format;
use cofix_common::formats::gnsslogger;
use cofix_common::formats::rtcm::StreamDates;
use cofix_common::frames::Ecef;
use cofix_common::gnss::ObservationEpoch;
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;

use crate::input::ntrip::RoverPosition;
use crate::input::{Bytes, Kept, LiveSource, RawFiles, Recorded};
use crate::{Source, Stop, clock};

use dating::Dated;
pub use error::SourceError;
use error::{no_epoch, with_hint};
use products::OwnNavigation;
use records::{Records, RecordsError};

const KIND: &str = cofix_common::formats::kinds::OBSERVATIONS;

/// How recordings are read.
#[derive(Clone, Debug, Default)]
pub struct Reading {
    /// An instant within three days of the beginning, for RTCM 3, whose observations carry the time of week only. Ephemerides in the stream know
    /// the week better.
    pub near: Option<GpsTime>,
    /// Clock and masks of GnssLogger text.
    pub log: gnsslogger::Options,
    /// Dates of a stream of RTCM 3, from an earlier reading of the same file.
    pub dates: Option<StreamDates>,
    /// Where the bytes of a live source are kept as they come.
    pub raw: Option<RawFiles>,
}

/// The result of a first reading of a recorded source.
#[derive(Clone, Debug, Default)]
pub struct Survey {
    /// Epochs, in order of time.
    pub epochs: u64,
    /// Navigation messages of the source itself.
    pub navigation: OwnNavigation,
    /// Whether it has satellite states and corrections of its own.
    pub has_corrections: bool,
    /// Approximate position of the antenna, as the source states it.
    pub station: Option<Ecef>,
    /// Whether these are the phone's own (GnssLogger text since 2022), and not those of a challenge table.
    pub has_phone_states: bool,
    /// Everything skipped.
    pub skips: Skips,
    /// Dates of a stream of RTCM 3.
    pub dates: Option<StreamDates>,
}

/// An opened source, which gives its records one by one.
pub(crate) enum Opened<'a> {
    Memory(slice::Iter<'a, ObservationEpoch>),
    Stream { name: String, path: Option<&'a Path>, records: Box<Records> },
}

impl<'a> Opened<'a> {
    /// Opens a source. Casters are sent the rover's position.
    pub(crate) fn open(
        source: &'a Source,
        reading: &Reading,
        rover: &RoverPosition,
    ) -> Result<Self, SourceError> {
        match source {
            Source::Epochs(epochs) => Ok(Self::Memory(epochs.iter())),
            Source::File { path, near } => {
                let reading = Reading { near: near.or(reading.near), ..reading.clone() };
                Ok(Self::stream(path.display().to_string(), Some(path), open_file(path, &reading)?))
            }
            Source::Live { from, near } => {
                let records = open_live(from, *near, rover, reading)?.with_log_options(reading.log.clone());
                Ok(Self::stream(from.to_string(), None, records))
            }
        }
    }

    fn stream(name: String, path: Option<&'a Path>, records: Records) -> Self {
        Self::Stream { name, path, records: Box::new(records) }
    }

    /// The next record.
    pub(crate) fn next(&mut self, stop: &Stop) -> Result<Option<Record>, SourceError> {
        match self {
            Self::Memory(epochs) => Ok(epochs.next().cloned().map(Record::Epoch)),
            Self::Stream { name, path, records } => {
                records.next(stop).map_err(|error| source_error(name, *path, error))
            }
        }
    }

    /// Whether the last record came with satellite states and corrections of its own.
    fn has_corrections(&self) -> bool {
        self.records().is_some_and(|records| records.decoder().recorded_corrections().is_some())
    }

    fn is_log(&self) -> bool {
        self.records().is_some_and(|records| records.decoder().format() == Some(Format::GnssLogger))
    }

    /// The records of a stream, whose decoder knows more about it.
    pub(crate) const fn records(&self) -> Option<&Records> {
        match self {
            Self::Memory(_) => None,
            Self::Stream { records, .. } => Some(records),
        }
    }
}

/// An error of a recorded file.
pub(crate) fn file_error(path: &Path, error: RecordsError) -> SourceError {
    source_error(&path.display().to_string(), Some(path), error)
}

fn source_error(name: &str, path: Option<&Path>, error: RecordsError) -> SourceError {
    match (error, path) {
        (RecordsError::Read(cause), Some(path)) => {
            SourceError::Read { path: path.to_owned(), kind: KIND, cause }
        }
        (RecordsError::Read(cause), None) => SourceError::Live { name: name.to_owned(), cause },
        (RecordsError::Wrong(wrong), path) => {
            let hint = path.and_then(|path| kinds::hint_for(path, KIND));
            let reason = with_hint(wrong.reason, hint);
            SourceError::Unusable { source_name: name.to_owned(), kind: KIND, reason }
        }
    }
}

/// Opens a recorded file. A stream of RTCM 3, which lacks the week, is dated first: see `dating`.
///
/// # Errors
/// When the file cannot be opened.
pub fn open_file(path: &Path, reading: &Reading) -> Result<Records, SourceError> {
    let cause = |cause| SourceError::Read { path: path.to_owned(), kind: KIND, cause };
    let bytes = Box::new(Recorded::open(path).map_err(cause)?);
    let dated = match reading.dates.clone() {
        Some(dates) => Some(Dated { dates, notes: Skips::default() }),
        None => dating::of_file(path, reading.near).map_err(cause)?,
    };
    let records = match dated {
        Some(dated) => Records::dated(bytes, dated),
        None => Records::new(bytes, reading.near.unwrap_or_else(clock::now)),
    };
    Ok(records.with_log_options(reading.log.clone()))
}

fn open_live(
    live: &LiveSource,
    near: Option<GpsTime>,
    rover: &RoverPosition,
    reading: &Reading,
) -> Result<Records, SourceError> {
    let bytes = live.open_near(rover).map_err(|cause| SourceError::Live { name: live.to_string(), cause })?;
    let bytes: Box<dyn Bytes> = match reading.raw.clone() {
        Some(files) => Box::new(Kept::new(bytes, files)),
        None => bytes,
    };
    Ok(Records::new(bytes, near.unwrap_or_else(clock::now)))
}

/// Reads a recorded source once, to its end. A live one cannot be surveyed.
///
/// # Errors
/// When it cannot be read, is of no format that is read, or holds no epoch.
pub fn survey(source: &Source, reading: &Reading, stop: &Stop) -> Result<Survey, SourceError> {
    let mut opened = Opened::open(source, reading, &RoverPosition::default())?;
    let mut survey = Survey::default();
    while let Some(record) = opened.next(stop)? {
        survey.epochs += u64::from(survey.navigation.take(record).is_some());
        let has_corrections = opened.has_corrections();
        survey.has_corrections |= has_corrections;
        survey.has_phone_states |= has_corrections && opened.is_log();
    }
    if let Some(records) = opened.records() {
        survey.navigation.take_terms(records.decoder());
        survey.station = records.decoder().station();
        survey.skips = records.skips();
        survey.dates = records.dates().cloned();
    }
    match &opened {
        Opened::Stream { name, .. } if survey.epochs == 0 && !stop.is_requested() => {
            Err(no_epoch(name, &survey.skips))
        }
        _ => Ok(survey),
    }
}
