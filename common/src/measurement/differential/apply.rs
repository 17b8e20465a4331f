//! Application of base corrections to the rover's observations.

use super::base::{BaseCorrection, BaseEpoch};
use super::{Applied, CorrectedObservation, Differential, Uncorrected, code_variance_m2};
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::frames::Ecef;
use crate::gnss::Constellation;
use crate::measurement::SharedError;
use crate::measurement::pair::variance_factor;
use crate::skips::Reason;
use crate::time::GpsTime;

/// Number of earlier epochs searched for a satellite that is missing in a base's last epoch.
const LOOK_BACK: usize = 3;
/// Minimum sine of the elevation in the distance term, because 1/sin e has no bound.
const LOWEST_SINE: f64 = 0.1;

/// Receiver position and time of a rover epoch.
#[derive(Clone, Copy, Debug)]
struct Rover {
    position: Ecef,
    time_gps: GpsTime,
}

/// Result of the search for a correction of one observation.
#[derive(Clone, Copy, Debug)]
enum Found {
    Corrected(FoundCorrection),
    Refused,
    Missing,
}

/// Correction of an observation by a base.
#[derive(Clone, Copy, Debug)]
struct FoundCorrection {
    correction: BaseCorrection,
    /// Position of the base.
    position: Ecef,
    age_s: f64,
    /// Whether the correction belongs to another code on the same band.
    is_other_code: bool,
}

impl Differential {
    /// Corrects the observations of one epoch, made for the rover position `rover`. The nearest base with a fresh epoch and a correction
    /// for at least one observation is used.
    pub fn apply(
        &mut self,
        observations: &mut Vec<CorrectedObservation>,
        rover: Ecef,
        time_gps: GpsTime,
    ) -> Applied {
        let mut applied = Applied::default();
        let rover = Rover { position: rover, time_gps };
        let fresh = self.fresh(rover);
        if fresh.is_empty() {
            self.count_stale(observations, time_gps, &mut applied);
            return applied;
        }
        let (mut found, mut any_corrected) = (Vec::new(), false);
        for (base, newest) in fresh {
            found = observations.iter().map(|o| self.find(base, newest, o, time_gps)).collect();
            any_corrected = found.iter().any(|found| matches!(found, Found::Corrected(_)));
            if any_corrected {
                break;
            }
        }
        let mut found = found.into_iter();
        observations.retain_mut(|observation| {
            let found = found.next().unwrap_or(Found::Missing);
            self.apply_found(observation, found, rover, any_corrected, &mut applied)
        });
        applied
    }

    /// Bases with an epoch that is not too old, nearest first: base number and index of its last epoch up to the rover's time, or else of
    /// the next epoch.
    fn fresh(&self, rover: Rover) -> Vec<(usize, usize)> {
        let Rover { position, time_gps } = rover;
        let fresh = self.bases.iter().enumerate().filter_map(|(base, epochs)| {
            let later = epochs.partition_point(|epoch| epoch.time_gps() <= time_gps);
            let newest = later.saturating_sub(1);
            let epoch = epochs.get(newest)?;
            let age_s = (time_gps - epoch.time_gps()).abs();
            let distance_m = epoch.position().distance_m(position);
            (age_s <= self.options.maximum_age_s).then_some((distance_m, base, newest))
        });
        let mut fresh: Vec<_> = fresh.collect();
        fresh.sort_by(|a, b| a.0.total_cmp(&b.0));
        fresh.into_iter().map(|(_, base, newest)| (base, newest)).collect()
    }

    fn count_stale(&self, observations: &[CorrectedObservation], time_gps: GpsTime, applied: &mut Applied) {
        let count = observations.len() as u64;
        let limit_s = self.options.maximum_age_s;
        let times = self.bases.iter().flatten().map(BaseEpoch::time_gps);
        let nearest = times.min_by(|a, b| (*a - time_gps).abs().total_cmp(&(*b - time_gps).abs()));
        match nearest {
            None => {
                applied.counts.missing = count;
                applied.skips.add(Reason::EpochWithoutCorrections, || format!("{time_gps}"));
            }
            Some(nearest) if nearest > time_gps => {
                applied.counts.missing = count;
                applied.skips.add(Reason::EpochBeforeCorrections, || {
                    let later_s = nearest - time_gps;
                    format!("{time_gps}: the nearest are {later_s:.1} s later, of {nearest}; the limit is {limit_s} s")
                });
            }
            Some(nearest) => {
                applied.counts.too_old = count;
                applied.skips.add(Reason::EpochWithOldCorrections, || {
                    let age_s = time_gps - nearest;
                    format!("{time_gps}: {age_s:.1} s, the last are of {nearest}; the limit is {limit_s} s")
                });
            }
        }
    }

