//! Columns and number of fields of a kind of lines.

use super::columns::Layout;
use super::fields::Fields;
use crate::skips::Reason;

/// The columns of a kind of lines, and the number of their fields.
#[derive(Clone, Debug)]
pub(super) struct Columns<const N: usize> {
    layout: Layout<N>,
    /// Whether the log has a header for the kind.
    pub(super) from_header: bool,
    /// Number of fields.
    fields: usize,
    /// A different number of fields that waits for a second line.
    suspect: Option<usize>,
}

impl<const N: usize> Columns<N> {
    pub(super) fn new(layout: Layout<N>, from_header: bool) -> Self {
        Self { fields: layout.fields(), layout, from_header, suspect: None }
    }

    /// The used fields of a line, when it has as many fields as the header. Where the lines agree with each other but not
    /// with the header, the second one is believed. Otherwise `None` (counted).
    pub(super) fn fields_of<'a>(&mut self, line: &'a [u8], read: &mut Fields<'_>) -> Option<[&'a [u8]; N]> {
        let (values, count) = self.layout.split(line);
        if count != self.fields {
            if self.suspect != Some(count) {
                self.suspect = Some(count);
                let (kind, number, expected) = (read.kind, read.line, self.fields);
                read.skips.add_about(Reason::OtherNumberOfFields, kind, || {
                    format!("line {number}: {count} fields, {expected} expected")
                });
                return None;
            }
            self.fields = count;
        }
        self.suspect = None;
        Some(values)
    }
}
