//! Epoch lines of RINEX 3 and 4.

use super::{columns, integer, real};
use crate::time::{Calendar, GpsTime};

/// The time of an epoch line of RINEX 3 and 4, in the file's time system.
pub(super) fn epoch_time(line: &[u8]) -> Option<GpsTime> {
    let small = |from: usize, to: usize| integer(columns(line, from, to)).and_then(|v| u32::try_from(v).ok());
    GpsTime::from_calendar(Calendar {
        year: i32::try_from(integer(columns(line, 2, 6))?).ok()?,
        month: small(7, 9)?,
        day: small(10, 12)?,
        hour: small(13, 15)?,
        minute: small(16, 18)?,
        second: real(columns(line, 18, 29))?,
    })
}
