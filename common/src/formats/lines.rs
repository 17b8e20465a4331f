//! Bytes in any portions to lines.

use super::text::trim_end;
use crate::skips::{Reason, Skips};

/// Longest line that is kept, bytes. Lines of observation files with dozens of types stay below 2000.
pub const MAX_LINE_BYTES: usize = 16_384;

/// Puts lines together, in bounded memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct LineAssembly {
    partial: Vec<u8>,
    overlong: bool,
    number: u64,
}

/// A line that is complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Line<'a> {
    /// Number from 1.
    pub(crate) number: u64,
    /// The line without its end; `None` where it was longer than [`MAX_LINE_BYTES`].
    text: Option<&'a [u8]>,
}

impl<'a> Line<'a> {
    /// The line; one that was too long is counted, and an empty one in its place.
    pub(crate) fn kept(self, skips: &mut Skips) -> &'a [u8] {
        self.text.unwrap_or_else(|| {
            skips.add(Reason::LineTooLong, || {
                format!("line {}: more than {MAX_LINE_BYTES} bytes; left out", self.number)
            });
            b""
        })
    }
}

impl LineAssembly {
    /// Takes bytes and hands every line that they complete to `take`, until that fails.
    pub(crate) fn feed<E>(
        &mut self,
        mut bytes: &[u8],
        mut take: impl FnMut(Line<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        loop {
            let before = bytes;
            // Searching a slice in memory cannot fail; `skip_until` is the standard library's fast byte search.
            let taken = std::io::BufRead::skip_until(&mut bytes, b'\n').unwrap_or(0);
            let Some(line) = before.get(..taken).and_then(|line| line.strip_suffix(b"\n")) else {
                self.append(before);
                return Ok(());
            };
            if self.partial.is_empty() && !self.overlong && line.len() <= MAX_LINE_BYTES {
                self.number += 1;
                take(Line { number: self.number, text: Some(trim_end(line)) })?;
            } else {
                self.append(line);
                self.complete(&mut take)?;
            }
        }
    }

    /// The last line, where it has no end.
    pub(crate) fn finish<E>(&mut self, mut take: impl FnMut(Line<'_>) -> Result<(), E>) -> Result<(), E> {
        if self.partial.is_empty() && !self.overlong { Ok(()) } else { self.complete(&mut take) }
    }

    fn complete<E>(&mut self, take: &mut impl FnMut(Line<'_>) -> Result<(), E>) -> Result<(), E> {
        let (partial, overlong) = (std::mem::take(&mut self.partial), std::mem::take(&mut self.overlong));
        self.number += 1;
        take(Line { number: self.number, text: (!overlong).then_some(trim_end(&partial)) })
    }

    fn append(&mut self, bytes: &[u8]) {
        if self.overlong || self.partial.len() + bytes.len() > MAX_LINE_BYTES {
            self.overlong = true;
            self.partial = Vec::new();
        } else {
            self.partial.extend_from_slice(bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Lines = Vec<(u64, Option<Vec<u8>>)>;

    fn assemble<'a>(portions: impl Iterator<Item = &'a [u8]>) -> Lines {
        let (mut assembly, mut lines) = (LineAssembly::default(), Lines::new());
        let mut take = |line: Line<'_>| {
            lines.push((line.number, line.text.map(<[u8]>::to_vec)));
            Ok::<(), ()>(())
        };
        for portion in portions {
            assembly.feed(portion, &mut take).unwrap();
            assert!(assembly.partial.len() <= MAX_LINE_BYTES);
        }
        assembly.finish(&mut take).unwrap();
        lines
    }

    #[test]
    fn overlong_lines_leave_a_number_behind() {
        let text = [b"a\r\n".to_vec(), vec![b'x'; 1_000_000], b"\nb".to_vec()].concat();
        let expected = vec![(1, Some(b"a".to_vec())), (2, None), (3, Some(b"b".to_vec()))];
        assert_eq!(assemble(text.chunks(text.len())), expected);
        assert_eq!(assemble(text.chunks(7)), expected);
    }

    proptest! {
        #[test]
        fn portions_do_not_matter(
            text in proptest::collection::vec(prop_oneof![Just(b'\n'), Just(b'\r'), any::<u8>()], 0..200),
            size in 1..20_usize,
        ) {
            let expected: Lines =
                crate::formats::text::lines(&text).map(|(number, line)| (number, Some(line.to_vec()))).collect();
            prop_assert_eq!(assemble(text.chunks(size)), expected);
        }
    }
}
