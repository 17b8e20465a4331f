//! Epoch lines of RINEX 3 and 4.

use crate::formats::decimal::{integer, real};
use crate::formats::text::columns;
use crate::time::{Calendar, GpsTime};

/// How many columns too far to the left a line's text is: some writers leave out the blank after `>`.
pub(super) fn columns_missing(line: &[u8]) -> usize {
    usize::from(line.get(1).is_some_and(u8::is_ascii_digit))
}

/// The time of an epoch line of RINEX 3 and 4, in the file's time system.
pub(super) fn epoch_time(line: &[u8]) -> Option<GpsTime> {
    let missing = columns_missing(line);
    let field = |from: usize, to: usize| columns(line, from - missing, to - missing);
    let small = |from: usize, to: usize| integer(field(from, to)).and_then(|v| u32::try_from(v).ok());
    GpsTime::from_calendar(Calendar {
        year: i32::try_from(integer(field(2, 6))?).ok()?,
        month: small(7, 9)?,
        day: small(10, 12)?,
        hour: small(13, 15)?,
        minute: small(16, 18)?,
        second: real(field(18, 29))?,
    })
}
