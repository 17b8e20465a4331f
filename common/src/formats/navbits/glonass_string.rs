//! Strings of the GLONASS navigation message, 85 bits each, and their Hamming code (GLONASS ICD, L1 and L2, edition 5.1, 4.3 and 4.7).

use super::{ReceiverCheck, Refused, refused};
use crate::formats::bits::{copy, invert, unsigned};
use crate::skips::Reason;

/// Bytes of a string as Android gives it.
pub(super) const STRING_BYTES: usize = 11;
/// Bits of a string. The ICD numbers them from 85, which comes first, to 1.
const BITS: usize = 85;
/// The lowest are check bits: seven of a Hamming code, and one that makes the number of ones even.
const CHECK_BITS: usize = 8;
/// Bits that a string leaves over in its bytes.
const SPARE: usize = 8 * STRING_BYTES - BITS;

/// A string, bit 85 first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct GlonassString([u8; STRING_BYTES]);

impl GlonassString {
    /// Reads a string. It may be at either end of its bytes; which one the check bits tell, or `number` where a receiver that vouches
    /// for the string has blanked them. That is the number by which the phone calls it. All bits may be turned over, as where a
    /// signal is tracked half a cycle off; bit 85, which is 0, tells, with the check bits and the number.
    pub(super) fn read(bytes: &[u8], number: Option<u8>, receiver: ReceiverCheck) -> Result<Self, Refused> {
        if bytes.len() != STRING_BYTES {
            let detail = format!("{} bytes, {STRING_BYTES} expected", bytes.len());
            return Err(refused(Reason::GlonassStringWrongLength, detail));
        }
        let as_called = |string: &Self| number.is_none_or(|number| string.number() == u64::from(number));
        let is_usable = |string: &Self| {
            string.is_right() || receiver == ReceiverCheck::Passed && string.is_blanked() && number.is_some()
        };
        let usable = || {
            let plain = [0, SPARE].into_iter().filter_map(|from| Self::at(bytes, from)).filter(is_usable);
            let inverted = [0, SPARE].into_iter().filter_map(|from| Self::inverted_at(bytes, from));
            plain.chain(inverted.filter(|string| string.is_right() && number.is_some() && as_called(string)))
        };
        usable().find(as_called).ok_or_else(|| {
            let reason = match usable().next() {
                Some(_) => Reason::GlonassStringOfOtherNumber,
                None => Reason::GlonassStringWrongCheckBits,
            };
            refused(reason, format!("{bytes:02x?}, string {number:?}"))
        })
    }

    /// The string from bit `from` of the bytes on; `None` unless the bits left over and bit 85 are zero.
    fn at(bytes: &[u8], from: usize) -> Option<Self> {
        let spare = if from == 0 { BITS } else { 0 };
        if unsigned(bytes, spare, SPARE) != 0 || unsigned(bytes, from, 1) != 0 {
            return None;
        }
        let mut string = [0; STRING_BYTES];
        copy(bytes, from, &mut string, 0, BITS);
        Some(Self(string))
    }

    /// The string with all its bits turned over. Those left over are zero, or in front of it turned over too: a damaged string
    /// may pass for one at the other end otherwise.
    fn inverted_at(bytes: &[u8], from: usize) -> Option<Self> {
        let mut upright = <[u8; STRING_BYTES]>::try_from(bytes).ok()?;
        invert(&mut upright, from, BITS);
        let spare = if from == 0 { BITS } else { 0 };
        if from != 0 || unsigned(&upright, spare, SPARE) != 0 {
            invert(&mut upright, spare, SPARE);
        }
        Self::at(&upright, from)
    }

    /// Bits `high` to `low` by the ICD's numbers.
    pub(super) fn field(&self, high: usize, low: usize) -> u64 {
        unsigned(&self.0, BITS - high, high + 1 - low)
    }

    /// The same as a number whose highest bit is its sign, in units of 2^`exponent`.
    pub(super) fn signed(&self, high: usize, low: usize, exponent: i32) -> f64 {
        crate::formats::bits::sign_magnitude(&self.0, BITS - high, high + 1 - low, exponent)
    }

    /// Number of the string in its frame.
    pub(super) fn number(&self) -> u64 {
        self.field(84, 81)
    }

    fn bit(&self, number: usize) -> bool {
        self.field(number, number) == 1
    }

    /// Whether no check bit contradicts. A Hamming code's data bits stand at the places 3, 5, 6, 7, 9, … that are no powers
    /// of two, and its check bits at those that are; then the places of all ones cancel.
    fn is_right(&self) -> bool {
        let data_places = (3_usize..).filter(|place| !place.is_power_of_two());
        let check_places = (0..).map(|k| 1_usize << k);
        let places = check_places.take(CHECK_BITS - 1).zip(1..).chain(data_places.zip(CHECK_BITS + 1..=BITS));
        let sum = places.filter(|(_, bit)| self.bit(*bit)).fold(0, |sum, (place, _)| sum ^ place);
        let ones: u32 = self.0.iter().map(|byte| byte.count_ones()).sum();
        sum == 0 && ones.is_multiple_of(2)
    }

    fn is_blanked(&self) -> bool {
        self.field(CHECK_BITS, 1) == 0
    }
}
