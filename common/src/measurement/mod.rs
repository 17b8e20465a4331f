//! From raw to corrected observations: masks, corrections, stochastic models.
//!
//! ```
//! # use std::sync::Arc;
//! # use cofix_common::simulation::{Scenario, Simulation};
//! # let simulation = Simulation::new(Scenario { duration_s: 10.0, ..Scenario::default() })?;
//! # let simulated = simulation.epochs(0).next().ok_or("no epoch")?;
//! # let (epoch, products) = (simulated.epoch, Arc::new(simulation.products()));
//! use cofix_common::frames::Ecef;
//! use cofix_common::measurement::{CorrectionOptions, Corrector, without_position};
//! use cofix_common::solve::solve_position;
//!
//! let mut corrector = Corrector::new(products, CorrectionOptions::default());
//! let prepared = corrector.prepare(&epoch);
//! // Without a position there is no elevation yet, and no atmosphere: a first solution comes first.
//! let rough = solve_position(&without_position(&prepared), Ecef::new(0.0, 0.0, 0.0))?;
//! let (corrected, _) = corrector.finish(&prepared, rough.position(), epoch.time_gps);
//! assert!(corrected.iter().all(|observation| observation.pseudorange_sigma_m > 0.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod beidou2;
mod channel;
mod correct;
mod differential;
mod exclusion;
mod given;
mod pair;
mod prepared;
mod recorded;
#[cfg(test)]
pub(crate) mod sky;
mod stochastic;

pub use beidou2::beidou2_code_correction_m;
pub use correct::{Carriers, CorrectionOptions, Corrector, Finished, without_position};
pub use differential::{Applied, Differential, DifferentialCounts, DifferentialOptions, Uncorrected};
pub use exclusion::{Exclusion, ExclusionError};
pub use given::{ChannelObservation, GivenCorrections, RecordedEpoch, RecordedObservation};
pub(crate) use given::{
    MAX_SATELLITE_CLOCK_M, MAX_SATELLITE_DRIFT_MPS, MAX_SATELLITE_SPEED_MPS, ORBIT_BOUNDS_M,
};
pub use pair::Ionosphere;
pub use prepared::PreparedObservation;
pub use stochastic::{StochasticModel, VarianceModel};

use serde::{Deserialize, Serialize};

use crate::frames::{Direction, Ecef, EcefVector};
use crate::gnss::{ClockGroup, LossOfLock, SatelliteId, SignalCode, SignalKey};

/// Corrected pseudorange and range rate, with only geometry, receiver clock and noise left.
///
/// The model is P_c = |r_s − r_k| + c·dt_k,group + ε, and for the rate ρ̇_c = (v_s − v_k)·u + c·ḋt_k + ε.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CorrectedObservation {
    /// The satellite.
    pub satellite: SatelliteId,
    /// The signal.
    pub signal: SignalCode,
    /// Corrected pseudorange P_c, m.
    pub pseudorange_m: f64,
    /// Standard deviation of the pseudorange by the stochastic model, m.
    pub pseudorange_sigma_m: f64,
    /// Errors of the pseudorange that other receivers of the satellite have too.
    pub shared: SharedError,
    /// Corrected range rate, if there was a Doppler.
    pub range_rate: Option<RangeRate>,
    /// Change of the range since the phone's previous epoch, if the carrier phase was tracked in between.
    pub range_change: Option<RangeChange>,
    /// Carrier-to-noise density, dB-Hz, if recorded.
    pub cn0_dbhz: Option<f64>,
    /// Azimuth and elevation at the phone.
    pub direction: Direction,
    /// Satellite position at transmission, m, in the Earth-fixed frame of the *reception* (Sagnac rotation applied).
    pub satellite_position: Ecef,
    /// Satellite velocity at transmission in the same frame, m/s.
    pub satellite_velocity: EcefVector,
    /// Use in the phone's own solution.
    pub usage: Usage,
    /// Residual after the phone's own epoch-wise solution, m (observed − computed); `None` without a solution.
    pub residual_m: Option<f64>,
}

/// Errors of a corrected pseudorange that all receivers of the satellite have alike. They last for hours, and no mean over phones or
/// epochs removes them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SharedError {
    /// Standard deviation of orbit, clock and group delay together that products state, m. It is part of
    /// [`CorrectedObservation::pseudorange_sigma_m`].
    pub stated_sigma_m: f64,
    /// Their usual standard deviation, m, by which filters weigh (see [`crate::orbit::BroadcastAccuracy`]).
    pub satellite_sigma_m: f64,
    /// Ionospheric delay of this signal by which what is left of it is measured, m: a share of it is still in the observation. What
    /// broadcast coefficients removed, a third of what maps removed, a nominal delay where there is no model; 0 for ionosphere-free pairs and
    /// with a base station.
    pub ionosphere_m: f64,
}

/// A corrected range rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RangeRate {
    /// Rate, m/s, positive = receding, satellite clock drift removed.
    pub range_rate_mps: f64,
    /// Standard deviation of the rate, m/s.
    pub sigma_mps: f64,
    /// Time before the epoch over which the phone averages, s; 0: the rate is that of the epoch itself.
    pub averaged_s: f64,
}

/// Change of a satellite's range from the phone's previous epoch to this one, by the carrier phase.
///
/// The model is Δρ = |r_s(t) − r_k(t)| − |r_s(t') − r_k(t')| + c·Δdt_k + ε with one clock change for all signals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RangeChange {
    /// Change Δρ, m, positive = receding, changes of satellite clock and atmosphere removed.
    pub change_m: f64,
    /// Standard deviation of the change, m.
    pub sigma_m: f64,
    /// Satellite position r_s(t') at the transmission of the previous epoch, in the Earth-fixed frame of *its* reception.
    pub satellite_before: Ecef,
}

/// What the carrier of a signal says beside its code. The sum of phase and delay has range, receiver clock, ambiguity and noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carrier {
    /// λφ + c·dT, m; `None` without a recorded phase.
    pub phase_m: Option<f64>,
    /// Ionospheric − tropospheric delay, m.
    pub delay_m: f64,
    /// Flags of the receiver on the continuity of the phase.
    pub loss_of_lock: LossOfLock,
}

/// Use of an observation in a solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Usage {
    /// Used in the solution.
    Used,
    /// Excluded by RAIM.
    Excluded,
}

impl CorrectedObservation {
    /// Variance of the pseudorange without its shared errors, m²: noise and multipath of this receiver.
    pub fn noise_variance_m2(&self) -> f64 {
        (self.pseudorange_sigma_m.powi(2) - self.shared.stated_sigma_m.powi(2)).max(0.0)
    }

    /// The satellite and its signal.
    pub const fn signal_key(&self) -> SignalKey {
        (self.satellite, self.signal)
    }

    /// Receiver clock of this observation.
    pub const fn clock_group(&self) -> ClockGroup {
        ClockGroup { constellation: self.satellite.constellation, band: self.signal.band }
    }
}
