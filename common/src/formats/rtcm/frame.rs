//! Transport frames: preamble 0xD3, six reserved bits, ten bits of length, message, CRC-24Q (RTCM 10403.3, transport layer).
//!
//! A preamble may be line noise. When the checksum of what follows is wrong, only that one byte is passed over and the
//! search goes on behind it, so that noise never swallows a frame.

use crate::formats::bits::crc24q;
use crate::skips::{Reason, Skips};

const PREAMBLE: u8 = 0xd3;
const HEADER_BYTES: usize = 3;
const CHECKSUM_BYTES: usize = 3;

/// Finds the frames in a stream of bytes. Holds at most one frame and the portion that was fed last.
#[derive(Clone, Debug, Default)]
pub(super) struct Framer {
    buffer: Vec<u8>,
    /// Bytes of the buffer that are done with.
    done: usize,
    /// Offset in the stream of the buffer's first byte.
    offset: u64,
    frames: u64,
    outside: u64,
}

/// What a look at the buffer's beginning shows.
enum Look {
    /// A frame with this much message.
    Frame(usize),
    NoPreamble,
    BadChecksum,
    Incomplete,
}

impl Framer {
    /// Takes the next bytes.
    pub(super) fn push(&mut self, bytes: &[u8]) {
        self.buffer.drain(..self.done);
        self.offset += self.done as u64;
        self.done = 0;
        self.buffer.extend_from_slice(bytes);
    }

    /// Frames found so far.
    pub(super) const fn frames(&self) -> u64 {
        self.frames
    }

    /// Bytes so far that belong to no frame.
    pub(super) const fn outside(&self) -> u64 {
        self.outside
    }

    /// The message of the next frame, or `None` until more bytes come. With `ended` no more will come, and an
    /// incomplete frame is passed over as noise. Stops also after `outside_limit` bytes without any frame.
    pub(super) fn next(&mut self, ended: bool, outside_limit: u64, skips: &mut Skips) -> Option<Vec<u8>> {
        while self.done < self.buffer.len() && (self.frames > 0 || self.outside < outside_limit) {
            let rest = self.buffer.get(self.done..)?;
            match look(rest) {
                Look::Frame(length) => {
                    let message = rest.get(HEADER_BYTES..HEADER_BYTES + length)?.to_vec();
                    self.done += HEADER_BYTES + length + CHECKSUM_BYTES;
                    self.frames += 1;
                    return Some(message);
                }
                Look::Incomplete if !ended => return None,
                Look::Incomplete => self.pass_over(Reason::FrameCutOff, skips),
                Look::BadChecksum => {
                    self.pass_over(Reason::FrameWrongChecksum, skips);
                }
                Look::NoPreamble => self.pass_over(Reason::ByteOutsideAnyFrame, skips),
            }
        }
        None
    }

    fn pass_over(&mut self, reason: Reason, skips: &mut Skips) {
        let at = self.offset + self.done as u64;
        skips.add(reason, || format!("at byte {at} of the stream"));
        self.done += 1;
        self.outside += 1;
    }
}

fn look(bytes: &[u8]) -> Look {
    match bytes {
        [PREAMBLE, reserved, ..] if reserved & 0b1111_1100 != 0 => Look::NoPreamble,
        [PREAMBLE] | [PREAMBLE, _] => Look::Incomplete,
        [PREAMBLE, high, low, ..] => {
            let length = usize::from(*high) << 8 | usize::from(*low);
            let Some(frame) = bytes.get(..HEADER_BYTES + length + CHECKSUM_BYTES) else {
                return Look::Incomplete;
            };
            // The checksum of a message with its checksum appended is zero.
            if crc24q(frame) == 0 { Look::Frame(length) } else { Look::BadChecksum }
        }
        _ => Look::NoPreamble,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example frame of RTCM 10403.3, transport layer (a 1005 message).
    const EXAMPLE: [u8; 25] = [
        0xd3, 0x00, 0x13, 0x3e, 0xd7, 0xd3, 0x02, 0x02, 0x98, 0x0e, 0xde, 0xef, 0x34, 0xb4, 0xbd, 0x62, 0xac,
        0x09, 0x41, 0x98, 0x6f, 0x33, 0x36, 0x0b, 0x98,
    ];

    fn frames(bytes: &[u8]) -> (Vec<Vec<u8>>, Skips) {
        let (mut framer, mut skips) = (Framer::default(), Skips::default());
        framer.push(bytes);
        let found = std::iter::from_fn(|| framer.next(true, u64::MAX, &mut skips)).collect();
        (found, skips)
    }

    #[test]
    fn the_standards_example_is_a_frame() {
        assert_eq!(crc24q(&EXAMPLE[..22]), 0x36_0b98);
        let (found, skips) = frames(&EXAMPLE);
        assert_eq!(found, [EXAMPLE[3..22].to_vec()]);
        assert!(skips.is_empty());
    }

    #[test]
    fn a_false_preamble_does_not_swallow_what_follows() {
        let (found, skips) =
            frames(&[&[0xd3, 0x00, 0x10, 0xd3][..], &EXAMPLE, &[0xd3, 0x03], &EXAMPLE].concat());
        assert_eq!(found.len(), 2, "{skips}");
        assert_eq!(skips.total(), 6, "{skips}");
    }

    #[test]
    fn each_flipped_bit_is_noticed() {
        for bit in 0..EXAMPLE.len() * 8 {
            let mut damaged = EXAMPLE;
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(frames(&damaged).0.is_empty(), "bit {bit}");
        }
    }
}
