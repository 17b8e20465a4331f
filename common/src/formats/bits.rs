//! Bit fields of messages, most significant bit first, and the checksum that RTCM 3, SBAS and Galileo share.
//!
//! Messages whose length is certain are read at places ([`unsigned`] and what builds on it); [`Bits`] reads field after field, and
//! checks each, for a message may be shorter than its type demands.

use std::f64::consts::PI;

/// `count` bits (at most 57) from bit `start` on; missing bits count as zero.
pub(super) fn unsigned(bytes: &[u8], start: usize, count: usize) -> u64 {
    let (end, first) = (start + count, start / 8);
    let last = end.div_ceil(8);
    let there = bytes.get(first..last.min(bytes.len())).unwrap_or_default();
    let gathered = there.iter().fold(0_u64, |sum, byte| sum << 8 | u64::from(*byte));
    let missing = 8 * (last - first - there.len());
    let shifted = gathered.unbounded_shl(shift(missing)) >> (8 * last - end);
    shifted & u64::MAX.unbounded_shr(shift(64_usize.saturating_sub(count)))
}

/// A number of bits to shift by; a number that does not fit shifts all bits out.
fn shift(bits: usize) -> u32 {
    u32::try_from(bits).unwrap_or(u32::MAX)
}

/// The same as a two's complement number.
pub(super) fn signed(bytes: &[u8], start: usize, count: usize) -> i64 {
    let unused = 64_usize.saturating_sub(count).min(63);
    (unsigned(bytes, start, count) << unused).cast_signed() >> unused
}

/// Copies `count` bits.
pub(super) fn copy(from: &[u8], from_bit: usize, to: &mut [u8], to_bit: usize, count: usize) {
    for k in 0..count {
        let bit = unsigned(from, from_bit + k, 1) == 1;
        let at = to_bit + k;
        if let Some(byte) = to.get_mut(at / 8) {
            let mask = 0x80 >> (at % 8);
            *byte = if bit { *byte | mask } else { *byte & !mask };
        }
    }
}

/// Turns over `count` bits from bit `start` on: those of a signal that is tracked half a cycle off.
pub(super) fn invert(bytes: &mut [u8], start: usize, count: usize) {
    for at in start..start + count {
        if let Some(byte) = bytes.get_mut(at / 8) {
            *byte ^= 0x80 >> (at % 8);
        }
    }
}

/// A number in units of 2^`exponent`, exact.
pub(super) fn scaled(value: i64, exponent: i32) -> f64 {
    value as f64 * 2_f64.powi(exponent)
}

/// A two's complement number of `count` bits from bit `start` on, in units of 2^`exponent`.
pub(super) fn number(bytes: &[u8], start: usize, count: usize, exponent: i32) -> f64 {
    scaled(signed(bytes, start, count), exponent)
}

/// A number without sign in units of 2^`exponent`.
pub(super) fn positive(bytes: &[u8], start: usize, count: usize, exponent: i32) -> f64 {
    unsigned(bytes, start, count) as f64 * 2_f64.powi(exponent)
}

/// A two's complement number in units of 2^`exponent` semicircles, in rad.
pub(super) fn angle(bytes: &[u8], start: usize, count: usize, exponent: i32) -> f64 {
    number(bytes, start, count, exponent) * PI
}

/// A number of which the first bit is the sign and the others are the magnitude, in units of 2^`exponent`.
pub(super) fn sign_magnitude(bytes: &[u8], start: usize, count: usize, exponent: i32) -> f64 {
    let magnitude = positive(bytes, start + 1, count.saturating_sub(1), exponent);
    if unsigned(bytes, start, 1) == 1 { -magnitude } else { magnitude }
}

/// 2ⁿ for n ≤ 0.
pub(super) const fn power(n: i32) -> f64 {
    let mut value = 1.0;
    let mut k = 0;
    while k > n {
        value /= 2.0;
        k -= 1;
    }
    value
}

/// Polynomial of CRC-24Q; its initial value is 0.
const CRC_POLYNOMIAL: u32 = 0x186_4cfb;

