//! Measurement update of one phone from code and Doppler, with an eliminated clock and robust weights on innovations.
//!
//! The rows of a phone are first compressed to its own states (see [`super::information`]) and then applied one by one in Joseph form. So the
//! cost is linear in the satellites, and quadratic in the states of the filter for each of the few rows that remain.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::consider::{Block, Consider, Pull};
use super::information::{Information, Measured, Other};
use super::joint::Kept;
use super::weights::{reweight, reweight_delayed};
use super::{FilterOptions, JointFilter};
use crate::frames::Ecef;
use crate::integrity::{Innovations, RaimOptions, TestReport};
use crate::measurement::{CorrectedObservation, Usage};
use crate::solve::elimination::Row;
use crate::solve::groups::ClockGroups;
use crate::solve::position::code_row;
use crate::solve::velocity::rate_row;

/// Offset of the velocity within a phone's states.
const VELOCITY: usize = 3;

/// Robust factor below which a range rate is doubted; if more than a third are, they are examined for a manoeuvre.
const DOUBTED: f64 = 0.5;
const MANOEUVRE_SHARE: usize = 3;

/// Standard deviation of a predicted position (root of the sum of its variances) above which innovations do not show outliers, m.
const VAGUE_M: f64 = 20.0;

/// What an update made of its measurements.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UpdateReport {
    /// Pseudoranges.
    pub codes: Kept,
    /// Range rates.
    pub rates: Kept,
    /// Changes of range.
    pub changes: Kept,
    /// Whether the phone stands still.
    pub stands: bool,
    /// Normalised innovation squared of the code, clock removed.
    pub code_nis: f64,
    /// Number of independent rows in [`UpdateReport::code_nis`]; its expected value if model and measurements agree.
    pub code_rows: usize,
    /// Normalised innovation squared of the Doppler, drift removed.
    pub rate_nis: f64,
    /// Number of independent rows in [`UpdateReport::rate_nis`].
    pub rate_rows: usize,
    /// Normalised innovation squared of the changes of range, clock removed.
    pub change_nis: f64,
    /// Number of independent rows in [`UpdateReport::change_nis`].
    pub change_rows: usize,
    /// Test of all pseudoranges against the prediction, under their nominal weights; `None` if it was not asked for, or RAIM's selection counts.
    pub test: Option<TestReport>,
}

impl UpdateReport {
    /// Normalised innovation squared of the code per independent row, 1 if model and measurements agree; `None` without code.
    pub fn code_nis_per_row(&self) -> Option<f64> {
        (self.code_rows > 0).then(|| self.code_nis / self.code_rows as f64)
    }

    /// The same of the Doppler.
    pub fn rate_nis_per_row(&self) -> Option<f64> {
        (self.rate_rows > 0).then(|| self.rate_nis / self.rate_rows as f64)
    }
}

/// Normalised innovation squared of applied rows.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Innovation {
    pub nis: f64,
    pub rows: usize,
}

impl JointFilter {
    /// Updates the phone in `slot` with its observations at the filter's present time. A slot that does not exist changes nothing.
    ///
    /// By default the observations include those excluded by the phone's own RAIM: the filter judges them by their innovations. A vague
    /// prediction, as after half a minute, judges nothing, and then RAIM's selection counts.
    pub fn update(&mut self, slot: usize, observations: &[CorrectedObservation]) -> UpdateReport {
        self.update_tested(slot, observations, None)
    }

    /// [`JointFilter::update`] with tests of the innovations.
    pub(super) fn update_tested(
        &mut self,
        slot: usize,
        observations: &[CorrectedObservation],
        tests: Option<&RaimOptions>,
    ) -> UpdateReport {
        if slot >= self.len() {
            return UpdateReport::default();
        }
        let at = self.slots[slot].at;
        let is_vague = self.prior(at).trace() > VAGUE_M.powi(2);
        let only_used = self.options.only_used || is_vague;
        let is_offered = |o: &&CorrectedObservation| !only_used || o.usage == Usage::Used;
        let offered: Vec<&CorrectedObservation> = observations.iter().filter(is_offered).collect();
        let position = self.position(slot);
        let (codes, code, test) = self.update_codes(slot, position, &offered, tests.filter(|_| !only_used));
        let (rates, rate, stands) = if self.options.use_rates {
            self.update_rates(slot, position, &offered)
        } else {
            Default::default()
        };
        if code.rows + rate.rows > 0 {
            self.mark_measured(slot, codes, rates);
        }
        let (code_nis, code_rows, rate_nis, rate_rows) = (code.nis, code.rows, rate.nis, rate.rows);
        UpdateReport {
            codes,
            rates,
            stands,
            code_nis,
            code_rows,
            rate_nis,
            rate_rows,
            test,
            ..UpdateReport::default()
        }
    }

