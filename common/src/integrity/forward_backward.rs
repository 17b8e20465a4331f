//! Exclusion of one measurement after another, and their way back (Cappello 2023, section 2.2; Baarda's local test).

use super::Verdict;
use super::checks::{forward, geometry_verdict, global_test};
use super::options::RaimOptions;
use crate::measurement::{CorrectedObservation, Usage};
use crate::solve::{Fit, solve_position};

/// A solution that fails the global test, and the verdict on it after exclusions. Excluded observations are marked in place.
///
/// Forward: [`forward`]. Backward: if it passes in the end and more than one was excluded, each is put back, the one that fits best
/// first, and stays if the test still passes.
pub(super) fn exclude(
    observations: &mut [CorrectedObservation],
    fit: Fit,
    options: &RaimOptions,
) -> (Fit, Verdict) {
    let mut excluded = Vec::new();
    let (fit, verdict) = forward(fit, options, |fit, residual| {
        let index = fit.observation(residual);
        observations[index].usage = Usage::Excluded;
        let next = solve_position(observations, fit.position());
        if next.is_ok() {
            excluded.push(index);
        } else {
            observations[index].usage = Usage::Used;
        }
        next.ok()
    });
    if verdict == Verdict::Reliable && excluded.len() > 1 {
        return (put_back(observations, &excluded, fit, options), verdict);
    }
    (fit, verdict)
}

/// The solution with those of the excluded observations with which the global test still passes.
fn put_back(
    observations: &mut [CorrectedObservation],
    excluded: &[usize],
    mut fit: Fit,
    options: &RaimOptions,
) -> Fit {
    let misfit = |index: &usize| {
        let observation = &observations[*index];
        // A clock that has no measurement any more says nothing against one of its own.
        let residual_m = fit.residual_of(observation).unwrap_or_default();
        (*index, residual_m.abs() / observation.pseudorange_sigma_m)
    };
    let mut order: Vec<(usize, f64)> = excluded.iter().map(misfit).collect();
    order.sort_by(|a, b| a.1.total_cmp(&b.1));
    for (index, _) in order {
        observations[index].usage = Usage::Used;
        let passing = solve_position(observations, fit.position()).ok().filter(|fit| {
            let passes = global_test(fit, options).is_some_and(|test| test.passes());
            passes && geometry_verdict(fit.dops(), options.dop_limits) == Verdict::Reliable
        });
        match passing {
            Some(passing) => fit = passing,
            None => observations[index].usage = Usage::Excluded,
        }
    }
    fit
}
