//! Measurement update of one phone: code and Doppler, clocks eliminated, innovations weighted robustly.
//!
//! A phone's rows are first compressed to its own three position (or velocity) states: with the clocks eliminated,
//! the information of the epoch is (A, b), A = Σ w h̃h̃ᵀ. With A = LLᵀ the rows z = L⁻¹b, H = Lᵀ have unit noise and
//! are applied one by one in Joseph form; the joint covariance never meets more than three rows per kind.

use nalgebra::{Matrix3, Vector3};

use super::{JointFilter, RobustWeights, STATES_PER_PHONE};
use crate::measurement::CorrectedObservation;
use crate::solve::elimination::{Eliminated, Row};
use crate::solve::groups::ClockGroups;
use crate::solve::position::code_row;
use crate::solve::velocity::rate_row;

/// Rounds of reweighting.
const ROUNDS: usize = 3;

/// What an update did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UpdateReport {
    /// Normalised innovation squared of the position information, and its degrees of freedom (0-3).
    pub code_nis: (f64, usize),
    /// The same of the velocity information.
    pub rate_nis: (f64, usize),
    /// Factor γ on the weight of each observation's pseudorange, in their order; 0 = rejected.
    pub code_factors: Vec<f64>,
    /// Pseudoranges of non-zero weight.
    pub code_used: usize,
}

/// The states that a kind of measurement sees: position at 0, velocity at 3 within a phone.
const POSITION: usize = 0;
const VELOCITY: usize = 3;

impl JointFilter {
    /// Updates the phone in `slot` with its observations of the filter's present time.
    ///
    /// All observations are offered, those that the phone's own RAIM excluded too: against a prediction the filter can
    /// judge them better, and rejects by innovation.
    pub fn update(&mut self, slot: usize, observations: &[CorrectedObservation]) -> UpdateReport {
        let mut report = UpdateReport::default();
        if slot >= self.len() {
            return report;
        }
        let position = self.position(slot);
        let groups = ClockGroups::of(observations.iter());
        let scale = self.options.code_sigma_scale.powi(-2);
        let mut rows: Vec<Row> =
            observations.iter().map(|o| scaled(code_row(o, position, &groups), scale)).collect();
        report.code_factors = self.weight(slot * STATES_PER_PHONE + POSITION, &mut rows, groups.len());
        report.code_used = report.code_factors.iter().filter(|f| **f > 0.0).count();
        report.code_nis = self.apply(slot * STATES_PER_PHONE + POSITION, &Eliminated::new(&rows, groups.len()));

        let velocity = self.mean.fixed_rows::<3>(slot * STATES_PER_PHONE + VELOCITY).into_owned();
        let scale = self.options.rate_sigma_scale.powi(-2);
        let mut rows: Vec<Row> = observations
            .iter()
            .filter_map(|o| rate_row(o, position))
            .map(|row| scaled(Row { y: row.y - row.h.dot(&velocity), ..row }, scale))
            .collect();
        self.weight(slot * STATES_PER_PHONE + VELOCITY, &mut rows, 1);
        report.rate_nis = self.apply(slot * STATES_PER_PHONE + VELOCITY, &Eliminated::new(&rows, 1));
        self.mark_measured(slot);
        report
    }

    /// Multiplies the rows' weights by their robust factors, which it returns. Clocks start from weighted medians, so
    /// that one outlier does not pull its whole group.
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

    /// Applies the information (A, b) about the three states at `at`; returns the NIS and its degrees of freedom.
    fn apply(&mut self, at: usize, eliminated: &Eliminated) -> (f64, usize) {
        let (root, rows) = compress(&eliminated.normal, &eliminated.rhs);
        let mut correction = Vector3::zeros();
        let mut nis = 0.0;
        let mut degrees = 0;
        for (h, z) in root.column_iter().zip(rows.iter()) {
            let h: Vector3<f64> = h.into_owned();
            if h.norm_squared() <= 0.0 {
                continue;
            }
            let before = self.mean.fixed_rows::<3>(at).into_owned();
            let innovation = z - h.dot(&correction);
            nis += self.apply_row(at, &h, innovation);
            correction += self.mean.fixed_rows::<3>(at) - before;
            degrees += 1;
        }
        (nis, degrees)
    }

    /// One row with unit noise, in Joseph form: P ← (I − KHᵀ)P(I − KHᵀ)ᵀ + KKᵀ.
    fn apply_row(&mut self, at: usize, h: &Vector3<f64>, innovation: f64) -> f64 {
        let ph = self.covariance.fixed_columns::<3>(at) * h;
        let s = h.dot(&ph.fixed_rows::<3>(at)) + 1.0;
        let gain = &ph / s;
        self.mean.axpy(innovation, &gain, 1.0);
        let n = self.mean.len();
        for (j, column) in self.covariance.as_mut_slice().chunks_exact_mut(n).enumerate() {
            let (kj, pj) = (gain[j], ph[j]);
            for ((value, ki), pi) in column.iter_mut().zip(gain.iter()).zip(ph.iter()) {
                // Written so that (i, j) and (j, i) round alike: P stays symmetric to the last bit.
                *value += s * (ki * kj) - (ki * pj + pi * kj);
            }
        }
        innovation * innovation / s
    }
}

fn scaled(row: Row, factor: f64) -> Row {
    Row { weight: row.weight * factor, ..row }
}

/// L and z = L⁻¹b for A = LLᵀ; a direction without information gives a zero column.
fn compress(normal: &Matrix3<f64>, rhs: &Vector3<f64>) -> (Matrix3<f64>, Vector3<f64>) {
    let floor = 1e-12 * normal.diagonal().max();
    let (mut root, mut z) = (Matrix3::zeros(), Vector3::zeros());
    for j in 0..3 {
        let pivot = normal[(j, j)] - (0..j).map(|k| root[(j, k)] * root[(j, k)]).sum::<f64>();
        if pivot.is_nan() || pivot <= floor {
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

/// Weighted median of the innovations of one clock; 0 when it has none.
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
