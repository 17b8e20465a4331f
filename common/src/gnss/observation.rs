//! Raw observations of one epoch.

use serde::{Deserialize, Serialize};

use super::{SatelliteId, SignalCode};
use crate::time::GpsTime;

/// RINEX loss-of-lock bits of a carrier phase.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LossOfLock {
    /// Bit 0: lock was lost between the previous and this epoch.
    pub cycle_slip: bool,
    /// Bit 1: half-cycle ambiguity not resolved.
    pub half_cycle: bool,
    /// Bit 2: increased noise, in RINEX 2 by anti-spoofing, in RINEX 3 and 4 by tracking only the BOC part of an
    /// MBOC-modulated signal. For information.
    pub noisier: bool,
}

/// Observations of one satellite on one signal. A value that was not recorded is `None`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// The satellite.
    pub satellite: SatelliteId,
    /// The signal.
    pub signal: SignalCode,
    /// Code pseudorange, m.
    pub pseudorange_m: Option<f64>,
    /// Carrier phase, cycles.
    pub carrier_phase_cycles: Option<f64>,
    /// Doppler, Hz, positive for an approaching satellite.
    pub doppler_hz: Option<f64>,
    /// Carrier-to-noise density, dB-Hz.
    pub cn0_dbhz: Option<f64>,
    /// Loss-of-lock bits of the carrier phase.
    pub loss_of_lock: LossOfLock,
}

/// RINEX epoch flag (RINEX 3.05, table A3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum EpochFlag {
    /// Flag 0.
    #[default]
    Ok,
    /// Flag 1: power failure since the previous epoch.
    PowerFailure,
}

/// Observations that share one receive time.
#[derive(Clone, Debug, PartialEq)]
pub struct ObservationEpoch {
    /// Receive time by the phone's own clock, GPS time.
    pub time_gps: GpsTime,
    /// Epoch flag.
    pub flag: EpochFlag,
    /// All signals of all satellites, in file order.
    pub observations: Vec<Observation>,
}
