//! `Fix` lines: positions that the phone computed.

use super::columns::{FIX_COLUMNS, Fix as Column};
use super::fields::{Fields, integer, real};
use crate::frames::{Ecef, Geodetic};
use crate::skips::Reason;
use crate::time::GpsTime;

/// Provider of a fix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FixProvider {
    /// The GNSS chip.
    Gnss,
    /// Android's fused location.
    Fused,
    /// Cell towers and wireless networks.
    Network,
    /// Another name.
    Other,
}

/// A position that the phone reported. Heights are above the ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// The provider.
    pub provider: FixProvider,
    /// Time of the fix, GPS time (the log has UTC to the millisecond).
    pub time_gps: GpsTime,
    /// Latitude, rad.
    pub latitude_rad: f64,
    /// Longitude, rad.
    pub longitude_rad: f64,
    /// Height above the WGS-84 ellipsoid, m.
    pub height_m: Option<f64>,
    /// Horizontal accuracy (68 %) by the phone, m.
    pub accuracy_m: Option<f64>,
    /// Speed over ground, m/s.
    pub speed_mps: Option<f64>,
    /// Course over ground, rad clockwise from north.
    pub bearing_rad: Option<f64>,
}

impl Fix {
    /// The position; one without a height is on the ellipsoid.
    pub fn position(&self) -> Ecef {
        let Self { latitude_rad, longitude_rad, .. } = *self;
        Geodetic { latitude_rad, longitude_rad, height_m: self.height_m.unwrap_or(0.0) }.geodetic_to_ecef()
    }
}

/// Reads the fields of a line; `None` (counted) when it gives no position.
pub(super) fn parse(fields: &[&[u8]; FIX_COLUMNS], read: &mut Fields<'_>) -> Option<Fix> {
    let at = |column: Column| fields.get(column as usize).copied().unwrap_or_default();
    let latitude_deg = read.required("latitude", at(Column::Latitude), real)?;
    let longitude_deg = read.required("longitude", at(Column::Longitude), real)?;
    let millis = read.required("time", at(Column::UnixTimeMillis), integer)?;
    let time = GpsTime::from_unix_millis(millis);
    let Some(time_gps) = time.filter(|_| latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 180.0) else {
        read.refuse(Reason::PositionOrTimeOutOfRange, || {
            format!("{latitude_deg}°, {longitude_deg}°, {millis} ms since 1970")
        });
        return None;
    };
    Some(Fix {
        provider: provider(at(Column::Provider)),
        time_gps,
        latitude_rad: latitude_deg.to_radians(),
        longitude_rad: longitude_deg.to_radians(),
        height_m: read.optional("altitude", at(Column::Altitude), real),
        accuracy_m: accuracy_m(at(Column::Accuracy), read),
        speed_mps: read.optional("speed", at(Column::Speed), real),
        bearing_rad: read.optional("bearing", at(Column::Bearing), real).map(f64::to_radians),
    })
}

fn accuracy_m(field: &[u8], read: &mut Fields<'_>) -> Option<f64> {
    let accuracy_m = read.optional("accuracy", field, real)?;
    if accuracy_m < 0.0 {
        read.refuse(Reason::NegativeAccuracy, || format!("{accuracy_m} m"));
        return None;
    }
    Some(accuracy_m)
}

fn provider(name: &[u8]) -> FixProvider {
    let is = |known: &str| name.eq_ignore_ascii_case(known.as_bytes());
    if is("gps") {
        FixProvider::Gnss
    } else if is("fused") || is("FLP") {
        FixProvider::Fused
    } else if is("network") || is("NLP") {
        FixProvider::Network
    } else {
        FixProvider::Other
    }
}
