//! State of one constraint during a call: preparation at the prior, and report at the end.

use nalgebra::{Matrix3, Vector3};

use super::kinds::Quantity;
use super::local::Site;
use super::options::ConstraintOptions;
use super::prior::Prior;
use super::rows::{BoundedRow, Placed, Rows, Terms};
use super::{Constraint, ConstraintAction, ConstraintOutcome, SkipReason};
use crate::frames::LocalFrame;

/// Number of standard deviations beyond which a bound has no effect (it cuts off 2e-9 of the probability).
const IDLE_SIGMAS: f64 = 6.0;
/// Maximum excess of a constraint that holds: 1 mm, 1 mm/s, 1 mrad.
pub(super) const TOLERANCE: f64 = 1e-3;

/// Where the vector of a constraint stands.
#[derive(Clone, Copy)]
pub(super) enum Seat {
    /// Nothing moves it.
    None,
    /// In one state.
    In {
        /// Number of the state.
        component: usize,
        /// The terms in that state.
        placed: Placed,
    },
    /// In two states that nothing connects, or in one beside phones that nothing moves.
    Apart,
}

/// State of one constraint during a call.
pub(super) struct Task<'f> {
    /// Index in the given list of constraints.
    pub(super) index: usize,
    pub(super) constraint: Constraint,
    pub(super) terms: Terms,
    /// Covariance of the constraint's vector at the prior.
    pub(super) prior: Matrix3<f64>,
    /// Local frame of the first phone at the prior.
    pub(super) frame: Option<&'f LocalFrame>,
    pub(super) seat: Seat,
    pub(super) before: f64,
    pub(super) rows: Option<Rows>,
    pub(super) sites: [Option<Site>; 3],
    pub(super) enlargements: u32,
    pub(super) acted: bool,
    pub(super) idle: bool,
    pub(super) skipped: Option<SkipReason>,
}

impl<'f> Task<'f> {
    /// Examines constraints at the prior.
    pub(super) fn all(
        constraints: &[Constraint],
        prior: &'f (impl Prior + ?Sized),
        options: &ConstraintOptions,
    ) -> Vec<Self> {
        let task = |(index, constraint): (usize, &Constraint)| Task::new(index, *constraint, prior, options);
        constraints.iter().enumerate().map(task).collect()
    }

    fn new(
        index: usize,
        constraint: Constraint,
        prior: &'f (impl Prior + ?Sized),
        options: &ConstraintOptions,
    ) -> Self {
        let mut task = Self {
            index,
            constraint,
            terms: constraint.kind().terms(options.horizon_s),
            prior: Matrix3::zeros(),
            frame: constraint.phones().first().and_then(|phone| prior.frame(*phone)),
            seat: Seat::None,
            before: f64::NAN,
            rows: None,
            sites: [None; 3],
            enlargements: 0,
            acted: false,
            idle: true,
            skipped: None,
        };
        match task.examine(prior, options) {
            Ok(idle) => task.idle = idle,
            Err(reason) => (task.skipped, task.idle) = (Some(reason), false),
        }
        task
    }

    /// Whether the constraint has no effect at the prior.
    fn examine(
        &mut self,
        prior: &(impl Prior + ?Sized),
        options: &ConstraintOptions,
    ) -> Result<bool, SkipReason> {
        let phones = self.constraint.phones();
        let is_unknown = |(n, phone): (usize, &usize)| {
            *phone >= prior.phones() || phones.iter().take(n).any(|other| other == phone)
        };
        if phones.iter().enumerate().any(is_unknown) {
            return Err(SkipReason::UnknownPhone);
        }
        let kind = self.constraint.kind();
        if !kind.has_valid_bounds() {
            return Err(SkipReason::InvalidBounds);
        }
        let at = quantity(&self.terms, self.frame, prior, options).ok_or(SkipReason::NotFinite)?;
        self.prior = at.covariance;
        if !kind.applies(&at)? {
            return Ok(true);
        }
        self.before = self.constraint.value_of(&at.mean, at.frame).ok_or(SkipReason::NotFinite)?;
        let rows = kind.rows(&at)?;
        self.rows = Some(rows);
        if !self.constraint.holds(self.before) {
            let contradicted = largest_excess(&rows, &at) > options.contradiction_sigmas;
            return if contradicted { Err(SkipReason::Contradicted) } else { Ok(false) };
        }
        // An idle constraint may be violated after another one has moved its phones, so it is checked again.
        Ok(!options.act_when_inside || rows.iter().flatten().all(|bounded| is_idle(bounded, &at)))
    }

