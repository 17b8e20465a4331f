//! Records of precise products and navigation messages, as input of the orbits.

use super::{GlonassEphemeris, KeplerEphemeris};
use crate::atmosphere::KlobucharCoefficients;
use crate::frames::Ecef;
use crate::gnss::{SatelliteId, SignalCode};
use crate::skips::Skips;
use crate::time::GpsTime;

/// One satellite at one epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sp3Position {
    /// The satellite.
    pub satellite: SatelliteId,
    /// The epoch, GPS time.
    pub time: GpsTime,
    /// Centre of mass in the Earth-fixed frame, m.
    pub position: Ecef,
    /// Clock offset without the periodic relativistic term, s.
    pub clock_s: Option<f64>,
}

/// A whole SP3 file.
#[derive(Clone, Debug, PartialEq)]
pub struct Sp3 {
    /// Interval between epochs, s.
    pub interval_s: f64,
    /// Number of epochs read.
    pub epochs: usize,
    /// Positions in file order; positions that the file marks as missing are left out.
    pub positions: Vec<Sp3Position>,
    /// Counts of skipped lines by reason.
    pub skips: Skips,
}

/// A satellite clock at one epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockRecord {
    /// The satellite.
    pub satellite: SatelliteId,
    /// The epoch, GPS time.
    pub time: GpsTime,
    /// Clock offset without the periodic relativistic term, s.
    pub clock_s: f64,
}

/// A whole RINEX clock file.
#[derive(Clone, Debug, PartialEq)]
pub struct ClockFile {
    /// Interval between epochs, s: the median of the differences.
    pub interval_s: f64,
    /// Satellite clocks in order of time.
    pub records: Vec<ClockRecord>,
    /// Counts of skipped lines by reason.
    pub skips: Skips,
}

/// Bias of one signal of a satellite. The convention is P − c·bias, which agrees with the clocks of the same product.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CodeBias {
    /// The satellite.
    pub satellite: SatelliteId,
    /// The signal.
    pub signal: SignalCode,
    /// Start of validity, inclusive.
    pub start: GpsTime,
    /// End of validity, inclusive; `None` if the file leaves it open.
    pub end: Option<GpsTime>,
    /// The bias, s.
    pub bias_s: f64,
}

/// A whole Bias-SINEX file.
#[derive(Clone, Debug, PartialEq)]
pub struct BiasFile {
    /// Code biases of satellites in file order.
    pub biases: Vec<CodeBias>,
    /// Counts of skipped lines by reason.
    pub skips: Skips,
}

/// Ionosphere terms of a navigation file, per system.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct IonosphereTerms {
    /// GPSA and GPSB: Klobuchar (IS-GPS-200, 20.3.3.5.2.5).
    pub gps: Option<KlobucharCoefficients>,
    /// BDSA and BDSB: BeiDou's Klobuchar variant, in geographic coordinates (BDS-SIS-ICD-B1I, 5.2.4.7).
    pub beidou: Option<KlobucharCoefficients>,
    /// GAL: NeQuick-G effective ionisation a0 (sfu), a1 (sfu/deg), a2 (sfu/deg²).
    pub galileo: Option<[f64; 3]>,
}

/// A whole navigation file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NavigationFile {
    /// GPS, QZSS, Galileo and BeiDou ephemerides in order of transmission. A missing group delay is NaN.
    pub ephemerides: Vec<KeplerEphemeris>,
    /// GLONASS ephemerides in order of reference time.
    pub glonass: Vec<GlonassEphemeris>,
    /// Ionosphere terms.
    pub ionosphere: IonosphereTerms,
    /// Seconds by which GPS time is ahead of UTC.
    pub leap_seconds: Option<i64>,
    /// Counts of skipped records by reason.
    pub skips: Skips,
}