/// Checksum of each value of one byte.
const CRC_TABLE: [u32; 256] = crc_table();

const fn crc_table() -> [u32; 256] {
    let mut table = [0; 256];
    let mut index = 0;
    while index < 256 {
        #[allow(clippy::cast_possible_truncation)] // below 256
        let byte = index as u32;
        table[index] = crc_shifted(byte << 16, 8);
        index += 1;
    }
    table
}

/// A checksum that `bits` zero bits follow.
const fn crc_shifted(mut crc: u32, bits: u32) -> u32 {
    let mut bit = 0;
    while bit < bits {
        crc <<= 1;
        if crc & 0x100_0000 != 0 {
            crc ^= CRC_POLYNOMIAL;
        }
        bit += 1;
    }
    crc
}

/// CRC-24Q (RTCM 10403.3, transport layer; Galileo OS SIS ICD, 5.1.9.4).
pub(super) fn crc24q(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |crc: u32, byte| {
        // Of the four bytes the first is always zero: the checksum has 24 bits.
        let [_, high, _, _] = crc.to_be_bytes();
        (crc << 8 & 0xff_ffff) ^ CRC_TABLE.get(usize::from(high ^ byte)).copied().unwrap_or_default()
    })
}

/// CRC-24Q of the first `count` bits, which need not fill their last byte.
pub(super) fn crc24q_of_bits(bytes: &[u8], count: usize) -> u32 {
    let whole = bytes.get(..count / 8).unwrap_or(bytes);
    let rest = count % 8;
    let last = u32::try_from(unsigned(bytes, count - rest, rest)).unwrap_or_default();
    crc_shifted(crc24q(whole) ^ last << (24 - rest), shift(rest))
}

/// A message that ends before a field does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TooShort;

/// Bits of a message, first bit of the first byte first.
#[derive(Clone, Debug)]
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    position: usize,
}

