//! Application of several constraints to one state.
//!
//! Each applied row leaves a *site*, the Gaussian factor exp(−½τy² + νy) of its value y that represents its interval. Before a row is applied
//! again, its own site is removed, and the remaining distribution (the cavity: the state with all other sites) is truncated. So no
//! information is applied twice, whatever the order and number of applications. Both methods use this loop; they differ in the constraints
//! that are applied again and in the end of the loop.
//!
//! The rows of a constraint are applied to its vector of three components (see `constraint::local`); then the state follows: O(n²) per
//! constraint for n states.

use nalgebra::{DMatrix, DVector, Vector3};

use super::kinds::{BoundedLength, NO_DIRECTION, Quantity};
use super::local::{CONVERGED, Local, Manner, PreviousSites};
use super::options::{ConstraintOptions, Method};
use super::prior::Joint;
use super::rows::{Part, Placed, Rows, part, position};
use super::sites::Posterior;
use super::task::{Seat, TOLERANCE, Task};
use super::truncation::{Enlargement, Gaussian, Interval, moments_within, plausible, truncate_with};
use super::{Constraint, ConstraintAction, SkipReason};
use crate::frames::{Ecef, LocalFrame};

/// Number of sweeps with relinearised rows. In later sweeps the rows are fixed, so that the sites converge.
const LINEARISING_SWEEPS: u32 = 3;

/// Applies constraints to a joint Gaussian state in place. Returns the effect of each constraint that acted, was violated or could not be
/// applied, with its index in `constraints`.
///
/// `state` holds nine elements per phone (see [`crate::filter`]), `covariance` theirs. A constraint that cannot be
/// applied (see [`SkipReason`]) changes nothing. A constraint that does not apply to the state, such as a heading of a phone that is too
/// slow (see [`HeadingGate`](super::HeadingGate)), is not reported. The covariance stays symmetric.
pub fn constrain(
    state: &mut DVector<f64>,
    covariance: &mut DMatrix<f64>,
    constraints: &[Constraint],
    options: &ConstraintOptions,
) -> Vec<ConstraintAction> {
    let frames = Joint::frames(state);
    let prior = Joint::new(state, covariance, &frames);
    let mut tasks = Task::all(constraints, &prior, options);
    let Some(after) = jointly(state, covariance, &mut tasks, options) else { return Vec::new() };
    let shift_m = |phone| {
        let moved = position(state, phone).zip(position(&after.state, phone));
        moved.map_or(0.0, |(from, to): (Ecef, Ecef)| from.distance_m(to))
    };
    let vector = |phone: usize, which: Part| part(&after.state, phone, which);
    let actions = tasks.iter().filter_map(|task| task.report(|terms| terms.sum(vector), shift_m)).collect();
    (*state, *covariance) = (after.state, after.covariance);
    actions
}

/// Applies examined constraints to a joint state. `None` if all are idle.
pub(super) fn jointly(
    state: &DVector<f64>,
    covariance: &DMatrix<f64>,
    tasks: &mut [Task<'_>],
    options: &ConstraintOptions,
) -> Option<Posterior> {
    if tasks.iter().all(|task| task.idle) {
        return None;
    }
    for task in tasks.iter_mut().filter(|task| task.is_able()) {
        let placed = task.terms.placed(|phone, part| part.offset_in_joint(phone));
        task.seat = placed.map_or(Seat::None, |placed| Seat::In { component: 0, placed });
    }
    let posterior = Posterior::new(state.clone(), covariance.clone());
    let mut propagation = Propagation::new(vec![posterior], options);
    // No task is apart, so nothing ends the loop early.
    let _ = propagation.run(tasks, |_, _| false);
    propagation.finish(tasks);
    propagation.components.pop()
}

/// Precision of a site times the variance of its row, 1 for an equality, from which on the state follows at once, because what comes next
/// would lose digits.
const NEARLY_EQUAL: f64 = 0.99;

/// Constraints on states that are independent of each other.
pub(super) struct Propagation<'a> {
    /// The states.
    pub(super) components: Vec<Posterior>,
    options: &'a ConstraintOptions,
}

impl<'a> Propagation<'a> {
    pub(super) const fn new(components: Vec<Posterior>, options: &'a ConstraintOptions) -> Self {
        Self { components, options }
    }

