//! Numbers of a line.

use crate::formats::text::shorten;
use crate::formats::{android, decimal};
use crate::skips::{Reason, Skips};

/// Reads the fields of a line as numbers, and counts those that cannot be read.
pub(super) struct Fields<'a> {
    /// Kind of line, such as "Raw line", for messages.
    pub(super) kind: &'static str,
    /// Line number.
    pub(super) line: u64,
    /// Counts of unreadable fields.
    pub(super) skips: &'a mut Skips,
}

impl Fields<'_> {
    /// A number that must be there; the line is lost without it.
    #[inline]
    pub(super) fn required<T>(
        &mut self,
        name: &str,
        field: &[u8],
        read: fn(&[u8]) -> Option<T>,
    ) -> Option<T> {
        let value = read(field);
        if value.is_none() {
            let (kind, line) = (self.kind, self.line);
            let reason =
                if field.is_empty() { Reason::NeededValueMissing } else { Reason::NeededValueUnreadable };
            self.skips.add_within(kind, reason, || format!("line {line}: {name} is '{}'", shorten(field)));
        }
        value
    }

    /// Counts a line or one of its values as refused.
    pub(super) fn refuse(&mut self, reason: Reason, describe: impl FnOnce() -> String) {
        let (kind, line) = (self.kind, self.line);
        self.skips.add_within(kind, reason, || format!("line {line}: {}", describe()));
    }

    /// A number that may be missing.
    #[inline]
    pub(super) fn optional<T>(
        &mut self,
        name: &str,
        field: &[u8],
        read: fn(&[u8]) -> Option<T>,
    ) -> Option<T> {
        if field.is_empty() {
            return None;
        }
        let value = read(field);
        if value.is_none() {
            let (kind, line) = (self.kind, self.line);
            self.skips.add_within(kind, Reason::ValueUnreadable, || {
                format!("line {line}: {name} is '{}'", shorten(field))
            });
        }
        value
    }
}

/// An integer in any notation of tools.
#[inline]
pub(super) fn integer(field: &[u8]) -> Option<i64> {
    crate::formats::integer::of_bytes(field)
}

/// A word of bits.
pub(super) fn bits(field: &[u8]) -> Option<u32> {
    integer(field).and_then(android::bits)
}

/// Yes or no, as 1 or 0.
pub(super) fn flag(field: &[u8]) -> Option<bool> {
    if field.eq_ignore_ascii_case(b"true") {
        return Some(true);
    }
    if field.eq_ignore_ascii_case(b"false") {
        return Some(false);
    }
    match integer(field)? {
        1 => Some(true),
        0 => Some(false),
        _ => None,
    }
}

/// A real number; neither NaN nor infinite.
#[inline]
pub(super) fn real(field: &[u8]) -> Option<f64> {
    decimal::finite(field)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn java_numbers() {
        assert_eq!(real(b"-9.876E-4"), Some(-9.876e-4));
        assert_eq!(real(b"340282346638528860000000000000000000000"), Some(f64::from(f32::MAX)));
        for bad in [&b"NaN"[..], b"Infinity", b"", b"1,5", b"\xff"] {
            assert_eq!(real(bad), None);
        }
        assert_eq!(integer(b"-1383435750910273353"), Some(-1_383_435_750_910_273_353));
        assert_eq!(integer(b"99999999999999999999"), None);
        assert_eq!(bits(b"-1"), Some(u32::MAX));
        assert_eq!((flag(b"1"), flag(b"false"), flag(b"2")), (Some(true), Some(false), None));
        assert_eq!(bits(b"65551"), Some(65_551));
        assert_eq!((bits(b"1.6397e+04"), bits(b"16397.0"), bits(b"1.5")), (Some(16_397), Some(16_397), None));
        assert_eq!((flag(b"1.0"), flag(b"False"), flag(b"")), (Some(true), Some(false), None));
    }
}
