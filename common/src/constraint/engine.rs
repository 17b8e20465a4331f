//! Application of several constraints to one state.
//!
//! Each applied row leaves a *site*, the Gaussian factor exp(−½τy² + νy) of y = cᵀX that represents its interval. Before a row is applied
//! again, its own site is removed, and the remaining distribution (the cavity: the state with all other sites) is truncated. So no
//! information is applied twice, whatever the order and number of applications. Both methods use this loop; they differ in the constraints
//! that are applied again and in the end of the loop.
//!
//! All updates are symmetric rank-one updates of the covariance along Pc: O(n·6 + n²) each for n states.

use nalgebra::{DMatrix, DVector};

use super::kinds::{BoundedLength, ConstrainedState, NO_DIRECTION};
use super::options::{ConstraintOptions, Method};
use super::rows::Rows;
use super::second::AppliedRow;
use super::sites::{CONVERGED, Posterior, PreviousSites, Site};
use super::task::{TOLERANCE, Task};
use super::truncation::{Enlargement, Gaussian, Interval, moments_within, plausible, truncate_with};
use super::{Constraint, ConstraintAction, SkipReason};

/// Number of sweeps with relinearised rows. In later sweeps the rows are fixed, so that the sites converge.
const LINEARISING_SWEEPS: u32 = 3;

/// Result of applying constraints.
#[derive(Clone, Debug, Default)]
pub struct Constrained {
    /// Effect of each constraint that acted, was violated or could not be applied.
    pub actions: Vec<ConstraintAction>,
    /// The rows that changed the state.
    pub applied: Vec<AppliedRow>,
}

struct Propagation<'a> {
    posterior: Posterior<'a>,
    options: &'a ConstraintOptions,
}

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
    apply(state, covariance, constraints, options).actions
}

/// The same, with the rows that changed the state.
pub fn apply(
    state: &mut DVector<f64>,
    covariance: &mut DMatrix<f64>,
    constraints: &[Constraint],
    options: &ConstraintOptions,
) -> Constrained {
    let prior = ConstrainedState { state, covariance, options };
    let task = |(index, constraint): (usize, &Constraint)| Task::new(index, *constraint, &prior);
    let mut tasks: Vec<Task> = constraints.iter().enumerate().map(task).collect();
    if tasks.iter().all(|task| task.idle) {
        return Constrained::default();
    }
    let (max_sweeps, damping) = match options.method {
        Method::Sequential { max_sweeps } => (max_sweeps, 0.0),
        Method::ExpectationPropagation { max_sweeps, damping } => (max_sweeps, damping),
    };
    let mut engine = Propagation { posterior: Posterior::new(state, covariance, damping), options };
    for sweep in 0..max_sweeps.max(1) {
        let mut largest_change = 0.0f64;
        for task in &mut tasks {
            if engine.is_due(task, sweep) {
                largest_change = largest_change.max(engine.refresh(task, sweep));
            }
        }
        if largest_change < CONVERGED {
            break;
        }
    }
    let mut posterior = engine.posterior;
    posterior.rebuild(tasks.iter().flat_map(|task| task.sites.iter().flatten()));
    let report = |task: &Task| task.report(&posterior.prior.0, posterior.state, options);
    let applied = tasks.iter().flat_map(|task| task.sites.iter().flatten()).map(Site::applied).collect();
    Constrained { actions: tasks.iter().filter_map(report).collect(), applied }
}

