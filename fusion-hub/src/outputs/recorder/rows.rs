//! Rows of one entity, collected in memory until a segment of the file is written.

/// A time series in which a value may end: the first row without a value is kept as an empty one, which
/// makes viewers clear the old value (or break the line) instead of holding it.
#[derive(Debug)]
pub(super) struct Rows<T> {
    times_ns: Vec<i64>,
    lengths: Vec<usize>,
    values: Vec<T>,
    holds_value: bool,
}

/// A segment taken out of [`Rows`]: one time and one length (0 or 1) per row, and the values.
pub(super) struct Segment<T> {
    pub times_ns: Vec<i64>,
    pub lengths: Vec<usize>,
    pub values: Vec<T>,
}

impl<T> Default for Rows<T> {
    fn default() -> Self {
        Self { times_ns: Vec::new(), lengths: Vec::new(), values: Vec::new(), holds_value: false }
    }
}

impl<T> Rows<T> {
    /// Adds a row.
    pub fn push(&mut self, time_ns: i64, value: Option<T>) {
        if value.is_none() && !self.holds_value {
            return;
        }
        self.holds_value = value.is_some();
        self.times_ns.push(time_ns);
        self.lengths.push(usize::from(value.is_some()));
        self.values.extend(value);
    }

    /// Takes the rows collected since the last call; `None` when there are none.
    pub fn take_segment(&mut self) -> Option<Segment<T>> {
        if self.times_ns.is_empty() {
            return None;
        }
        Some(Segment {
            times_ns: std::mem::take(&mut self.times_ns),
            lengths: std::mem::take(&mut self.lengths),
            values: std::mem::take(&mut self.values),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_ends_leaves_one_empty_row() {
        let mut rows = Rows::default();
        for (time, value) in [(1, None), (2, Some(7.0)), (3, None), (4, None), (5, Some(8.0))] {
            rows.push(time, value);
        }
        let segment = rows.take_segment().unwrap();
        assert_eq!(segment.times_ns, [2, 3, 5]);
        assert_eq!(segment.lengths, [1, 0, 1]);
        assert_eq!(segment.values, [7.0, 8.0]);
        assert!(rows.take_segment().is_none());
        rows.push(6, None);
        assert_eq!(rows.take_segment().unwrap().lengths, [0], "the end of a value crosses segments");
    }
}
