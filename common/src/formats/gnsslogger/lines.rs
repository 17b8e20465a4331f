//! Lines out of a stream of bytes, however it is cut into portions.

use std::io::BufRead;

/// Longest line that is looked at, bytes. `Raw` lines have about 400, headers about 1000.
pub(crate) const MAX_LINE: usize = 65_536;

/// Collects the part of a line that has come.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lines {
    part: Vec<u8>,
    /// The line is too long; the rest of it is thrown away.
    too_long: bool,
    /// The line in `part` has been given out.
    given: bool,
}

/// A line, or the place of one that is too long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Framed<'a> {
    /// Without its line feed.
    Line(&'a [u8]),
    /// More than [`MAX_LINE`] bytes.
    TooLong,
}

impl Lines {
    /// The next line that ends in `bytes`, which is moved on; `None` when all of it is taken.
    pub(crate) fn next<'a, 'b: 'a>(&'a mut self, bytes: &mut &'b [u8]) -> Option<Framed<'a>> {
        if std::mem::take(&mut self.given) {
            self.part.clear();
        }
        let before = *bytes;
        // Searching a slice in memory cannot fail; `skip_until` is the standard library's fast byte search.
        let taken = bytes.skip_until(b'\n').unwrap_or(0);
        let piece = before.get(..taken)?;
        let Some(end) = piece.strip_suffix(b"\n") else {
            self.keep(piece);
            return None;
        };
        if std::mem::take(&mut self.too_long) {
            return Some(Framed::TooLong);
        }
        if self.part.len() + end.len() > MAX_LINE {
            self.given = true;
            return Some(Framed::TooLong);
        }
        if self.part.is_empty() {
            return Some(Framed::Line(end));
        }
        self.part.extend_from_slice(end);
        self.given = true;
        Some(Framed::Line(&self.part))
    }

    fn keep(&mut self, piece: &[u8]) {
        if self.too_long {
            return;
        }
        if self.part.len() + piece.len() > MAX_LINE {
            self.too_long = true;
            self.part.clear();
        } else {
            self.part.extend_from_slice(piece);
        }
    }

    /// What is left of a line without its line feed.
    pub(crate) fn finish(&mut self) -> Option<Vec<u8>> {
        let too_long = std::mem::take(&mut self.too_long);
        let part = std::mem::take(&mut self.part);
        (too_long || (!part.is_empty() && !self.given)).then_some(part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn collect(text: &[u8], portion: usize) -> Vec<String> {
        let mut lines = Lines::default();
        let mut out = Vec::new();
        for piece in text.chunks(portion) {
            let mut rest = piece;
            while let Some(framed) = lines.next(&mut rest) {
                out.push(match framed {
                    Framed::Line(line) => String::from_utf8_lossy(line).into_owned(),
                    Framed::TooLong => "too long".to_owned(),
                });
            }
        }
        out.extend(lines.finish().map(|cut| format!("cut {}", cut.len())));
        out
    }

    #[test]
    fn portions_do_not_matter() {
        let mut text = b"a\r\n\nlonger line\n".to_vec();
        text.extend(vec![b'x'; MAX_LINE + 1]);
        text.extend_from_slice(b"\n");
        text.extend(vec![b'y'; MAX_LINE]);
        text.extend_from_slice(b"\nend");
        let whole = collect(&text, text.len());
        assert_eq!(whole.len(), 6);
        assert_eq!(&whole[..4], ["a\r", "", "longer line", "too long"]);
        assert_eq!(whole[5], "cut 3");
        for portion in [1, 2, 3, 7, 1_000, 65_536, 65_537] {
            assert_eq!(collect(&text, portion), whole, "{portion}");
        }
    }
}
