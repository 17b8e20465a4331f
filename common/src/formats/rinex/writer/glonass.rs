//! Records of GLONASS in navigation files.

use super::{calendar_columns, scientific};
use crate::orbit::{GlonassEphemeris, accuracy_m};
use crate::time::leap_seconds_by;

/// Highest accuracy factor F_T that has a meaning (ICD table 4.4).
const LAST_ACCURACY_FACTOR: u8 = 14;
/// Reference times are multiples of this, s of the UTC day.
const REFERENCE_GRID_S: f64 = 900.0;
/// An L1-L2 delay that is not known (RINEX 3.05, table A10).
const UNKNOWN_DELAY: f64 = 0.999999999999e9;

/// The record of a GLONASS ephemeris (RINEX 3.05, table A10). `leap_seconds` are those of the file's header, which
/// count beyond the known leap seconds only. `None` when the reference time is then not a quarter of an hour of UTC, as all reference
/// times are, or the calendar cannot show it.
///
/// Fields that [`GlonassEphemeris`] does not keep are written as unknown (status flags) or as the reference time (message frame
/// time).
pub fn glonass_record(ephemeris: &GlonassEphemeris, leap_seconds: Option<i64>) -> Option<String> {
    let e = ephemeris;
    let utc = e.toe - leap_seconds_by(leap_seconds, e.toe) as f64;
    if utc.tow_s() % REFERENCE_GRID_S != 0.0 {
        return None;
    }
    let mut text = format!("{} {}", e.satellite, calendar_columns(utc)?);
    let number = |value: Option<u8>| value.map_or(f64::NAN, f64::from);
    let [(x, y, z), (vx, vy, vz), (ax, ay, az)] =
        [e.position.0, e.velocity.0, e.acceleration.0].map(|v| (v.x / 1e3, v.y / 1e3, v.z / 1e3));
    let delay_s = e.l2_delay_s.unwrap_or(UNKNOWN_DELAY);
    let lines: [&[f64]; 5] = [
        &[-e.tau_s, e.gamma, utc.tow_s()],
        &[x, vx, ax, number(e.health)],
        &[y, vy, ay, f64::from(e.frequency_channel)],
        &[z, vz, az, e.age_days],
        &[f64::NAN, delay_s, f64::from(accuracy_factor(e.accuracy_m)), number(e.health_flags)],
    ];
    for (index, values) in lines.into_iter().enumerate() {
        if index > 0 {
            text += "    ";
        }
        text.extend(values.iter().map(|value| scientific(*value, 19, 12)));
        text.truncate(text.trim_end().len());
        text.push('\n');
    }
    Some(text)
}

/// The factor whose accuracy is nearest.
fn accuracy_factor(wanted_m: f64) -> u8 {
    let distance = |factor: &u8| (accuracy_m(Some(*factor)) - wanted_m).abs();
    (0..=LAST_ACCURACY_FACTOR)
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .unwrap_or(LAST_ACCURACY_FACTOR)
}
