//! Reads big-endian bit fields. Every read is checked: a message may be shorter than its type demands.

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
        let bytes = self.bytes.get(self.position / 8..end.div_ceil(8)).ok_or(TooShort)?;
        let gathered = bytes.iter().fold(0_u64, |sum, byte| sum << 8 | u64::from(*byte));
        let shifted = gathered >> (end.div_ceil(8) * 8 - end);
        self.position = end;
        let mask = (1_u64 << width.min(32)) - 1;
        u32::try_from(shifted & mask).map_err(|_| TooShort)
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
