//! Lines of a stream.

use crate::formats::text::without_mark;
use crate::skips::{Reason, Skips};

/// No row of these tables comes near this, bytes.
const MAX_LINE_BYTES: usize = 65_536;

/// Cuts a stream into lines, whatever the portions.
#[derive(Clone, Debug, Default)]
pub(super) struct Lines {
    partial: Vec<u8>,
    number: u64,
    too_long: bool,
}

impl Lines {
    /// Takes bytes and calls `each` with the number and content of every line that they complete.
    pub(super) fn feed(
        &mut self,
        bytes: &[u8],
        skips: &mut Skips,
        mut each: impl FnMut(u64, &[u8], &mut Skips),
    ) {
        let mut parts = bytes.split(|byte| *byte == b'\n').peekable();
        while let Some(part) = parts.next() {
            self.append(part, skips);
            if parts.peek().is_some() {
                self.number += 1;
                if !self.too_long {
                    each(self.number, &self.partial, skips);
                }
                self.partial.clear();
                self.too_long = false;
            }
        }
    }

    /// What follows the last line end, which may be cut short.
    pub(super) fn rest(&self) -> Option<(u64, &[u8])> {
        let any = self.partial.iter().any(|byte| !byte.is_ascii_whitespace());
        (any && !self.too_long).then_some((self.number + 1, self.partial.as_slice()))
    }

    fn append(&mut self, part: &[u8], skips: &mut Skips) {
        if self.too_long {
            return;
        }
        if self.partial.len() + part.len() > MAX_LINE_BYTES {
            let number = self.number + 1;
            skips.add(Reason::LineTooLong, || format!("line {number}: more than {MAX_LINE_BYTES} bytes"));
            self.too_long = true;
            self.partial.clear();
            return;
        }
        self.partial.extend_from_slice(part);
    }
}

/// The fields of a line: cut at commas, without blanks, quotes and the carriage return around them. Bytes that are no text
/// give an empty field.
pub(super) fn fields(line: &[u8]) -> Vec<&str> {
    without_mark(line)
        .split(|byte| *byte == b',')
        .map(|field| std::str::from_utf8(field).unwrap_or_default().trim().trim_matches('"').trim())
        .collect()
}
