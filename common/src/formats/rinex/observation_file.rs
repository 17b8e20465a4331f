//! Whole observation files.

use super::header::ObservationHeader;
use super::{ObservationDecoder, RinexError};
use crate::formats::decode::Record;
use crate::formats::packing::decompress;
use crate::gnss::{Event, ObservationEpoch};
use crate::skips::Skips;

/// A whole observation file.
#[derive(Clone, Debug, PartialEq)]
pub struct ObservationFile {
    /// The header, with the changes by events.
    pub header: ObservationHeader,
    /// Epochs, in time order.
    pub epochs: Vec<ObservationEpoch>,
    /// Events between epochs, in the file's order: each with the number of epochs before it.
    pub events: Vec<(usize, Event)>,
    /// Counts of skipped records.
    pub skips: Skips,
}

impl ObservationFile {
    /// Reads a whole file, plain or compressed (.gz, .Z).
    ///
    /// # Errors
    /// When the compression is damaged or the header cannot be used; damage further on is counted in
    /// [`ObservationFile::skips`].
    pub fn parse(bytes: &[u8]) -> Result<Self, RinexError> {
        let bytes = decompress(bytes)?;
        let mut decoder = ObservationDecoder::default();
        let (mut epochs, mut events) = (Vec::new(), Vec::new());
        let mut take = |record| match record {
            Record::Epoch(epoch) => epochs.push(epoch),
            Record::Event(event) => events.push((epochs.len(), *event)),
            Record::Ephemeris(_) | Record::Glonass(_) => {}
        };
        decoder.whole(&bytes, &mut take)?;
        decoder.finish(&mut take)?;
        let (header, skips) = decoder.into_parts();
        Ok(Self { header, epochs, events, skips })
    }
}