    /// Applies the constraints until nothing changes, in all states alike.
    ///
    /// # Errors
    /// The place of a constraint between two states for which `is_violated_apart` holds: the states must be one.
    pub(super) fn run(
        &mut self,
        tasks: &mut [Task<'_>],
        is_violated_apart: impl Fn(&Task<'_>, &[Posterior]) -> bool,
    ) -> Result<(), usize> {
        let (Method::Sequential { max_sweeps } | Method::ExpectationPropagation { max_sweeps, .. }) =
            self.options.method;
        for sweep in 0..max_sweeps.max(1) {
            let mut largest_change = 0.0f64;
            for (place, task) in tasks.iter_mut().enumerate().filter(|(_, task)| task.is_able()) {
                match task.seat {
                    Seat::In { component, placed } => {
                        let Some(posterior) = self.components.get_mut(component) else { continue };
                        if is_due(task, &placed.mean(&posterior.state), sweep, self.options) {
                            let change = refresh(posterior, &placed, task, sweep, self.options);
                            largest_change = largest_change.max(change);
                        }
                    }
                    Seat::Apart if is_violated_apart(task, &self.components) => return Err(place),
                    Seat::Apart | Seat::None => {}
                }
            }
            if largest_change < CONVERGED {
                break;
            }
        }
        Ok(())
    }

    /// Recomputes the states from all sites.
    pub(super) fn finish(&mut self, tasks: &[Task<'_>]) {
        for (component, posterior) in self.components.iter_mut().enumerate() {
            posterior.rebuild(tasks.iter().filter_map(|task| match &task.seat {
                Seat::In { component: own, placed } if *own == component => Some((placed, &task.sites)),
                _ => None,
            }));
            posterior.finish();
        }
    }
}

/// Whether a constraint is applied in this sweep.
fn is_due(task: &Task<'_>, vector: &Vector3<f64>, sweep: u32, options: &ConstraintOptions) -> bool {
    let refreshes = match options.method {
        Method::Sequential { .. } => sweep == 0,
        Method::ExpectationPropagation { .. } => true,
    };
    let wanted = (options.act_when_inside && !task.idle) || task.acted;
    (refreshes && wanted) || task.is_violated(vector)
}

/// Applies a constraint for the first time or again. Returns the change of its rows in the units of [`CONVERGED`].
fn refresh(
    posterior: &mut Posterior,
    placed: &Placed,
    task: &mut Task<'_>,
    sweep: u32,
    options: &ConstraintOptions,
) -> f64 {
    let Some(frame) = task.frame else { return 0.0 };
    let before = task.sites;
    let local = posterior.local(placed);
    let mut refresh = Refresh { posterior, placed, local, frame, options };
    let change = refresh.apply(task, sweep).unwrap_or_else(|reason| {
        refresh.remove_all(task);
        task.skipped = Some(reason);
        0.0
    });
    match refresh.flush() {
        Ok(()) => change,
        Err(reason) => {
            (task.sites, task.skipped) = (before, Some(reason));
            0.0
        }
    }
}

/// One application of a constraint to its vector.
struct Refresh<'a> {
    posterior: &'a mut Posterior,
    placed: &'a Placed,
    local: Local,
    frame: &'a LocalFrame,
    options: &'a ConstraintOptions,
}

impl Refresh<'_> {
    fn apply(&mut self, task: &mut Task<'_>, sweep: u32) -> Result<f64, SkipReason> {
        let earlier = task.sites;
        let relinearised = self.relinearised_rows(task, sweep)?;
        let Some(given) = relinearised.or(task.rows) else { return Ok(0.0) };
        let (mut rows, mut policy) = (given, self.options.enlargement);
        if policy != Enlargement::Fixed && task.constraint.kind().widens_as_a_whole() {
            // The bounds are enlarged for all rows together, on the state without this constraint.
            self.remove_all(task);
            self.flush()?;
            (rows, task.enlargements) = self.widened_rows(&task.constraint)?;
            policy = Enlargement::Fixed;
        }
        let damping = match self.options.method {
            Method::Sequential { .. } => 0.0,
            Method::ExpectationPropagation { damping, .. } => {
                for row in &mut rows {
                    *row = row.filter(|bounded| !bounded.is_implied);
                }
                damping
            }
        };
        let manner = Manner { policy, prior: &task.prior, damping };
        let mut change = 0.0f64;
        for index in 0..rows.len() {
            if relinearised.is_some() && task.sites[index].is_some() {
                if !self.local.remove(&mut task.sites[index]) {
                    // The site could not be removed, so its former row stays too.
                    rows[index] = task.rows.and_then(|former| former[index]);
                    continue;
                }
                // Near an equality the change by a removal and that by the next row nearly cancel; together they would lose digits.
                self.flush()?;
            }
            if let Some(length) = task.constraint.kind().length()
                && (index, relinearised.is_some()) == (0, true)
            {
                self.relinearise(&mut rows, length);
            }
            // The given bounds decide whether a row acts; the enlarged bounds decide its effect.
            let Some((bounded, given)) = rows[index].zip(given[index]) else { continue };
            let inside = given.interval.contains(given.at(&self.local.mean));
            if inside && !self.options.act_when_inside && task.sites[index].is_none() {
                continue;
            }
            let sites = PreviousSites { in_state: task.sites[index], earlier: earlier[index] };
            let applied = self.local.apply(&bounded, &sites, &manner)?;
            task.enlargements = task.enlargements.max(applied.enlargements);
            task.sites[index] = Some(applied.site);
            task.acted = true;
            change = change.max(applied.change);
            if applied.site.precision * bounded.variance(&self.local.covariance) > NEARLY_EQUAL {
                self.flush()?;
            }
        }
        if relinearised.is_some() {
            task.rows = Some(rows);
        }
        Ok(change)
    }

    /// Changes the state as the vector has changed, and begins anew from there.
    fn flush(&mut self) -> Result<(), SkipReason> {
        self.posterior.follow(&self.local, self.placed)?;
        self.local = self.posterior.local(self.placed);
        Ok(())
    }

    /// The present distribution with the options.
    fn current(&self) -> Quantity<'_> {
        let Local { mean, covariance, .. } = self.local;
        Quantity { mean, covariance, frame: self.frame, options: self.options }
    }