    fn update_codes(
        &mut self,
        slot: usize,
        position: Ecef,
        observations: &[&CorrectedObservation],
        tests: Option<&RaimOptions>,
    ) -> (Kept, Innovation, Option<TestReport>) {
        let groups = ClockGroups::of(observations.iter().copied());
        let code: Vec<Row> = observations.iter().map(|o| code_row(o, position, &groups)).collect();
        self.prepare_biases(slot, &groups, &code);
        let interval_s = self.silence_s(slot);
        let is_tied =
            self.slots[slot].is_tied || (self.options.use_standing && self.slots[slot].standing.stands());
        let inflation = self.options.code_noise.inflation(interval_s, is_tied);
        let known = &self.slots[slot];
        let FilterOptions { lasting_weight, tied_lasting_weight, .. } = self.options;
        let lasting_weight = if is_tied { tied_lasting_weight } else { lasting_weight };
        let row = |(row, o): (&Row, &&CorrectedObservation)| {
            let bias = known.bias(o.clock_group());
            let bias_m = bias.map_or(0.0, |place| self.mean[known.first_bias() + place]);
            let variance_m2 = o.noise_variance_m2() + lasting_weight * o.shared.satellite_sigma_m.powi(2);
            Measured {
                h: row.h,
                other: bias.map_or(Other::None, Other::Bias),
                y: row.y - bias_m,
                weight: 1.0 / (inflation * variance_m2),
            }
        };
        let mut rows: Vec<Measured> = code.iter().zip(observations).map(row).collect();
        let states: Vec<usize> =
            (known.at..known.at + 3).chain(known.first_bias()..known.behind_biases()).collect();
        let test = tests.and_then(|tests| self.innovations(&states, &rows, observations)?.test(tests));
        let prior = self.prior(states[0]);
        let robust = self.options.robust;
        let pull = |row: &Measured| {
            let sigma_m = (row.weight.recip() + row.h.dot(&(prior * row.h))).sqrt();
            Pull { kept_m: robust.keep * sigma_m, rejected_m: robust.reject * sigma_m }
        };
        let pulls: Vec<Pull> = rows.iter().map(pull).collect();
        let late = |i: usize| self.options.late_codes.factor(observations[i].cn0_dbhz);
        let factors = reweight_delayed(&mut rows, &prior, self.options.robust, late);
        let information = Information::new(&rows, states.len());
        self.slots[slot].noise_level.take(interval_s, &rows, observations, &prior);
        let level = self.slots[slot].noise_level.factor();
        let (gain, innovation) = self.apply(&states, &information);
        if let Some(consider) = self.consider.as_mut().filter(|_| innovation.rows > 0) {
            let sensitive: Vec<_> = observations.iter().map(|o| consider.sensitivity(o)).collect();
            let mut shared = DMatrix::zeros(states.len(), consider.shared_states());
            let mut noise = DMatrix::zeros(states.len(), states.len());
            let mut h = DVector::zeros(states.len());
            for ((row, observation), sensitivity) in rows.iter().zip(observations).zip(&sensitive) {
                information.compress(row, &mut h);
                // w²σ², with w the weight of the row and σ² of its noise alone.
                let own = row.weight * inflation * observation.noise_variance_m2();
                noise.ger(row.weight * own * level, &h, &h, 1.0);
                Consider::add_sensitivity(&mut shared, row.weight, &h, *sensitivity);
            }
            let (root, gain) = (&information.root, &gain);
            consider.update(&Block { states: &states, root, gain, noise, shared: Some(shared) });
            consider.take_pulls(&states, &rows, &sensitive, &pulls);
        }
        (kept(&factors), innovation, test)
    }

