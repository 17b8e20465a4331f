//! Times of week to instants.

use crate::time::{GpsTime, SECONDS_PER_WEEK};

/// The instant with this GPS time of week (s, may lie outside the week) that is nearest to another.
pub(super) fn nearest(tow_s: f64, to: GpsTime) -> GpsTime {
    let same_week = GpsTime::from_week_tow(to.week(), tow_s);
    same_week + ((to - same_week) / SECONDS_PER_WEEK).round() * SECONDS_PER_WEEK
}
