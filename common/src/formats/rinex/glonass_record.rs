//! One GLONASS record of a navigation file.

use super::navigation_record::{Fault, Record};
use crate::frames::{Ecef, EcefVector};
use crate::orbit::{GlonassEphemeris, accuracy_m, within};
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;
use crate::time::leap_seconds_by;

/// Reference times are multiples of this, s of the UTC day.
const REFERENCE_GRID_S: f64 = 900.0;
/// A reference time farther than this from the grid is damaged, s; some writers add or forget the leap seconds.
const OFF_GRID_S: f64 = 60.0;
/// Larger L1-L2 delays (s) cannot be broadcast; RINEX 3.05 writes .999999999999e+09 for "missing".
const MAX_L2_DELAY_S: f64 = 1e-6;

/// Position and velocity or acceleration components are at these places, x first.
const POSITION: [usize; 3] = [3, 7, 11];

/// The ephemeris of a record. `leap_seconds` are those of the header, see [`leap_seconds_by`].
pub(super) fn glonass_ephemeris(
    record: &Record,
    leap_seconds: Option<i64>,
    skips: &mut Skips,
) -> Result<GlonassEphemeris, Fault> {
    let toe = reference(record, leap_seconds)?;
    let vector = |offset: usize, name| -> Result<nalgebra::Vector3<f64>, Fault> {
        let [x, y, z] = POSITION.map(|at| record.number(at + offset, name).map(|km| km * 1e3));
        Ok(nalgebra::Vector3::new(x?, y?, z?))
    };
    let health = small(record, 6);
    if health.is_none() {
        skips.add(Reason::GlonassHealthUnknown, || {
            format!("line {}: {} {toe}", record.line, record.satellite)
        });
    }
    let ephemeris = GlonassEphemeris {
        satellite: record.satellite,
        toe,
        position: Ecef(vector(0, "position")?),
        velocity: EcefVector(vector(1, "velocity")?),
        acceleration: EcefVector(vector(2, "acceleration")?),
        tau_s: -record.number(0, "clock bias")?,
        gamma: record.number(1, "frequency bias")?,
        l2_delay_s: record.value(16).filter(|delay| delay.abs() <= MAX_L2_DELAY_S),
        frequency_channel: channel(record)?,
        health,
        health_flags: small(record, 18),
        age_days: record.value(14).unwrap_or(0.0),
        accuracy_m: accuracy_m(small(record, 17)),
    };
    ephemeris.check()?;
    Ok(ephemeris)
}

/// The reference time: a multiple of a quarter of an hour in UTC, in GPS time.
fn reference(record: &Record, leap_seconds: Option<i64>) -> Result<GpsTime, Fault> {
    let written = record.own_epoch()?;
    let of_day = written.tow_s().rem_euclid(86_400.0);
    let off = of_day - (of_day / REFERENCE_GRID_S).round() * REFERENCE_GRID_S;
    within("seconds off the quarter of an hour", off, -OFF_GRID_S..=OFF_GRID_S)?;
    let utc = written - off;
    Ok(utc + leap_seconds_by(leap_seconds, utc) as f64)
}

/// The frequency channel. Some receivers' writers give it as a byte without sign.
fn channel(record: &Record) -> Result<i8, Fault> {
    let written = record.number(10, "frequency channel")?;
    let channel = if written > 128.0 { written - 256.0 } else { written };
    within("frequency channel", channel, -7.0..=13.0)?;
    #[allow(clippy::cast_possible_truncation)] // within −7 to 13
    Ok(channel.round() as i8)
}

/// A whole number from 0 to 255; `None` where it is missing or another.
fn small(record: &Record, index: usize) -> Option<u8> {
    let value = record.value(index).filter(|v| (0.0..=255.0).contains(v) && v.fract() == 0.0)?;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within 0 to 255
    Some(value as u8)
}
