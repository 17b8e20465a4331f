//! Whole numbers in text, also where a tool has made floating-point numbers of them.
//!
//! A column of whole numbers with blanks becomes one of doubles in many tools, and those print `5.0`, or from 10¹⁶ on
//! `1.3037709439996923e+18`. Such a text is taken as the decimal number that it is, exactly.

/// Most digits of a number that are read; an `i64` has 19, and tools print at most 20 behind the point.
const MOST_DIGITS: usize = 38;
/// Any number of this many digits is below 2⁶³.
const DIGITS_THAT_FIT: usize = 18;

/// Reads a whole number in any decimal notation. `None` if the text is no number, has a fraction, or does not fit in 64 bits.
#[inline]
pub(crate) fn integer(text: &str) -> Option<i64> {
    of_bytes(text.as_bytes())
}

/// The same for bytes that need not be text.
#[inline]
pub(crate) fn of_bytes(field: &[u8]) -> Option<i64> {
    digits(field).or_else(|| {
        let text = std::str::from_utf8(field).ok()?;
        text.parse().ok().or_else(|| decimal(text))
    })
}

/// The same for up to 18 digits with an optional minus, which nearly all numbers in logs are.
#[inline]
fn digits(field: &[u8]) -> Option<i64> {
    let (sign, digits) = match field {
        [b'-', digits @ ..] => (-1, digits),
        digits => (1, digits),
    };
    if digits.is_empty() || digits.len() > DIGITS_THAT_FIT {
        return None;
    }
    let mut value = 0;
    for byte in digits {
        let digit = byte.wrapping_sub(b'0');
        if digit > 9 {
            return None;
        }
        value = value * 10 + i64::from(digit);
    }
    Some(sign * value)
}

fn decimal(text: &str) -> Option<i64> {
    let (is_negative, magnitude) = match text.as_bytes().first()? {
        b'-' => (true, text.get(1..)?),
        b'+' => (false, text.get(1..)?),
        _ => (false, text),
    };
    let (mantissa, exponent) = match magnitude.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse::<i64>().ok()?),
        None => (magnitude, 0),
    };
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    if whole.is_empty() && fraction.is_empty() {
        return None;
    }
    let fraction_digits = i64::try_from(fraction.len()).ok()?;
    let digits = format!("{whole}{fraction}");
    if !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    // Zeros at the end belong to the exponent.
    let significant = digits.trim_end_matches('0');
    let zeros = i64::try_from(digits.len() - significant.len()).ok()?;
    let significant = significant.trim_start_matches('0');
    if significant.is_empty() {
        return Some(0);
    }
    if significant.len() > MOST_DIGITS {
        return None;
    }
    let power = exponent.checked_sub(fraction_digits)?.checked_add(zeros)?;
    // A negative power of ten leaves a fraction.
    let power = u32::try_from(power).ok()?;
    let value = significant.parse::<i128>().ok()?.checked_mul(10_i128.checked_pow(power)?)?;
    i64::try_from(if is_negative { -value } else { value }).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn whole_numbers_in_every_notation() {
        for (text, value) in [
            ("1303770943999692247", Some(1_303_770_943_999_692_247)),
            ("1.3037709439996923e+18", Some(1_303_770_943_999_692_300)),
            ("-1.303768821813692e18", Some(-1_303_768_821_813_692_000)),
            ("1.2771216E18", Some(1_277_121_600_000_000_000)),
            ("1303770943999692288.000", Some(1_303_770_943_999_692_288)),
            ("16397.0", Some(16_397)),
            ("3.2e1", Some(32)),
            ("32e0", Some(32)),
            ("320e-1", Some(32)),
            ("0.0320E+03", Some(32)),
            (".5e1", Some(5)),
            ("5.", Some(5)),
            ("+5.0", Some(5)),
            ("-0.0", Some(0)),
            ("0e99", Some(0)),
            ("9223372036854775807.0", Some(i64::MAX)),
            ("-9223372036854775808.0", Some(i64::MIN)),
            ("9223372036854775808", None),
            ("1e19", None),
            ("1e400", None),
            ("1e9223372036854775807", None),
            ("1e-9223372036854775808", None),
            ("1.5", None),
            ("1e-1", None),
            ("", None),
            (".", None),
            ("-", None),
            ("e5", None),
            ("1e", None),
            ("1e+", None),
            ("1.2.3", None),
            ("1 0", None),
            ("--1", None),
            ("-+1.0", None),
            ("1_0.0", None),
            ("0x10", None),
            ("nan", None),
            ("NaN", None),
            ("inf", None),
            ("-Infinity", None),
            ("١", None),
        ] {
            assert_eq!(integer(text), value, "'{text}'");
        }
    }

    proptest! {
        #[test]
        fn what_a_double_holds_comes_back(value in -(1_i64 << 53)..1_i64 << 53) {
            let double = value as f64;
            for text in [value.to_string(), format!("{double:?}"), format!("{double:e}"), format!("{double:.3}")] {
                prop_assert_eq!(integer(&text), Some(value), "{}", text);
            }
        }

        #[test]
        fn no_text_is_a_panic(text in "[-+0-9.eE ]{0,30}|.{0,40}") {
            let _ = integer(&text);
        }
    }
}
