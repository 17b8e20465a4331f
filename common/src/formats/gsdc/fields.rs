//! The fields of a row as numbers.

use crate::skips::Reason;
use std::ops::RangeInclusive;

use super::columns::{Columns, Optional, Required};
use crate::formats::android;
use crate::formats::integer::integer;

/// Highest time that a 64-bit count of nanoseconds since 1980 leaves room to calculate with.
pub(super) const MAX_NANOS: i64 = i64::MAX / 2;

/// Reason why a row gives no observation.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    /// Reason to count under.
    pub(super) reason: Reason,
    /// Column and value.
    pub(super) detail: String,
}

/// A row's fields by column.
pub(super) struct Fields<'a> {
    pub(super) columns: &'a Columns,
    pub(super) fields: &'a [&'a str],
}

impl Fields<'_> {
    pub(super) fn text(&self, column: Required) -> &str {
        self.columns.required(self.fields, column)
    }

    /// A number that must be there, and within bounds.
    pub(super) fn number(&self, column: Required, bounds: RangeInclusive<f64>) -> Result<f64, Fault> {
        let text = self.text(column);
        let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
        let name = self.columns.name(column);
        let value = value.ok_or_else(|| Fault {
            reason: Reason::ValueMissing,
            detail: format!("{name} '{}'", shorten(text)),
        })?;
        if bounds.contains(&value) {
            return Ok(value);
        }
        Err(Fault {
            reason: Reason::ImpossibleValue,
            detail: format!("{name} = {value}, limits {} to {}", bounds.start(), bounds.end()),
        })
    }

    pub(super) fn symmetric(&self, column: Required, limit: f64) -> Result<f64, Fault> {
        self.number(column, -limit..=limit)
    }

    /// A whole number of nanoseconds or milliseconds.
    pub(super) fn count(&self, column: Required, limit: i64) -> Result<i64, Fault> {
        let text = self.text(column);
        let value = integer(text).filter(|value| (0..=limit).contains(value));
        value.ok_or_else(|| Fault {
            reason: Reason::TimeMissing,
            detail: format!("{} '{}'", self.columns.name(column), shorten(text)),
        })
    }

    /// A number where there is one.
    pub(super) fn optional(&self, column: Optional) -> Option<f64> {
        self.columns.optional(self.fields, column).parse().ok().filter(|value: &f64| value.is_finite())
    }

    /// A word of bits where there is one.
    pub(super) fn bits(&self, column: Optional) -> Option<u32> {
        integer(self.columns.optional(self.fields, column)).and_then(android::bits)
    }
}

/// The beginning of a text, for messages.
pub(super) fn shorten(text: &str) -> String {
    text.chars().take(40).collect()
}
