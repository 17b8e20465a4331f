//! Broadcast orbits as Kepler elements with harmonic corrections (GPS, Galileo, BeiDou, QZSS).

use crate::gnss::SatelliteId;
use crate::time::GpsTime;

/// Type of the message of an ephemeris; decides the reference of its clock and group delays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NavigationMessage {
    /// GPS or QZSS LNAV: clock for L1/L2 P(Y), TGD.
    Lnav,
    /// Galileo I/NAV: clock for E1/E5b, BGD E1-E5b.
    GalileoInav,
    /// Galileo F/NAV: clock for E1/E5a, BGD E1-E5a.
    GalileoFnav,
    /// BeiDou D1 or D2: clock for B3I, TGD1 (B1I) and TGD2 (B2I).
    BeidouD1D2,
}

/// One broadcast ephemeris. Angles in rad, times in s, lengths in m; symbols as in IS-GPS-200, table 20-II.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeplerEphemeris {
    /// The satellite.
    pub satellite: SatelliteId,
    /// The message type.
    pub message: NavigationMessage,
    /// Reference time of the orbit, GPS time.
    pub toe: GpsTime,
    /// Reference time of the orbit as seconds of the system's *own* week (BeiDou: BeiDou time), s.
    pub toe_own_tow_s: f64,
    /// Reference time of the clock, GPS time.
    pub toc: GpsTime,
    /// Square root of the semi-major axis, √m.
    pub sqrt_a: f64,
    /// Eccentricity.
    pub eccentricity: f64,
    /// Inclination at toe, rad.
    pub i0_rad: f64,
    /// Inclination rate, rad/s.
    pub i_dot_radps: f64,
    /// Longitude of the ascending node at the week's start, rad.
    pub omega0_rad: f64,
    /// Rate of the ascending node, rad/s.
    pub omega_dot_radps: f64,
    /// Argument of perigee, rad.
    pub omega_rad: f64,
    /// Mean anomaly at toe, rad.
    pub m0_rad: f64,
    /// Mean motion difference, rad/s.
    pub delta_n_radps: f64,
    /// Cosine and sine corrections to the argument of latitude, rad.
    pub cuc_cus_rad: (f64, f64),
    /// Cosine and sine corrections to the radius, m.
    pub crc_crs_m: (f64, f64),
    /// Cosine and sine corrections to the inclination, rad.
    pub cic_cis_rad: (f64, f64),
    /// Clock bias (s), drift (s/s), drift rate (s/s²) at toc.
    pub clock: (f64, f64, f64),
    /// GPS, QZSS: TGD and 0. Galileo: BGD E1-E5a and E1-E5b. BeiDou: TGD1 and TGD2. Seconds.
    pub group_delays_s: (f64, f64),
    /// Signal-in-space accuracy (URA, SISA), m.
    pub accuracy_m: f64,
    /// Health word of the message; 0 = healthy.
    pub health: f64,
    /// Issue of data (IODE, IODnav, AODE).
    pub issue_of_data: u32,
    /// Issue of the clock's data (IODC, AODC); for Galileo IODnav, which covers both.
    pub issue_of_clock: u32,
}

impl KeplerEphemeris {
    /// Whether two messages have the same content. The missing group delay of F/NAV is NaN, which counts as equal here.
    pub(crate) fn is_same_as(&self, other: &Self) -> bool {
        let known = |e: &Self| {
            let (first_s, second_s) = e.group_delays_s;
            Self { group_delays_s: (first_s, if second_s.is_nan() { 0.0 } else { second_s }), ..*e }
        };
        known(self) == known(other)
    }
}
