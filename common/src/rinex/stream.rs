//! The decoders as streams: bytes in, records out.

use std::collections::VecDeque;

use super::line_assembly::{Line, LineAssembly};
use super::navigation_decoder::Found;
use super::{NavigationDecoder, ObservationDecoder, RinexError};
use crate::decode::{Decoder, Record, WrongStream};
use crate::gnss::ObservationEpoch;
use crate::skips::Skips;

/// What a decoder needs to be one of a stream.
#[derive(Clone, Debug, Default)]
pub(super) struct Stream {
    assembly: LineAssembly,
    ready: VecDeque<Record>,
    /// The error that ended it; nothing more is decoded then.
    wrong: Option<WrongStream>,
}

impl Stream {
    fn end(&mut self, result: Result<(), RinexError>) -> Result<(), WrongStream> {
        result.map_err(|error| {
            let wrong = WrongStream { reason: error.to_string() };
            self.wrong = Some(wrong.clone());
            wrong
        })
    }

    fn check(&self) -> Result<(), WrongStream> {
        self.wrong.clone().map_or(Ok(()), Err)
    }
}

impl ObservationDecoder {
    /// Decodes a whole file.
    pub(super) fn whole(
        &mut self,
        bytes: &[u8],
        mut take: impl FnMut(ObservationEpoch),
    ) -> Result<(), RinexError> {
        let mut assembly = LineAssembly::default();
        let mut line = |line: Line<'_>| self.take(line).map(|epoch| epoch.map_or((), &mut take));
        assembly.feed(bytes, &mut line)?;
        assembly.finish(&mut line)
    }

    fn take(&mut self, line: Line<'_>) -> Result<Option<ObservationEpoch>, RinexError> {
        let text = self.kept(line);
        self.line(line.number, text)
    }
}

impl Decoder for ObservationDecoder {
    fn feed(&mut self, bytes: &[u8]) -> Result<(), WrongStream> {
        self.stream.check()?;
        let mut stream = std::mem::take(&mut self.stream);
        let Stream { assembly, ready, .. } = &mut stream;
        let take = |line: Line<'_>| self.take(line).map(|epoch| ready.extend(epoch.map(Record::Epoch)));
        let result = assembly.feed(bytes, take);
        self.stream = stream;
        self.stream.end(result)
    }

    fn finish(&mut self) -> Result<(), WrongStream> {
        self.stream.check()?;
        let mut stream = std::mem::take(&mut self.stream);
        let Stream { assembly, ready, .. } = &mut stream;
        let take = |line: Line<'_>| self.take(line).map(|epoch| ready.extend(epoch.map(Record::Epoch)));
        let result = assembly.finish(take).and_then(|()| Self::finish(self));
        self.stream = stream;
        self.stream.end(result)
    }

    fn next_record(&mut self) -> Option<Record> {
        self.stream.ready.pop_front()
    }

    fn skips(&self) -> &Skips {
        Self::skips(self)
    }
}

impl From<Found> for Record {
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
        let mut assembly = LineAssembly::default();
        let mut line = |line: Line<'_>| self.take(line).map(|found| found.map_or((), &mut take));
        assembly.feed(bytes, &mut line)?;
        assembly.finish(&mut line)?;
        self.end().map(|found| found.map_or((), take))
    }

    fn take(&mut self, line: Line<'_>) -> Result<Option<Found>, RinexError> {
        let text = self.kept(line);
        self.line(line.number, text)
    }
}

impl Decoder for NavigationDecoder {
    fn feed(&mut self, bytes: &[u8]) -> Result<(), WrongStream> {
        self.stream.check()?;
        let mut stream = std::mem::take(&mut self.stream);
        let Stream { assembly, ready, .. } = &mut stream;
        let take = |line: Line<'_>| self.take(line).map(|found| ready.extend(found.map(Record::from)));
        let result = assembly.feed(bytes, take);
        self.stream = stream;
        self.stream.end(result)
    }

    fn finish(&mut self) -> Result<(), WrongStream> {
        self.stream.check()?;
        let mut stream = std::mem::take(&mut self.stream);
        let Stream { assembly, ready, .. } = &mut stream;
        let take = |line: Line<'_>| self.take(line).map(|found| ready.extend(found.map(Record::from)));
        let last = assembly.finish(take).and_then(|()| self.end());
        let result = last.map(|found| stream.ready.extend(found.map(Record::from)));
        self.stream = stream;
        self.stream.end(result)
    }

    fn next_record(&mut self) -> Option<Record> {
        self.stream.ready.pop_front()
    }

    fn skips(&self) -> &Skips {
        Self::skips(self)
    }
}
