//! State of one constraint during a call: preparation at the prior, and report at the end.

use nalgebra::{DMatrix, DVector};

use super::kinds::ConstrainedState;
use super::options::ConstraintOptions;
use super::rows::{BoundedRow, Rows, position};
use super::sites::Site;
use super::{Constraint, ConstraintAction, ConstraintOutcome, SkipReason};
use crate::filter::STATES_PER_PHONE;
use crate::frames::Ecef;

/// Number of standard deviations beyond which a bound has no effect (it cuts off 2e-9 of the probability).
const IDLE_SIGMAS: f64 = 6.0;
/// Maximum excess of a constraint that holds: 1 mm, 1 mm/s, 1 mrad.
pub(super) const TOLERANCE: f64 = 1e-3;

/// State of one constraint during a call.
pub(super) struct Task {
    /// Index in the given list of constraints.
    pub(super) index: usize,
    pub(super) constraint: Constraint,
    pub(super) before: f64,
    pub(super) rows: Option<Rows>,
    pub(super) sites: [Option<Site>; 3],
    pub(super) enlargements: u32,
    pub(super) acted: bool,
    pub(super) idle: bool,
    pub(super) skipped: Option<SkipReason>,
}

impl Task {
    /// Examines a constraint at the prior.
    pub(super) fn new(index: usize, constraint: Constraint, prior: &ConstrainedState<'_>) -> Self {
        let mut task = Self {
            index,
            constraint,
            before: f64::NAN,
            rows: None,
            sites: [None; 3],
            enlargements: 0,
            acted: false,
            idle: true,
            skipped: None,
        };
        match task.examine(prior) {
            Ok(idle) => task.idle = idle,
            Err(reason) => (task.skipped, task.idle) = (Some(reason), false),
        }
        task
    }

    /// Whether the constraint has no effect at the prior.
    fn examine(&mut self, prior: &ConstrainedState<'_>) -> Result<bool, SkipReason> {
        let ConstrainedState { state, covariance, options } = *prior;
        let phones = self.constraint.phones();
        let is_unknown = |(n, phone): (usize, &usize)| {
            *phone >= state.len() / STATES_PER_PHONE || phones.iter().take(n).any(|other| other == phone)
        };
        if covariance.shape() != (state.len(), state.len()) || phones.iter().enumerate().any(is_unknown) {
            return Err(SkipReason::UnknownPhone);
        }
        let kind = self.constraint.kind();
        if !kind.has_valid_bounds() {
            return Err(SkipReason::InvalidBounds);
        }
        if !kind.applies(prior)? {
            return Ok(true);
        }
        self.before = self.constraint.value(state, options.horizon_s).ok_or(SkipReason::NotFinite)?;
        let rows = kind.rows(prior)?;
        self.rows = Some(rows);
        if !self.constraint.holds(self.before) {
            let contradicted = largest_excess(&rows, state, covariance) > options.contradiction_sigmas;
            return if contradicted { Err(SkipReason::Contradicted) } else { Ok(false) };
        }
        let idle = |bounded: &BoundedRow| is_idle(bounded, state, covariance);
        // An idle constraint may be violated after another one has moved its phones, so it is checked again.
        Ok(!options.act_when_inside || rows.iter().flatten().all(idle))
    }

    /// The report on the constraint, if it acted or was skipped.
    pub(super) fn report(
        &self,
        prior: &DVector<f64>,
        state: &DVector<f64>,
        options: &ConstraintOptions,
    ) -> Option<ConstraintAction> {
        let after = self.constraint.value(state, options.horizon_s).unwrap_or(f64::NAN);
        let outcome = match self.skipped {
            Some(reason) => ConstraintOutcome::Skipped(reason),
            None if !self.acted => return None,
            None if self.constraint.excess(after) <= TOLERANCE => ConstraintOutcome::Holds,
            None => ConstraintOutcome::Violated,
        };
        let shift_m = |phone: &usize| {
            let moved = position(prior, *phone).zip(position(state, *phone));
            moved.map_or(0.0, |(from, to): (Ecef, Ecef)| from.distance_m(to))
        };
        Some(ConstraintAction {
            index: self.index,
            constraint: self.constraint,
            before: self.before,
            free_sigmas: 0.0,
            after,
            shift_m: self.constraint.phones().iter().map(shift_m).fold(0.0, f64::max),
            enlargements: self.enlargements,
            outcome,
        })
    }
}

/// Excess of a state over the bounds of a constraint, in standard deviations; 0 within the bounds, or where the constraint does not apply.
///
/// The state must not contain the constraint's own information: a state that a wrong constraint has narrowed never contradicts it.
pub fn excess_sigmas(constraint: &Constraint, at: &ConstrainedState<'_>) -> f64 {
    let kind = constraint.kind();
    let value = constraint.value(at.state, at.options.horizon_s);
    let is_outside = value.is_some_and(|value| !constraint.holds(value));
    if !is_outside || !kind.applies(at).unwrap_or(false) {
        return 0.0;
    }
    kind.rows(at).map_or(0.0, |rows| largest_excess(&rows, at.state, at.covariance))
}

fn largest_excess(rows: &Rows, state: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    rows.iter().flatten().map(|bounded| outside_sigmas(bounded, state, covariance)).fold(0.0, f64::max)
}

/// Excess of a row's mean over its interval in standard deviations; 0 inside, or without a variance.
fn outside_sigmas(bounded: &BoundedRow, state: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    let mean = bounded.row.at(state);
    let excess = (bounded.interval.lower - mean).max(mean - bounded.interval.upper).max(0.0);
    let variance = bounded.row.variance(covariance);
    if excess > 0.0 && variance > 0.0 { excess / variance.sqrt() } else { 0.0 }
}

/// Whether the interval of a row cuts off a negligible part of its distribution.
fn is_idle(bounded: &BoundedRow, state: &DVector<f64>, covariance: &DMatrix<f64>) -> bool {
    let margin = IDLE_SIGMAS * bounded.row.variance(covariance).max(0.0).sqrt();
    let mean = bounded.row.at(state);
    mean - margin >= bounded.interval.lower && mean + margin <= bounded.interval.upper
}