    /// Whether the constraint may act, now or after others.
    pub(super) const fn is_able(&self) -> bool {
        self.skipped.is_none() && self.rows.is_some()
    }

    /// The constrained quantity for the constraint's vector.
    pub(super) fn value(&self, vector: &Vector3<f64>) -> Option<f64> {
        self.constraint.value_of(vector, self.frame?)
    }

    /// Whether the constraint is violated for its vector.
    pub(super) fn is_violated(&self, vector: &Vector3<f64>) -> bool {
        self.value(vector).is_some_and(|value| self.constraint.excess(value) > TOLERANCE)
    }

    /// The report on the constraint, if it acted or was skipped, from its vector at the end and the shift of each of its phones' positions.
    pub(super) fn report(
        &self,
        vector: impl Fn(&Terms) -> Option<Vector3<f64>>,
        shift_m: impl Fn(usize) -> f64,
    ) -> Option<ConstraintAction> {
        if self.skipped.is_none() && !self.acted {
            return None;
        }
        let after = vector(&self.terms).and_then(|vector| self.value(&vector)).unwrap_or(f64::NAN);
        let outcome = match self.skipped {
            Some(reason) => ConstraintOutcome::Skipped(reason),
            None if self.constraint.excess(after) <= TOLERANCE => ConstraintOutcome::Holds,
            None => ConstraintOutcome::Violated,
        };
        Some(ConstraintAction {
            index: self.index,
            constraint: self.constraint,
            before: self.before,
            free_sigmas: 0.0,
            after,
            shift_m: self.constraint.phones().iter().map(|phone| shift_m(*phone)).fold(0.0, f64::max),
            enlargements: self.enlargements,
            outcome,
        })
    }
}

/// Distribution of a vector at the prior; `None` without its phones, or if a mean is not finite.
fn quantity<'a>(
    terms: &Terms,
    frame: Option<&'a LocalFrame>,
    prior: &(impl Prior + ?Sized),
    options: &'a ConstraintOptions,
) -> Option<Quantity<'a>> {
    let mean = prior.mean(terms).filter(|mean| mean.iter().all(|element| element.is_finite()))?;
    Some(Quantity { mean, covariance: prior.covariance(terms)?, frame: frame?, options })
}

/// Excess of a distribution over the bounds of a constraint, in standard deviations; 0 within the bounds, or where the constraint does not
/// apply.
///
/// The distribution must not contain the constraint's own information: one that a wrong constraint has narrowed never contradicts it.
pub fn excess_sigmas(
    constraint: &Constraint,
    prior: &(impl Prior + ?Sized),
    options: &ConstraintOptions,
) -> f64 {
    let kind = constraint.kind();
    let terms = kind.terms(options.horizon_s);
    let frame = constraint.phones().first().and_then(|phone| prior.frame(*phone));
    let Some((mean, frame)) = prior.mean(&terms).zip(frame) else { return 0.0 };
    if constraint.value_of(&mean, frame).is_none_or(|value| constraint.holds(value)) {
        return 0.0;
    }
    let Some(at) = quantity(&terms, Some(frame), prior, options) else { return 0.0 };
    if !kind.applies(&at).unwrap_or(false) {
        return 0.0;
    }
    kind.rows(&at).map_or(0.0, |rows| largest_excess(&rows, &at))
}

fn largest_excess(rows: &Rows, at: &Quantity<'_>) -> f64 {
    rows.iter().flatten().map(|bounded| outside_sigmas(bounded, at)).fold(0.0, f64::max)
}

/// Excess of a row's mean over its interval in standard deviations; 0 inside, or without a variance.
fn outside_sigmas(bounded: &BoundedRow, at: &Quantity<'_>) -> f64 {
    let excess = bounded.interval.excess(bounded.at(&at.mean));
    let variance = bounded.variance(&at.covariance);
    if excess > 0.0 && variance > 0.0 { excess / variance.sqrt() } else { 0.0 }
}

/// Whether the interval of a row cuts off a negligible part of its distribution.
fn is_idle(bounded: &BoundedRow, at: &Quantity<'_>) -> bool {
    let margin = IDLE_SIGMAS * bounded.variance(&at.covariance).max(0.0).sqrt();
    let mean = bounded.at(&at.mean);
    mean - margin >= bounded.interval.lower && mean + margin <= bounded.interval.upper
}
