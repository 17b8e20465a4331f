//! A recorded source of corrections, read along with the rover's time.

use std::path::{Path, PathBuf};

use cofix_common::decode::Record;
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;

use super::Arrived;
use crate::Stop;
use crate::records::Records;
use crate::source::{self, Reading, SourceError};

/// A file of corrections.
pub(super) struct Recorded {
    path: PathBuf,
    /// Opened with the rover's first epoch, which tells the week to streams without one.
    records: Option<Records>,
    /// An epoch whose time has not come.
    ahead: Option<Arrived>,
    ended: bool,
}

impl Recorded {
    /// A file, which must be there.
    pub(super) fn open(path: &Path) -> Result<Self, SourceError> {
        source::open_file(path, &Reading::default())?;
        Ok(Self { path: path.to_owned(), records: None, ahead: None, ended: false })
    }

    /// The records that come before the first epoch later than `time_gps`.
    pub(super) fn until(&mut self, time_gps: GpsTime, stop: &Stop) -> Result<Vec<Arrived>, SourceError> {
        let mut arrived = Vec::new();
        if self.records.is_none() {
            self.records = Some(source::open_file(&self.path, &Reading::default().near(time_gps))?);
        }
        loop {
            match self.ahead.take() {
                Some(epoch) if is_later(&epoch.record, time_gps) => {
                    self.ahead = Some(epoch);
                    return Ok(arrived);
                }
                Some(record) => arrived.push(record),
                None => {}
            }
            let Some(records) = self.records.as_mut().filter(|_| !self.ended) else { return Ok(arrived) };
            match records.next(stop).map_err(|error| source::file_error(&self.path, error))? {
                Some(record) => {
                    self.ahead = Some(Arrived { record, station: records.decoder().station() });
                }
                None => self.ended = true,
            }
        }
    }

    /// What was skipped so far.
    pub(super) fn skips(&self) -> Skips {
        self.records.as_ref().map(Records::skips).unwrap_or_default()
    }
}

fn is_later(record: &Record, time_gps: GpsTime) -> bool {
    matches!(record, Record::Epoch(epoch) if epoch.time_gps > time_gps)
}