    /// The rows of a bounded length linearised at the present state, if it is out of bounds or has a minimum.
    /// `None` keeps the former rows; all other constraints are linear.
    fn relinearised_rows(&self, task: &Task<'_>, sweep: u32) -> Result<Option<Rows>, SkipReason> {
        let kind = task.constraint.kind();
        if kind.length().is_some()
            && sweep < LINEARISING_SWEEPS
            && (kind.bounds().lower > 0.0 || task.is_violated(&self.local.mean))
        {
            kind.rows(&self.current()).map(Some)
        } else {
            Ok(None)
        }
    }

    /// Relinearises the rows of a length until truncation of the present state (the cavity) keeps the length in bounds or no longer changes
    /// it.
    fn relinearise(&mut self, rows: &mut Rows, length: &dyn BoundedLength) {
        let mut last = f64::INFINITY;
        for _ in 0..self.options.max_relinearisations {
            let Some(bounded) = rows[0] else { return };
            let Ok(marginal) = self.local.project(&bounded.axis) else { return };
            let Some(truncation) =
                truncate_with(marginal, bounded.interval, bounded.density, self.options.enlargement)
            else {
                return;
            };
            let step = (truncation.moments.mean - marginal.mean) / marginal.variance;
            let moved = length.bounded(&(self.local.mean + step * self.local.gain), self.frame);
            let size = moved.norm();
            let Interval { lower, upper } = bounded.interval;
            if (size >= lower - TOLERANCE && size <= upper + TOLERANCE)
                || (size - last).abs() <= TOLERANCE
                || size <= NO_DIRECTION
            {
                return;
            }
            last = size;
            *rows = length.rows_along(&self.current(), &(moved / size));
        }
    }

    /// The rows of a constraint with the enlarged bounds of Algorithm 1, and the number of enlargements.
    fn widened_rows(&self, constraint: &Constraint) -> Result<(Rows, u32), SkipReason> {
        let (mut wide, mut times) = (*constraint, 0);
        let mut rows = wide.kind().rows(&self.current())?;
        let Enlargement::Peng { confidence, factor, max_iterations } = self.options.enlargement else {
            return Ok((rows, times));
        };
        while times < max_iterations
            && let Some(wider) = wide.kind().widened(factor)
            && !self.are_plausible(&rows, confidence)?
        {
            times += 1;
            wide = wider;
            rows = wide.kind().rows(&self.current())?;
        }
        Ok((rows, times))
    }

    /// Whether the intervals of all rows except implied ones are plausible under the truncated distribution.
    fn are_plausible(&self, rows: &Rows, confidence: f64) -> Result<bool, SkipReason> {
        let mut all_plausible = true;
        for bounded in rows.iter().flatten().filter(|bounded| !bounded.is_implied) {
            let marginal = Gaussian {
                mean: bounded.at(&self.local.mean),
                variance: bounded.variance(&self.local.covariance),
            };
            let moments =
                moments_within(marginal, bounded.interval, bounded.density).ok_or(SkipReason::NoVariance)?;
            all_plausible &= plausible(moments, bounded.interval, confidence);
        }
        Ok(all_plausible)
    }

    /// Removes all sites of a constraint.
    fn remove_all(&mut self, task: &mut Task<'_>) {
        for slot in &mut task.sites {
            self.local.remove(slot);
        }
    }
}