impl Propagation<'_> {
    /// Whether a constraint is applied in this sweep.
    fn is_due(&self, task: &Task, sweep: u32) -> bool {
        if task.skipped.is_some() || task.rows.is_none() {
            return false;
        }
        let refreshes = match self.options.method {
            Method::Sequential { .. } => sweep == 0,
            Method::ExpectationPropagation { .. } => true,
        };
        let wanted = (self.options.act_when_inside && !task.idle) || task.acted;
        (refreshes && wanted) || self.is_violated(&task.constraint)
    }

    fn is_violated(&self, constraint: &Constraint) -> bool {
        constraint
            .value(self.posterior.state, self.options.horizon_s)
            .is_some_and(|value| constraint.excess(value) > TOLERANCE)
    }

    /// Applies a constraint for the first time or again. Returns the change of its rows in the units of [`CONVERGED`].
    fn refresh(&mut self, task: &mut Task, sweep: u32) -> f64 {
        match self.try_refresh(task, sweep) {
            Ok(change) => change,
            Err(reason) => {
                self.remove_all(task);
                task.skipped = Some(reason);
                0.0
            }
        }
    }

    fn try_refresh(&mut self, task: &mut Task, sweep: u32) -> Result<f64, SkipReason> {
        let earlier = task.sites;
        let relinearised = self.relinearised_rows(task, sweep)?;
        let Some(given) = relinearised.or(task.rows) else { return Ok(0.0) };
        let (mut rows, mut policy) = (given, self.options.enlargement);
        if policy != Enlargement::Fixed && task.constraint.kind().widens_as_a_whole() {
            // The bounds are enlarged for all rows together, on the state without this constraint.
            self.remove_all(task);
            (rows, task.enlargements) = self.widened_rows(&task.constraint)?;
            policy = Enlargement::Fixed;
        }
        if matches!(self.options.method, Method::ExpectationPropagation { .. }) {
            for row in &mut rows {
                *row = row.filter(|bounded| !bounded.is_implied);
            }
        }
        let mut change = 0.0f64;
        for index in 0..rows.len() {
            if relinearised.is_some() && !self.posterior.remove(&mut task.sites[index]) {
                // The site could not be removed, so its former row stays too.
                rows[index] = task.rows.and_then(|former| former[index]);
                continue;
            }
            if let Some(length) = task.constraint.kind().length()
                && (index, relinearised.is_some()) == (0, true)
            {
                self.relinearise(&mut rows, length);
            }
            // The given bounds decide whether a row acts; the enlarged bounds decide its effect.
            let Some((bounded, given)) = rows[index].zip(given[index]) else { continue };
            let inside = given.interval.contains(given.row.at(self.posterior.state));
            if inside && !self.options.act_when_inside && task.sites[index].is_none() {
                continue;
            }
            let sites = PreviousSites { in_state: task.sites[index], earlier: earlier[index] };
            let applied = self.posterior.apply(&bounded, policy, &sites)?;
            task.enlargements = task.enlargements.max(applied.enlargements);
            task.sites[index] = Some(applied.site);
            task.acted = true;
            change = change.max(applied.change);
        }
        if relinearised.is_some() {
            task.rows = Some(rows);
        }
        Ok(change)
    }

    /// The present state with the options.
    fn current(&self) -> ConstrainedState<'_> {
        ConstrainedState {
            state: self.posterior.state,
            covariance: self.posterior.covariance,
            options: self.options,
        }
    }

    /// The rows of a bounded length linearised at the present state, if it is out of bounds or has a minimum.
    /// `None` keeps the former rows; all other constraints are linear.
    fn relinearised_rows(&self, task: &Task, sweep: u32) -> Result<Option<Rows>, SkipReason> {
        let kind = task.constraint.kind();
        if kind.length().is_some()
            && sweep < LINEARISING_SWEEPS
            && (kind.bounds().lower > 0.0 || self.is_violated(&task.constraint))
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
            let Some((bounded, vector)) = rows[0].zip(length.vector(&self.current())) else { return };
            let Ok(marginal) = self.posterior.project(&bounded.row) else { return };
            let Some(truncation) =
                truncate_with(marginal, bounded.interval, bounded.density, self.options.enlargement)
            else {
                return;
            };
            let step = (truncation.moments.mean - marginal.mean) / marginal.variance;
            let Some(relative_gain) = length.change(&self.current(), &self.posterior.gain) else { return };
            let moved = vector + step * relative_gain;
            let size = moved.norm();
            let Interval { lower, upper } = bounded.interval;
            if (size >= lower - TOLERANCE && size <= upper + TOLERANCE)
                || (size - last).abs() <= TOLERANCE
                || size <= NO_DIRECTION
            {
                return;
            }
            last = size;
            let Some(relinearised) = length.rows_along(&self.current(), &(moved / size)) else { return };
            *rows = relinearised;
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
                mean: bounded.row.at(self.posterior.state),
                variance: bounded.row.variance(self.posterior.covariance),
            };
            let moments =
                moments_within(marginal, bounded.interval, bounded.density).ok_or(SkipReason::NoVariance)?;
            all_plausible &= plausible(moments, bounded.interval, confidence);
        }
        Ok(all_plausible)
    }

    /// Removes all sites of a constraint.
    fn remove_all(&mut self, task: &mut Task) {
        for slot in &mut task.sites {
            self.posterior.remove(slot);
        }
    }
}
