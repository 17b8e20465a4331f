//! Recorded observations with satellite states and corrections.

use crate::frames::{Ecef, EcefVector};
use crate::gnss::{EpochFlag, Observation, ObservationEpoch};
use crate::time::GpsTime;

/// Plausible distances of navigation satellites from the Earth's centre, m.
pub(crate) const ORBIT_BOUNDS_M: std::ops::RangeInclusive<f64> = 1.5e7..=6e7;
/// Maximum speed of a satellite in the Earth-fixed frame, m/s.
pub(crate) const MAX_SATELLITE_SPEED_MPS: f64 = 1e4;
/// Maximum satellite clock offset (10 ms), m.
pub(crate) const MAX_SATELLITE_CLOCK_M: f64 = 3e6;
/// Maximum satellite clock drift, m/s.
pub(crate) const MAX_SATELLITE_DRIFT_MPS: f64 = 10.0;

/// Satellite state and corrections from a recording, in place of those from products.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GivenCorrections {
    /// Satellite position at transmission, m, in the Earth-fixed frame of the *transmission*.
    pub satellite_position: Ecef,
    /// Satellite velocity in the same frame, m/s.
    pub satellite_velocity: EcefVector,
    /// Satellite clock offset, relativity and group delay included, m.
    pub clock_m: f64,
    /// Satellite clock drift, m/s.
    pub clock_drift_mps: f64,
    /// Receiver bias between signals, m; subtracted from the pseudorange.
    pub receiver_bias_m: f64,
    /// Ionospheric delay of this signal, m; `None`: by the products' model.
    pub ionosphere_m: Option<f64>,
    /// Tropospheric delay, m; `None`: by the standard atmosphere.
    pub troposphere_m: Option<f64>,
    /// Standard deviation of orbit and clock together along the line of sight, m.
    pub sigma_m: f64,
    /// Standard deviation of the pseudorange by the receiver, m; replaces the stochastic model for observations without a C/N0.
    pub code_sigma_m: Option<f64>,
}

/// One satellite's signal at one epoch, with the recording's data on it.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedObservation {
    /// The raw observation.
    pub observation: Observation,
    /// Carrier frequency, Hz, if known.
    pub frequency_hz: Option<f64>,
    /// Satellite state and corrections of the recording; `None` if missing.
    pub given: Option<GivenCorrections>,
}

/// An observation of a GLONASS satellite with unknown slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelObservation {
    /// Frequency channel, −7 to 6.
    pub channel: i8,
    /// The observation; its satellite number has no meaning.
    pub observation: Observation,
}

/// A recorded epoch with more data than raw observations.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedEpoch {
    /// Receive time by the phone's clock, GPS time. The challenge tables of 2021 truncate it to a millisecond; the transmission time and
    /// pseudorange of the first row restore it.
    pub time_gps: GpsTime,
    /// One entry per satellite and signal, in file order.
    pub observations: Vec<RecordedObservation>,
    /// Observations of GLONASS satellites known by their frequency channel only.
    pub by_channel: Vec<ChannelObservation>,
}

impl RecordedEpoch {
    /// The raw observations, for corrections with other products.
    pub fn to_observations(&self) -> ObservationEpoch {
        ObservationEpoch {
            time_gps: self.time_gps,
            flag: EpochFlag::Ok,
            observations: self.observations.iter().map(|recorded| recorded.observation).collect(),
        }
    }

    /// Whether an observation has recorded corrections.
    pub fn has_corrections(&self) -> bool {
        self.observations.iter().any(|recorded| recorded.given.is_some())
    }
}
