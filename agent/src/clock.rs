//! The computer's clock.

use std::time::{SystemTime, UNIX_EPOCH};

use cofix_common::time::{GpsTime, leap_seconds_at};

/// GPS time now, by the computer's clock.
pub fn now() -> GpsTime {
    gps_time_of(SystemTime::now())
}

/// GPS time of an instant of the computer's clock.
pub fn gps_time_of(time: SystemTime) -> GpsTime {
    let unix_s = time.duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64());
    let epoch = GpsTime::default().as_unix_calendar_nanos() as f64 * 1e-9;
    let utc = GpsTime::default() + (unix_s - epoch);
    utc + leap_seconds_at(utc) as f64
}
