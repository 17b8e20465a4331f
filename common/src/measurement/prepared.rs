//! Observations with their satellite's state, before corrections that depend on the phone's position.

use super::given::GivenCorrections;
use crate::frames::{Ecef, EcefVector};
use crate::gnss::{Observation, SignalCode};

/// An observation with its satellite's state and all corrections that do not depend on the phone's position.
#[derive(Clone, Debug)]
pub struct PreparedObservation {
    pub(super) observation: Observation,
    pub(super) frequency_hz: f64,
    /// P + c·dT_s + group delay correction, m.
    pub(super) pseudorange_m: f64,
    pub(super) range_rate_mps: Option<f64>,
    /// λφ + c·dT_s, m; `None` without a carrier phase and for a pair.
    pub(super) phase_m: Option<f64>,
    /// Satellite position at transmission, in the Earth-fixed frame of the transmission.
    pub(super) position: Ecef,
    pub(super) velocity: EcefVector,
    /// Variance of the errors common to all signals of the satellite that products state, m².
    pub(super) satellite_variance_m2: f64,
    /// Their usual variance, m².
    pub(super) usual_variance_m2: f64,
    /// Variance of the errors of this signal alone, without its noise, m².
    pub(super) signal_variance_m2: f64,
    /// Standard deviation of the code by the receiver, m; used without a C/N0 for the model.
    pub(super) code_sigma_m: Option<f64>,
    /// Corrections stated by the recording.
    pub(super) stated: Option<GivenCorrections>,
    /// SecondSignal signal, if this is an ionosphere-free pair.
    pub(super) second: Option<SecondSignal>,
}

/// The second signal of a pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct SecondSignal {
    /// Signal code of the pair.
    pub(super) pair: SignalCode,
    /// Factor f₁²/(f₁² − f₂²) of the first signal; that of the second is lower by one.
    pub(super) factor: f64,
    /// C/N0 of the second signal, dB-Hz.
    pub(super) cn0_dbhz: Option<f64>,
    /// Standard deviation of the second code by the receiver, m.
    pub(super) code_sigma_m: Option<f64>,
    /// Variance of the errors of the second signal alone, without its noise, m².
    pub(super) signal_variance_m2: f64,
}

impl SecondSignal {
    /// Variance of the pair from that of the first signal and the noise variance of the second, m².
    pub(super) fn variance_m2(&self, first_m2: f64, own_noise_m2: f64) -> f64 {
        let second_m2 = own_noise_m2 + self.signal_variance_m2;
        self.factor.powi(2) * first_m2 + (self.factor - 1.0).powi(2) * second_m2
    }
}
