//! The tests that every scheme of exclusion uses.

use super::options::{DopLimits, RaimOptions};
use super::{Cause, GlobalTest, Verdict};
use crate::measurement::{CorrectedObservation, Usage};
use crate::solve::{Dops, Fit};
use crate::statistics::normal::two_sided_threshold;

/// Checkable share of a measurement's variance, (C_v)_ii·w_i, below which its residual is zero whatever its error. So it is with a measurement
/// that is the only one of its clock.
pub(super) const UNCHECKABLE: f64 = 1e-9;

/// Verdict by the geometry: reliable within the limits.
pub(super) fn geometry_verdict(dops: Option<Dops>, limits: DopLimits) -> Verdict {
    match dops {
        Some(d) if d.pdop <= limits.pdop && d.hdop <= limits.hdop && d.vdop <= limits.vdop => {
            Verdict::Reliable
        }
        _ => Verdict::Unreliable(Cause::Geometry),
    }
}

/// The global test of a position's residuals; `None` without redundancy.
pub(super) fn global_test(fit: &Fit, options: &RaimOptions) -> Option<GlobalTest> {
    test_of(fit.weighted_square_sum(), fit.degrees_of_freedom(), options)
}

/// A weighted square sum D of residuals against χ²(1 − P_fa, m − n); `None` without redundancy.
pub(super) fn test_of(
    statistic: f64,
    degrees_of_freedom: usize,
    options: &RaimOptions,
) -> Option<GlobalTest> {
    (degrees_of_freedom > 0).then(|| GlobalTest {
        statistic,
        threshold: options.global.threshold(degrees_of_freedom),
        degrees_of_freedom: u16::try_from(degrees_of_freedom).unwrap_or(u16::MAX),
    })
}

/// Residuals of an adjustment, with what the tests need to know of them.
pub(super) trait Residuals {
    /// Number of residuals.
    fn count(&self) -> usize;
    /// A residual, m.
    fn residual_m(&self, i: usize) -> f64;
    /// Element of the residuals' covariance, m².
    fn covariance(&self, i: usize, j: usize) -> f64;
    /// Weight of a measurement, 1/m².
    fn weight(&self, i: usize) -> f64;
    /// The global test of all residuals; `None` without redundancy.
    fn global_test(&self, options: &RaimOptions) -> Option<GlobalTest>;
}

impl Residuals for Fit {
    fn count(&self) -> usize {
        self.len()
    }

    fn residual_m(&self, i: usize) -> f64 {
        self.residual_m(i)
    }

    fn covariance(&self, i: usize, j: usize) -> f64 {
        self.residual_covariance(i, j)
    }

    fn weight(&self, i: usize) -> f64 {
        self.weight(i)
    }

    fn global_test(&self, options: &RaimOptions) -> Option<GlobalTest> {
        global_test(self, options)
    }
}

/// Excludes one measurement after another until the global test passes: that with the largest normalised residual, if it fails the local test
/// and can be separated from the others. `without` solves without the measurement of a residual. Returns the last adjustment and the verdict
/// on it.
pub(super) fn forward<R: Residuals>(
    mut fit: R,
    options: &RaimOptions,
    mut without: impl FnMut(&R, usize) -> Option<R>,
) -> (R, Verdict) {
    let mut excluded = 0;
    let verdict = loop {
        let Some(test) = fit.global_test(options) else { break Verdict::CannotBeChecked };
        if test.passes() {
            break Verdict::Reliable;
        }
        if test.degrees_of_freedom < 2 {
            break Verdict::Unreliable(Cause::InsufficientRedundancy);
        }
        if excluded >= options.maximum_exclusions {
            break Verdict::Unreliable(Cause::TestsFailed);
        }
        let index = match suspect(&fit, options) {
            Suspect::Found(index) => index,
            Suspect::Inseparable => break Verdict::Unreliable(Cause::Inseparable),
            Suspect::None => break Verdict::Unreliable(Cause::TestsFailed),
        };
        let Some(next) = without(&fit, index) else { break Verdict::Unreliable(Cause::TestsFailed) };
        excluded += 1;
        fit = next;
    };
    (fit, verdict)
}

/// Result of the local tests.
enum Suspect {
    /// Index of the residual whose measurement is to be excluded.
    Found(usize),
    /// The largest residual belongs to one of several that cannot be told apart.
    Inseparable,
    /// All residuals pass the local test.
    None,
}

/// The observation with the largest |w_i| = |r_i|/√(C_v)_ii that fails the local test, unless its correlation with another failing observation
/// makes the two inseparable.
fn suspect(fit: &impl Residuals, options: &RaimOptions) -> Suspect {
    let threshold = two_sided_threshold(options.local_false_alarm);
    let mut failing: Vec<(usize, f64)> = (0..fit.count())
        .filter_map(|i| {
            let variance = fit.covariance(i, i);
            let checkable = variance * fit.weight(i) > UNCHECKABLE;
            let w = fit.residual_m(i).abs() / variance.sqrt();
            (checkable && w > threshold).then_some((i, w))
        })
        .collect();
    failing.sort_by(|a, b| b.1.total_cmp(&a.1));
    let Some((worst, others)) = failing.split_first() else { return Suspect::None };
    if others.iter().any(|other| correlation(fit, worst.0, other.0) >= options.separability) {
        Suspect::Inseparable
    } else {
        Suspect::Found(worst.0)
    }
}

/// |(WC_vW)_ij| / √((WC_vW)_ii (WC_vW)_jj); the diagonal W cancels.
fn correlation(fit: &impl Residuals, i: usize, j: usize) -> f64 {
    let scale = fit.covariance(i, i) * fit.covariance(j, j);
    fit.covariance(i, j).abs() / scale.sqrt()
}

/// Usage of all observations.
pub(super) fn usages(observations: &[CorrectedObservation]) -> Vec<Usage> {
    observations.iter().map(|o| o.usage).collect()
}

/// Sets the usage of all observations.
pub(super) fn mark(observations: &mut [CorrectedObservation], usages: &[Usage]) {
    for (observation, usage) in observations.iter_mut().zip(usages) {
        observation.usage = *usage;
    }
}

/// Number of excluded observations.
pub(super) fn count_excluded(observations: &[CorrectedObservation]) -> u16 {
    let excluded = observations.iter().filter(|o| o.usage == Usage::Excluded).count();
    u16::try_from(excluded).unwrap_or(u16::MAX)
}
