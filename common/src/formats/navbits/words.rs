//! Subframes of ten words of 30 bits, which GPS, QZSS and BeiDou have (LNAV; D1 and D2).

/// Bytes of a subframe as Android gives it: ten words of 30 bits, each in four bytes.
pub(super) const SUBFRAME_BYTES: usize = 40;
/// All bits of a word.
const WORD: u32 = 0x3fff_ffff;
const WORD_BITS: u32 = 30;

/// Words of 30 bits with the preamble (of `length` bits) in front, whichever end of the four bytes they are at and whichever
/// sign they have.
pub(super) fn upright(bytes: &[u8; SUBFRAME_BYTES], (preamble, length): (u32, u32)) -> Option<[u32; 10]> {
    let mut raw = [0_u32; 10];
    for (word, four) in raw.iter_mut().zip(bytes.as_chunks::<4>().0) {
        *word = u32::from_be_bytes(*four);
    }
    let low = raw.map(|word| word & WORD);
    let high = raw.map(|word| word >> 2);
    [low, high, low.map(|w| w ^ WORD), high.map(|w| w ^ WORD)]
        .into_iter()
        .find(|words| words.first().is_some_and(|word| word >> (WORD_BITS - length) == preamble))
}
