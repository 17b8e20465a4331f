//! Changes of range by the carrier: from one epoch of a phone to the next, with their tests and their noise.
//!
//! A phase is a range with an unknown constant, which the difference of two epochs removes while the signal is tracked. What is left is the
//! change of range and of the receiver clock, to a centimetre with good phones. Receivers' flags do not separate good phases from bad,
//! so each difference must agree with the Doppler and with the other satellites, and the noise is learnt from the residuals. A
//! Doppler that is the mean over the interval (see [`doppler`]) is such a change too.

mod displacement;
mod doppler;
mod noise;

use std::collections::BTreeMap;

use crate::frames::{Ecef, EcefVector};
use crate::gnss::SignalKey;
use crate::measurement::{Carrier, Carriers, CorrectedObservation, RangeChange};
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;

use displacement::{Change, Fit, Geometry, Source, fit};
use doppler::DopplerEpoch;
use noise::NoiseLevels;

/// Longest time between two epochs whose phases are compared, s.
const LONGEST_S: f64 = 60.0;
/// Difference between the mean rate by phase and by Doppler beyond which a cycle slipped, m/s (Suzuki 2023), and the longest interval over
/// which two Dopplers tell the mean rate, s.
const DOPPLER_AGREEMENT_MPS: f64 = 1.5;
const DOPPLER_LONGEST_S: f64 = 5.0;
/// Least standard deviation of a change that is stated, m.
const LEAST_SIGMA_M: f64 = 0.01;
/// Standard deviation, m, and over longer intervals m/s, above which a change says no more than a Doppler. Phases of such phones are
/// integrated Dopplers: their errors have the same sign for seconds, and are those of the Doppler once more.
const USELESS_SIGMA_M: f64 = 0.05;

/// An epoch with its carriers.
pub(crate) struct CarrierEpoch<'a> {
    /// Receive time, GPS time.
    pub time_gps: GpsTime,
    /// What the carriers of the observations say.
    pub carriers: &'a Carriers,
    /// A position of the phone.
    pub position: Ecef,
    /// Velocity by Doppler.
    pub velocity: Option<EcefVector>,
}

/// The epoch before.
#[derive(Clone, Debug)]
struct Before {
    time_gps: GpsTime,
    signals: BTreeMap<SignalKey, Known>,
}

/// What is known of a signal at the epoch before.
#[derive(Clone, Copy, Debug)]
struct Known {
    carrier: Carrier,
    satellite: Ecef,
    rate_mps: Option<f64>,
}

/// Compares successive epochs of one phone.
#[derive(Clone, Debug, Default)]
pub(crate) struct PhaseTracker {
    before: Option<Before>,
    noise: NoiseLevels,
    doppler: DopplerEpoch,
}

impl PhaseTracker {
    /// Forgets the epoch before, as after a power failure.
    pub fn interrupt(&mut self) {
        self.before = None;
    }

    /// Gives observations their changes of range since the epoch before, and their rates the time over which the phone averages. Returns the
    /// time of the epoch before if there is any change.
    pub fn take(
        &mut self,
        epoch: &CarrierEpoch<'_>,
        observations: &mut [CorrectedObservation],
        skips: &mut Skips,
    ) -> Option<GpsTime> {
        let before = self.before.replace(Before::of(epoch, observations));
        let changed = before.and_then(|before| {
            let interval_s = epoch.time_gps - before.time_gps;
            let is_near = interval_s > 0.0 && interval_s <= LONGEST_S;
            let any = is_near && self.compare(&before, epoch, observations, skips);
            any.then_some(before.time_gps)
        });
        if let Some(averaged_s) = self.doppler.averaged_s() {
            let has_phase = |o: &CorrectedObservation| {
                epoch.carriers.get(&o.signal_key()).is_some_and(|carrier| carrier.phase_m.is_some())
            };
            let averaged = observations.iter_mut().filter(|observation| has_phase(observation));
            for rate in averaged.filter_map(|observation| observation.range_rate.as_mut()) {
                rate.averaged_s = averaged_s;
            }
        }
        changed
    }

    /// Gives observations their changes of range since `before`. Returns whether there are any.
    fn compare(
        &mut self,
        before: &Before,
        epoch: &CarrierEpoch<'_>,
        observations: &mut [CorrectedObservation],
        skips: &mut Skips,
    ) -> bool {
        let interval_s = epoch.time_gps - before.time_gps;
        let mut changes = before.changes(epoch, observations, skips);
        self.doppler.take(&changes, interval_s);
        if self.doppler.is_mean_over(interval_s) {
            changes.extend(before.changes_by_doppler(&changes, epoch, observations));
        } else {
            drop_slipped(&mut changes, interval_s, epoch.time_gps, skips);
        }
        let weights: Vec<f64> = changes.iter().map(|change| self.noise.sigma_m(change).powi(-2)).collect();
        let moved = epoch.velocity.map(|velocity| velocity.0 * interval_s);
        let Some(fitted) = fit(&changes, &weights, moved) else { return false };
        self.noise.take(&changes, &fitted);
        give(&changes, &fitted, &weights, epoch, observations, skips)
    }
}

