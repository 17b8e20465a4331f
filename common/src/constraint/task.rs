//! One constraint's work within a call: what it needs at the prior, and what it reports in the end.

use nalgebra::{DMatrix, DVector};

use super::kinds::At;
use super::options::ConstraintOptions;
use super::rows::{BoundedRow, Rows, position};
use super::sites::Site;
use super::{Constraint, ConstraintAction, ConstraintOutcome, SkipReason};
use crate::filter::STATES_PER_PHONE;
use crate::frames::Ecef;

/// Beyond this many standard deviations a bound takes nothing away (2e-9 of the probability).
const IDLE_SIGMAS: f64 = 6.0;
/// Excess below which a constraint counts as holding: 1 mm, 1 mm/s, 1 mrad.
pub(super) const TOLERANCE: f64 = 1e-3;

/// One constraint's work within a call.
pub(super) struct Task {
    /// The constraint's place in the list given.
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
    /// Looks at a constraint at the prior.
    pub(super) fn new(index: usize, constraint: Constraint, prior: &At<'_>) -> Self {
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

    /// Whether the constraint has nothing to do at the prior, for good.
    fn examine(&mut self, prior: &At<'_>) -> Result<bool, SkipReason> {
        let At { state, covariance, options } = *prior;
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
            let limit = options.contradiction_sigmas;
            let contradicted =
                rows.iter().flatten().any(|bounded| outside_sigmas(bounded, state, covariance) > limit);
            return if contradicted { Err(SkipReason::Contradicted) } else { Ok(false) };
        }
        let idle = |bounded: &BoundedRow| is_idle(bounded, state, covariance);
        // An idle constraint may still be violated when another one has moved its phones: it is looked at again.
        Ok(!options.act_when_inside || rows.iter().flatten().all(idle))
    }

    /// What it did, if anything.
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
            after,
            shift_m: self.constraint.phones().iter().map(shift_m).fold(0.0, f64::max),
            enlargements: self.enlargements,
            outcome,
        })
    }
}

/// How far a row's mean is out of its interval, in standard deviations; 0 inside, or without a variance to tell.
fn outside_sigmas(bounded: &BoundedRow, state: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    let mean = bounded.row.at(state);
    let excess = (bounded.interval.lower - mean).max(mean - bounded.interval.upper).max(0.0);
    let variance = bounded.row.variance(covariance);
    if excess > 0.0 && variance > 0.0 { excess / variance.sqrt() } else { 0.0 }
}

/// Whether a row's interval takes nothing noticeable from its distribution.
fn is_idle(bounded: &BoundedRow, state: &DVector<f64>, covariance: &DMatrix<f64>) -> bool {
    let margin = IDLE_SIGMAS * bounded.row.variance(covariance).max(0.0).sqrt();
    let mean = bounded.row.at(state);
    mean - margin >= bounded.interval.lower && mean + margin <= bounded.interval.upper
}
