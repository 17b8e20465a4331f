//! Times of week to instants.

use crate::time::{GpsTime, SECONDS_PER_WEEK, WEEKS_PER_ROLLOVER};

/// The instant with this GPS time of week (s, may lie outside the week) that is nearest to another.
pub(super) fn nearest(tow_s: f64, to: GpsTime) -> GpsTime {
    let same_week = GpsTime::from_week_tow(to.week(), tow_s);
    same_week + ((to - same_week) / SECONDS_PER_WEEK).round() * SECONDS_PER_WEEK
}

/// The hint that the recording's week is probably the wrong one, where a message's is a multiple of 1,024 later or earlier.
pub(super) fn rollover_hint(weeks_later: i64) -> String {
    if weeks_later % WEEKS_PER_ROLLOVER == 0 {
        format!(
            "; the recording's week is probably wrong by a multiple of {WEEKS_PER_ROLLOVER} (--shift-weeks)"
        )
    } else {
        String::new()
    }
}
