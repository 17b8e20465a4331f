//! The instant to which a phone's Doppler refers, learnt from its phases.
//!
//! Most phones report the rate at the epoch. Some report the change of phase over the interval before the epoch, divided by the interval.
//! Under acceleration the two differ. The mean rate by phase over an interval is that of the two rates at its ends for the first kind, and
//! the second rate alone for the others.

use super::displacement::{Change, median};

/// Number of epochs over which the two kinds are compared.
const AVERAGED_EPOCHS: f64 = 60.0;
/// Number of epochs, with discount, before anything is concluded.
const LEAST_WEIGHT: f64 = 10.0;
/// Minimum number of changes in an epoch that counts.
const FEWEST: usize = 5;
/// The mean kind must fit this many times better (in squares) to be believed, and is given up where it fits worse than the other.
const BELIEVED: f64 = 9.0;
/// Largest interval, s, and largest relative difference of an interval from that of the averages.
const LONGEST_S: f64 = 2.5;
const SAME_INTERVAL: f64 = 0.05;

/// How well both kinds fit.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DopplerEpoch {
    at_epoch: f64,
    mean: f64,
    weight: f64,
    interval_s: f64,
    is_mean: bool,
}

impl DopplerEpoch {
    /// Takes the changes of an epoch that come from phases.
    pub fn take(&mut self, changes: &[Change], interval_s: f64) {
        let with_rates: Vec<(f64, f64, f64)> = changes
            .iter()
            .filter_map(|change| change.rates_mps.map(|(now, then)| (change.value_m, now, then)))
            .collect();
        if with_rates.len() < FEWEST || interval_s > LONGEST_S {
            return;
        }
        if (self.interval_s - interval_s).abs() > SAME_INTERVAL * interval_s {
            *self = Self { interval_s, ..Self::default() };
        }
        let square = |expected: &dyn Fn(f64, f64) -> f64| {
            let off: Vec<f64> = with_rates
                .iter()
                .map(|(change, now, then)| change / interval_s - expected(*now, *then))
                .collect();
            let common = median(&off);
            let sizes: Vec<f64> = off.iter().map(|off| (off - common).abs()).collect();
            median(&sizes).powi(2)
        };
        let keep = 1.0 - AVERAGED_EPOCHS.recip();
        self.at_epoch = keep * self.at_epoch + square(&|now, then| 0.5 * (now + then));
        self.mean = keep * self.mean + square(&|now, _| now);
        self.weight = keep * self.weight + 1.0;
        if self.weight >= LEAST_WEIGHT {
            let needed = if self.is_mean { 1.0 } else { BELIEVED };
            self.is_mean = self.mean * needed < self.at_epoch;
        }
    }

    /// Time over which the phone averages its Doppler, s; `None` if it does not.
    pub fn averaged_s(&self) -> Option<f64> {
        self.is_mean.then_some(self.interval_s)
    }

    /// Whether the Doppler of an epoch is the mean over this interval before it.
    pub fn is_mean_over(&self, interval_s: f64) -> bool {
        self.is_mean && (self.interval_s - interval_s).abs() <= SAME_INTERVAL * interval_s
    }
}
