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

/// Result of the local tests.
pub(super) enum Suspect {
    /// Index of the observation to exclude.
    Found(usize),
    /// The largest residual belongs to one of several that cannot be told apart.
    Inseparable,
    /// All residuals pass the local test.
    None,
}

/// The observation with the largest |w_i| = |r_i|/√(C_v)_ii that fails the local test, unless its correlation with another failing observation
/// makes the two inseparable.
pub(super) fn suspect(fit: &Fit, options: &RaimOptions) -> Suspect {
    let threshold = two_sided_threshold(options.local_false_alarm);
    let mut failing: Vec<(usize, f64)> = (0..fit.len())
        .filter_map(|i| {
            let variance = fit.residual_covariance(i, i);
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
        Suspect::Found(fit.observation(worst.0))
    }
}

/// |(WC_vW)_ij| / √((WC_vW)_ii (WC_vW)_jj); the diagonal W cancels.
fn correlation(fit: &Fit, i: usize, j: usize) -> f64 {
    let scale = fit.residual_covariance(i, i) * fit.residual_covariance(j, j);
    fit.residual_covariance(i, j).abs() / scale.sqrt()
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
