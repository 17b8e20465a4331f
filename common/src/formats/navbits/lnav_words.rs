//! The ten words of an LNAV subframe and their parity (IS-GPS-200, 20.3.5).

use super::words::{SUBFRAME_BYTES, upright};
use super::{ReceiverCheck, Refused, refused};
use crate::skips::Reason;

/// The preamble, and its number of bits.
const PREAMBLE: (u32, u32) = (0x8b, 8);

/// Which of the bits d1 to d24 enter each parity bit, D25 to D30 (IS-GPS-200, table 20-XIV), d1 as the highest of 24 bits.
const PARITY_MASKS: [u32; 6] = [
    mask(&[1, 2, 3, 5, 6, 10, 11, 12, 13, 14, 17, 18, 20, 23]),
    mask(&[2, 3, 4, 6, 7, 11, 12, 13, 14, 15, 18, 19, 21, 24]),
    mask(&[1, 3, 4, 5, 7, 8, 12, 13, 14, 15, 16, 19, 20, 22]),
    mask(&[2, 4, 5, 6, 8, 9, 13, 14, 15, 16, 17, 20, 21, 23]),
    mask(&[1, 3, 5, 6, 7, 9, 10, 14, 15, 16, 17, 18, 21, 22, 24]),
    mask(&[3, 5, 6, 8, 9, 10, 11, 13, 15, 19, 22, 23, 24]),
];
/// Whether D29* (else D30*) of the word before enters each parity bit.
const USES_D29: [bool; 6] = [true, false, true, false, false, true];

const fn mask(bits: &[u32]) -> u32 {
    let mut value = 0;
    let mut k = 0;
    while k < bits.len() {
        value |= 1 << (24 - bits[k]);
        k += 1;
    }
    value
}

/// The 240 data bits of a subframe, parity checked and removed.
pub(super) type Data = [u8; 30];

/// Parity bits D25 to D30 of 24 data bits after a word that ended in D29* and D30*.
pub(super) fn parity(data: u32, d29: u32, d30: u32) -> u32 {
    PARITY_MASKS.iter().zip(USES_D29).fold(0, |bits, (mask, uses_d29)| {
        let previous = if uses_d29 { d29 } else { d30 };
        bits << 1 | ((data & mask).count_ones() & 1) ^ previous
    })
}

/// Reads a subframe. Receivers differ in three ways, and each is recognised by itself: words at the low or the high end of
/// their four bytes, the sign of all bits, and whether data bits are as sent (turned over after a word that ends in 1) or
/// as meant, with parity bits of either sign.
pub(super) fn data(bytes: &[u8], receiver: ReceiverCheck) -> Result<Data, Refused> {
    let Some(bytes) = bytes.first_chunk::<SUBFRAME_BYTES>().filter(|_| bytes.len() == SUBFRAME_BYTES) else {
        let detail = format!("{} bytes, {SUBFRAME_BYTES} expected", bytes.len());
        return Err(refused(Reason::LnavSubframeWrongLength, detail));
    };
    let words = upright(bytes, PREAMBLE).ok_or_else(|| {
        refused(Reason::LnavSubframeWithoutPreamble, format!("first bytes {:02x?}", bytes.first_chunk::<4>()))
    })?;
    [as_sent(&words), as_meant(&words), blanked(&words, receiver)]
        .into_iter()
        .flatten()
        .next()
        .ok_or_else(|| refused(Reason::LnavSubframeWrongParity, format!("words {words:08x?}")))
}

/// Data bits as sent. The first word follows one that ended in two zeros, which the message makes so.
fn as_sent(words: &[u32; 10]) -> Option<Data> {
    let (mut d29, mut d30) = (0, 0);
    let mut out = Packer::default();
    for word in words {
        let data = if d30 == 1 { word >> 6 ^ 0x00ff_ffff } else { word >> 6 };
        if parity(data, d29, d30) != word & 0x3f {
            return None;
        }
        (d29, d30) = (word >> 1 & 1, word & 1);
        out.push(data);
    }
    Some(out.data)
}

/// Data bits as meant, parity bits as received. Where the receiver is locked half a cycle off, all parity bits are turned over,
/// those before the first word too; each depends on exactly one bit of the word before, so that they still fit.
fn as_meant(words: &[u32; 10]) -> Option<Data> {
    [0, 1].into_iter().find_map(|last| meant_after(words, last))
}

/// Data bits as meant after a word whose last two bits were received as `last`.
fn meant_after(words: &[u32; 10], last: u32) -> Option<Data> {
    let (mut d29, mut d30) = (last, last);
    let mut out = Packer::default();
    for word in words {
        if parity(word >> 6, d29, d30) != word & 0x3f {
            return None;
        }
        (d29, d30) = (word >> 1 & 1, word & 1);
        out.push(word >> 6);
    }
    Some(out.data)
}

/// Whether the receiver has blanked all parity bits and vouches for the data bits.
fn blanked(words: &[u32; 10], receiver: ReceiverCheck) -> Option<Data> {
    if receiver != ReceiverCheck::Passed || words.iter().any(|word| word & 0x3f != 0) {
        return None;
    }
    let mut out = Packer::default();
    for word in words {
        out.push(word >> 6);
    }
    Some(out.data)
}

#[derive(Default)]
struct Packer {
    data: Data,
    words: usize,
}

impl Packer {
    fn push(&mut self, word: u32) {
        let [_, bytes @ ..] = word.to_be_bytes();
        if let Some(place) = self.data.get_mut(3 * self.words..3 * self.words + 3) {
            place.copy_from_slice(&bytes);
        }
        self.words += 1;
    }
}
