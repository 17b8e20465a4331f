//! Exclusion of one measurement after another, and their way back (Cappello 2023, section 2.2; Baarda's local test).

use super::checks::{Suspect, geometry_verdict, global_test, suspect};
use super::options::RaimOptions;
use super::{Cause, Verdict};
use crate::measurement::{CorrectedObservation, Usage};
use crate::solve::{Fit, solve_position};

/// A solution that fails the global test, and the verdict on it after exclusions. Excluded observations are marked in place.
///
/// Forward: while the global test fails, the measurement with the largest normalised residual that fails the local test and can be separated
/// from the others is excluded. Backward: if it passes in the end and more than one was excluded, each is put back, the one that fits best
/// first, and stays if the test still passes.
pub(super) fn exclude(
    observations: &mut [CorrectedObservation],
    mut fit: Fit,
    options: &RaimOptions,
) -> (Fit, Verdict) {
    let mut excluded = Vec::new();
    let verdict = loop {
        let Some(test) = global_test(&fit, options) else { break Verdict::CannotBeChecked };
        if test.passes() {
            break Verdict::Reliable;
        }
        if test.degrees_of_freedom < 2 {
            break Verdict::Unreliable(Cause::InsufficientRedundancy);
        }
        if excluded.len() >= options.maximum_exclusions {
            break Verdict::Unreliable(Cause::TestsFailed);
        }
        let index = match suspect(&fit, options) {
            Suspect::Found(index) => index,
            Suspect::Inseparable => break Verdict::Unreliable(Cause::Inseparable),
            Suspect::None => break Verdict::Unreliable(Cause::TestsFailed),
        };
        observations[index].usage = Usage::Excluded;
        let Ok(next) = solve_position(observations, fit.position()) else {
            observations[index].usage = Usage::Used;
            break Verdict::Unreliable(Cause::TestsFailed);
        };
        excluded.push(index);
        fit = next;
    };
    if verdict == Verdict::Reliable && excluded.len() > 1 {
        fit = put_back(observations, &excluded, fit, options);
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
