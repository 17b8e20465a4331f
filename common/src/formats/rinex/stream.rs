//! The decoders as streams: bytes in, records out.

use std::collections::VecDeque;

use super::RinexError;
use crate::formats::decode::{Decoder, Record, WrongStream};
use crate::formats::lines::{self, LineAssembly};
use crate::skips::{Reason, Skips};

/// Longest line that is read, bytes. Lines of observation files with dozens of types stay below 2000.
const MAX_LINE_BYTES: usize = 16_384;

pub(super) type Line<'a> = lines::Line<'a, MAX_LINE_BYTES>;

/// State that makes a decoder of streams of a decoder of lines.
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
pub(super) fn kept<'a>(line: Line<'a>, skips: &mut Skips) -> &'a [u8] {
    line.text.unwrap_or_else(|| {
        skips.add(Reason::LineTooLong, || {
            format!("line {}: more than {MAX_LINE_BYTES} bytes; left out", line.number)
        });
        b""
    })
}