    /// The innovations of some rows about these states under the nominal noise of the observations and the covariance that is stated.
    fn innovations(
        &self,
        states: &[usize],
        rows: &[Measured],
        observations: &[&CorrectedObservation],
    ) -> Option<Innovations> {
        let mut partials = DMatrix::zeros(states.len(), rows.len());
        for (row, mut column) in rows.iter().zip(partials.column_iter_mut()) {
            row.add_to(&mut column, 1.0);
        }
        let stated = self.stated();
        let prior = DMatrix::from_fn(states.len(), states.len(), |i, j| stated[(states[i], states[j])]);
        let innovations_m = rows.iter().map(|row| row.y).collect();
        let weights = observations.iter().map(|o| o.pseudorange_sigma_m.powi(-2)).collect();
        Innovations::new(&partials, prior, innovations_m, weights)
    }

    fn update_rates(
        &mut self,
        slot: usize,
        position: Ecef,
        observations: &[&CorrectedObservation],
    ) -> (Kept, Innovation, bool) {
        let at = self.slots[slot].at + VELOCITY;
        let velocity: Vector3<f64> = self.mean.fixed_rows::<3>(at).into_owned();
        let scale = self.options.rate_sigma_scale.powi(-2);
        let row = |o: &&CorrectedObservation| {
            let row = rate_row(o, position).filter(|_| !self.options.use_changes || is_of_the_epoch(o))?;
            Some(Measured {
                h: row.h,
                other: Other::None,
                y: row.y - row.h.dot(&velocity),
                weight: row.weight * scale,
            })
        };
        let mut rows: Vec<Measured> = observations.iter().filter_map(row).collect();
        let states = [at, at + 1, at + 2];
        let nominal = rows.clone();
        let mut factors = reweight(&mut rows, &self.prior(at), self.options.robust);
        let doubted = factors.iter().filter(|factor| **factor < DOUBTED).count();
        if MANOEUVRE_SHARE * doubted > factors.len() && self.open_for_manoeuvre(slot, &nominal) {
            rows = nominal;
            factors = reweight(&mut rows, &self.prior(at), self.options.robust);
        }
        let information = Information::new(&rows, states.len());
        let innovation = self.apply_unshared(&states, &information);
        let stands = innovation.rows > 0 && self.stand(slot, &velocity, &information);
        (kept(&factors), innovation, stands)
    }

    /// Covariance of three consecutive states.
    fn prior(&self, at: usize) -> Matrix3<f64> {
        self.covariance.fixed_view::<3, 3>(at, at).into_owned()
    }

    /// Applies compressed rows about some states, whose noise has the unit variance that they say, to both covariances. Errors that all phones
    /// share are not in them.
    pub(super) fn apply_unshared(&mut self, states: &[usize], information: &Information) -> Innovation {
        let (gain, innovation) = self.apply(states, information);
        if let Some(consider) = self.consider.as_mut().filter(|_| innovation.rows > 0) {
            let noise = DMatrix::identity(states.len(), states.len());
            consider.update(&Block { states, root: &information.root, gain: &gain, noise, shared: None });
        }
        innovation
    }

    /// Applies compressed rows about some states. Returns the gain on all of them together.
    fn apply(&mut self, states: &[usize], information: &Information) -> (DMatrix<f64>, Innovation) {
        let n = self.mean.len();
        let mut gains = DMatrix::zeros(n, states.len());
        let (mut ph, mut gain) = (DVector::zeros(n), DVector::zeros(n));
        let before = self.mean.clone();
        let mut total = Innovation::default();
        for (index, (h, z)) in information.root.column_iter().zip(information.z.iter()).enumerate() {
            if h[index] <= 0.0 {
                continue;
            }
            let row = states.iter().copied().zip(h.iter().copied()).skip(index);
            let moved: f64 = row.clone().map(|(state, h)| h * (self.mean[state] - before[state])).sum();
            let variance = self.apply_row(row.clone(), z - moved, &mut ph, &mut gain);
            total.nis += (z - moved).powi(2) / variance;
            total.rows += 1;
            // e ← (I − khᵀ)e − kz: earlier columns are carried on, and this row's is added.
            for mut column in gains.column_iter_mut().take(index) {
                let carried: f64 = row.clone().map(|(state, h)| h * column[state]).sum();
                column.axpy(-carried, &gain, 1.0);
            }
            gains.column_mut(index).copy_from(&gain);
        }
        (gains, total)
    }

