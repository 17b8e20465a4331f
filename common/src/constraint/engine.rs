//! Many constraints on one state.
//!
//! Each row that acted leaves a *site*, the Gaussian factor exp(−½τy² + νy) of y = cᵀX that stands for its interval. A row
//! that comes again first takes its own site out (the cavity: the state as if only the others had acted) and
//! truncates that. So nothing is ever applied twice to the same prior, in whatever order and however often. Both methods
//! are this loop; they differ in which constraints come again, and when it ends.
//!
//! All updates are symmetric rank-one updates of the covariance along Pc: O(n·6 + n²) each for n states.

use nalgebra::{DMatrix, DVector};

use super::options::{ConstraintOptions, Method};
use super::rows::{DistanceBounds, Motion, Rows, heading_rows};
use super::sites::{CONVERGED, Former, Posterior};
use super::task::{TOLERANCE, Task, rows_at};
use super::truncation::{Enlargement, Gaussian, Interval, moments_within, plausible, truncate};
use super::{Constraint, ConstraintAction, SkipReason};
use crate::filter::STATES_PER_PHONE;

/// Sweeps in which rows are linearised anew. Later ones keep them: with fixed rows the sites settle.
const LINEARISING_SWEEPS: u32 = 3;
/// Widest tolerance that a course is enlarged to, rad (89°).
const WIDEST_TOLERANCE_RAD: f64 = 1.553_343_034_274_953_4;

struct Engine<'a> {
    posterior: Posterior<'a>,
    options: &'a ConstraintOptions,
}

