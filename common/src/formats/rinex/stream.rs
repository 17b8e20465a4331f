//! The decoders as streams: bytes in, records out.

use std::collections::VecDeque;

use super::navigation_decoder::Found;
use super::{NavigationDecoder, ObservationDecoder, RinexError};
use crate::formats::decode::{Decoder, Record, WrongStream};
use crate::formats::lines::{Line, LineAssembly};
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

/// A decoder that takes lines: what [`feed`] and [`finish`] need to make a stream of it.
trait LineDecoder {
    fn stream(&mut self) -> &mut Stream;

    /// Takes a line and adds the records that it completes.
    fn take_line(&mut self, line: Line<'_>, ready: &mut VecDeque<Record>) -> Result<(), RinexError>;

    /// There are no more lines; adds the records that their end completes.
    fn end_of_lines(&mut self, ready: &mut VecDeque<Record>) -> Result<(), RinexError>;
}

fn feed(decoder: &mut impl LineDecoder, bytes: &[u8]) -> Result<(), WrongStream> {
    work(decoder, |decoder, Stream { assembly, ready, .. }| {
        assembly.feed(bytes, |line| decoder.take_line(line, ready))
    })
}

fn finish(decoder: &mut impl LineDecoder) -> Result<(), WrongStream> {
    work(decoder, |decoder, Stream { assembly, ready, .. }| {
        assembly.finish(|line| decoder.take_line(line, ready))?;
        decoder.end_of_lines(ready)
    })
}

/// Lends the stream out of the decoder while both are at work.
fn work<D: LineDecoder>(
    decoder: &mut D,
    run: impl FnOnce(&mut D, &mut Stream) -> Result<(), RinexError>,
) -> Result<(), WrongStream> {
    decoder.stream().check()?;
    let mut stream = std::mem::take(decoder.stream());
    let result = run(decoder, &mut stream);
    *decoder.stream() = stream;
    decoder.stream().end(result)
}

impl ObservationDecoder {
    /// Decodes a whole file.
    pub(super) fn whole(&mut self, bytes: &[u8], take: &mut dyn FnMut(Record)) -> Result<(), RinexError> {
        let mut assembly = LineAssembly::default();
        let mut line = |line: Line<'_>| self.take(line, take);
        assembly.feed(bytes, &mut line)?;
        assembly.finish(&mut line)
    }

    fn take(&mut self, line: Line<'_>, take: &mut dyn FnMut(Record)) -> Result<(), RinexError> {
        let text = self.kept(line);
        self.line(line.number, text, take)
    }
}

impl LineDecoder for ObservationDecoder {
    fn stream(&mut self) -> &mut Stream {
        &mut self.stream
    }

    fn take_line(&mut self, line: Line<'_>, ready: &mut VecDeque<Record>) -> Result<(), RinexError> {
        self.take(line, &mut |record| ready.push_back(record))
    }

    fn end_of_lines(&mut self, ready: &mut VecDeque<Record>) -> Result<(), RinexError> {
        Self::finish(self, &mut |record| ready.push_back(record))
    }
}

impl Decoder for ObservationDecoder {
    fn feed(&mut self, bytes: &[u8]) -> Result<(), WrongStream> {
        feed(self, bytes)
    }

    fn finish(&mut self) -> Result<(), WrongStream> {
        finish(self)
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

impl LineDecoder for NavigationDecoder {
    fn stream(&mut self) -> &mut Stream {
        &mut self.stream
    }

    fn take_line(&mut self, line: Line<'_>, ready: &mut VecDeque<Record>) -> Result<(), RinexError> {
        self.take(line).map(|found| ready.extend(found.map(Record::from)))
    }

    fn end_of_lines(&mut self, ready: &mut VecDeque<Record>) -> Result<(), RinexError> {
        self.end().map(|found| ready.extend(found.map(Record::from)))
    }
}

impl Decoder for NavigationDecoder {
    fn feed(&mut self, bytes: &[u8]) -> Result<(), WrongStream> {
        feed(self, bytes)
    }

    fn finish(&mut self) -> Result<(), WrongStream> {
        finish(self)
    }

    fn next_record(&mut self) -> Option<Record> {
        self.stream.ready.pop_front()
    }

    fn skips(&self) -> &Skips {
        Self::skips(self)
    }
}
