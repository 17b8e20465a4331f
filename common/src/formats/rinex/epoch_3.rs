//! Epoch lines of RINEX 3 and 4.

use crate::formats::decimal::{calendar, year};
use crate::formats::text::columns;
use crate::time::GpsTime;

/// Number of columns by which a line's text is too far to the left: some writers leave out the blank after `>`.
pub(super) fn columns_missing(line: &[u8]) -> usize {
    usize::from(line.get(1).is_some_and(u8::is_ascii_digit))
}

/// The time of an epoch line of RINEX 3 and 4, in the file's time system.
pub(super) fn epoch_time(line: &[u8]) -> Option<GpsTime> {
    let missing = columns_missing(line);
    let field = |from: usize, to: usize| columns(line, from - missing, to - missing);
    let fields = [field(7, 9), field(10, 12), field(13, 15), field(16, 18), field(18, 29)];
    GpsTime::from_calendar(calendar(year(field(2, 6)), fields)?)
}
