//! Measurement update of one phone from code and Doppler, with eliminated clocks and robust weights on innovations.
//!
//! The weight of an innovation depends on the variances of the measurement and of the predicted position. The variance of the clock, which
//! is estimated from the same few innovations, is neglected.
//!
//! The rows of a phone are first compressed to its own three position (or velocity) states: with the clocks eliminated,
//! the information of the epoch is (A, b), A = Σ w h̃h̃ᵀ. With A = LLᵀ the rows z = L⁻¹b, H = Lᵀ have unit noise and
//! are applied one by one in Joseph form, so that the joint covariance is updated with at most three rows per kind of measurement.

use nalgebra::{Matrix3, Vector3};

use super::{JointFilter, RobustWeights, STATES_PER_PHONE};
use crate::measurement::CorrectedObservation;
use crate::solve::elimination::{Eliminated, Row};
use crate::solve::groups::ClockGroups;
use crate::solve::position::code_row;
use crate::solve::velocity::rate_row;

/// Number of reweighting iterations.
const ROUNDS: usize = 3;

/// Offsets of the measured states within a phone: position 0, velocity 3.
const POSITION: usize = 0;
const VELOCITY: usize = 3;

impl JointFilter {
    /// Updates the phone in `slot` with its observations at the filter's present time.
    ///
    /// The observations include those excluded by the phone's own RAIM: the filter judges them better against its prediction, and rejects
    /// them by their innovations. A slot that does not exist changes nothing.
    pub fn update(&mut self, slot: usize, observations: &[CorrectedObservation]) {
        if slot >= self.len() {
            return;
        }
        let (at_position, at_velocity) =
            (slot * STATES_PER_PHONE + POSITION, slot * STATES_PER_PHONE + VELOCITY);
        let position = self.position(slot);
        let groups = ClockGroups::of(observations.iter());
        let scale = self.options.code_sigma_scale.powi(-2);
        let mut rows: Vec<Row> =
            observations.iter().map(|o| scaled(code_row(o, position, &groups), scale)).collect();
        let code_factors = self.weight(at_position, &mut rows, groups.len());
        let has_code = self.apply(at_position, &Eliminated::new(&rows, groups.len()));

        let velocity = self.mean.fixed_rows::<3>(at_velocity).into_owned();
        let scale = self.options.rate_sigma_scale.powi(-2);
        let mut rows: Vec<Row> = observations
            .iter()
            .filter_map(|o| rate_row(o, position))
            .map(|row| scaled(Row { y: row.y - row.h.dot(&velocity), ..row }, scale))
            .collect();
        self.weight(at_velocity, &mut rows, 1);
        let has_rates = self.apply(at_velocity, &Eliminated::new(&rows, 1));
        if has_code || has_rates {
            let code_used = code_factors.iter().filter(|factor| **factor > 0.0).count();
            self.mark_measured(slot, code_used, observations.len());
        }
    }

    /// Multiplies the rows' weights by their robust factors and returns the factors. Clocks start from weighted medians, so that one
    /// outlier does not shift all rows of its group.
    fn weight(&self, at: usize, rows: &mut [Row], group_count: usize) -> Vec<f64> {
        let robust: RobustWeights = self.options.robust;
        let prior = self.covariance.fixed_view::<3, 3>(at, at).into_owned();
        let nominal: Vec<f64> = rows.iter().map(|row| row.weight).collect();
        let mut factors = vec![1.0; rows.len()];
        let mut clocks: Vec<f64> = (0..group_count).map(|g| weighted_median(rows, g)).collect();
        for round in 0..ROUNDS {
            for ((row, factor), weight) in rows.iter().zip(&mut factors).zip(&nominal) {
                let variance = 1.0 / weight + row.h.dot(&(prior * row.h));
                *factor = robust.factor((row.y - clocks[row.group]) / variance.sqrt());
            }
            for ((row, factor), weight) in rows.iter_mut().zip(&factors).zip(&nominal) {
                row.weight = weight * factor;
            }
            if round + 1 < ROUNDS {
                let eliminated = Eliminated::new(rows, group_count);
                for (group, clock) in clocks.iter_mut().enumerate() {
                    if eliminated.group_weight(group) > 0.0 {
                        *clock = eliminated.clock(group, &Vector3::zeros());
                    }
                }
            }
        }
        factors
    }

