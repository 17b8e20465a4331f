//! One constraint's work within a call: what it needs at the prior, and what it reports in the end.

use nalgebra::{DMatrix, DVector};

use super::options::{ConstraintOptions, DistanceModel};
use super::rows::{BoundedRow, DistanceBounds, Motion, Rows, heading_rows, position, vertical_velocity_rows};
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
    pub(super) fn new(
        constraint: Constraint,
        state: &DVector<f64>,
        covariance: &DMatrix<f64>,
        options: &ConstraintOptions,
    ) -> Self {
        let mut task = Self {
            constraint,
            before: f64::NAN,
            rows: None,
            sites: [None; 3],
            enlargements: 0,
            acted: false,
            idle: true,
            skipped: None,
        };
        match task.examine(state, covariance, options) {
            Ok(idle) => task.idle = idle,
            Err(reason) => (task.skipped, task.idle) = (Some(reason), false),
        }
        task
    }

    /// Whether the constraint has nothing to do at the prior, for good.
    fn examine(
        &mut self,
        state: &DVector<f64>,
        covariance: &DMatrix<f64>,
        options: &ConstraintOptions,
    ) -> Result<bool, SkipReason> {
        let [first, second] = self.constraint.phones();
        let known = |phone: usize| phone < state.len() / STATES_PER_PHONE;
        let is_pair = matches!(self.constraint, Constraint::Distance { .. });
        if covariance.shape() != (state.len(), state.len())
            || !known(first)
            || !known(second)
            || (is_pair && first == second)
        {
            return Err(SkipReason::UnknownPhone);
        }
        if !self.constraint.has_valid_bounds() {
            return Err(SkipReason::InvalidBounds);
        }
        if let Constraint::Heading { phone, .. } = self.constraint {
            let motion = Motion::of(state, phone, options.horizon_s).ok_or(SkipReason::NotFinite)?;
            if !has_heading(&motion, covariance, options)? {
                return Ok(true);
            }
        }
        self.before = self.constraint.value(state, options.horizon_s).ok_or(SkipReason::NotFinite)?;
        let rows = rows_at(&self.constraint, state, covariance, options)?;
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
        let shift = |phone: usize| {
            let moved = position(prior, phone).zip(position(state, phone));
            moved.map_or(0.0, |(from, to): (Ecef, Ecef)| from.distance_m(to))
        };
        let [first, second] = self.constraint.phones();
        Some(ConstraintAction {
            constraint: self.constraint,
            before: self.before,
            after,
            shift_m: shift(first).max(shift(second)),
            enlargements: self.enlargements,
            outcome,
        })
    }
}

/// The rows of a constraint at a state; none when it has nothing to say there.
pub(super) fn rows_at(
    constraint: &Constraint,
    state: &DVector<f64>,
    covariance: &DMatrix<f64>,
    options: &ConstraintOptions,
) -> Result<Rows, SkipReason> {
    let motion = |phone| Motion::of(state, phone, options.horizon_s).ok_or(SkipReason::NotFinite);
    match *constraint {
        Constraint::VerticalVelocity { phone, maximum_mps } => {
            Ok(vertical_velocity_rows(&motion(phone)?, maximum_mps))
        }
        Constraint::Heading { phone, course_rad, tolerance_rad } => {
            Ok(heading_rows(&motion(phone)?, course_rad, tolerance_rad))
        }
        Constraint::Distance { phones, minimum_m, maximum_m } => {
            let bounds = DistanceBounds { phones, minimum_m, maximum_m };
            let difference = bounds.difference(state).ok_or(SkipReason::NotFinite)?;
            let is_upper_only = minimum_m <= 0.0 && options.distance_model == DistanceModel::Radial;
            if is_upper_only && DistanceBounds::is_without_direction(&difference) {
                return Ok([None; 3]);
            }
            let direction = bounds.direction(state, covariance).ok_or(SkipReason::NotFinite)?;
            Ok(bounds.rows(&direction, covariance, options.distance_model))
        }
    }
}

/// Whether a phone is fast enough for its course to mean something.
fn has_heading(
    motion: &Motion,
    covariance: &DMatrix<f64>,
    options: &ConstraintOptions,
) -> Result<bool, SkipReason> {
    let speed_mps = motion.velocity().horizontal();
    let sigma_mps = motion.horizontal_sigma_mps(covariance);
    let gate = options.heading_gate;
    if !sigma_mps.is_finite() {
        return Err(SkipReason::NotFinite);
    }
    Ok(speed_mps >= gate.minimum_speed_mps && speed_mps > gate.minimum_sigmas * sigma_mps)
}

/// How far a row's mean is out of its interval, in standard deviations; 0 inside, or without a variance to tell.
fn outside_sigmas(bounded: &BoundedRow, state: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    let mean = bounded.row.times(state);
    let excess = (bounded.interval.lower - mean).max(mean - bounded.interval.upper).max(0.0);
    let variance = bounded.row.variance(covariance);
    if excess > 0.0 && variance > 0.0 { excess / variance.sqrt() } else { 0.0 }
}

/// Whether a row's interval takes nothing noticeable from its law.
fn is_idle(bounded: &BoundedRow, state: &DVector<f64>, covariance: &DMatrix<f64>) -> bool {
    let margin = IDLE_SIGMAS * bounded.row.variance(covariance).max(0.0).sqrt();
    let mean = bounded.row.times(state);
    mean - margin >= bounded.interval.lower && mean + margin <= bounded.interval.upper
}
