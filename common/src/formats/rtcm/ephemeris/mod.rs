//! Ephemeris messages 1019 (GPS), 1042 (BeiDou), 1044 (QZSS), 1045 and 1046 (Galileo F/NAV and I/NAV).
//!
//! RTCM 10403.3; the scale factors are those of the systems' own documents.

mod fields;

use super::date::{Claim, Unit};
use crate::formats::bits::{Bits, TooShort};
use crate::gnss::{Constellation, SatelliteId};
use crate::orbit::{Implausible, KeplerEphemeris, NavigationMessage, check_reference_s, within};
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
    /// Its reference times are at the beginning of GPS time, as far apart as they are, when the whole message is read.
    ephemeris: KeplerEphemeris,
    /// toc, seconds of the system's own week.
    toc_s: f64,
    /// As sent, and how many weeks until the number repeats.
    week: (u32, i64),
}

/// Reads an ephemeris message by its number.
pub(super) fn read(bytes: &[u8], number: u32) -> Result<Sent, Fault> {
    let mut bits = Bits::new(bytes);
    bits.skip(12);
    let mut sent = match number {
        1019 => fields::gps(&mut bits)?,
        1042 => fields::beidou(&mut bits)?,
        1044 => fields::qzss(&mut bits)?,
        1046 => fields::galileo(&mut bits, NavigationMessage::GalileoInav)?,
        _ => fields::galileo(&mut bits, NavigationMessage::GalileoFnav)?,
    };
    let ephemeris = &mut sent.ephemeris;
    within("satellite number", f64::from(ephemeris.satellite.number), 1.0..=63.0)?;
    ephemeris.toc = ephemeris.toe + from_toe_to_toc_s(ephemeris.toe_own_tow_s, sent.toc_s);
    let check = check_reference_s("toc", sent.toc_s).and_then(|()| ephemeris.check());
    check.map_err(|value| Fault::from(value).of(ephemeris.satellite))?;
    Ok(sent)
}

impl Sent {
    /// The date that it states.
    pub(super) fn claim(&self) -> Claim {
        let Self { ephemeris, week, .. } = self;
        let (offset, behind_s) = match ephemeris.satellite.constellation {
            Constellation::Beidou => (BEIDOU_WEEK_OFFSET, BEIDOU_BEHIND_GPS_S),
            Constellation::Galileo => (GALILEO_WEEK_OFFSET, 0.0),
            _ => (0, 0.0),
        };
        let (week, period) = *week;
        let tow_s = ephemeris.toe_own_tow_s + behind_s;
        Claim {
            satellite: ephemeris.satellite,
            as_sent: GpsTime::from_week_tow(i64::from(week) + offset, tow_s),
            repeats_days: Some(7 * period),
            unit: Unit::Week,
        }
    }

    /// The ephemeris with its reference time.
    pub(super) fn dated(self, toe: GpsTime) -> KeplerEphemeris {
        let toc = toe + (self.ephemeris.toc - self.ephemeris.toe);
        KeplerEphemeris { toe, toc, ..self.ephemeris }
    }
}

/// From the orbit's reference time to the clock's, which is the nearest to it, s.
fn from_toe_to_toc_s(toe_s: f64, toc_s: f64) -> f64 {
    let difference_s = toc_s - toe_s;
    difference_s - (difference_s / SECONDS_PER_WEEK).round() * SECONDS_PER_WEEK
}
