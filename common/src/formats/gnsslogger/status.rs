//! `Status` lines: the signals that the phone receives or could receive, and how it uses them (Android API, `GnssStatus`).
//!
//! The phone reports all its signals together, one line each, numbered from 0. Where nothing is known it writes zeros: a C/N0
//! of 0 is no reception, a time of 0 (other loggers than Google's) no fix yet, and azimuth and elevation both 0, which
//! is a satellite exactly in the north and exactly on the horizon, an unknown direction.

use super::columns::{STATUS_COLUMNS, Status as Column};
use super::fields::{Fields, flag, integer, real};
use crate::formats::android::{satellite, signal};
use crate::frames::Direction;
use crate::gnss::{CN0_BOUNDS_DBHZ, SatelliteId, SignalCode};
use crate::skips::Reason;
use crate::time::GpsTime;

/// The phone's report on one signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignalStatus {
    /// Number of the report: lines of one report have the same, each report has the next.
    pub report: u64,
    /// Time of the report, GPS time (the log has UTC to the millisecond); Google's app leaves it out.
    pub time_gps: Option<GpsTime>,
    /// The last epoch of raw measurements before the line, by which a report without a time can be placed.
    pub after_epoch: Option<GpsTime>,
    /// The satellite.
    pub satellite: SatelliteId,
    /// The signal: these lines have no code type, so its attribute is the usual one of its band.
    pub signal: SignalCode,
    /// Carrier-to-noise density at the antenna, dB-Hz; `None` when the phone does not receive it.
    pub cn0_dbhz: Option<f64>,
    /// Carrier-to-noise density in the receiver, after the losses of antenna and front end, dB-Hz.
    pub baseband_cn0_dbhz: Option<f64>,
    /// Direction of the satellite by the phone.
    pub direction: Option<Direction>,
    /// Whether the signal was used in the phone's last position.
    pub used_in_fix: bool,
    /// Whether the phone has the satellite's almanac.
    pub has_almanac: bool,
    /// Whether the phone has the satellite's ephemeris.
    pub has_ephemeris: bool,
}

/// Numbers the reports, by lines in their order.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Reports {
    /// Number of reports that have begun.
    begun: u64,
    last: Option<Place>,
}

/// Place of a line in its report.
#[derive(Clone, Copy, Debug)]
struct Place {
    index: i64,
    unix_millis: Option<i64>,
}

impl Reports {
    /// The number of the report that a line belongs to: its index goes on, and its time is that of the line before.
    fn number(&mut self, line: Place) -> u64 {
        let goes_on = |last: Place| line.index > last.index && line.unix_millis == last.unix_millis;
        if !self.last.is_some_and(goes_on) {
            self.begun += 1;
        }
        self.last = Some(line);
        self.begun - 1
    }
}

/// Reads the fields of a line; `None` (counted) when it tells no signal.
pub(super) fn parse(
    fields: &[&[u8]; STATUS_COLUMNS],
    after_epoch: Option<GpsTime>,
    reports: &mut Reports,
    read: &mut Fields<'_>,
) -> Option<SignalStatus> {
    let at = |column: Column| fields.get(column as usize).copied().unwrap_or_default();
    let index = read.required("SignalIndex", at(Column::SignalIndex), integer)?;
    let unix_millis = read.optional("UnixTimeMillis", at(Column::UnixTimeMillis), integer);
    let report = reports.number(Place { index, unix_millis });
    let (satellite, signal) = named(fields, read)?;
    Some(SignalStatus {
        report,
        time_gps: time(unix_millis, read),
        after_epoch,
        satellite,
        signal,
        cn0_dbhz: strength("Cn0DbHz", at(Column::Cn0DbHz), read),
        baseband_cn0_dbhz: strength("BasebandCn0DbHz", at(Column::BasebandCn0DbHz), read),
        direction: direction(fields, read),
        used_in_fix: read.optional("UsedInFix", at(Column::UsedInFix), flag).unwrap_or(false),
        has_almanac: read.optional("HasAlmanacData", at(Column::HasAlmanacData), flag).unwrap_or(false),
        has_ephemeris: read.optional("HasEphemerisData", at(Column::HasEphemerisData), flag).unwrap_or(false),
    })
}

