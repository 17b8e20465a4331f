//! Numbers in fixed columns, exact to the printed digits, and dates of such numbers.

use crate::time::Calendar;

/// Content of an F14.3 field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Thousandths {
    /// Nothing there.
    Blank,
    /// The number times 1000; below 2⁵³, so that one division gives the correctly rounded value.
    Value(i64),
    /// Not a number as F14.3 prints it.
    Bad,
}

/// Reads an F14.3 field. The decimal point must be in its column and three digits must follow, so that a lost
/// or an inserted byte is noticed instead of shifting digits into a neighbouring number.
#[inline]
pub(super) fn thousandths(field: &[u8; 14]) -> Thousandths {
    let [integral @ .., point, d1, d2, d3] = field;
    if *point != b'.' {
        let blank = field.iter().all(|b| *b == b' ');
        return if blank { Thousandths::Blank } else { Thousandths::Bad };
    }
    let start = integral.iter().position(|b| *b != b' ').unwrap_or(integral.len());
    let digits = integral.get(start..).unwrap_or_default();
    let (negative, digits) = match digits.split_first() {
        Some((b'-', rest)) => (true, rest),
        _ => (false, digits),
    };
    let mut value = 0_i64;
    let mut worst = 0_u8;
    for byte in digits.iter().chain([d1, d2, d3]) {
        let digit = byte.wrapping_sub(b'0');
        worst = worst.max(digit);
        value = value * 10 + i64::from(digit);
    }
    if worst > 9 {
        return Thousandths::Bad;
    }
    Thousandths::Value(if negative { -value } else { value })
}

/// Reads a finite number, correctly rounded; `None` when the text is no such number. No blanks are allowed.
#[inline]
pub(crate) fn finite(field: &[u8]) -> Option<f64> {
    lexical_core::parse::<f64>(field).ok().filter(|value| value.is_finite())
}

/// Reads a real number with surrounding blanks and, where given, an exponent after E or D. `None` when blank,
/// not a number or not finite.
pub(crate) fn real(field: &[u8]) -> Option<f64> {
    const LONGEST: usize = 32;
    let field = field.trim_ascii();
    if !field.iter().any(|byte| matches!(byte, b'D' | b'd')) {
        return finite(field);
    }
    let mut buffer = [0_u8; LONGEST];
    let copy = buffer.get_mut(..field.len())?;
    for (to, from) in copy.iter_mut().zip(field) {
        *to = if matches!(from, b'D' | b'd') { b'e' } else { *from };
    }
    finite(copy)
}

/// Reads an integer with surrounding blanks. `None` when blank or not an integer.
pub(crate) fn integer(field: &[u8]) -> Option<i64> {
    std::str::from_utf8(field.trim_ascii()).ok()?.parse().ok()
}

/// Reads a date and time from the fields of month, day, hour, minute and second. The year is read before: files have two or four digits.
pub(crate) fn calendar(year: Option<i32>, fields: [&[u8]; 5]) -> Option<Calendar> {
    let [month, day, hour, minute, second] = fields;
    let small = |field: &[u8]| integer(field).and_then(|value| u32::try_from(value).ok());
    Some(Calendar {
        year: year?,
        month: small(month)?,
        day: small(day)?,
        hour: small(hour)?,
        minute: small(minute)?,
        second: real(second)?,
    })
}

/// Reads a year of four digits.
pub(crate) fn year(field: &[u8]) -> Option<i32> {
    integer(field).and_then(|year| i32::try_from(year).ok())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn fields_are_strict() {
        let read = |text: &str| thousandths(text.as_bytes().try_into().unwrap());
        assert_eq!(read("  21111612.436"), Thousandths::Value(21_111_612_436));
        assert_eq!(read("        -0.001"), Thousandths::Value(-1));
        assert_eq!(read("          .500"), Thousandths::Value(500));
        assert_eq!(read("              "), Thousandths::Blank);
        for bad in [
            "  2111161.436 ",
            "  2111161 .436",
            "  21111612.4  ",
            "           NaN",
            "  2-111612.436",
            "+ 21111612.436",
        ] {
            assert_eq!(read(&bad[..14]), Thousandths::Bad, "{bad}");
        }
    }

    #[test]
    fn reals_take_fortran_exponents_and_refuse_words() {
        assert_eq!(real(b" 1.5D-03 "), Some(1.5e-3));
        assert_eq!(real(b".999999999999e+09"), Some(0.999999999999e9));
        assert_eq!(real(b"-9.300000000000e-09"), Some(-9.3e-9));
        for bad in [&b"nan"[..], b"inf", b"", b"   ", b"1e999", b"1 2", b"0x10"] {
            assert_eq!(real(bad), None);
        }
    }

    proptest! {
        /// The standard library's reading is the reference; words for what is no finite number are refused by both.
        #[test]
        fn numbers_are_those_of_the_standard_library(text in "[-+]?[0-9]{0,20}[.]?[0-9]{0,20}([eE][-+]?[0-9]{0,4})?|[-+.0-9eE]{0,8}") {
            let expected = text.parse::<f64>().ok().filter(|value| value.is_finite());
            prop_assert_eq!(finite(text.as_bytes()).map(f64::to_bits), expected.map(f64::to_bits), "'{}'", text);
        }

        #[test]
        fn printed_values_come_back_exactly(value in -999_999_999_999_i64..9_999_999_999_999) {
            let printed = format!("{:14.3}", value as f64 / 1000.0);
            let field = printed.as_bytes().try_into().unwrap();
            prop_assert_eq!(thousandths(field), Thousandths::Value(value));
            prop_assert_eq!(value as f64 / 1000.0, printed.trim().parse::<f64>().unwrap());
        }
    }
}