/// Applies constraints to a joint Gaussian state, in place, and tells what those did that acted, were violated or could
/// not be applied.
///
/// `state` holds nine elements per phone (see [`crate::filter`]), `covariance` theirs. A constraint that cannot be
/// applied (see [`SkipReason`]) changes nothing. A heading whose phone is too slow for one (see
/// [`HeadingGate`](super::HeadingGate)) does not apply and is not reported. The covariance stays symmetric.
pub fn constrain(
    state: &mut DVector<f64>,
    covariance: &mut DMatrix<f64>,
    constraints: &[Constraint],
    options: &ConstraintOptions,
) -> Vec<ConstraintAction> {
    let mut tasks: Vec<Task> =
        constraints.iter().map(|constraint| Task::new(*constraint, state, covariance, options)).collect();
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
        if let Constraint::Heading { phone, course_rad, tolerance_rad } = task.constraint
            && policy != Enlargement::Fixed
        {
            // A course's half-planes have no width of their own: the tolerance is enlarged for all of them, before the
            // first, on the state without this constraint.
            self.remove_all(task);
            let motion = Motion::of(self.posterior.state, phone, self.options.horizon_s)
                .ok_or(SkipReason::NotFinite)?;
            (rows, task.enlargements) = self.enlarged_heading(&motion, course_rad, tolerance_rad)?;
            policy = Enlargement::Fixed;
        }
        if self.skips_ahead_row(task) {
            rows[0] = None;
        }
        let mut change = 0.0f64;
        for index in 0..rows.len() {
            if turned.is_some() && !self.posterior.take_out(&mut task.sites[index]) {
                // The site stays, and with it the row that it belongs to.
                rows[index] = task.rows.and_then(|former| former[index]);
                continue;
            }
            if let Constraint::Distance { phones, minimum_m, maximum_m } = task.constraint
                && (index, turned.is_some()) == (0, true)
            {
                self.settle(&mut rows, DistanceBounds { phones, minimum_m, maximum_m });
            }
            // Whether a row acts is asked of the bounds as given; how it acts, of the enlarged ones.
            let Some((bounded, given)) = rows[index].zip(given[index]) else { continue };
            let inside = given.interval.contains(given.row.times(self.posterior.state));
            if inside && !self.options.act_when_inside && task.sites[index].is_none() {
                continue;
            }
            let sites = Former { in_state: task.sites[index], earlier: earlier[index] };
            let applied = self.posterior.apply(&bounded, policy, sites)?;
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

    /// Under expectation propagation the first half-plane of a heading is left out: the other two imply it.
    fn skips_ahead_row(&self, task: &Task) -> bool {
        matches!(task.constraint, Constraint::Heading { .. })
            && matches!(self.options.method, Method::ExpectationPropagation { .. })
    }

    /// The rows of a distance linearised about the present state, when they should be: while it is out of bounds or has a
    /// minimum. `None` keeps those it has; all other constraints are linear.
    fn turned_rows(&self, task: &Task, sweep: u32) -> Result<Option<Rows>, SkipReason> {
        match task.constraint {
            Constraint::Distance { minimum_m, .. }
                if sweep < LINEARISING_SWEEPS && (minimum_m > 0.0 || self.is_violated(&task.constraint)) =>
            {
                rows_at(&task.constraint, self.posterior.state, self.posterior.covariance, self.options)
                    .map(Some)
            }
            _ => Ok(None),
        }
    }

    /// Turns a distance's rows until the truncation of the state as it stands (the cavity) keeps the distance
    /// in bounds or no longer changes it.
    fn settle(&mut self, rows: &mut Rows, bounds: DistanceBounds) {
        let mut last_m = f64::INFINITY;
        for _ in 0..self.options.max_relinearisations {
            let Some((bounded, difference)) = rows[0].zip(bounds.difference(self.posterior.state)) else {
                return;
            };
            let Ok(law) = self.posterior.project(&bounded.row) else { return };
            let Some(truncation) = truncate(law, bounded.interval, self.options.enlargement) else { return };
            let step = (truncation.moments.mean - law.mean) / law.variance;
            let (i, j) = (STATES_PER_PHONE * bounds.phones.0, STATES_PER_PHONE * bounds.phones.1);
            let relative_gain =
                self.posterior.gain.fixed_rows::<3>(i) - self.posterior.gain.fixed_rows::<3>(j);
            let moved = difference + step * relative_gain;
            let distance_m = moved.norm();
            let Interval { lower, upper } = bounded.interval;
            if (distance_m >= lower - TOLERANCE && distance_m <= upper + TOLERANCE)
                || (distance_m - last_m).abs() <= TOLERANCE
                || DistanceBounds::is_without_direction(&moved)
            {
                return;
            }
            last_m = distance_m;
            let direction = moved / distance_m;
            *rows = bounds.rows(&direction, self.posterior.covariance, self.options.distance_model);
        }
    }

    /// A heading's rows with the tolerance that Algorithm 1 arrives at, and the number of enlargements.
    fn enlarged_heading(
        &self,
        motion: &Motion,
        course_rad: f64,
        tolerance_rad: f64,
    ) -> Result<(Rows, u32), SkipReason> {
        let mut rows = heading_rows(motion, course_rad, tolerance_rad);
        let Enlargement::Peng { confidence, factor, max_iterations } = self.options.enlargement else {
            return Ok((rows, 0));
        };
        let (mut tolerance_rad, mut times) = (tolerance_rad.max(TOLERANCE), 0);
        while times < max_iterations && tolerance_rad < WIDEST_TOLERANCE_RAD {
            let mut all_plausible = true;
            for bounded in rows.iter().skip(1).flatten() {
                let law = Gaussian {
                    mean: bounded.row.times(self.posterior.state),
                    variance: bounded.row.variance(self.posterior.covariance),
                };
                let moments = moments_within(law, bounded.interval).ok_or(SkipReason::NoVariance)?;
                all_plausible &= plausible(moments, bounded.interval, confidence);
            }
            if all_plausible {
                break;
            }
            times += 1;
            tolerance_rad = (tolerance_rad * factor).min(WIDEST_TOLERANCE_RAD);
            rows = heading_rows(motion, course_rad, tolerance_rad);
        }
        Ok((rows, times))
    }

    /// Takes all of a constraint's sites out.
    fn remove_all(&mut self, task: &mut Task) {
        for slot in &mut task.sites {
            self.posterior.take_out(slot);
        }
    }
}
