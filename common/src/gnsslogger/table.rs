//! Columns and their number.

use super::columns::Layout;

/// The columns of a kind of line, and how many fields its lines have.
#[derive(Clone, Debug)]
pub(super) struct Columns<const N: usize> {
    layout: Layout<N>,
    /// The log has a header for it.
    pub(super) from_header: bool,
    /// Number of fields.
    pub(super) fields: usize,
    /// A different number of fields that waits for a second line.
    suspect: Option<usize>,
}

impl<const N: usize> Columns<N> {
    pub(super) fn new(layout: Layout<N>, from_header: bool) -> Self {
        Self { fields: layout.fields(), layout, from_header, suspect: None }
    }

    /// The used fields of a line, when it has as many fields as the header. Where the lines agree with each other but not
    /// with the header, the second one is believed. Otherwise the number that was found.
    pub(super) fn split<'a>(&mut self, line: &'a [u8]) -> Result<[&'a [u8]; N], usize> {
        let (values, count) = self.layout.split(line);
        if count != self.fields {
            if self.suspect != Some(count) {
                self.suspect = Some(count);
                return Err(count);
            }
            self.fields = count;
        }
        self.suspect = None;
        Ok(values)
    }
}
