//! Satellites that all phones of a group contradict for a minute.
//!
//! A wrong group delay or clock shifts the pseudoranges of one satellite at all phones, all the time. In one epoch of one phone it hides in the
//! noise. The residuals of the epoch-wise solutions, averaged over the phones and the last minute, have little noise left; a least-squares fit of
//! a common shift and a clock for each group with the standard deviations of satellites' errors, and the local test of its residuals
//! (Baarda), show the satellite. It is left out until its averaged residual is small again.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use crate::gnss::{ClockGroup, SatelliteId};
use crate::measurement::CorrectedObservation;
use crate::time::GpsTime;
use crate::wire::EpochMessage;

/// Time over which residuals are averaged, s.
const AVERAGED_S: f64 = 60.0;
/// Share of a full average (all phones for ever) from which on a satellite is judged: about 100 s of all phones.
const FULL: f64 = 0.8;
/// Time after a satellite was left out until the next one is, s.
const SETTLED_S: f64 = 60.0;
/// Share of the limit below which a satellite that is left out comes back.
const BACK_SHARE: f64 = 0.5;
/// Minimum number of phones whose residuals are averaged.
const FEWEST_PHONES: usize = 2;
/// Share of the standard deviation that products state for a satellite's error.
const STATED_SHARE: f64 = 0.5;
/// What multipath leaves in an average: a standard deviation, m, and a share of the variance of code noise.
const LEFT_NOISE_M: f64 = 0.8;
const LEFT_SHARE: f64 = 0.1;

/// Averaged residual of one signal of one satellite.
#[derive(Clone, Copy, Debug, Default)]
struct Average {
    sum_m: f64,
    weight: f64,
    line: [f64; 3],
    sigma_m: f64,
}

/// Judge of the satellites of a group.
#[derive(Clone, Debug)]
pub(super) struct BiasedSatellites {
    limit_sigmas: f64,
    time_gps: GpsTime,
    averages: BTreeMap<(SatelliteId, ClockGroup), Average>,
    left_out: Vec<SatelliteId>,
    /// When a satellite was left out last.
    judged: GpsTime,
}

impl BiasedSatellites {
    /// Satellites beyond `limit_sigmas` are left out; infinite: none.
    pub fn new(limit_sigmas: f64) -> Self {
        Self {
            limit_sigmas,
            time_gps: GpsTime::default(),
            averages: BTreeMap::new(),
            left_out: Vec::new(),
            judged: GpsTime::default(),
        }
    }

    /// Whether a satellite is left out.
    pub fn is_left_out(&self, satellite: SatelliteId) -> bool {
        self.left_out.contains(&satellite)
    }

    /// Takes the residuals of an epoch of the group and judges anew.
    pub fn take<'a>(&mut self, time_gps: GpsTime, messages: impl Iterator<Item = &'a EpochMessage> + Clone) {
        if self.limit_sigmas.is_infinite() {
            return;
        }
        let step_s = (time_gps - self.time_gps).clamp(0.0, AVERAGED_S);
        self.time_gps = time_gps;
        let keep = (-step_s / AVERAGED_S).exp();
        for average in self.averages.values_mut() {
            average.sum_m *= keep;
            average.weight *= keep;
        }
        let count = messages.clone().count();
        for message in messages {
            let Some(solution) = &message.wls else { continue };
            for observation in &message.observations {
                self.add(
                    observation,
                    solution.position.0 - observation.satellite_position.0,
                    (1.0 - keep) / count as f64,
                );
            }
        }
        self.averages.retain(|_, average| average.weight > 1e-3);
        if count >= FEWEST_PHONES {
            self.judge();
        }
    }

    fn add(&mut self, observation: &CorrectedObservation, line: nalgebra::Vector3<f64>, weight: f64) {
        let Some(residual_m) = observation.residual_m else { return };
        let key = (observation.satellite, observation.clock_group());
        let average = self.averages.entry(key).or_default();
        average.sum_m += weight * residual_m;
        average.weight += weight;
        average.line = line.normalize().into();
        let stated_m2 = (STATED_SHARE * observation.shared.stated_sigma_m).powi(2);
        let left_m2 = LEFT_NOISE_M.powi(2) + LEFT_SHARE * observation.noise_variance_m2();
        average.sigma_m = (stated_m2 + left_m2).sqrt();
    }

    /// Leaves out the satellite with the largest residual beyond the limit, and takes back those whose residual is small.
    fn judge(&mut self) {
        let rows: Vec<((SatelliteId, ClockGroup), Average)> = self
            .averages
            .iter()
            .filter(|(_, average)| average.weight > FULL)
            .map(|(key, average)| (*key, *average))
            .collect();
        let Some(normalised) = normalised_residuals(&rows, |satellite| self.is_left_out(satellite)) else {
            return;
        };
        let of = |satellite: SatelliteId| {
            let its = rows.iter().zip(&normalised).filter(move |((key, _), _)| key.0 == satellite);
            its.map(|(_, w)| w.abs()).fold(0.0, f64::max)
        };
        let back = BACK_SHARE * self.limit_sigmas;
        self.left_out.retain(|satellite| of(*satellite) > back);
        let worst = rows.iter().map(|((satellite, _), _)| (*satellite, of(*satellite)));
        let worst = worst.filter(|(satellite, _)| !self.left_out.contains(satellite));
        if let Some((satellite, sigmas)) = worst.max_by(|a, b| a.1.total_cmp(&b.1))
            && sigmas > self.limit_sigmas
            && self.time_gps - self.judged > SETTLED_S
        {
            self.left_out.push(satellite);
            self.judged = self.time_gps;
        }
    }
}

