//! The distribution of one constraint's vector while the constraint is applied, and what its rows change in the whole state.
//!
//! A row c of a vector y = Jx with the covariance D changes the state x, P along PJᵀ alone. So all rows of a constraint are removed and
//! applied on the three components of y, and the state follows once: x ← x + PJᵀm and P ← P + PJᵀMJP with m and M of three dimensions.

use nalgebra::{Matrix3, Vector3};

use super::SkipReason;
use super::rows::BoundedRow;
use super::truncation::{Enlargement, Gaussian, Truncation, truncate_with};

/// Convergence limit of a refresh: change of the mean in standard deviations, and relative change of the variance.
pub(super) const CONVERGED: f64 = 1e-3;
/// Minimum fraction of a row's prior variance after one constraint (1 % of the standard deviation). Removing a site loses digits with the
/// square of this ratio; the mean is not affected.
const LEAST_VARIANCE: f64 = 1e-4;

/// Contribution of a row: exp(−½ precision y² + shift y) of its value y.
#[derive(Clone, Copy)]
pub(super) struct Site {
    /// Direction of the row.
    pub axis: Vector3<f64>,
    /// Precision, in the inverse square of the row's unit.
    pub precision: f64,
    shift: f64,
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

/// How rows are applied.
#[derive(Clone, Copy)]
pub(super) struct Manner<'a> {
    /// Treatment of an interval that the state contradicts.
    pub policy: Enlargement,
    /// Covariance of the vector without any site.
    pub prior: &'a Matrix3<f64>,
    /// Fraction of a former site that is kept.
    pub damping: f64,
}

/// Distribution of the vector of one constraint, with the change of the state since [`Local::new`].
#[derive(Clone, Debug)]
pub(super) struct Local {
    /// Mean of the vector.
    pub mean: Vector3<f64>,
    /// Covariance of the vector.
    pub covariance: Matrix3<f64>,
    /// Direction of the row projected last.
    axis: Vector3<f64>,
    /// Covariance of the vector with that row.
    pub gain: Vector3<f64>,
    /// Covariance of the vector at the begin.
    begin: Matrix3<f64>,
    /// m.
    pub step: Vector3<f64>,
    /// M.
    pub change: Matrix3<f64>,
    /// Whether m and M differ from zero.
    pub has_changed: bool,
    /// Whether a site was removed, which loses digits.
    pub has_removed: bool,
}

impl Local {
    /// A vector with its distribution in the present state.
    pub fn new(mean: Vector3<f64>, covariance: Matrix3<f64>) -> Self {
        Self {
            mean,
            covariance,
            axis: Vector3::zeros(),
            gain: Vector3::zeros(),
            begin: covariance,
            step: Vector3::zeros(),
            change: Matrix3::zeros(),
            has_changed: false,
            has_removed: false,
        }
    }

