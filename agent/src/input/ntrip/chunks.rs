//! Decoder of HTTP's chunked transfer coding (RFC 9112, 7.1).

/// Longest line with a chunk's size, including extensions.
const LONGEST_LINE: usize = 1_024;

/// Damaged chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the caster's chunked reply is damaged")]
pub(super) struct Damaged;

/// A body in chunks, each with its length.
#[derive(Debug, Default)]
pub(super) struct Chunks {
    /// Bytes not decoded yet: a part of a size line, or of the line end after a chunk.
    pending: Vec<u8>,
    expected: Expected,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Expected {
    #[default]
    Size,
    Data(u64),
    LineEnd,
    Nothing,
}

impl Chunks {
    /// Takes bytes as they arrive and appends their content.
    pub(super) fn feed(&mut self, mut bytes: &[u8], out: &mut Vec<u8>) -> Result<(), Damaged> {
        while !bytes.is_empty() {
            match self.expected {
                Expected::Data(left) => {
                    let take = bytes.len().min(usize::try_from(left).unwrap_or(usize::MAX));
                    let (data, rest) = bytes.split_at(take);
                    out.extend_from_slice(data);
                    bytes = rest;
                    let left = left - take as u64;
                    self.expected = if left == 0 { Expected::LineEnd } else { Expected::Data(left) };
                }
                // What follows the last chunk is of no interest.
                Expected::Nothing => return Ok(()),
                Expected::Size | Expected::LineEnd => {
                    let (first, rest) = bytes.split_at(1);
                    self.pending.extend_from_slice(first);
                    bytes = rest;
                    self.line()?;
                }
            }
        }
        Ok(())
    }

    /// Whether the last chunk has arrived.
    pub(super) fn is_complete(&self) -> bool {
        self.expected == Expected::Nothing
    }

    /// Decodes the pending bytes when they are complete.
    fn line(&mut self) -> Result<(), Damaged> {
        if self.expected == Expected::LineEnd {
            match self.pending.as_slice() {
                b"\r" => return Ok(()),
                b"\r\n" | b"\n" => self.expected = Expected::Size,
                _ => return Err(Damaged),
            }
        } else if !self.pending.first().is_some_and(u8::is_ascii_hexdigit) {
            return Err(Damaged);
        } else {
            match httparse::parse_chunk_size(&self.pending) {
                Ok(httparse::Status::Partial) if self.pending.len() < LONGEST_LINE => return Ok(()),
                Ok(httparse::Status::Complete((_, 0))) => self.expected = Expected::Nothing,
                Ok(httparse::Status::Complete((_, size))) => self.expected = Expected::Data(size),
                _ => return Err(Damaged),
            }
        }
        self.pending.clear();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BODY: &[u8] = b"5\r\nhello\r\nA;name=value\r\n, chunked \r\n1\r\n!\r\n0\r\n\r\nrubbish";

    #[test]
    fn every_border_will_do() {
        for size in 1..BODY.len() {
            let (mut chunks, mut out) = (Chunks::default(), Vec::new());
            for portion in BODY.chunks(size) {
                chunks.feed(portion, &mut out).unwrap();
            }
            assert_eq!(out, b"hello, chunked !", "in portions of {size}");
            assert!(chunks.is_complete());
        }
    }

    #[test]
    fn damage_is_noticed() {
        let endless = vec![b'1'; 2_000];
        let extended = [b"1;".to_vec(), vec![b'x'; 2_000]].concat();
        for body in [&b"hello\r\n"[..], b"5\r\nhelloX", b"\r\n", &endless, &extended] {
            let outcome = Chunks::default().feed(body, &mut Vec::new());
            assert_eq!(outcome, Err(Damaged), "{}", String::from_utf8_lossy(body));
        }
    }
}
