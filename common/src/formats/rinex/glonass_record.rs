//! One GLONASS record of a navigation file.

use super::navigation_record::{Fault, Record};
use crate::frames::{Ecef, EcefVector};
use crate::orbit::{GlonassEphemeris, RADIUS_BOUNDS_M, SPEED_BOUNDS_MPS, accuracy_m};
use crate::skips::Skips;
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
    let vector = |offset: usize, name, limit: f64| -> Result<nalgebra::Vector3<f64>, Fault> {
        let [x, y, z] = POSITION.map(|at| record.within(at + offset, name, limit / 1e3).map(|km| km * 1e3));
        Ok(nalgebra::Vector3::new(x?, y?, z?))
    };
    let position = vector(0, "position", 3e7)?;
    let velocity = vector(1, "velocity", 1e4)?;
    check("distance from the Earth's centre (m)", position.norm(), RADIUS_BOUNDS_M)?;
    check("speed (m/s)", velocity.norm(), SPEED_BOUNDS_MPS)?;
    let health = small(record, 6);
    if health.is_none() {
        skips.add("GLONASS health unknown, record kept", || {
            format!("line {}: {} {toe}", record.line, record.satellite)
        });
    }
    Ok(GlonassEphemeris {
        satellite: record.satellite,
        toe,
        position: Ecef(position),
        velocity: EcefVector(velocity),
        acceleration: EcefVector(vector(2, "acceleration", 1e-4)?),
        tau_s: -record.within(0, "clock bias", 0.01)?,
        gamma: record.within(1, "frequency bias", 1e-8)?,
        l2_delay_s: record.value(16).filter(|delay| delay.abs() <= MAX_L2_DELAY_S),
        frequency_channel: channel(record)?,
        health,
        health_flags: small(record, 18),
        age_days: record.value(14).unwrap_or(0.0),
        accuracy_m: accuracy_m(small(record, 17)),
    })
}

/// The reference time: a multiple of a quarter of an hour in UTC, in GPS time.
fn reference(record: &Record, leap_seconds: Option<i64>) -> Result<GpsTime, Fault> {
    let written = record.own_epoch()?;
    let of_day = written.tow_s().rem_euclid(86_400.0);
    let off = of_day - (of_day / REFERENCE_GRID_S).round() * REFERENCE_GRID_S;
    check("seconds off the quarter of an hour", off, (-OFF_GRID_S, OFF_GRID_S))?;
    let utc = written - off;
    Ok(utc + leap_seconds_by(leap_seconds, utc) as f64)
}

/// The frequency channel. Some receivers' writers give it as a byte without sign.
fn channel(record: &Record) -> Result<i8, Fault> {
    let written = record.within(10, "frequency channel", 255.0)?;
    let channel = if written > 128.0 { written - 256.0 } else { written };
    check("frequency channel", channel, (-7.0, 13.0))?;
    #[allow(clippy::cast_possible_truncation)] // within −7 to 13
    Ok(channel.round() as i8)
}

/// A whole number from 0 to 255; `None` where it is missing or another.
fn small(record: &Record, index: usize) -> Option<u8> {
    let value = record.value(index).filter(|v| (0.0..=255.0).contains(v) && v.fract() == 0.0)?;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within 0 to 255
    Some(value as u8)
}

fn check(name: &str, value: f64, (low, high): (f64, f64)) -> Result<(), Fault> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(Fault {
        reason: "record with impossible values",
        detail: format!("{name} = {value:e}, limits {low:e} to {high:e}"),
    })
}
