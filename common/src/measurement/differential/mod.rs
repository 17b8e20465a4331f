//! Differential pseudorange corrections from a base station at a known position.
//!
//! Base and rover are corrected by the same models with the same products:
//!
//! P_c = P + c·dT_s − I − T + group delay correction.
//!
//! At the base the range ρ_b = |r_s − r_b| is known, so the errors of the models can be observed there. The correction of a signal is the
//! residual error less the common part of all signals of its constellation and band, which is the base's clock:
//!
//! Δ = P_c,b − ρ_b − clock_b,      rover: P_c,r − Δ.
//!
//! This is the classical correction P_b + c·dT_s − ρ_b plus the modelled difference between the two positions, (I_r − I_b) + (T_r − T_b):
//! the base's true ionosphere and troposphere cancel with the rover's, and the models only need to describe the *difference* between rover
//! and base. Long baselines and height differences therefore do no harm, and the corrections are small and age slowly. The group delay is
//! the same on both sides and cancels.
//!
//! - The subtracted clock is a robust weighted mean, so the correction of a signal is its difference from the other signals of its group.
//!   The common part is
//!   absorbed by the rover's clock of that constellation and band.
//! - A base signal that differs from its group by much more than the scatter of the group is *refused*: either the base's measurement or
//!   the
//!   satellite is faulty. The rover does not use it either.
//! - Corrections are held, not extrapolated: over a minute they change by less than the noise of a rate from two epochs.
//! - Another code on the same band of the same satellite is corrected with a larger standard deviation.
//! - **Signals without a correction** stay beside corrected signals on the same clock, with 5 m added to their standard deviation. The
//!   corrections have
//!   zero mean by construction, so nothing shifts, and a phone between houses needs satellites that a base does not track. Under
//!   an open sky dropping them is better, and is an option: a base that tracks GPS only improves a receiver of four systems from
//!   3.0 m to 1.0 m with them, to 0.3 m without them, and to 0.2 m if it tracks all (horizontal medians of
//!   `tests/differential_recordings.rs`).
//!   If no signal has a correction, everything stays unchanged.
//! - Base and rover epochs may use different navigation messages of a satellite, or only one of them precise orbits. The difference in
//!   orbit, clock and
//!   group delay is added to the correction.
//!
//! Errors of the receivers themselves do not cancel: the biases between GLONASS' frequency channels keep their standard deviation, and the
//! noise of an ionosphere-free pair its amplification, at base and rover.
//!
//! Range rates are not corrected: their errors at a base are millimetres per second.
//!
//! Limitation: corrections of successive base epochs are correlated (multipath at the base), which later steps neglect.
//! Classical references: RTCM 10402.3 (message 1); Kaplan and Hegarty, Understanding GPS/GNSS, chapter 12.

mod apply;
mod base;
mod clock;

use std::collections::VecDeque;
use std::sync::Arc;

use self::base::BaseEpoch;
use super::pair::variance_factor;
use super::{CorrectedObservation, CorrectionOptions, Corrector, VarianceModel};
use crate::frames::Ecef;
use crate::gnss::ObservationEpoch;
use crate::orbit::Products;
use crate::skips::Skips;

/// Maximum number of stored epochs per base.
const MOST_EPOCHS: usize = 1_000;

/// Variance of an observation's code by a model, m². The two signals of a pair count as equally strong.
fn code_variance_m2(model: VarianceModel, observation: &CorrectedObservation) -> f64 {
    model.variance(observation.cn0_dbhz, observation.direction.elevation_rad)
        * variance_factor(observation.signal, observation.satellite.constellation)
}

/// Options of the differential corrections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferentialOptions {
    /// Maximum age of a correction, s.
    pub maximum_age_s: f64,
    /// Variance of the base's code, m².
    pub base_code: VarianceModel,
    /// Growth of the standard deviation with the age of the correction, m/s.
    pub age_sigma_mps: f64,
    /// Growth of the standard deviation with the distance between rover and base, m/m at the zenith, times 1/sin e.
    pub distance_sigma: f64,
    /// Additional standard deviation of a correction from another code on the same band, m.
    pub other_code_sigma_m: f64,
    /// Treatment of signals without a correction beside corrected signals.
    pub uncorrected: Uncorrected,
    /// Limit for refusing a base's signal, in robust standard deviations from the median of its group.
    pub outlier_sigmas: f64,
}

