//! A recorded source of corrections, read along with the rover's time.

use std::path::{Path, PathBuf};

use cofix_common::formats::decode::Record;
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;

use super::Arrived;
use crate::Stop;
use crate::source::records::Records;
use crate::source::{self, Reading, SourceError};

/// Corrections never serve for longer than this, s.
const LONGEST_AGE_S: f64 = 3_600.0;

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
        // Of a base that began long before only its last word counts.
        let mut stale = None;
        if self.records.is_none() {
            self.records =
                Some(source::open_file(&self.path, &Reading { near: Some(time_gps), ..Reading::default() })?);
        }
        loop {
            match self.ahead.take() {
                Some(epoch) if is_later(&epoch.record, time_gps) => {
                    self.ahead = Some(epoch);
                    return Ok(arrived);
                }
                Some(record) => {
                    if is_epoch(&record.record)
                        && let Some(before) = stale.take()
                    {
                        arrived.remove(before);
                    }
                    if is_stale(&record.record, time_gps) {
                        stale = Some(arrived.len());
                    }
                    arrived.push(record);
                }
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

const fn is_epoch(record: &Record) -> bool {
    matches!(record, Record::Epoch(_))
}

fn is_stale(record: &Record, time_gps: GpsTime) -> bool {
    matches!(record, Record::Epoch(epoch) if time_gps - epoch.time_gps > LONGEST_AGE_S)
}

fn is_later(record: &Record, time_gps: GpsTime) -> bool {
    matches!(record, Record::Epoch(epoch) if epoch.time_gps > time_gps)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two epochs a second apart, and one two hours later.
    const BASE: &str = "     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE
G    1 C1C                                                  SYS / # / OBS TYPES
                                                            END OF HEADER
> 2020 08 13 10 00  0.0000000  0  1
G01  22100000.000
> 2020 08 13 10 00  1.0000000  0  1
G01  22100000.000
> 2020 08 13 12 00  0.0000000  0  1
G01  22100000.000
";

    #[test]
    fn of_a_base_that_began_long_before_only_the_last_word_counts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("base.rnx");
        std::fs::write(&path, BASE).unwrap();
        let times = |recorded: &mut Recorded, until: &str| -> Vec<String> {
            let arrived = recorded.until(until.parse().unwrap(), &Stop::default()).unwrap();
            let time = |arrived: Arrived| match arrived.record {
                Record::Epoch(epoch) => epoch.time_gps.iso(),
                _ => "an ephemeris".to_owned(),
            };
            arrived.into_iter().map(time).collect()
        };
        let mut recorded = Recorded::open(&path).unwrap();
        assert_eq!(times(&mut recorded, "2020-08-13T11:59:59"), ["2020-08-13T10:00:01.000"]);
        assert_eq!(times(&mut recorded, "2020-08-13T12:00:00"), ["2020-08-13T12:00:00.000"]);
        let mut recorded = Recorded::open(&path).unwrap();
        assert_eq!(times(&mut recorded, "2020-08-13T10:00:01").len(), 2, "all of them are fresh");
    }
}