/// Gives observations the changes that the fit accepts. Returns whether there are any.
fn give(
    changes: &[Change],
    fitted: &Fit,
    weights: &[f64],
    epoch: &CarrierEpoch<'_>,
    observations: &mut [CorrectedObservation],
    skips: &mut Skips,
) -> bool {
    let mut any = false;
    for ((change, weight), factor) in changes.iter().zip(weights).zip(&fitted.factors) {
        let describe = || format!("{} {} at {}", change.key.0, change.key.1, epoch.time_gps);
        if *factor <= 0.0 {
            skips.add(Reason::PhaseContradictsOthers, describe);
            continue;
        }
        if weight.powf(-0.5) > USELESS_SIGMA_M {
            skips.add(Reason::PhaseTooNoisy, describe);
            continue;
        }
        let sigma_m = (fitted.scale / (weight * factor).sqrt()).max(LEAST_SIGMA_M);
        let satellite_before = change.geometry.satellite_before;
        observations[change.index].range_change =
            Some(RangeChange { change_m: change.value_m, sigma_m, satellite_before });
        any = true;
    }
    any
}

impl Before {
    fn of(epoch: &CarrierEpoch<'_>, observations: &[CorrectedObservation]) -> Self {
        let known = |observation: &CorrectedObservation| {
            let key = observation.signal_key();
            let carrier = *epoch.carriers.get(&key)?;
            let rate_mps = observation.range_rate.map(|rate| rate.range_rate_mps);
            Some((key, Known { carrier, satellite: observation.satellite_position, rate_mps }))
        };
        let signals = observations.iter().filter_map(known).collect();
        Self { time_gps: epoch.time_gps, signals }
    }

    /// The observations of signals that were observed before, with their place, their carrier and what is known of the epoch before.
    fn again<'a>(
        &'a self,
        epoch: &'a CarrierEpoch<'_>,
        observations: &'a [CorrectedObservation],
    ) -> impl Iterator<Item = Again<'a>> {
        observations.iter().enumerate().filter_map(|(index, observation)| {
            let key = observation.signal_key();
            let (carrier, known) = epoch.carriers.get(&key).zip(self.signals.get(&key))?;
            Some(Again { index, observation, carrier, known })
        })
    }

    /// The changes of the signals whose phase the receiver says to have tracked without interruption.
    fn changes(
        &self,
        epoch: &CarrierEpoch<'_>,
        observations: &[CorrectedObservation],
        skips: &mut Skips,
    ) -> Vec<Change> {
        let mut changes = Vec::new();
        for again in self.again(epoch, observations) {
            let Again { observation, carrier, known, .. } = again;
            let Some((phase_m, before_m)) = carrier.phase_m.zip(known.carrier.phase_m) else { continue };
            let (now, then) = (carrier.loss_of_lock, known.carrier.loss_of_lock);
            if now.cycle_slip || now.half_cycle != then.half_cycle {
                skips.add(Reason::PhaseLockLost, || {
                    format!("{} {} at {}", observation.satellite, observation.signal, epoch.time_gps)
                });
                continue;
            }
            let value_m = phase_m - before_m + carrier.delay_m - known.carrier.delay_m;
            let rates_mps = observation.range_rate.map(|rate| rate.range_rate_mps).zip(known.rate_mps);
            changes.push(again.change(Source::Phase, value_m, rates_mps, epoch.position));
        }
        changes
    }

    /// The changes by Dopplers that are means over the interval, for the signals without one by phase.
    fn changes_by_doppler(
        &self,
        by_phase: &[Change],
        epoch: &CarrierEpoch<'_>,
        observations: &[CorrectedObservation],
    ) -> Vec<Change> {
        let interval_s = epoch.time_gps - self.time_gps;
        // The clock of the phases may be steered and that of the Dopplers not.
        let of_both = by_phase.iter().filter_map(|c| Some(c.value_m - c.rates_mps?.0 * interval_s));
        let clock_m = displacement::median(&of_both.collect::<Vec<f64>>());
        let change = |again: Again<'_>| {
            let Again { index, observation, carrier, known } = again;
            if carrier.phase_m.is_none() || by_phase.iter().any(|change| change.index == index) {
                return None;
            }
            let delay_m = carrier.delay_m - known.carrier.delay_m;
            let value_m = observation.range_rate?.range_rate_mps * interval_s + clock_m + delay_m;
            Some(again.change(Source::Doppler, value_m, None, epoch.position))
        };
        self.again(epoch, observations).filter_map(change).collect()
    }
}

/// An observation of a signal that was observed at the epoch before too.
#[derive(Clone, Copy)]
struct Again<'a> {
    /// Place of the observation.
    index: usize,
    observation: &'a CorrectedObservation,
    carrier: &'a Carrier,
    known: &'a Known,
}

impl Again<'_> {
    fn change(&self, source: Source, value_m: f64, rates_mps: Option<(f64, f64)>, position: Ecef) -> Change {
        let Self { index, observation, known, .. } = *self;
        Change {
            index,
            key: observation.signal_key(),
            group: observation.clock_group(),
            source,
            value_m,
            rates_mps,
            geometry: Geometry::new(observation.satellite_position, known.satellite, position),
        }
    }
}

/// Leaves out changes that contradict the Doppler, less the median of all, since the clocks of phase and Doppler may differ.
fn drop_slipped(changes: &mut Vec<Change>, interval_s: f64, time_gps: GpsTime, skips: &mut Skips) {
    if interval_s > DOPPLER_LONGEST_S {
        return;
    }
    let excess = |change: &Change| {
        let (now, then) = change.rates_mps?;
        Some(change.value_m / interval_s - 0.5 * (now + then))
    };
    let all: Vec<f64> = changes.iter().filter_map(excess).collect();
    let common = displacement::median(&all);
    changes.retain(|change| {
        let agrees = excess(change).is_none_or(|excess| (excess - common).abs() <= DOPPLER_AGREEMENT_MPS);
        if !agrees {
            skips.add(Reason::PhaseContradictsDoppler, || {
                format!("{} {} at {time_gps}", change.key.0, change.key.1)
            });
        }
        agrees
    });
}

#[cfg(test)]
mod tests;