/// Treatment of signals without a correction beside corrected signals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Uncorrected {
    /// They are used with a larger standard deviation.
    Kept {
        /// Additional standard deviation, m.
        sigma_m: f64,
    },
    /// They are not used.
    Dropped,
}

impl Default for DifferentialOptions {
    fn default() -> Self {
        Self {
            maximum_age_s: 60.0,
            base_code: VarianceModel::Elevation { ura: 0.2, zenith: 0.3 },
            age_sigma_mps: 0.005,
            distance_sigma: 4e-6,
            other_code_sigma_m: 1.0,
            uncorrected: Uncorrected::Kept { sigma_m: 5.0 },
            outlier_sigmas: 5.0,
        }
    }
}

/// Counts of rover observations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DifferentialCounts {
    /// Corrected with the same signal.
    pub corrected: u64,
    /// Corrected with another code of the same band.
    pub other_code: u64,
    /// Signal missing at the base.
    pub missing: u64,
    /// Last epoch of the base too old.
    pub too_old: u64,
    /// Value of the base refused and observation dropped.
    pub refused: u64,
}

impl DifferentialCounts {
    /// Adds other counts.
    pub const fn add(&mut self, other: Self) {
        self.corrected += other.corrected;
        self.other_code += other.other_code;
        self.missing += other.missing;
        self.too_old += other.too_old;
        self.refused += other.refused;
    }
}

/// Result of [`Differential::apply`] for one epoch, valid only if the rover position is final.
#[derive(Clone, Debug, Default)]
pub struct Applied {
    /// Counts of the epoch.
    pub counts: DifferentialCounts,
    /// Counts of dropped or incompletely corrected observations by reason.
    pub skips: Skips,
}

/// Differential corrections from one or several bases.
#[derive(Clone, Debug)]
pub struct Differential {
    corrector: Corrector,
    products: Arc<Products>,
    correction: CorrectionOptions,
    options: DifferentialOptions,
    /// Epochs in order of time by base number.
    bases: Vec<VecDeque<BaseEpoch>>,
    skips: Skips,
}

impl Differential {
    /// Corrections without bases. The bases use the rover's masks and models.
    pub fn new(products: Arc<Products>, correction: CorrectionOptions, options: DifferentialOptions) -> Self {
        Self {
            corrector: Corrector::new(Arc::clone(&products), correction.clone()),
            products,
            correction,
            options,
            bases: Vec::new(),
            skips: Skips::default(),
        }
    }

    /// Replaces the products and discards the corrections computed with the former ones.
    pub fn set_products(&mut self, products: Arc<Products>) {
        self.corrector.set_products(Arc::clone(&products));
        self.products = products;
        for epoch in self.bases.iter_mut().flatten() {
            epoch.forget();
        }
    }

    /// Takes an epoch of base number `base` with its antenna at `position`. Late epochs, and epochs with a wrong date, are inserted in
    /// order of time.
    pub fn add(&mut self, base: usize, epoch: ObservationEpoch, position: Ecef) {
        if self.bases.len() <= base {
            self.bases.resize_with(base + 1, VecDeque::new);
        }
        let Some(epochs) = self.bases.get_mut(base) else { return };
        let oldest = epoch.time_gps + -self.options.maximum_age_s;
        while epochs.len() >= MOST_EPOCHS || epochs.front().is_some_and(|first| first.time_gps() < oldest) {
            epochs.pop_front();
        }
        let at = epochs.partition_point(|known| known.time_gps() <= epoch.time_gps);
        epochs.insert(at, BaseEpoch::new(epoch, position));
    }

    /// Whether there is no base epoch.
    pub fn is_empty(&self) -> bool {
        self.bases.iter().all(VecDeque::is_empty)
    }

    /// Counts of skips at the bases by reason.
    pub fn skips(&self) -> Skips {
        let mut all = self.skips.clone();
        all.merge(&self.corrector.skips().with_prefix("base: "));
        all
    }
}
