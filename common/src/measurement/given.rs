//! Observations that come with their satellites' states and corrections.

use super::{Corrector, PreparedObservation};
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::frames::{Ecef, EcefVector};
use crate::gnss::Observation;
use crate::time::GpsTime;

/// Satellite state and corrections that came with a recording, in place of those from products.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GivenCorrections {
    /// Satellite at transmission, m, in the Earth-fixed frame of the *transmission*.
    pub satellite_position: Ecef,
    /// Its velocity in the same frame, m/s.
    pub satellite_velocity: EcefVector,
    /// Satellite clock offset, relativity and group delay included, m.
    pub clock_m: f64,
    /// Its drift, m/s.
    pub clock_drift_mps: f64,
    /// Receiver bias between signals, m; taken from the pseudorange.
    pub receiver_bias_m: f64,
    /// Ionospheric delay of this signal, m.
    pub ionosphere_m: f64,
    /// Tropospheric delay, m.
    pub troposphere_m: f64,
    /// Standard deviation of orbit and clock together along the line of sight, m.
    pub sigma_m: f64,
    /// The receiver's own standard deviation of the pseudorange, m. It stands in for the stochastic model, which has nothing
    /// to go by, where no C/N0 was recorded.
    pub code_sigma_m: Option<f64>,
}

impl Corrector {
    /// As [`Corrector::prepare`], for an observation whose satellite state and corrections came with it. `frequency_hz` is the carrier's, where
    /// it is known; only range rates need it. `None` without a pseudorange, and for a signal below the mask.
    pub fn prepare_given(
        &mut self,
        observation: &Observation,
        frequency_hz: Option<f64>,
        time_gps: GpsTime,
        given: &GivenCorrections,
    ) -> Option<PreparedObservation> {
        let pseudorange_m = observation.pseudorange_m?;
        if self.is_weak(observation, time_gps) {
            return None;
        }
        let range_rate =
            |doppler_hz: f64| Some(-SPEED_OF_LIGHT_MPS / frequency_hz? * doppler_hz + given.clock_drift_mps);
        Some(PreparedObservation {
            observation: *observation,
            frequency_hz: frequency_hz.unwrap_or(f64::NAN),
            pseudorange_m: pseudorange_m + given.clock_m - given.receiver_bias_m,
            range_rate_mps: observation.doppler_hz.and_then(range_rate),
            position: given.satellite_position,
            velocity: given.satellite_velocity,
            satellite_variance_m2: given.sigma_m.powi(2) + self.beidou_variance_m2(observation),
            signal_variance_m2: self.glonass_variance_m2(observation),
            code_sigma_m: given.code_sigma_m,
            stated: Some(*given),
            second: None,
        })
    }
}
