//! The ten words of a BeiDou D1 or D2 subframe and their BCH code (BDS-SIS-ICD-B1I 3.0, 5.1.3).
//!
//! A word carries two blocks of 11 data bits with 4 check bits each, of the code with the generator X⁴ + X + 1. The satellite
//! sends the blocks' bits alternately. Word 1 has 15 bits without check bits (the preamble among them) and then one block.

use super::words::{SUBFRAME_BYTES, upright};
use super::{ReceiverCheck, Refused, refused};
use crate::formats::bits::{copy, unsigned};
use crate::skips::Reason;

/// The preamble, and its number of bits.
const PREAMBLE: (u32, u32) = (0x712, 11);
/// X⁴ + X + 1.
const GENERATOR: u32 = 0b1_0011;
const BLOCK_BITS: u32 = 15;
/// Data bits of word 1, and of another word.
const FIRST_DATA: usize = 26;
const DATA: usize = 22;

/// The 224 data bits of a subframe, check bits removed: 26 of word 1 and 22 of each other.
pub(super) type Data = [u8; 28];

/// Reads a subframe of whose words the first `used` have data; the check bits of the others do not matter. Receivers give
/// words as they are sent, or with the blocks taken apart: data bits in order, then the check bits of the first block and
/// those of the second. The code tells which of the two it is.
pub(super) fn data(bytes: &[u8], used: usize, receiver: ReceiverCheck) -> Result<Data, Refused> {
    let Some(bytes) = bytes.first_chunk::<SUBFRAME_BYTES>().filter(|_| bytes.len() == SUBFRAME_BYTES) else {
        let detail = format!("{} bytes, {SUBFRAME_BYTES} expected", bytes.len());
        return Err(refused(Reason::BeidouSubframeWrongLength, detail));
    };
    let words = upright(bytes, PREAMBLE).ok_or_else(|| {
        refused(
            Reason::BeidouSubframeWithoutPreamble,
            format!("first bytes {:02x?}", bytes.first_chunk::<4>()),
        )
    })?;
    let is_apart = |words: [u32; 10]| words.iter().take(used).enumerate().all(|(k, w)| is_right(k, *w));
    // Tracked half a cycle off, data bits may be put right and check bits not.
    let with_checks_turned = |mut words: [u32; 10]| {
        words.iter_mut().enumerate().for_each(|(k, word)| *word ^= if k == 0 { 0xf } else { 0xff });
        words
    };
    let taken_apart = |words: [u32; 10]| is_apart(words) || is_apart(with_checks_turned(words));
    let blanked = receiver == ReceiverCheck::Passed
        && words.iter().take(used).enumerate().all(|(k, word)| word & if k == 0 { 0xf } else { 0xff } == 0);
    if blanked || taken_apart(words) {
        return Ok(packed(&words));
    }
    let [first, rest @ ..] = words;
    let mut sent = [first; 10];
    for (apart, word) in sent.iter_mut().skip(1).zip(rest) {
        *apart = apart_of(word);
    }
    if taken_apart(sent) {
        return Ok(packed(&sent));
    }
    Err(refused(Reason::BeidouSubframeWrongCheckBits, format!("words {words:08x?}")))
}

/// Whether the check bits of word `index` (from 0), taken apart, fit.
fn is_right(index: usize, word: u32) -> bool {
    if index == 0 {
        return remainder(word & 0x7fff) == 0;
    }
    let (first, second) = (word >> 19, word >> 8 & 0x7ff);
    remainder(first << 4 | word >> 4 & 0xf) == 0 && remainder(second << 4 | word & 0xf) == 0
}

/// Remainder of a block of 15 bits by the generator.
const fn remainder(block: u32) -> u32 {
    let mut rest = block;
    let mut bit = BLOCK_BITS;
    while bit > 4 {
        bit -= 1;
        if rest >> bit & 1 == 1 {
            rest ^= GENERATOR << (bit - 4);
        }
    }
    rest
}

/// A word as sent with its blocks taken apart.
fn apart_of(word: u32) -> u32 {
    let every_second =
        |from: u32| (0..BLOCK_BITS).fold(0, |block, k| block << 1 | word >> (from - 2 * k) & 1);
    let (first, second) = (every_second(29), every_second(28));
    (first >> 4) << 19 | (second >> 4) << 8 | (first & 0xf) << 4 | second & 0xf
}

fn packed(words: &[u32; 10]) -> Data {
    let mut data = Data::default();
    let mut at = 0;
    for word in words {
        let count = if at == 0 { FIRST_DATA } else { DATA };
        // A word has 30 bits in four bytes.
        copy(&word.to_be_bytes(), 2, &mut data, at, count);
        at += count;
    }
    data
}

/// Number of the subframe (`FraID`).
pub(super) fn number(data: &Data) -> u64 {
    unsigned(data, 15, 3)
}

/// Seconds of the BeiDou week (SOW) of the beginning of a D1 subframe, or of the D2 frame that a subframe is in.
pub(super) fn seconds_of_week(data: &Data) -> u64 {
    unsigned(data, 18, 20)
}