    /// Applies one row with unit noise in Joseph form: P ← (I − KHᵀ)P(I − KHᵀ)ᵀ + KKᵀ. Returns the innovation's variance, and leaves PH in `ph` and
    /// the gain in `gain`.
    fn apply_row(
        &mut self,
        row: impl Iterator<Item = (usize, f64)> + Clone,
        innovation: f64,
        ph: &mut DVector<f64>,
        gain: &mut DVector<f64>,
    ) -> f64 {
        ph.fill(0.0);
        for (state, h) in row.clone() {
            ph.axpy(h, &self.covariance.column(state), 1.0);
        }
        let s = row.map(|(state, h)| h * ph[state]).sum::<f64>() + 1.0;
        gain.copy_from(ph);
        *gain /= s;
        self.mean.axpy(innovation, gain, 1.0);
        let (n, k, ph) = (self.mean.len(), gain.as_slice(), ph.as_slice());
        for (column, (kj, pj)) in self.covariance.as_mut_slice().chunks_exact_mut(n).zip(k.iter().zip(ph)) {
            for (value, (ki, pi)) in column.iter_mut().zip(k.iter().zip(ph)) {
                // The form is symmetric in i and j, so (i, j) and (j, i) round alike and P stays exactly symmetric.
                *value += s * (ki * kj) - (ki * pj + pi * kj);
            }
        }
        s
    }
}

/// Whether a range rate is that of its epoch. A mean over the interval before is a change of range.
fn is_of_the_epoch(observation: &CorrectedObservation) -> bool {
    observation.range_rate.is_some_and(|rate| rate.averaged_s <= 0.0)
}