    /// Applies the information (A, b) about the three states from `at`. Returns whether there was any information.
    fn apply(&mut self, at: usize, eliminated: &Eliminated) -> bool {
        let (root, rows) = compress(eliminated);
        let mut correction = Vector3::zeros();
        let mut has_information = false;
        for (h, z) in root.column_iter().zip(rows.iter()) {
            let h: Vector3<f64> = h.into_owned();
            if h.norm_squared() <= 0.0 {
                continue;
            }
            let before = self.mean.fixed_rows::<3>(at).into_owned();
            self.apply_row(at, &h, z - h.dot(&correction));
            correction += self.mean.fixed_rows::<3>(at) - before;
            has_information = true;
        }
        has_information
    }

    /// Applies one row with unit noise in Joseph form: P ← (I − KHᵀ)P(I − KHᵀ)ᵀ + KKᵀ.
    fn apply_row(&mut self, at: usize, h: &Vector3<f64>, innovation: f64) {
        let ph = self.covariance.fixed_columns::<3>(at) * h;
        let s = h.dot(&ph.fixed_rows::<3>(at)) + 1.0;
        let gain = &ph / s;
        self.mean.axpy(innovation, &gain, 1.0);
        let (n, gain, ph) = (self.mean.len(), gain.as_slice(), ph.as_slice());
        for (column, (kj, pj)) in self.covariance.as_mut_slice().chunks_exact_mut(n).zip(gain.iter().zip(ph))
        {
            for (value, (ki, pi)) in column.iter_mut().zip(gain.iter().zip(ph)) {
                // The form is symmetric in i and j, so (i, j) and (j, i) round alike and P stays exactly symmetric.
                *value += s * (ki * kj) - (ki * pj + pi * kj);
            }
        }
    }
}

fn scaled(row: Row, factor: f64) -> Row {
    Row { weight: row.weight * factor, ..row }
}

/// L and z = L⁻¹b for A = LLᵀ; a direction without information gives a zero column.
fn compress(eliminated: &Eliminated) -> (Matrix3<f64>, Vector3<f64>) {
    let Eliminated { normal, rhs, floor, .. } = eliminated;
    let (mut root, mut z) = (Matrix3::zeros(), Vector3::zeros());
    for j in 0..3 {
        let pivot = normal[(j, j)] - (0..j).map(|k| root[(j, k)] * root[(j, k)]).sum::<f64>();
        if pivot.is_nan() || pivot <= *floor {
            continue;
        }
        let diagonal = pivot.sqrt();
        root[(j, j)] = diagonal;
        for i in j + 1..3 {
            let known: f64 = (0..j).map(|k| root[(i, k)] * root[(j, k)]).sum();
            root[(i, j)] = (normal[(i, j)] - known) / diagonal;
        }
        z[j] = (rhs[j] - (0..j).map(|k| root[(j, k)] * z[k]).sum::<f64>()) / diagonal;
    }
    (root, z)
}

/// Weighted median of the innovations of one clock; 0 without innovations.
fn weighted_median(rows: &[Row], group: usize) -> f64 {
    let mut values: Vec<(f64, f64)> =
        rows.iter().filter(|row| row.group == group).map(|row| (row.y, row.weight)).collect();
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = values.iter().map(|v| v.1).sum::<f64>() / 2.0;
    let mut passed = 0.0;
    for (value, weight) in &values {
        passed += weight;
        if passed >= half {
            return *value;
        }
    }
    0.0
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::filter::{FilterOptions, Start};
    use crate::frames::EcefVector;
    use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};
    use crate::time::GpsTime;

    const PLAIN: FilterOptions = FilterOptions::peng2023();

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
        assert!((&filter.mean - &prior_mean - correction.rows(0, n)).amax() < 1e-4);
        assert!((&filter.covariance - posterior.view((0, 0), (n, n))).amax() < 1e-4);
        assert!((&filter.mean - &prior_mean).rows(0, 9).amax() > 1e-3, "the other phone moves too");
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
        let mut without = with.clone();
        let mut observations = receiver.observe(&OPEN_SKY_DEG);
        observations[3].pseudorange_m += 300.0;
        with.update(0, &observations);
        observations[3].pseudorange_sigma_m = 1e9;
        without.update(0, &observations);
        assert!((&with.mean - &without.mean).amax() < 1e-6);
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
