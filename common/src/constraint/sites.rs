//! Sites: the contributions of rows to a state, which can be added, replaced and removed.

use nalgebra::{DMatrix, DVector};

use super::SkipReason;
use super::rows::{BoundedRow, SparseRow};
use super::second::AppliedRow;
use super::truncation::{Enlargement, Gaussian, Truncation, truncate_with};

/// Convergence limit of a refresh: change of the mean in standard deviations, and relative change of the variance.
pub(super) const CONVERGED: f64 = 1e-3;
/// Minimum fraction of a row's prior variance after one constraint (1 % of the standard deviation). Removing a site loses digits with the
/// square of this ratio; the mean is not affected.
const LEAST_VARIANCE: f64 = 1e-4;

/// Contribution of a row: exp(−½ precision y² + shift y), y = cᵀX + c₀.
#[derive(Clone, Copy)]
pub(super) struct Site {
    row: SparseRow,
    precision: f64,
    shift: f64,
}

impl Site {
    /// The row with its precision.
    pub(super) const fn applied(&self) -> AppliedRow {
        AppliedRow { row: self.row, precision: self.precision }
    }
}

/// The sites of a row before it is applied again.
#[derive(Clone, Copy)]
pub(super) struct PreviousSites {
    /// Site on the same row that the state contains.
    pub(super) in_state: Option<Site>,
    /// Site of the previous sweep, as the reference for the change; it may have been removed.
    pub(super) earlier: Option<Site>,
}

/// Result of applying a row.
pub(super) struct Applied {
    /// New site of the row.
    pub(super) site: Site,
    /// Number of enlargements of the interval.
    pub(super) enlargements: u32,
    /// Change since the previous sweep, in standard deviations of the mean or as the logarithm of the variance ratio.
    pub(super) change: f64,
}

/// A Gaussian state with sites.
pub(super) struct Posterior<'a> {
    pub(super) state: &'a mut DVector<f64>,
    pub(super) covariance: &'a mut DMatrix<f64>,
    /// Pc of the row projected last.
    pub(super) gain: DVector<f64>,
    /// State and covariance without sites.
    pub(super) prior: (DVector<f64>, DMatrix<f64>),
    /// Fraction of a former site that is kept.
    damping: f64,
    /// Whether a site was removed from the covariance, which loses digits.
    has_removed: bool,
}

impl<'a> Posterior<'a> {
    /// A posterior without sites.
    pub(super) fn new(state: &'a mut DVector<f64>, covariance: &'a mut DMatrix<f64>, damping: f64) -> Self {
        let prior = (state.clone(), covariance.clone());
        let gain = DVector::zeros(state.len());
        Self { state, covariance, gain, prior, damping, has_removed: false }
    }

    /// Truncates the state by one row, in place of the row's site in the state.
    pub(super) fn apply(
        &mut self,
        bounded: &BoundedRow,
        policy: Enlargement,
        sites: &PreviousSites,
    ) -> Result<Applied, SkipReason> {
        let marginal = self.project(&bounded.row)?;
        let former = sites.in_state.unwrap_or(Site { row: bounded.row, precision: 0.0, shift: 0.0 });
        let cavity = with_site(marginal, -former.precision, -former.shift);
        if !is_proper(cavity) {
            return Ok(Applied { site: former, enlargements: 0, change: 0.0 });
        }
        let Truncation { moments, enlargements } =
            truncate_with(cavity, bounded.interval, bounded.density, policy).ok_or(SkipReason::NotFinite)?;
        let cavity_precision = 1.0 / cavity.variance;
        let most = 1.0 / (LEAST_VARIANCE * bounded.row.variance(&self.prior.1));
        let precision = (1.0 / moments.variance - cavity_precision).max(0.0).min(most);
        // For any precision the mean becomes that of the truncation.
        let shift = moments.mean * (precision + cavity_precision) - cavity.mean * cavity_precision;
        let mut site = Site { row: bounded.row, precision, shift };
        if former.precision > 0.0 {
            let keep = self.damping.clamp(0.0, 0.99);
            site.precision += keep * (former.precision - site.precision);
            site.shift += keep * (former.shift - site.shift);
        }
        let updated = with_site(cavity, site.precision, site.shift);
        let before = sites.earlier.map_or(marginal, |site| with_site(cavity, site.precision, site.shift));
        let moved = (updated.mean - before.mean).abs() / before.variance.sqrt();
        let change = moved.max((updated.variance / before.variance).ln().abs());
        if change < CONVERGED && former.precision > 0.0 {
            return Ok(Applied { site: former, enlargements, change });
        }
        self.update(marginal, updated)?;
        Ok(Applied { site, enlargements, change })
    }

