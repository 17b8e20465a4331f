//! Differential pseudorange corrections from a base station at a known place.
//!
//! Base and rover are corrected by the same models with the same products:
//!
//! P_c = P + c·dT_s − I − T + group delay correction.
//!
//! At the base the range ρ_b = |r_s − r_b| is known, so what the models leave there can be seen. The correction of a satellite's signal is
//! what is left, less what all signals of its constellation and band have in common, which is the base's clock:
//!
//! Δ = P_c,b − ρ_b − clock_b,      rover: P_c,r − Δ.
//!
//! This is the classical correction P_b + c·dT_s − ρ_b with the model's difference between the two places,
//! (I_r − I_b) + (T_r − T_b), taken into account: written out, the base's ionosphere and troposphere cancel against the true ones that both
//! see, and the models only have to know by how much rover and base *differ*. So a long baseline and a difference in height do no
//! harm, numbers are small, and they age slowly. The group delay is that of the models on both sides and cancels.
//!
//! - The clock that is taken off is a robust weighted mean, so the correction of any one signal tells how it differs from its fellows;
//!   what is common goes into the rover's own clock of that constellation and band.
//! - A signal that differs from its fellows at the base by much more than they do among themselves is *refused*: either the base sees
//!   it wrongly, or the satellite is at fault. It is not used at the rover either.
//! - Corrections are held, not extrapolated: over a minute they change by less than the noise that a rate from two epochs would bring.
//! - Another code on the same band of the same satellite is corrected with a larger sigma.
//! - **Signals without a correction** stay beside corrected ones, on the same clock, with 5 m of sigma more: the corrections' common part is
//!   zero by construction, so nothing shifts, and a phone between houses cannot spare satellites that a base happens not to track. Under
//!   an open sky dropping them is better, and can be chosen: a base that tracks GPS only brings a receiver of four systems from
//!   3.0 m to 1.0 m so, to 0.3 m without the others, and to 0.2 m when it tracks them all (horizontal medians of `tests/differential_recordings.rs`).
//!   Where nothing is corrected, everything stays as it is.
//! - Base and rover may fall into the validity of two messages of a satellite, or one of them beyond the precise orbits. The difference of the two, of orbit, clock and
//!   group delay, goes into the correction.
//!
//! What receivers add of their own does not cancel: the biases between GLONASS' frequency channels keep their sigma, and the
//! noise of an ionosphere-free pair its factor, at the base and at the rover.
//!
//! Range rates are left alone: what a base could correct in them is millimetres per second.
//!
//! *Not* sound: corrections of different epochs of a base are correlated in time (multipath at the base), which nobody downstream knows.
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

/// Epochs of a base that are kept at most.
const MOST_EPOCHS: usize = 1_000;

/// Variance of an observation's code by a model, m². Of a pair both signals count as equally strong.
fn code_variance_m2(model: VarianceModel, observation: &CorrectedObservation) -> f64 {
    model.variance(observation.cn0_dbhz, observation.direction.elevation_rad)
        * variance_factor(observation.signal, observation.satellite.constellation)
}

/// What the differential corrections may be told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferentialOptions {
    /// Corrections older than this are not used, s.
    pub maximum_age_s: f64,
    /// Variance of the base's code, m².
    pub base_code: VarianceModel,
    /// How fast the standard deviation grows with the correction's age, m/s.
    pub age_sigma_mps: f64,
    /// How fast it grows with the distance between rover and base, m/m at the zenith; more near the horizon, with 1/sin e.
    pub distance_sigma: f64,
    /// Standard deviation that the correction of another code on the same band adds, m.
    pub other_code_sigma_m: f64,
    /// What becomes of signals without a correction beside others that have one.
    pub uncorrected: Uncorrected,
    /// Robust standard deviations from the median of its group beyond which a base's signal is refused.
    pub outlier_sigmas: f64,
}

/// What becomes of signals without a correction beside others that have one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Uncorrected {
    /// They stay, with this standard deviation more, m.
    Kept {
        /// The standard deviation that is added.
        sigma_m: f64,
    },
    /// They are left out.
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

/// What happened to the observations of rover epochs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DifferentialCounts {
    /// Corrected with the same signal.
    pub corrected: u64,
    /// Corrected with another code of the same band.
    pub other_code: u64,
    /// The base does not have the signal.
    pub missing: u64,
    /// The base's last epoch is too old.
    pub too_old: u64,
    /// The base's own value is refused, and the observation dropped.
    pub refused: u64,
}

impl DifferentialCounts {
    /// Adds another's counts.
    pub const fn add(&mut self, other: Self) {
        self.corrected += other.corrected;
        self.other_code += other.other_code;
        self.missing += other.missing;
        self.too_old += other.too_old;
        self.refused += other.refused;
    }
}

/// What [`Differential::apply`] did with one epoch; it counts only if that position stands.
#[derive(Clone, Debug, Default)]
pub struct Applied {
    /// How many of what.
    pub counts: DifferentialCounts,
    /// What was left out or used with less than a correction, by reason.
    pub skips: Skips,
}

/// Corrections of one or several bases.
#[derive(Clone, Debug)]
pub struct Differential {
    corrector: Corrector,
    products: Arc<Products>,
    correction: CorrectionOptions,
    options: DifferentialOptions,
    /// By the number that the caller gives them; epochs in order of time.
    bases: Vec<VecDeque<BaseEpoch>>,
    skips: Skips,
}

impl Differential {
    /// No base yet. Masks and models of the bases are those of the rover.
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

    /// Goes on with other products; what was computed from the former ones is computed again.
    pub fn set_products(&mut self, products: Arc<Products>) {
        self.corrector.set_products(Arc::clone(&products));
        self.products = products;
        for epoch in self.bases.iter_mut().flatten() {
            epoch.forget();
        }
    }

    /// Takes an epoch of base number `base`, whose antenna is at `position`. Epochs that come late, or with a date that
    /// is far off, find their place among the others.
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

    /// Whether there is any base epoch.
    pub fn is_empty(&self) -> bool {
        self.bases.iter().all(VecDeque::is_empty)
    }

    /// What was skipped at the bases so far, by reason.
    pub fn skips(&self) -> Skips {
        let mut all = self.skips.clone();
        all.merge(&self.corrector.skips().with_prefix("base: "));
        all
    }
}
