//! Search for the largest consistent subset of measurements (Cappello 2023, section 2.1).
//!
//! Subsets are judged about the solution of all measurements: without a set S of them the statistic is D − r_Sᵀ(C_v)_SS⁻¹r_S, and each element of
//! S takes one degree of freedom. A Cholesky factor that grows and shrinks with S makes a subset cost a few operations. What is found is
//! solved and tested again exactly.

use nalgebra::DMatrix;

use super::checks::{UNCHECKABLE, global_test};
use super::options::RaimOptions;
use super::{Cause, Verdict};
use crate::measurement::{CorrectedObservation, Usage};
use crate::solve::{Fit, solve_position};

/// The solution of the largest subset that passes the global test, and the verdict on it. Excluded observations are marked in place.
///
/// If several subsets of one size pass, the measurements do not tell which one is right: the solution is that with the smallest statistic, and the
/// verdict says so. If none passes, or the search becomes too long, the solution is that of all measurements.
pub(super) fn exclude(
    observations: &mut [CorrectedObservation],
    fit: Fit,
    options: &RaimOptions,
) -> (Fit, Verdict) {
    let mut search = Search::new(&fit, options);
    let most = options.maximum_exclusions.min(fit.degrees_of_freedom().saturating_sub(1));
    if most == 0 {
        return (fit, Verdict::Unreliable(Cause::InsufficientRedundancy));
    }
    for size in 1..=most {
        search.sets_of(size);
        if search.is_exhausted() {
            return (fit, Verdict::Unreliable(Cause::SearchLimit));
        }
        let Some(best) = search.best.take() else { continue };
        let taken: Vec<usize> = best.set.iter().map(|i| fit.observation(*i)).collect();
        for index in &taken {
            observations[*index].usage = Usage::Excluded;
        }
        let solved = solve_position(observations, fit.position()).ok();
        let passing = solved.filter(|fit| global_test(fit, options).is_some_and(|test| test.passes()));
        let Some(passing) = passing else {
            for index in taken {
                observations[index].usage = Usage::Used;
            }
            continue;
        };
        let verdict = if search.passing > 1 { Verdict::Unreliable(Cause::Tie) } else { Verdict::Reliable };
        return (passing, verdict);
    }
    (fit, Verdict::Unreliable(Cause::TestsFailed))
}

/// A set of measurements without which the rest passes.
struct Found {
    set: Vec<usize>,
    statistic: f64,
}

struct Search<'a> {
    options: &'a RaimOptions,
    covariance: DMatrix<f64>,
    residuals_m: Vec<f64>,
    weights: Vec<f64>,
    degrees_of_freedom: usize,
    /// Cholesky rows of (C_v)_SS, and L⁻¹r_S, for the present set.
    rows: Vec<Vec<f64>>,
    solved: Vec<f64>,
    set: Vec<usize>,
    tried: usize,
    passing: usize,
    best: Option<Found>,
}

impl<'a> Search<'a> {
    fn new(fit: &Fit, options: &'a RaimOptions) -> Self {
        let m = fit.len();
        Self {
            options,
            covariance: DMatrix::from_fn(
                m,
                m,
                |i, j| if i < j { 0.0 } else { fit.residual_covariance(i, j) },
            ),
            residuals_m: (0..m).map(|i| fit.residual_m(i)).collect(),
            weights: (0..m).map(|i| fit.weight(i)).collect(),
            degrees_of_freedom: fit.degrees_of_freedom(),
            rows: Vec::new(),
            solved: Vec::new(),
            set: Vec::new(),
            tried: 0,
            passing: 0,
            best: None,
        }
    }

    const fn is_exhausted(&self) -> bool {
        self.tried > self.options.maximum_subsets
    }

    /// Tries all sets of this size.
    fn sets_of(&mut self, size: usize) {
        (self.passing, self.best) = (0, None);
        let total = self.residuals_m.iter().zip(&self.weights).map(|(r, w)| w * r * r).sum();
        self.descend(0, size, total);
    }

    /// Extends the present set by `missing` measurements from number `from` on; `statistic` is that without the present set.
    fn descend(&mut self, from: usize, missing: usize, statistic: f64) {
        if missing == 0 {
            self.tried += 1;
            let threshold = self.options.global.threshold(self.degrees_of_freedom - self.set.len());
            if statistic <= threshold {
                self.passing += 1;
                if self.best.as_ref().is_none_or(|best| statistic < best.statistic) {
                    self.best = Some(Found { set: self.set.clone(), statistic });
                }
            }
            return;
        }
        for i in from..=self.residuals_m.len().saturating_sub(missing) {
            if self.is_exhausted() {
                return;
            }
            if let Some(gain) = self.push(i) {
                self.descend(i + 1, missing - 1, statistic - gain);
                self.pop();
            }
        }
    }

    /// Adds a measurement to the set and returns by how much the statistic falls; `None` if its error is not seen without those in the set.
    fn push(&mut self, i: usize) -> Option<f64> {
        let mut row: Vec<f64> = Vec::with_capacity(self.set.len() + 1);
        let (mut pivot, mut residual_m) = (self.covariance[(i, i)], self.residuals_m[i]);
        for (k, j) in self.set.iter().enumerate() {
            let known: f64 = row.iter().zip(&self.rows[k]).map(|(a, b)| a * b).sum();
            let element = (self.covariance[(i, *j)] - known) / self.rows[k][k];
            pivot -= element * element;
            residual_m -= element * self.solved[k];
            row.push(element);
        }
        if pivot * self.weights[i] <= UNCHECKABLE {
            return None;
        }
        let diagonal = pivot.sqrt();
        row.push(diagonal);
        let solved = residual_m / diagonal;
        self.rows.push(row);
        self.solved.push(solved);
        self.set.push(i);
        Some(solved * solved)
    }

    fn pop(&mut self) {
        self.rows.pop();
        self.solved.pop();
        self.set.pop();
    }
}

/// Statistic of the measurements without a set of them, judged about the solution of all.
#[cfg(test)]
pub(super) fn statistic_without(fit: &Fit, set: &[usize]) -> f64 {
    let options = RaimOptions::default();
    let mut search = Search::new(fit, &options);
    let gained: f64 = set.iter().filter_map(|i| search.push(*i)).sum();
    fit.weighted_square_sum() - gained
}