    /// Removes a site from the state and from its slot. Returns `false` if, near an equality, rounding leaves no valid distribution without
    /// the site; the site then stays in both.
    pub(super) fn remove(&mut self, slot: &mut Option<Site>) -> bool {
        let Some(site) = *slot else { return true };
        let Ok(marginal) = self.project(&site.row) else { return false };
        let cavity = with_site(marginal, -site.precision, -site.shift);
        let is_out = is_proper(cavity) && self.update(marginal, cavity).is_ok();
        if is_out {
            *slot = None;
            self.has_removed = true;
        }
        is_out
    }

    /// Recomputes the state from the prior and all present sites, each applied once, without the rounding errors of removed sites. Every
    /// step reduces the covariance, so it stays positive definite.
    pub(super) fn rebuild<'s>(&mut self, sites: impl Iterator<Item = &'s Site>) {
        if !self.has_removed {
            return;
        }
        self.state.copy_from(&self.prior.0);
        self.covariance.copy_from(&self.prior.1);
        for site in sites {
            if let Ok(marginal) = self.project(&site.row) {
                // A step that is not finite is left out; the state is then that without this site.
                let _ = self.update(marginal, with_site(marginal, site.precision, site.shift));
            }
        }
    }

    /// Distribution of cᵀX + c₀; leaves Pc in `gain`.
    pub(super) fn project(&mut self, row: &SparseRow) -> Result<Gaussian, SkipReason> {
        if !row.fits(self.state.len()) {
            return Err(SkipReason::UnknownPhone);
        }
        row.covariance_times(self.covariance, &mut self.gain);
        let marginal = Gaussian { mean: row.at(self.state), variance: row.times(&self.gain) };
        if !(marginal.mean.is_finite() && self.gain.iter().all(|element| element.is_finite())) {
            Err(SkipReason::NotFinite)
        } else if marginal.variance > 0.0 {
            Ok(marginal)
        } else {
            Err(SkipReason::NoVariance)
        }
    }

    /// Changes the moments of the projected row by a rank-one update along `gain`.
    fn update(&mut self, from: Gaussian, to: Gaussian) -> Result<(), SkipReason> {
        let step = (to.mean - from.mean) / from.variance;
        // Two divisions avoid underflow of the square of a small variance.
        let factor = (to.variance - from.variance) / from.variance / from.variance;
        if !(step.is_finite() && factor.is_finite()) {
            return Err(SkipReason::NotFinite);
        }
        self.state.axpy(step, &self.gain, 1.0);
        // Both sides of the diagonal are products of the same two factors, so the result is exactly symmetric.
        let root = factor.abs().sqrt();
        self.gain *= root;
        let sign = factor.signum();
        for (column, element) in self.gain.iter().enumerate() {
            self.covariance.column_mut(column).axpy(sign * element, &self.gain, 1.0);
        }
        Ok(())
    }
}

/// Whether mean and variance define a distribution.
fn is_proper(marginal: Gaussian) -> bool {
    marginal.mean.is_finite() && marginal.variance > 0.0 && marginal.variance.is_finite()
}

/// The distribution times exp(−½ precision y² + shift y).
fn with_site(marginal: Gaussian, precision: f64, shift: f64) -> Gaussian {
    let denominator = 1.0 + precision * marginal.variance;
    Gaussian {
        mean: (marginal.mean + shift * marginal.variance) / denominator,
        variance: marginal.variance / denominator,
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::super::truncation::Interval;
    use super::*;

    /// y + c₀ in [l, u] is equivalent to y in [l − c₀, u − c₀]; removing the site restores the prior.
    #[test]
    fn a_row_with_a_constant_is_the_row_without_it_in_a_shifted_interval() {
        let row = SparseRow::of(0, &Vector3::new(0.6, 0.8, 0.0));
        let constant = 7.5;
        let shifted = Interval { lower: -1.0, upper: 2.0 };
        let interval = Interval { lower: shifted.lower + constant, upper: shifted.upper + constant };
        let results = [BoundedRow::new(row, shifted), BoundedRow::new(row.with_constant(constant), interval)]
            .map(|bounded| {
                let mut state = DVector::from_vec(vec![3.0, 1.5, -2.0]);
                let mut covariance = DMatrix::from_diagonal(&DVector::from_vec(vec![4.0, 1.0, 9.0]));
                let prior = state.clone();
                let mut posterior = Posterior::new(&mut state, &mut covariance, 0.0);
                let former = PreviousSites { in_state: None, earlier: None };
                let applied = posterior.apply(&bounded, Enlargement::Fixed, &former);
                let mut site = applied.ok().map(|applied| applied.site);
                let marginal = (posterior.state.clone(), posterior.covariance.clone());
                assert!((&marginal.0 - &prior).amax() > 0.5 && posterior.remove(&mut site));
                assert!((&*posterior.state - &prior).amax() < 1e-9, "{}", posterior.state);
                marginal
            });
        assert!((&results[0].0 - &results[1].0).amax() < 1e-12);
        assert!((&results[0].1 - &results[1].1).amax() < 1e-12);
    }
}
