//! Time systems of files, and from them to GPS time.

use crate::time::leap_seconds_at;
use crate::time::{BEIDOU_BEHIND_GPS_S, GpsTime};

/// TAI is ahead of GPS time by this, s.
const TAI_AHEAD_OF_GPS_S: f64 = 19.0;

/// A scale in which a file gives its times.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub(crate) enum TimeSystem {
    /// GPS time, and Galileo's, QZSS' and NavIC's, which agree with it to nanoseconds (RINEX 3.05, 4.1.7).
    #[default]
    Gps,
    /// BeiDou time.
    Beidou,
    /// UTC, and GLONASS time as files have it: UTC(SU) without its three hours.
    Utc,
    /// International atomic time.
    Tai,
}

impl TimeSystem {
    /// All names, for messages.
    pub(crate) const NAMES: &'static str = "GPS, GAL, QZS, IRN, BDT, GLO, UTC and TAI";

    /// By the name that RINEX, SP3 and clock files have for it, in letters of either case; `None` when it is not known.
    pub(crate) fn of(name: &[u8]) -> Option<Self> {
        match name.trim_ascii().to_ascii_uppercase().as_slice() {
            b"GPS" | b"GAL" | b"QZS" | b"IRN" => Some(Self::Gps),
            // Some writers call it by the system's name.
            b"BDT" | b"BDS" => Some(Self::Beidou),
            b"GLO" | b"UTC" => Some(Self::Utc),
            b"TAI" => Some(Self::Tai),
            _ => None,
        }
    }

    /// A time of this system, read as if it were GPS time, in GPS time; UTC by the table of leap seconds.
    pub(crate) fn to_gps(self, own: GpsTime) -> GpsTime {
        own + match self {
            Self::Gps => 0.0,
            Self::Beidou => BEIDOU_BEHIND_GPS_S,
            Self::Utc => leap_seconds_at(own) as f64,
            Self::Tai => -TAI_AHEAD_OF_GPS_S,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_leads_to_gps_time() {
        let own: GpsTime = "2020-08-13T00:00:30".parse().unwrap();
        for (name, seconds) in [
            ("GPS", 0.0),
            ("GAL", 0.0),
            ("QZS", 0.0),
            ("IRN", 0.0),
            ("BDT", 14.0),
            ("BDS", 14.0),
            ("GLO", 18.0),
            ("UTC", 18.0),
            ("TAI", -19.0),
            (" utc", 18.0),
        ] {
            assert_eq!(TimeSystem::of(name.as_bytes()).unwrap().to_gps(own) - own, seconds, "{name}");
        }
        for name in ["", "ccc", "XYZ", "GPST"] {
            assert_eq!(TimeSystem::of(name.as_bytes()), None, "{name}");
        }
        // Before and after the leap second at the end of 2016.
        for (utc, seconds) in [("2016-12-31T23:59:59", 17.0), ("2017-01-01T00:00:00", 18.0)] {
            let utc: GpsTime = utc.parse().unwrap();
            assert_eq!(TimeSystem::Utc.to_gps(utc) - utc, seconds, "{utc}");
        }
    }
}