/// Residuals of a fit of a shift and a clock per group to the rows of the satellites that are not left out, in their standard deviations; for
/// the others the difference from that fit. `None` without redundancy.
fn normalised_residuals(
    rows: &[((SatelliteId, ClockGroup), Average)],
    is_left_out: impl Fn(SatelliteId) -> bool,
) -> Option<Vec<f64>> {
    let mut groups: Vec<ClockGroup> = rows.iter().map(|((_, group), _)| *group).collect();
    groups.sort_unstable();
    groups.dedup();
    let unknowns = 3 + groups.len();
    let design = DMatrix::from_fn(rows.len(), unknowns, |i, j| match j {
        0..=2 => rows[i].1.line[j],
        _ => f64::from(u8::from(groups[j - 3] == rows[i].0.1)),
    });
    let fitted = |i: usize| !is_left_out(rows[i].0.0);
    if (0..rows.len()).filter(|i| fitted(*i)).count() < unknowns + 2 {
        return None;
    }
    let weight = |i: usize| if fitted(i) { rows[i].1.sigma_m.powi(-2) } else { 0.0 };
    let residual = DVector::from_iterator(rows.len(), rows.iter().map(|(_, a)| a.sum_m / a.weight));
    let weighted = DMatrix::from_fn(rows.len(), unknowns, |i, j| weight(i) * design[(i, j)]);
    // A group without a fitted satellite has no clock: a weak one keeps the fit defined.
    let normal = design.tr_mul(&weighted) + DMatrix::identity(unknowns, unknowns) * 1e-9;
    let factor = nalgebra::Cholesky::new(normal)?;
    let solution = factor.solve(&weighted.tr_mul(&residual));
    let left = residual - &design * solution;
    let covered = factor.solve(&design.transpose());
    let normalised = |i: usize| {
        let of_fit = (design.row(i) * covered.column(i))[(0, 0)];
        let variance = rows[i].1.sigma_m.powi(2) + if fitted(i) { -of_fit } else { of_fit };
        // A row that the fit takes over cannot be judged.
        if variance > 1e-3 * rows[i].1.sigma_m.powi(2) && variance < 1e6 {
            left[i] / variance.sqrt()
        } else {
            0.0
        }
    };
    Some((0..rows.len()).map(normalised).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};
    use crate::pipeline::{PhonePipeline, PipelineOptions};
    use crate::simulation::{Scenario, Simulation};
    use std::sync::Arc;

    /// Messages of phones on a table; the pseudoranges of `biased` are wrong by `bias_m` at all of them.
    fn messages(biased: Option<SatelliteId>, bias_m: f64) -> Vec<Vec<EpochMessage>> {
        let scenario = Scenario { duration_s: 240.0, seed: 3, ..Scenario::stationary(3) };
        let simulation = Simulation::new(scenario).unwrap();
        let products = Arc::new(simulation.products());
        let run = |index: usize| {
            let mut pipeline = PhonePipeline::new("a", Arc::clone(&products), PipelineOptions::default());
            let changed = simulation.epochs(index).map(|simulated| {
                let mut epoch = simulated.epoch;
                for observation in &mut epoch.observations {
                    if Some(observation.satellite) == biased {
                        observation.pseudorange_m = observation.pseudorange_m.map(|m| m + bias_m);
                    }
                }
                pipeline.process(&epoch)
            });
            changed.collect()
        };
        (0..3).map(run).collect()
    }

    /// The satellites that are left out at the end.
    fn left_out(messages: &[Vec<EpochMessage>], phones: usize) -> Vec<SatelliteId> {
        let mut judge = BiasedSatellites::new(3.0);
        for second in 0..230 {
            let epoch = messages.iter().take(phones).filter_map(|of_phone| of_phone.get(second));
            let time_gps = messages[0][second].time_gps;
            judge.take(time_gps, epoch);
        }
        judge.left_out
    }

    fn high_satellite(messages: &[Vec<EpochMessage>]) -> SatelliteId {
        let high = messages[0][100].observations.iter().filter(|o| o.direction.elevation_rad > 0.6);
        high.map(|o| o.satellite).next().unwrap()
    }

    #[test]
    fn a_satellite_that_all_phones_contradict_is_left_out_and_no_other() {
        let sound = messages(None, 0.0);
        assert_eq!(left_out(&sound, 3), []);
        let wrong = high_satellite(&sound);
        assert_eq!(left_out(&messages(Some(wrong), -8.0), 3), [wrong]);
    }

    #[test]
    fn one_phone_alone_accuses_no_satellite() {
        let wrong = high_satellite(&messages(None, 0.0));
        assert_eq!(left_out(&messages(Some(wrong), -8.0), 1), []);
    }

    #[test]
    fn residuals_of_a_fit_without_redundancy_are_not_judged() {
        let observations = Receiver::in_wuhan().observe(&OPEN_SKY_DEG[..6]);
        let average = |o: &CorrectedObservation| Average {
            sum_m: 1.0,
            weight: 1.0,
            line: (o.satellite_position.0.normalize()).into(),
            sigma_m: 1.0,
        };
        let rows: Vec<_> =
            observations.iter().map(|o| ((o.satellite, o.clock_group()), average(o))).collect();
        assert!(normalised_residuals(&rows, |_| false).is_none());
    }
}
