//! Bit fields of a message, most significant bit first.

use std::f64::consts::PI;

/// `count` bits (at most 64) from bit `start` on; missing bits count as zero.
pub(super) fn unsigned(bytes: &[u8], start: usize, count: usize) -> u64 {
    (start..start + count).fold(0, |value, at| {
        let byte = bytes.get(at / 8).copied().unwrap_or(0);
        value << 1 | u64::from(byte >> (7 - at % 8) & 1)
    })
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

/// CRC-24Q (RTCM 10403, Galileo OS SIS ICD 5.1.9.4) of the first `count` bits.
pub(super) fn crc24q(bytes: &[u8], count: usize) -> u32 {
    const POLYNOMIAL: u32 = 0x0186_4cfb;
    (0..count).fold(0, |crc, at| {
        let bit = u32::from(unsigned(bytes, at, 1) == 1);
        let shifted = (crc << 1) ^ (bit << 24);
        if shifted & 0x0100_0000 == 0 { shifted } else { shifted ^ POLYNOMIAL }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_cross_bytes() {
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
        assert_eq!(crc24q(&message, 8 * message.len()), 0x0036_0b98);
    }
}
