//! Bytes in any portions to lines.

use crate::formats::text::split_line;
use crate::skips::{Reason, Skips};

/// Longest line that is read of logs and tables, bytes. `Raw` lines of GnssLogger have about 400, its headers about 1000.
const MAX_LINE_BYTES: usize = 65_536;

/// Puts lines of at most `MAX_BYTES` together, in bounded memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct LineAssembly<const MAX_BYTES: usize = MAX_LINE_BYTES> {
    partial: Vec<u8>,
    overlong: bool,
    number: u64,
}

/// A line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Line<'a, const MAX_BYTES: usize = MAX_LINE_BYTES> {
    /// Number from 1.
    pub(crate) number: u64,
    /// The line without its line feed; `None` if it is longer than `MAX_BYTES`.
    pub(crate) text: Option<&'a [u8]>,
}

impl<'a, const MAX_BYTES: usize> Line<'a, MAX_BYTES> {
    /// The text; a line that is too long is counted.
    pub(crate) fn counted(self, skips: &mut Skips) -> Option<&'a [u8]> {
        if self.text.is_none() {
            skips.add(Reason::LineTooLong, || format!("line {}: more than {MAX_BYTES} bytes", self.number));
        }
        self.text
    }
}

/// Hands every line of `bytes` to `take`, until that fails.
pub(crate) fn each_line<const MAX_BYTES: usize, E>(
    bytes: &[u8],
    mut take: impl FnMut(Line<'_, MAX_BYTES>) -> Result<(), E>,
) -> Result<(), E> {
    let mut assembly = LineAssembly::<MAX_BYTES>::default();
    assembly.feed(bytes, &mut take)?;
    assembly.finish(take)
}

impl<const MAX_BYTES: usize> LineAssembly<MAX_BYTES> {
    /// Takes bytes and hands every line that they complete to `take`, until that fails.
    pub(crate) fn feed<E>(
        &mut self,
        mut bytes: &[u8],
        mut take: impl FnMut(Line<'_, MAX_BYTES>) -> Result<(), E>,
    ) -> Result<(), E> {
        while let Some((line, rest)) = split_line(bytes) {
            bytes = rest;
            if self.partial.is_empty() && !self.overlong && line.len() <= MAX_BYTES {
                self.number += 1;
                take(Line { number: self.number, text: Some(line) })?;
            } else {
                self.append(line);
                self.complete(&mut take)?;
            }
        }
        self.append(bytes);
        Ok(())
    }

    /// Hands the last line to `take` if it has no line feed.
    pub(crate) fn finish<E>(
        &mut self,
        take: impl FnOnce(Line<'_, MAX_BYTES>) -> Result<(), E>,
    ) -> Result<(), E> {
        if self.partial.is_empty() && !self.overlong { Ok(()) } else { self.complete(take) }
    }

    fn complete<E>(&mut self, take: impl FnOnce(Line<'_, MAX_BYTES>) -> Result<(), E>) -> Result<(), E> {
        let (partial, overlong) = (std::mem::take(&mut self.partial), std::mem::take(&mut self.overlong));
        self.number += 1;
        take(Line { number: self.number, text: (!overlong).then_some(&partial) })
    }

    fn append(&mut self, bytes: &[u8]) {
        if self.overlong || self.partial.len() + bytes.len() > MAX_BYTES {
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
    use crate::formats::text::{lines, trim_end};
    use proptest::prelude::*;

    type Lines = Vec<(u64, Option<Vec<u8>>)>;

    fn assemble<'a>(portions: impl Iterator<Item = &'a [u8]>) -> Lines {
        let (mut assembly, mut lines) = (<LineAssembly>::default(), Lines::new());
        let mut take = |line: Line<'_>| {
            lines.push((line.number, line.text.map(|text| trim_end(text).to_vec())));
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
        let longest = vec![b'y'; MAX_LINE_BYTES];
        let text = [b"a\r\n", &*vec![b'x'; 1_000_000], b"\n\n", &longest, b"\n", &longest, b"y\nb"].concat();
        let expected = vec![
            (1, Some(b"a".to_vec())),
            (2, None),
            (3, Some(Vec::new())),
            (4, Some(longest)),
            (5, None),
            (6, Some(b"b".to_vec())),
        ];
        for portion in [1, 7, 1_000, MAX_LINE_BYTES, MAX_LINE_BYTES + 1, text.len()] {
            assert_eq!(assemble(text.chunks(portion)), expected, "{portion}");
        }
    }

    proptest! {
        #[test]
        fn portions_do_not_matter(
            text in proptest::collection::vec(prop_oneof![Just(b'\n'), Just(b'\r'), any::<u8>()], 0..200),
            size in 1..20_usize,
        ) {
            let expected: Lines =
                lines(&text).map(|(number, line)| (number, Some(line.to_vec()))).collect();
            prop_assert_eq!(assemble(text.chunks(size)), expected);
        }
    }
}