impl<'a> Bits<'a> {
    /// Starts at the first bit.
    pub(super) const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, position: 0 }
    }

    /// The next `width` bits (at most 32) as an unsigned number.
    pub(super) fn unsigned(&mut self, width: usize) -> Result<u32, TooShort> {
        let end = self.position + width;
        if end > 8 * self.bytes.len() {
            return Err(TooShort);
        }
        let value = u32::try_from(unsigned(self.bytes, self.position, width)).map_err(|_| TooShort)?;
        self.position = end;
        Ok(value)
    }

    /// The next `width` bits (1 to 32) as a number in two's complement.
    pub(super) fn signed(&mut self, width: usize) -> Result<i32, TooShort> {
        let raw = self.unsigned(width)?;
        let unused = 32_usize.saturating_sub(width);
        Ok((raw << unused).cast_signed() >> unused)
    }

    /// One bit.
    pub(super) fn flag(&mut self) -> Result<bool, TooShort> {
        Ok(self.unsigned(1)? == 1)
    }

    /// An unsigned number times a scale factor.
    pub(super) fn scaled_unsigned(&mut self, width: usize, scale: f64) -> Result<f64, TooShort> {
        Ok(f64::from(self.unsigned(width)?) * scale)
    }

    /// A number in two's complement times a scale factor.
    pub(super) fn scaled(&mut self, width: usize, scale: f64) -> Result<f64, TooShort> {
        Ok(f64::from(self.signed(width)?) * scale)
    }

    /// The next `width` bits (33 to 64) as a number in two's complement.
    pub(super) fn signed_long(&mut self, width: usize) -> Result<i64, TooShort> {
        let high = i64::from(self.signed(width.saturating_sub(32))?);
        Ok(high << 32 | i64::from(self.unsigned(32)?))
    }

    /// The next `width` bits (2 to 32) as a sign, 1 = negative, and a magnitude, times a scale factor (GLONASS).
    pub(super) fn sign_magnitude(&mut self, width: usize, scale: f64) -> Result<f64, TooShort> {
        let sign = if self.flag()? { -1.0 } else { 1.0 };
        Ok(sign * self.scaled_unsigned(width.saturating_sub(1), scale)?)
    }

    /// Passes over bits.
    pub(super) fn skip(&mut self, width: usize) {
        self.position += width;
    }

    /// The positions of the ones among the next `width` bits, counted from 1 as the standard's masks are.
    pub(super) fn mask(&mut self, width: u8) -> Result<Vec<u8>, TooShort> {
        let mut set = Vec::new();
        for number in 1..=width {
            if self.flag()? {
                set.push(number);
            }
        }
        Ok(set)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_stand_at_places() {
        let bytes = [0b1010_0011, 0b1100_0001, 0xff];
        assert_eq!(unsigned(&bytes, 0, 3), 0b101);
        assert_eq!(unsigned(&bytes, 4, 8), 0b0011_1100);
        assert_eq!(signed(&bytes, 8, 4), -4);
        assert_eq!(signed(&bytes, 12, 4), 1);
        assert_eq!(signed(&bytes, 16, 16), -256, "bits beyond the end are zero");
        assert_eq!(signed(&bytes, 5, 0), 0);
        assert_eq!((sign_magnitude(&bytes, 0, 4, -1), sign_magnitude(&bytes, 1, 4, 0)), (-1.0, 4.0));
        let mut copied = [0xff; 2];
        copy(&bytes, 4, &mut copied, 3, 8);
        assert_eq!(copied, [0b1110_0111, 0b1001_1111]);
        invert(&mut copied, 7, 2);
        assert_eq!(copied, [0b1110_0110, 0b0001_1111]);
    }

    /// A 1005 message of the RTCM 10403.1 standard's annex: header, 19 bytes, CRC.
    #[test]
    fn crc_of_a_published_message() {
        let message = [
            0xd3, 0x00, 0x13, 0x3e, 0xd7, 0xd3, 0x02, 0x02, 0x98, 0x0e, 0xde, 0xef, 0x34, 0xb4, 0xbd, 0x62,
            0xac, 0x09, 0x41, 0x98, 0x6f, 0x33,
        ];
        assert_eq!(crc24q(&message), 0x0036_0b98);
        let complete = [&message[..], &[0x36, 0x0b, 0x98]].concat();
        assert_eq!(crc24q(&complete), 0);
        // Bits that are zero before the first one change nothing.
        for shift in 0..8 {
            let mut shifted = [0; 23];
            copy(&message, 0, &mut shifted, shift, 8 * message.len());
            assert_eq!(crc24q_of_bits(&shifted, shift + 8 * message.len()), 0x0036_0b98, "{shift}");
        }
    }

    #[test]
    fn long_and_sign_magnitude_numbers() {
        let mut bits = Bits::new(&[0xff, 0xff, 0xff, 0xff, 0b1111_1010, 0b1000_0101, 0]);
        assert_eq!(bits.signed_long(38), Ok(-2));
        assert_eq!(bits.sign_magnitude(4, 0.5), Ok(-1.0), "1010 is minus two");
        assert_eq!(bits.sign_magnitude(6, 1.0), Ok(5.0));
        let mut bits = Bits::new(&[0b0100_0000, 0, 0, 0, 0b0000_0100]);
        assert_eq!(bits.signed_long(38), Ok((1 << 36) + 1));
    }

    #[test]
    fn fields_cross_bytes_and_keep_their_sign() {
        let mut bits = Bits::new(&[0b1010_0111, 0b1100_0000, 0b0000_0001, 0xff, 0xff, 0xff, 0xff]);
        assert_eq!(bits.unsigned(3), Ok(0b101));
        assert_eq!(bits.signed(5), Ok(0b00111));
        assert_eq!(bits.signed(3), Ok(-2));
        assert_eq!(bits.unsigned(13), Ok(1));
        assert_eq!(bits.signed(32), Ok(-1));
        assert_eq!(bits.unsigned(1), Err(TooShort));
        assert_eq!(Bits::new(&[0b1000_0010]).mask(8), Ok(vec![1, 7]));
        assert_eq!(Bits::new(&[0; 2]).mask(17), Err(TooShort));
    }
}