    /// Truncates the distribution by one row, in place of the row's site in it.
    pub fn apply(
        &mut self,
        bounded: &BoundedRow,
        sites: &PreviousSites,
        manner: &Manner<'_>,
    ) -> Result<Applied, SkipReason> {
        let marginal = self.project(&bounded.axis)?;
        let former = sites.in_state.unwrap_or(Site { axis: bounded.axis, precision: 0.0, shift: 0.0 });
        let cavity = with_site(marginal, -former.precision, -former.shift);
        if !is_proper(cavity) {
            return Ok(Applied { site: former, enlargements: 0, change: 0.0 });
        }
        let Truncation { moments, enlargements } =
            truncate_with(cavity, bounded.interval, bounded.density, manner.policy)
                .ok_or(SkipReason::NotFinite)?;
        let cavity_precision = 1.0 / cavity.variance;
        let most = 1.0 / (LEAST_VARIANCE * bounded.variance(manner.prior));
        let precision = (1.0 / moments.variance - cavity_precision).max(0.0).min(most);
        // For any precision the mean becomes that of the truncation.
        let shift = moments.mean * (precision + cavity_precision) - cavity.mean * cavity_precision;
        let mut site = Site { axis: bounded.axis, precision, shift };
        if former.precision > 0.0 {
            let keep = manner.damping.clamp(0.0, 0.99);
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

    /// Removes a site from the distribution and from its slot. Returns `false` if, near an equality, rounding leaves no valid distribution
    /// without the site; the site then stays in both.
    pub fn remove(&mut self, slot: &mut Option<Site>) -> bool {
        let Some(site) = *slot else { return true };
        let Ok(marginal) = self.project(&site.axis) else { return false };
        let cavity = with_site(marginal, -site.precision, -site.shift);
        let is_out = is_proper(cavity) && self.update(marginal, cavity).is_ok();
        if is_out {
            *slot = None;
            self.has_removed = true;
        }
        is_out
    }

    /// Adds a site. One that leaves no finite distribution is left out.
    pub fn add(&mut self, site: &Site) {
        if let Ok(marginal) = self.project(&site.axis) {
            let _ = self.update(marginal, with_site(marginal, site.precision, site.shift));
        }
    }

    /// Distribution of a row's value; leaves the covariance of the vector with it in `gain`.
    pub fn project(&mut self, axis: &Vector3<f64>) -> Result<Gaussian, SkipReason> {
        self.axis = *axis;
        self.gain = self.covariance * axis;
        let marginal = Gaussian { mean: axis.dot(&self.mean), variance: axis.dot(&self.gain) };
        if !(marginal.mean.is_finite() && self.gain.iter().all(|element| element.is_finite())) {
            Err(SkipReason::NotFinite)
        } else if marginal.variance > 0.0 {
            Ok(marginal)
        } else {
            Err(SkipReason::NoVariance)
        }
    }

    /// Changes the moments of the projected row.
    fn update(&mut self, from: Gaussian, to: Gaussian) -> Result<(), SkipReason> {
        let step = (to.mean - from.mean) / from.variance;
        // Two divisions avoid underflow of the square of a small variance.
        let factor = (to.variance - from.variance) / from.variance / from.variance;
        if !(step.is_finite() && factor.is_finite()) {
            return Err(SkipReason::NotFinite);
        }
        // The covariance of the state with the row is PJᵀ(I + MD)c at the P and D of the begin.
        let along = self.axis + self.change * (self.begin * self.axis);
        self.step += step * along;
        self.change += factor * along * along.transpose();
        self.mean += step * self.gain;
        self.covariance += factor * self.gain * self.gain.transpose();
        self.has_changed = true;
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
    use super::super::truncation::Interval;
    use super::*;

    /// Two rows applied and one removed change the state by m and M as they change the vector; all removed, nothing is left.
    #[test]
    fn the_change_of_the_state_is_that_of_the_vector() {
        let covariance = Matrix3::new(4.0, 0.5, -0.3, 0.5, 1.0, 0.2, -0.3, 0.2, 9.0);
        let mean = Vector3::new(3.0, 1.5, -2.0);
        let mut local = Local::new(mean, covariance);
        let manner = Manner { policy: Enlargement::Fixed, prior: &covariance, damping: 0.0 };
        let none = PreviousSites { in_state: None, earlier: None };
        let bounded =
            |axis: Vector3<f64>| BoundedRow::new(axis.normalize(), Interval { lower: -1.0, upper: 1.0 });
        let mut sites = [Vector3::new(0.6, 0.8, 0.0), Vector3::new(0.1, -0.5, 1.0)].map(|axis| {
            let applied = local.apply(&bounded(axis), &none, &manner);
            applied.ok().map(|applied| applied.site)
        });
        for site in &mut sites {
            assert!((local.mean - mean).amax() > 0.3);
            assert!((local.mean - mean - covariance * local.step).amax() < 1e-12);
            let changed = covariance + covariance * local.change * covariance;
            assert!((local.covariance - changed).amax() < 1e-12);
            assert!(local.remove(site));
        }
        assert!(local.step.amax() < 1e-12 && local.change.amax() < 1e-12);
    }
}
