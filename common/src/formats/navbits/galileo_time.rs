//! Satellites, weeks and reference times of both Galileo messages.

use super::week::{nearest, rollover_hint};
use super::{Refused, impossible, refused};
use crate::gnss::SatelliteId;
use crate::orbit::check_reference_s;
use crate::skips::Reason;
use crate::time::GpsTime;

/// Galileo's week 0 is GPS week 1024.
const WEEK_OFFSET: i64 = 1024;
/// Weeks are sent modulo this.
const WEEKS: i64 = 4096;
/// A message is sent for at most some hours after its reference time; this (s) allows for old logs of stored messages.
const MAX_AGE_S: f64 = 86_400.0;

/// The number as sent must be the satellite's.
pub(super) fn check_number(satellite: SatelliteId, sent: u64, reason: Reason) -> Result<(), Refused> {
    if sent == u64::from(satellite.number) {
        return Ok(());
    }
    Err(refused(reason, format!("{satellite}: SVID {sent}")))
}

/// The week as sent (modulo 4096) must be that of the recording, or one next to it: the message may be older than `now`.
pub(super) fn check_week(satellite: SatelliteId, sent: u64, now: GpsTime) -> Result<(), Refused> {
    let broadcast = i64::try_from(sent).unwrap_or_default();
    let expected = now.week() - WEEK_OFFSET;
    let apart = (broadcast - expected).rem_euclid(WEEKS);
    if apart <= 1 || apart == WEEKS - 1 {
        return Ok(());
    }
    let hint = rollover_hint(broadcast - expected);
    let expected = expected.rem_euclid(WEEKS);
    let detail = format!("{satellite}: week {broadcast}, {expected} expected at {now}{hint}");
    Err(refused(Reason::EphemerisOfOtherWeek, detail))
}

/// Reference time of `minutes` into the week, in the week that brings it nearest to `now`.
pub(super) fn reference(
    name: &'static str,
    minutes: u64,
    satellite: SatelliteId,
    now: GpsTime,
) -> Result<GpsTime, Refused> {
    let tow_s = minutes as f64 * 60.0;
    check_reference_s(name, tow_s).map_err(|value| impossible(satellite, &value))?;
    let time = nearest(tow_s, now);
    if (time - now).abs() <= MAX_AGE_S {
        return Ok(time);
    }
    let detail = format!("{satellite}: reference time {tow_s} s of the week, received at {now}");
    Err(refused(Reason::EphemerisImpossible, detail))
}
