//! Ephemeris messages 1019 (GPS), 1042 (BeiDou), 1044 (QZSS), 1045 and 1046 (Galileo F/NAV and I/NAV).
//!
//! RTCM 10403.3; the scale factors are those of the systems' own documents.

mod fields;

pub(super) use fields::power;
use fields::{Orbit, Rest};

use super::bits::{Bits, TooShort};
use super::date::{Claim, Unit};
use crate::gnss::{Constellation, SatelliteId};
use crate::orbit::{Implausible, KeplerEphemeris, check_reference_s, within};
use crate::time::{BEIDOU_BEHIND_GPS_S, BEIDOU_WEEK_OFFSET, GpsTime, SECONDS_PER_WEEK};

/// Galileo week 0 is GPS week 1024.
const GALILEO_WEEK_OFFSET: i64 = 1024;

/// Why a message gives no ephemeris.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Fault {
    /// It ends too early.
    TooShort,
    /// A value that cannot be: what, and its limits.
    Impossible(String),
}

impl From<TooShort> for Fault {
    fn from(_: TooShort) -> Self {
        Self::TooShort
    }
}

impl From<Implausible> for Fault {
    fn from(value: Implausible) -> Self {
        Self::Impossible(value.to_string())
    }
}

impl Fault {
    /// The same, which names the satellite.
    pub(super) fn of(self, satellite: SatelliteId) -> Self {
        match self {
            Self::TooShort => self,
            Self::Impossible(detail) => Self::Impossible(format!("{satellite}: {detail}")),
        }
    }
}

/// An ephemeris as sent: all but its date is known.
pub(super) struct Sent {
    rest: Rest,
    orbit: Orbit,
}

/// Reads an ephemeris message by its number.
pub(super) fn read(bytes: &[u8], number: u32) -> Result<Sent, Fault> {
    let mut bits = Bits::new(bytes);
    bits.skip(12);
    let (rest, orbit) = match number {
        1019 => fields::gps(&mut bits)?,
        1042 => fields::beidou(&mut bits)?,
        1044 => fields::qzss(&mut bits)?,
        _ => fields::galileo(&mut bits, number == 1046)?,
    };
    within("satellite number", f64::from(rest.satellite.number), 1.0..=63.0)?;
    let satellite = rest.satellite;
    let of_satellite = |value: Implausible| Fault::from(value).of(satellite);
    check_reference_s("toc", rest.toc_s).map_err(of_satellite)?;
    let sent = Sent { rest, orbit };
    sent.dated(GpsTime::default()).check().map_err(of_satellite)?;
    Ok(sent)
}

impl Sent {
    /// The date that it states.
    pub(super) fn claim(&self) -> Claim {
        let Self { rest, orbit } = self;
        let (offset, behind_s) = match rest.satellite.constellation {
            Constellation::Beidou => (BEIDOU_WEEK_OFFSET, BEIDOU_BEHIND_GPS_S),
            Constellation::Galileo => (GALILEO_WEEK_OFFSET, 0.0),
            _ => (0, 0.0),
        };
        let (week, period) = rest.week;
        Claim {
            satellite: rest.satellite,
            as_sent: GpsTime::from_week_tow(i64::from(week) + offset, orbit.toe_s + behind_s),
            repeats_days: Some(7 * period),
            unit: Unit::Week,
        }
    }

    /// The ephemeris with its reference time.
    pub(super) fn dated(&self, toe: GpsTime) -> KeplerEphemeris {
        let toc = toe + from_toe_to_toc_s(&self.rest, &self.orbit);
        assembled(&self.rest, &self.orbit, (toe, toc))
    }
}

/// From the orbit's reference time to the clock's, which is the nearest to it, s.
fn from_toe_to_toc_s(rest: &Rest, orbit: &Orbit) -> f64 {
    let difference_s = rest.toc_s - orbit.toe_s;
    difference_s - (difference_s / SECONDS_PER_WEEK).round() * SECONDS_PER_WEEK
}

fn assembled(rest: &Rest, orbit: &Orbit, (toe, toc): (GpsTime, GpsTime)) -> KeplerEphemeris {
    KeplerEphemeris {
        satellite: rest.satellite,
        message: rest.message,
        toe,
        toe_own_tow_s: orbit.toe_s,
        toc,
        sqrt_a: orbit.sqrt_a,
        eccentricity: orbit.eccentricity,
        i0_rad: orbit.i0_rad,
        i_dot_radps: rest.i_dot_radps,
        omega0_rad: orbit.omega0_rad,
        omega_dot_radps: orbit.omega_dot_radps,
        omega_rad: orbit.omega_rad,
        m0_rad: orbit.m0_rad,
        delta_n_radps: orbit.delta_n_radps,
        cuc_cus_rad: (orbit.cuc_rad, orbit.cus_rad),
        crc_crs_m: (orbit.crc_m, orbit.crs_m),
        cic_cis_rad: (orbit.cic_rad, orbit.cis_rad),
        clock: rest.clock,
        group_delays_s: rest.group_delays_s,
        accuracy_m: rest.accuracy_m,
        health: f64::from(rest.health),
        issue_of_data: rest.issue_of_data,
        issue_of_clock: rest.issue_of_clock,
    }
}