/// Satellite and signal, by the rules of `Raw` lines. A frequency of 0 is none.
fn named(fields: &[&[u8]; STATUS_COLUMNS], read: &mut Fields<'_>) -> Option<(SatelliteId, SignalCode)> {
    let at = |column: Column| fields.get(column as usize).copied().unwrap_or_default();
    let system = read.required("ConstellationType", at(Column::ConstellationType), integer)?;
    let svid = read.required("Svid", at(Column::Svid), integer)?;
    let frequency_hz =
        read.optional("CarrierFrequencyHz", at(Column::CarrierFrequencyHz), real).filter(|hz| *hz != 0.0);
    let satellite = match satellite(system, svid) {
        Ok(satellite) => satellite,
        Err(reason) => {
            read.refuse(reason, || format!("ConstellationType {system}, Svid {svid}"));
            return None;
        }
    };
    let Some(signal) = signal(satellite, frequency_hz, None) else {
        let hz = frequency_hz.unwrap_or(f64::NAN);
        read.refuse(Reason::CarrierFrequencyOfNoSignal, || format!("{satellite}, {hz} Hz"));
        return None;
    };
    Some((satellite, signal.code))
}

fn time(unix_millis: Option<i64>, read: &mut Fields<'_>) -> Option<GpsTime> {
    let millis = unix_millis.filter(|millis| *millis != 0)?;
    let time = GpsTime::from_unix_millis(millis);
    if time.is_none() {
        read.refuse(Reason::TimeOutOfRange, || format!("{millis} ms since 1970"));
    }
    time
}

fn strength(name: &str, field: &[u8], read: &mut Fields<'_>) -> Option<f64> {
    let dbhz = read.optional(name, field, real)?;
    if !CN0_BOUNDS_DBHZ.contains(&dbhz) {
        read.refuse(Reason::Cn0LeftOut, || format!("{name} is {dbhz}"));
        return None;
    }
    Some(dbhz).filter(|dbhz| *dbhz > 0.0)
}

fn direction(fields: &[&[u8]; STATUS_COLUMNS], read: &mut Fields<'_>) -> Option<Direction> {
    let at = |column: Column| fields.get(column as usize).copied().unwrap_or_default();
    let azimuth_deg = read.optional("AzimuthDegrees", at(Column::AzimuthDegrees), real);
    let elevation_deg = read.optional("ElevationDegrees", at(Column::ElevationDegrees), real);
    let (azimuth_deg, elevation_deg) = (azimuth_deg?, elevation_deg?);
    if azimuth_deg.abs() > 360.0 || elevation_deg.abs() > 90.0 {
        read.refuse(Reason::DirectionOutOfRange, || {
            format!("azimuth {azimuth_deg}°, elevation {elevation_deg}°")
        });
        return None;
    }
    let known = azimuth_deg != 0.0 || elevation_deg != 0.0;
    known.then(|| Direction {
        azimuth_rad: azimuth_deg.rem_euclid(360.0).to_radians(),
        elevation_rad: elevation_deg.to_radians(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reports_begin_where_numbers_do() {
        let mut reports = Reports::default();
        let mut number = |index, unix_millis| reports.number(Place { index, unix_millis });
        assert_eq!([number(0, None), number(1, None), number(5, None)], [0, 0, 0]);
        // One signal only, twice.
        assert_eq!([number(0, None), number(0, None)], [1, 2]);
        // The first lines of a report are lost; its time is another.
        assert_eq!([number(1, Some(1_000)), number(2, Some(1_000)), number(3, Some(2_000))], [3, 3, 4]);
    }
}
