//! Noise of a phone's changes of range, learnt from residuals: one level for each constellation and band.

use std::collections::BTreeMap;

use super::displacement::{Change, Fit, Source};
use crate::gnss::ClockGroup;

/// Standard deviation until enough is known, m: one that says little beside a Doppler.
const UNKNOWN_SIGMA_M: f64 = 0.2;
/// Number of residuals, with discount, that are enough.
const ENOUGH: f64 = 12.0;
/// Number of epochs over which the level is averaged.
const AVERAGED_EPOCHS: f64 = 60.0;
/// Residual in standard deviations at which larger ones count.
const LARGEST: f64 = 4.0;
/// Minimum redundancy of a residual that tells something.
const LEAST_REDUNDANCY: f64 = 0.1;

/// Levels by group.
#[derive(Clone, Debug, Default)]
pub(super) struct NoiseLevels(BTreeMap<(Source, ClockGroup), Level>);

#[derive(Clone, Copy, Debug, Default)]
struct Level {
    sum_m2: f64,
    weight: f64,
}

impl NoiseLevels {
    /// Standard deviation of a change, m.
    pub fn sigma_m(&self, change: &Change) -> f64 {
        self.0.get(&(change.source, change.group)).copied().unwrap_or_default().sigma_m()
    }

    /// Largest level, m.
    #[cfg(test)]
    pub fn largest_sigma_m(&self) -> f64 {
        self.0.values().map(Level::sigma_m).fold(0.0, f64::max)
    }

    /// Takes the residuals of an epoch.
    pub fn take(&mut self, changes: &[Change], fit: &Fit) {
        for level in self.0.values_mut() {
            level.sum_m2 *= 1.0 - AVERAGED_EPOCHS.recip();
            level.weight *= 1.0 - AVERAGED_EPOCHS.recip();
        }
        let residuals = changes.iter().zip(&fit.residuals_m).zip(&fit.redundancies);
        for ((change, residual_m), redundancy) in residuals {
            if *redundancy < LEAST_REDUNDANCY {
                continue;
            }
            let level = self.0.entry((change.source, change.group)).or_default();
            let largest_m2 = (LARGEST * fit.scale * level.sigma_m()).powi(2);
            level.sum_m2 += (residual_m * residual_m / redundancy).min(largest_m2);
            level.weight += 1.0;
        }
    }
}

impl Level {
    fn sigma_m(&self) -> f64 {
        if self.weight < ENOUGH { UNKNOWN_SIGMA_M } else { (self.sum_m2 / self.weight).sqrt() }
    }
}
