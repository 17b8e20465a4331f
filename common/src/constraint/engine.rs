//! Many constraints on one state.
//!
//! Each row that acted leaves a *site*, the Gaussian factor exp(−½τy² + νy) of y = cᵀX that stands for its interval. A row
//! that comes again first takes its own site out (the cavity: the state as if only the others had acted) and
//! truncates that. So nothing is ever applied twice to the same prior, in whatever order and however often. Both methods
//! are this loop; they differ in which constraints come again, and when it ends.
//!
//! All updates are symmetric rank-one updates of the covariance along Pc: O(n·6 + n²) each for n states.

use nalgebra::{DMatrix, DVector};

use super::kinds::{At, Length, NO_DIRECTION};
use super::options::{ConstraintOptions, Method};
use super::rows::Rows;
use super::sites::{CONVERGED, Former, Posterior};
use super::task::{TOLERANCE, Task};
use super::truncation::{Enlargement, Gaussian, Interval, moments_within, plausible, truncate};
use super::{Constraint, ConstraintAction, SkipReason};

/// Sweeps in which rows are linearised anew. Later ones keep them: with fixed rows the sites settle.
const LINEARISING_SWEEPS: u32 = 3;

struct Engine<'a> {
    posterior: Posterior<'a>,
    options: &'a ConstraintOptions,
}

/// Applies constraints to a joint Gaussian state, in place, and tells what those did that acted, were violated or could
/// not be applied, each by its place in `constraints`.
///
/// `state` holds nine elements per phone (see [`crate::filter`]), `covariance` theirs. A constraint that cannot be
/// applied (see [`SkipReason`]) changes nothing. One that has nothing to say of the state, as a heading whose phone is too slow
/// for one (see [`HeadingGate`](super::HeadingGate)), is not reported. The covariance stays symmetric.
pub fn constrain(
    state: &mut DVector<f64>,
    covariance: &mut DMatrix<f64>,
    constraints: &[Constraint],
    options: &ConstraintOptions,
) -> Vec<ConstraintAction> {
    let prior = At { state, covariance, options };
    let task = |(index, constraint): (usize, &Constraint)| Task::new(index, *constraint, &prior);
    let mut tasks: Vec<Task> = constraints.iter().enumerate().map(task).collect();
    if tasks.iter().all(|task| task.idle) {
        return Vec::new();
    }
    let (max_sweeps, damping) = match options.method {
        Method::Sequential { max_sweeps } => (max_sweeps, 0.0),
        Method::ExpectationPropagation { max_sweeps, damping } => (max_sweeps, damping),
    };
    let mut engine = Engine { posterior: Posterior::new(state, covariance, damping), options };
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
    tasks.iter().filter_map(|task| task.report(&posterior.prior.0, posterior.state, options)).collect()
}

impl Engine<'_> {
    /// Whether a constraint comes in this sweep.
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

    /// Applies a constraint, again if need be, and returns by how much it changed its rows.
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
        let turned = self.turned_rows(task, sweep)?;
        let Some(given) = turned.or(task.rows) else { return Ok(0.0) };
        let (mut rows, mut policy) = (given, self.options.enlargement);
        if policy != Enlargement::Fixed && task.constraint.kind().widens_as_a_whole() {
            // The bounds are enlarged for all rows, before the first, on the state without this constraint.
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
            if turned.is_some() && !self.posterior.take_out(&mut task.sites[index]) {
                // The site stays, and with it the row that it belongs to.
                rows[index] = task.rows.and_then(|former| former[index]);
                continue;
            }
            if let Some(length) = task.constraint.kind().length()
                && (index, turned.is_some()) == (0, true)
            {
                self.settle(&mut rows, length);
            }
            // Whether a row acts is asked of the bounds as given; how it acts, of the enlarged ones.
            let Some((bounded, given)) = rows[index].zip(given[index]) else { continue };
            let inside = given.interval.contains(given.row.at(self.posterior.state));
            if inside && !self.options.act_when_inside && task.sites[index].is_none() {
                continue;
            }
            let sites = Former { in_state: task.sites[index], earlier: earlier[index] };
            let applied = self.posterior.apply(&bounded, policy, &sites)?;
            task.enlargements = task.enlargements.max(applied.enlargements);
            task.sites[index] = Some(applied.site);
            task.acted = true;
            change = change.max(applied.change);
        }
        if turned.is_some() {
            task.rows = Some(rows);
        }
        Ok(change)
    }

    /// The state as it stands.
    fn at(&self) -> At<'_> {
        At { state: self.posterior.state, covariance: self.posterior.covariance, options: self.options }
    }

    /// The rows of a bounded length linearised about the present state, when they should be: while it is out of bounds or has
    /// a minimum. `None` keeps those it has; all other constraints are linear.
    fn turned_rows(&self, task: &Task, sweep: u32) -> Result<Option<Rows>, SkipReason> {
        let kind = task.constraint.kind();
        if kind.length().is_some()
            && sweep < LINEARISING_SWEEPS
            && (kind.bounds().lower > 0.0 || self.is_violated(&task.constraint))
        {
            kind.rows(&self.at()).map(Some)
        } else {
            Ok(None)
        }
    }

    /// Turns a length's rows until the truncation of the state as it stands (the cavity) keeps the length
    /// in bounds or no longer changes it.
    fn settle(&mut self, rows: &mut Rows, length: &dyn Length) {
        let mut last = f64::INFINITY;
        for _ in 0..self.options.max_relinearisations {
            let Some((bounded, vector)) = rows[0].zip(length.vector(&self.at())) else { return };
            let Ok(marginal) = self.posterior.project(&bounded.row) else { return };
            let Some(truncation) = truncate(marginal, bounded.interval, self.options.enlargement) else {
                return;
            };
            let step = (truncation.moments.mean - marginal.mean) / marginal.variance;
            let Some(relative_gain) = length.change(&self.at(), &self.posterior.gain) else { return };
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
            let Some(turned) = length.rows_along(&self.at(), &(moved / size)) else { return };
            *rows = turned;
        }
    }

    /// A constraint's rows with the bounds that Algorithm 1 arrives at, and the number of enlargements.
    fn widened_rows(&self, constraint: &Constraint) -> Result<(Rows, u32), SkipReason> {
        let (mut wide, mut times) = (*constraint, 0);
        let mut rows = wide.kind().rows(&self.at())?;
        let Enlargement::Peng { confidence, factor, max_iterations } = self.options.enlargement else {
            return Ok((rows, times));
        };
        while times < max_iterations
            && let Some(wider) = wide.kind().widened(factor)
            && !self.are_plausible(&rows, confidence)?
        {
            times += 1;
            wide = wider;
            rows = wide.kind().rows(&self.at())?;
        }
        Ok((rows, times))
    }

    /// Whether the intervals of all rows, but for implied ones, are plausible under the distribution within them.
    fn are_plausible(&self, rows: &Rows, confidence: f64) -> Result<bool, SkipReason> {
        let mut all_plausible = true;
        for bounded in rows.iter().flatten().filter(|bounded| !bounded.is_implied) {
            let marginal = Gaussian {
                mean: bounded.row.at(self.posterior.state),
                variance: bounded.row.variance(self.posterior.covariance),
            };
            let moments = moments_within(marginal, bounded.interval).ok_or(SkipReason::NoVariance)?;
            all_plausible &= plausible(moments, bounded.interval, confidence);
        }
        Ok(all_plausible)
    }

    /// Takes all of a constraint's sites out.
    fn remove_all(&mut self, task: &mut Task) {
        for slot in &mut task.sites {
            self.posterior.take_out(slot);
        }
    }
}