    /// Searches for the correction of one observation.
    fn find(
        &mut self,
        base: usize,
        newest: usize,
        observation: &CorrectedObservation,
        time_gps: GpsTime,
    ) -> Found {
        let oldest = newest.saturating_sub(LOOK_BACK);
        let mut other = None;
        for at in (oldest..=newest).rev() {
            let Some(epoch) = self.bases.get_mut(base).and_then(|epochs| epochs.get_mut(at)) else {
                continue;
            };
            let age_s = (time_gps - epoch.time_gps()).abs();
            if age_s > self.options.maximum_age_s {
                break;
            }
            let position = epoch.position();
            let corrections = epoch.corrections(&mut self.corrector, &self.options, &mut self.skips);
            let of_band = |c: &&BaseCorrection| {
                c.satellite == observation.satellite && c.signal.band == observation.signal.band
            };
            let same = corrections.iter().filter(of_band).find(|c| c.signal == observation.signal);
            let found = |correction: &BaseCorrection, is_other_code| {
                Found::Corrected(FoundCorrection { correction: *correction, position, age_s, is_other_code })
            };
            match same {
                Some(correction) if correction.is_refused => return Found::Refused,
                Some(correction) => return found(correction, false),
                None => {
                    let of_other_code = corrections.iter().filter(of_band).find(|c| !c.is_refused);
                    other = other.or_else(|| of_other_code.map(|correction| found(correction, true)));
                }
            }
        }
        other.unwrap_or(Found::Missing)
    }

    /// Applies the result of the search. Returns whether the observation stays.
    fn apply_found(
        &self,
        observation: &mut CorrectedObservation,
        found: Found,
        rover: Rover,
        any_corrected: bool,
        applied: &mut Applied,
    ) -> bool {
        let (satellite, signal) = (observation.satellite, observation.signal);
        let name = || format!("{satellite} {signal} at {}", rover.time_gps);
        match found {
            Found::Corrected(found) => {
                if found.is_other_code {
                    applied.counts.other_code += 1;
                    applied.skips.add(Reason::CorrectedByOtherCode, || {
                        format!("{}, by {}", name(), found.correction.signal)
                    });
                } else {
                    applied.counts.corrected += 1;
                }
                self.correct(observation, &found, rover);
                true
            }
            Found::Refused => {
                applied.counts.refused += 1;
                applied.skips.add(Reason::BaseValueRefused, name);
                false
            }
            Found::Missing => {
                applied.counts.missing += 1;
                let (reason, stays) = match self.options.uncorrected {
                    _ if !any_corrected => (Reason::ObservationUncorrected, true),
                    Uncorrected::Dropped => (Reason::ObservationWithoutCorrectionDropped, false),
                    Uncorrected::Kept { sigma_m } => {
                        observation.pseudorange_sigma_m = observation.pseudorange_sigma_m.hypot(sigma_m);
                        (Reason::ObservationUncorrectedLargerSigma, true)
                    }
                };
                applied.skips.add(reason, name);
                stays
            }
        }
    }

    /// Subtracts the correction, and replaces the variances of the models by those of rover code, base code, age and distance.
    fn correct(&self, observation: &mut CorrectedObservation, found: &FoundCorrection, rover: Rover) {
        let FoundCorrection { correction, position, age_s, is_other_code } = found;
        let options = &self.options;
        let elevation_rad = observation.direction.elevation_rad;
        let slant_m = position.distance_m(rover.position) / elevation_rad.sin().max(LOWEST_SINE);
        let other_code_m = if *is_other_code { options.other_code_sigma_m } else { 0.0 };
        let own_m2 = code_variance_m2(self.correction.stochastic.code, observation)
            + self.channel_variance_m2(observation)
            + other_code_m.powi(2);
        let of_correction_m2 = correction.variance_m2
            + (options.age_sigma_mps * age_s).powi(2)
            + (options.distance_sigma * slant_m).powi(2);
        let sent = rover.time_gps + -(observation.pseudorange_m / SPEED_OF_LIGHT_MPS);
        let change_m = correction.change_of_message_m(&self.products, sent, *position);
        observation.pseudorange_m -= correction.correction_m + change_m;
        observation.pseudorange_sigma_m = (own_m2 + of_correction_m2).sqrt();
        // What the models left is removed; phones that use the same base share the error of the correction.
        let sigma_m = of_correction_m2.sqrt();
        observation.shared =
            SharedError { stated_sigma_m: sigma_m, satellite_sigma_m: sigma_m, ionosphere_m: 0.0 };
    }

    /// Variance of the rover's biases between GLONASS' frequency channels, m²; a base of another make does not share them.
    fn channel_variance_m2(&self, observation: &CorrectedObservation) -> f64 {
        let constellation = observation.satellite.constellation;
        if constellation != Constellation::Glonass {
            return 0.0;
        }
        self.correction.glonass_bias_sigma_m.powi(2) * variance_factor(observation.signal, constellation)
    }
}