fn kept(factors: &[f64]) -> Kept {
    Kept { kept: factors.iter().filter(|factor| **factor > 0.0).count(), offered: factors.len() }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::filter::Start;
    use crate::frames::EcefVector;
    use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};
    use crate::time::GpsTime;

    const PLAIN: FilterOptions = FilterOptions { use_rates: true, ..FilterOptions::peng2023() };

    fn start(receiver: &Receiver, offset_m: f64) -> Start {
        Start {
            position: receiver.position + EcefVector::new(offset_m, -offset_m, 0.5 * offset_m),
            position_covariance: Matrix3::identity() * 25.0,
            velocity: None,
        }
    }

    /// Two phones, correlated by a fictitious difference measurement, ready for an update.
    fn dependent_pair(options: FilterOptions) -> (Receiver, JointFilter) {
        let receiver = Receiver::in_wuhan();
        let time = GpsTime::from_week_tow(2118, 100.0);
        let mut filter = JointFilter::new(options);
        filter.insert(0, time, &start(&receiver, 3.0));
        filter.insert(1, time, &start(&receiver, -2.0));
        let n = filter.mean.len();
        let mut row = DVector::zeros(n);
        (row[0], row[9]) = (1.0, -1.0);
        let pc = &filter.covariance * &row;
        let s = row.dot(&pc) + 0.25;
        filter.covariance -= &pc * pc.transpose() / s;
        (receiver, filter)
    }

    #[test]
    fn compressed_rows_equal_the_dense_update_with_clock_states() {
        let (receiver, mut filter) = dependent_pair(PLAIN);
        let observations = receiver.observe(&OPEN_SKY_DEG);
        let (prior_mean, prior) = (filter.mean.clone(), filter.covariance.clone());
        let position = filter.position(1);
        filter.update(1, &observations);

        // Textbook solution: clocks as states with a very large variance.
        let (m, n) = (observations.len(), prior_mean.len());
        let groups = ClockGroups::of(observations.iter());
        let clock_columns = groups.len() + 1;
        let mut design = DMatrix::zeros(2 * m, n + clock_columns);
        let mut innovation = DVector::zeros(2 * m);
        let mut noise = DMatrix::zeros(2 * m, 2 * m);
        let velocity = prior_mean.fixed_rows::<3>(12).into_owned();
        for (i, observation) in observations.iter().enumerate() {
            let code = code_row(observation, position, &groups);
            design.view_mut((i, 9), (1, 3)).copy_from(&code.h.transpose());
            design[(i, n + code.group)] = 1.0;
            innovation[i] = code.y;
            noise[(i, i)] = 1.0 / code.weight;
            let rate = rate_row(observation, position).unwrap();
            design.view_mut((m + i, 12), (1, 3)).copy_from(&rate.h.transpose());
            design[(m + i, n + groups.len())] = 1.0;
            innovation[m + i] = rate.y - rate.h.dot(&velocity);
            noise[(m + i, m + i)] = 1.0 / rate.weight;
        }
        let mut wide = DMatrix::zeros(n + clock_columns, n + clock_columns);
        wide.view_mut((0, 0), (n, n)).copy_from(&prior);
        for clock in n..n + clock_columns {
            wide[(clock, clock)] = 1e8;
        }
        let cross = &wide * design.transpose();
        let s = &design * &cross + noise;
        let gain = s.clone().cholesky().unwrap().solve(&cross.transpose()).transpose();
        let correction = &gain * innovation;
        let posterior = &wide - &gain * s * gain.transpose();
        // The biases of the clock groups are states of their own behind the phone's.
        let (mean, covariance) = (filter.mean.rows(0, n), filter.covariance.view((0, 0), (n, n)));
        assert!((mean - &prior_mean - correction.rows(0, n)).amax() < 1e-4);
        assert!((covariance - posterior.view((0, 0), (n, n))).amax() < 1e-4);
        assert!((mean - &prior_mean).rows(0, 9).amax() > 1e-3, "the other phone moves too");
    }

    #[test]
    fn the_covariance_stays_symmetric_to_the_bit_and_shrinks() {
        let (receiver, mut filter) = dependent_pair(FilterOptions::default());
        let before = filter.covariance.trace();
        for second in 1..50 {
            filter.predict(GpsTime::from_week_tow(2118, 100.0 + f64::from(second)));
            filter.update(0, &receiver.observe(&OPEN_SKY_DEG));
            filter.update(1, &receiver.observe(&OPEN_SKY_DEG));
            assert_eq!(filter.covariance, filter.covariance.transpose());
            assert!(filter.covariance.clone().cholesky().is_some());
        }
        assert!(filter.covariance.trace() < before);
    }

    #[test]
    fn an_outlier_counts_as_if_it_were_not_there() {
        let (receiver, mut with) = dependent_pair(FilterOptions::default());
        with.predict(with.time_gps() + 1.0);
        let mut without = with.clone();
        let mut observations = receiver.observe(&OPEN_SKY_DEG);
        observations[3].pseudorange_m += 300.0;
        with.update(0, &observations);
        observations[3].pseudorange_sigma_m = 1e9;
        without.update(0, &observations);
        let difference = (&with.mean - &without.mean).rows(0, 18).amax();
        assert!(difference < 1e-4, "{difference}");
        assert!((&with.covariance - &without.covariance).amax() < 1e-6);
    }

    #[test]
    fn a_wrong_start_is_noticed() {
        let (receiver, mut filter) = dependent_pair(FilterOptions::default());
        let time = filter.time_gps();
        filter.insert(1, time, &start(&receiver, 2_000.0));
        for second in 1..=5 {
            assert!(!filter.is_lost(1));
            filter.predict(time + f64::from(second));
            filter.update(0, &receiver.observe(&OPEN_SKY_DEG));
            filter.update(1, &receiver.observe(&OPEN_SKY_DEG));
        }
        assert!(filter.is_lost(1));
        assert!(!filter.is_lost(0));
    }

    #[test]
    fn a_lone_satellite_of_a_system_says_nothing() {
        let (receiver, mut filter) = dependent_pair(PLAIN);
        let mut lone = receiver.observe(&OPEN_SKY_DEG[..1]);
        lone[0].range_rate = None;
        let before = filter.mean.clone();
        filter.update(0, &lone);
        assert_eq!(filter.mean, before);
    }

    #[test]
    fn phones_that_share_nothing_are_filtered_as_if_alone() {
        let receiver = Receiver::in_wuhan();
        let time = GpsTime::from_week_tow(2118, 100.0);
        let (mut both, mut alone) = (JointFilter::new(PLAIN), JointFilter::new(PLAIN));
        both.insert(7, time, &start(&receiver, 10.0));
        both.insert(3, time, &start(&receiver, 4.0));
        alone.insert(3, time, &start(&receiver, 4.0));
        for filter in [&mut both, &mut alone] {
            filter.predict(time + 1.0);
            let slot = filter.slot(3).unwrap();
            filter.update(slot, &receiver.observe(&OPEN_SKY_DEG));
        }
        assert_eq!(both.state(1), alone.state(0));
        both.remove(0);
        assert_eq!(both.slot(3), Some(0));
        assert_eq!(both.state(0), alone.state(0), "a phone taken out leaves the others as they were");
    }
}
