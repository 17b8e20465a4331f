//! Records of any source and format, in order of time.

use cofix_common::formats::decode::{Decoder, Record, WrongStream};
use cofix_common::formats::format::Format;
use cofix_common::formats::gnsslogger;
use cofix_common::formats::rtcm::StreamDates;
use cofix_common::formats::stream::StreamDecoder;
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;

use crate::Stop;
use crate::input::{Bytes, Portion};
use crate::source::dating::Dated;

/// Why a source gives no records.
#[derive(Debug, thiserror::Error)]
pub enum RecordsError {
    /// The source cannot be read.
    #[error(transparent)]
    Read(#[from] std::io::Error),
    /// It is of no format that is read.
    #[error(transparent)]
    Wrong(#[from] WrongStream),
}

/// The records of a source.
pub struct Records {
    bytes: Box<dyn Bytes>,
    decoder: StreamDecoder,
    buffer: Vec<u8>,
    ended: bool,
    /// Whether the next bytes belong to another file than those before.
    is_restarted: bool,
    /// An instant near the stream's beginning.
    near: GpsTime,
    /// Dates of a stream of RTCM 3.
    dates: Option<StreamDates>,
    last: Option<GpsTime>,
    /// Skipped here; the decoder counts for itself.
    skips: Skips,
}

impl Records {
    /// The records of a source. `near` as in [`StreamDecoder::new`].
    pub fn new(bytes: Box<dyn Bytes>, near: GpsTime) -> Self {
        Self {
            bytes,
            decoder: StreamDecoder::new(near),
            buffer: Vec::new(),
            ended: false,
            is_restarted: false,
            near,
            dates: None,
            last: None,
            skips: Skips::default(),
        }
    }

    /// The records of a recording whose dates have been found.
    pub(crate) fn dated(bytes: Box<dyn Bytes>, dated: Dated) -> Self {
        let Dated { dates, notes } = dated;
        let near = dates.begins();
        let decoder = StreamDecoder::dated(&dates);
        Self { decoder, dates: Some(dates), skips: notes, ..Self::new(bytes, near) }
    }

    /// Dates of a stream of RTCM 3, where it was recorded.
    pub(crate) const fn dates(&self) -> Option<&StreamDates> {
        self.dates.as_ref()
    }

    /// The same for GnssLogger text read in another way than by default.
    #[must_use]
    pub fn with_log_options(self, log: gnsslogger::Options) -> Self {
        Self { decoder: self.decoder.with_log_options(log), ..self }
    }

    /// The next record; blocks until there is one. `None` at the end, and soon after a request to stop. Epochs come in
    /// order of time: an epoch that does not is counted and left out.
    ///
    /// # Errors
    /// When the source cannot be read, or shows that it is of no format that is read.
    pub fn next(&mut self, stop: &Stop) -> Result<Option<Record>, RecordsError> {
        loop {
            while let Some(record) = self.decoder.next_record() {
                if self.is_in_order(&record) {
                    return Ok(Some(self.without_impossible_signals(record)));
                }
            }
            if self.ended {
                return Ok(None);
            }
            self.advance(stop)?;
        }
    }

    fn advance(&mut self, stop: &Stop) -> Result<(), RecordsError> {
        if std::mem::take(&mut self.is_restarted) {
            self.renew();
        }
        match self.bytes.next(&mut self.buffer, stop)? {
            Portion::Bytes => {
                let fed = self.decoder.feed(&self.buffer);
                self.excuse(fed)?;
            }
            Portion::Broken => {
                self.count_break();
                let interrupted = self.decoder.interrupt();
                self.excuse(interrupted)?;
            }
            Portion::Restarted => {
                self.count_break();
                // Its format does not matter any more.
                let _ = self.decoder.finish();
                self.is_restarted = true;
            }
            Portion::End => self.end(stop)?,
            Portion::Lost => {
                let reason = self.bytes.failure_reason().unwrap_or("no reason is known").to_owned();
                self.skips.add(Reason::SourceEndedEarly, || reason);
                self.end(stop)?;
            }
        }
        Ok(())
    }

    /// Begins with another stream.
    fn renew(&mut self) {
        self.skips.merge(self.decoder.skips());
        self.decoder = self.decoder.renewed(self.last.unwrap_or(self.near));
    }

    /// A stream of no format that is read is an error, unless its source goes on with another sender.
    fn excuse(&mut self, taken: Result<(), WrongStream>) -> Result<(), RecordsError> {
        if let Err(wrong) = taken {
            if !self.bytes.rejected(&wrong.reason) {
                return Err(wrong.into());
            }
            self.renew();
        }
        Ok(())
    }

    fn count_break(&mut self) {
        self.skips.add(Reason::ConnectionOpenedAgain, || {
            self.last.map_or("before the first epoch".to_owned(), |time| format!("after {time}"))
        });
    }

    /// A stream that was cut off by a request to stop may not have been recognised yet: that is no error.
    fn end(&mut self, stop: &Stop) -> Result<(), RecordsError> {
        self.ended = true;
        match self.decoder.finish() {
            Err(_) if stop.is_requested() => Ok(()),
            Err(wrong) => match self.bytes.failure_reason() {
                None => Err(wrong.into()),
                // Why the source failed tells more than what its rest looks like.
                Some(reason) => Err(RecordsError::Read(std::io::Error::other(reason.to_owned()))),
            },
            Ok(()) => Ok(()),
        }
    }

    fn is_in_order(&mut self, record: &Record) -> bool {
        let Record::Epoch(epoch) = record else { return true };
        if let Some(last) = self.last
            && epoch.time_gps <= last
        {
            self.skips.add(Reason::EpochNotLater, || format!("{} after {last}", epoch.time_gps));
            return false;
        }
        self.last = Some(epoch.time_gps);
        true
    }

    /// Leaves out observations of signals that their satellites cannot send. In RINEX the decoder has done so, which knows the lines.
    fn without_impossible_signals(&mut self, mut record: Record) -> Record {
        let is_rinex = matches!(self.decoder.format(), Some(Format::Rinex | Format::CompactRinex));
        if let (Record::Epoch(epoch), false) = (&mut record, is_rinex) {
            let time_gps = epoch.time_gps;
            epoch.observations.retain(|observation| {
                let reason = observation.satellite.cannot_send(observation.signal);
                if let Some(reason) = reason {
                    self.skips.add(reason, || {
                        format!("{} {} at {time_gps}", observation.satellite, observation.signal)
                    });
                }
                reason.is_none()
            });
        }
        record
    }

    /// The decoder, which knows more about the stream.
    pub const fn decoder(&self) -> &StreamDecoder {
        &self.decoder
    }

    /// Everything skipped so far.
    pub fn skips(&self) -> Skips {
        let mut all = self.decoder.skips().clone();
        all.merge(&self.skips);
        if let Some(skips) = self.bytes.skips() {
            all.merge(skips);
        }
        all
    }
}
