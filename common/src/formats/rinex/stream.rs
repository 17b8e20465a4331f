//! The decoders as streams: bytes in, records out.

use std::collections::VecDeque;

use super::navigation_decoder::Found;
use super::{NavigationDecoder, ObservationDecoder, RinexError};
use crate::formats::decode::{Decoder, Record, WrongStream};
use crate::formats::lines::{self, LineAssembly, each_line};
use crate::skips::{Reason, Skips};

/// Longest line that is read, bytes. Lines of observation files with dozens of types stay below 2000.
const MAX_LINE_BYTES: usize = 16_384;

type Line<'a> = lines::Line<'a, MAX_LINE_BYTES>;

/// What a decoder of lines needs to be one of a stream.
#[derive(Clone, Debug, Default)]
pub(super) struct Stream {
    assembly: LineAssembly<MAX_LINE_BYTES>,
    ready: VecDeque<Record>,
    /// The error that ended it; nothing more is decoded then.
    wrong: Option<WrongStream>,
}

/// A decoder that takes lines.
pub(super) trait LineDecoder {
    fn stream(&mut self) -> &mut Stream;

    fn skips(&self) -> &Skips;

    /// Takes a line and adds the records that it completes.
    fn take_line(&mut self, line: Line<'_>, ready: &mut VecDeque<Record>) -> Result<(), RinexError>;

    /// There are no more lines; adds the records that their end completes.
    fn end_of_lines(&mut self, ready: &mut VecDeque<Record>) -> Result<(), RinexError>;
}

impl<D: LineDecoder> Decoder for D {
    fn feed(&mut self, bytes: &[u8]) -> Result<(), WrongStream> {
        work(self, |decoder, Stream { assembly, ready, .. }| {
            assembly.feed(bytes, |line| decoder.take_line(line, ready))
        })
    }

    fn finish(&mut self) -> Result<(), WrongStream> {
        work(self, |decoder, Stream { assembly, ready, .. }| {
            assembly.finish(|line| decoder.take_line(line, ready))?;
            decoder.end_of_lines(ready)
        })
    }

    fn next_record(&mut self) -> Option<Record> {
        self.stream().ready.pop_front()
    }

    fn skips(&self) -> &Skips {
        LineDecoder::skips(self)
    }
}

/// Lends the stream out of the decoder while both are at work.
fn work<D: LineDecoder>(
    decoder: &mut D,
    run: impl FnOnce(&mut D, &mut Stream) -> Result<(), RinexError>,
) -> Result<(), WrongStream> {
    if let Some(wrong) = &decoder.stream().wrong {
        return Err(wrong.clone());
    }
    let mut stream = std::mem::take(decoder.stream());
    let result = run(decoder, &mut stream).map_err(|error| WrongStream { reason: error.to_string() });
    stream.wrong = result.clone().err();
    *decoder.stream() = stream;
    result
}

/// The text of a line; one that is too long is counted, and an empty one in its place.
fn kept<'a>(line: Line<'a>, skips: &mut Skips) -> &'a [u8] {
    line.text.unwrap_or_else(|| {
        skips.add(Reason::LineTooLong, || {
            format!("line {}: more than {MAX_LINE_BYTES} bytes; left out", line.number)
        });
        b""
    })
}

impl ObservationDecoder {
    /// Decodes a whole file.
    pub(super) fn whole(&mut self, bytes: &[u8], take: &mut dyn FnMut(Record)) -> Result<(), RinexError> {
        each_line(bytes, |line| self.take(line, take))
    }

    fn take(&mut self, line: Line<'_>, take: &mut dyn FnMut(Record)) -> Result<(), RinexError> {
        let text = kept(line, &mut self.skips);
        self.line(line.number, text, take)
    }
}

impl LineDecoder for ObservationDecoder {
    fn stream(&mut self) -> &mut Stream {
        &mut self.stream
    }

    fn skips(&self) -> &Skips {
        Self::skips(self)
    }

    fn take_line(&mut self, line: Line<'_>, ready: &mut VecDeque<Record>) -> Result<(), RinexError> {
        self.take(line, &mut |record| ready.push_back(record))
    }

    fn end_of_lines(&mut self, ready: &mut VecDeque<Record>) -> Result<(), RinexError> {
        Self::finish(self, &mut |record| ready.push_back(record))
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

    fn take_line(&mut self, line: Line<'_>, ready: &mut VecDeque<Record>) -> Result<(), RinexError> {
        self.take(line).map(|found| ready.extend(found.map(Record::from)))
    }

    fn end_of_lines(&mut self, ready: &mut VecDeque<Record>) -> Result<(), RinexError> {
        self.end().map(|found| ready.extend(found.map(Record::from)))
    }
}
