//! Preparation of recorded observations with the satellite states and corrections of the recording.

use super::correct::Corrector;
use super::given::{GivenCorrections, RecordedEpoch, RecordedObservation};
use super::prepared::PreparedObservation;
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::gnss::{Observation, ObservationEpoch};
use crate::time::GpsTime;

impl RecordedEpoch {
    /// Prepares the observations with the recording's satellite states and corrections, in place of [`Corrector::prepare`];
    /// [`Corrector::finish`] follows. Observations without recorded corrections are prepared with the corrector's products.
    pub fn prepare(&self, corrector: &mut Corrector) -> Vec<PreparedObservation> {
        let mut others = ObservationEpoch { observations: Vec::new(), ..self.to_observations() };
        let mut given = Vec::with_capacity(self.observations.len());
        for RecordedObservation { observation, frequency_hz, given: corrections } in &self.observations {
            match corrections {
                Some(corrections) => {
                    given.extend(corrector.prepare_given(
                        observation,
                        *frequency_hz,
                        self.time_gps,
                        corrections,
                    ));
                }
                None => others.observations.push(*observation),
            }
        }
        let mut prepared = corrector.pairs(given);
        prepared.extend(corrector.prepare(&others));
        prepared
    }

    /// Prepares the observations with the corrector's products. For a satellite without a state in the products the recorded state is used
    /// (counted).
    /// Otherwise only the receiver's standard deviations are taken from the recording, for observations without a C/N0.
    pub fn prepare_with_products(&self, corrector: &mut Corrector) -> Vec<PreparedObservation> {
        corrector.prepare_stated(&self.to_observations(), |index| self.observations.get(index))
    }
}

impl Corrector {
    /// Like [`Corrector::prepare`], for an observation with recorded satellite state and corrections. Range rates and ionosphere models
    /// need the carrier frequency `frequency_hz`. `None` without a pseudorange, and for an excluded or masked observation.
    pub fn prepare_given(
        &mut self,
        observation: &Observation,
        frequency_hz: Option<f64>,
        time_gps: GpsTime,
        given: &GivenCorrections,
    ) -> Option<PreparedObservation> {
        if self.is_excluded(observation, time_gps) {
            return None;
        }
        let pseudorange_m = observation.pseudorange_m?;
        if self.is_weak(observation, time_gps) {
            return None;
        }
        if frequency_hz.is_none() && given.ionosphere_m.is_none() {
            self.no_carrier_frequency(observation, time_gps);
            return None;
        }
        let range_rate =
            |doppler_hz: f64| Some(-SPEED_OF_LIGHT_MPS / frequency_hz? * doppler_hz + given.clock_drift_mps);
        let phase = |cycles: f64| Some(SPEED_OF_LIGHT_MPS / frequency_hz? * cycles + given.clock_m);
        let satellite_m2 = given.sigma_m.powi(2) + self.beidou_variance_m2(observation);
        Some(PreparedObservation {
            observation: *observation,
            frequency_hz: frequency_hz.unwrap_or(f64::NAN),
            pseudorange_m: pseudorange_m + given.clock_m - given.receiver_bias_m,
            range_rate_mps: observation.doppler_hz.and_then(range_rate),
            phase_m: observation.carrier_phase_cycles.and_then(phase),
            position: given.satellite_position,
            velocity: given.satellite_velocity,
            satellite_variance_m2: satellite_m2,
            usual_variance_m2: satellite_m2,
            signal_variance_m2: self.glonass_variance_m2(observation),
            code_sigma_m: given.code_sigma_m,
            stated: Some(*given),
            second: None,
        })
    }
}
