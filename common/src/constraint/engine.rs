//! Many constraints on one state.
//!
//! Each row that acted leaves a *site*, the Gaussian factor exp(−½τy² + νy) of y = cᵀX that stands for its interval. A row
//! that comes again first takes its own site out (the cavity: the state as if only the others had acted) and
//! truncates that. So nothing is ever applied twice to the same prior, in whatever order and however often. Both methods
//! are this loop; they differ in which constraints come again, and when it ends.
//!
//! All updates are symmetric rank-one updates of the covariance along Pc: O(n·6 + n²) each for n states.

use nalgebra::{DMatrix, DVector};

use super::options::{ConstraintOptions, DistanceModel, Method};
use super::rows::{
    BoundedRow, DistanceBounds, Motion, Rows, SparseRow, heading_rows, vertical_velocity_rows,
};
use super::truncation::{Enlargement, Gaussian, Interval, Truncation, moments_within, plausible, truncate};
use super::{Constraint, ConstraintAction, ConstraintOutcome, SkipReason};
use crate::filter::STATES_PER_PHONE;
use crate::frames::Ecef;

/// Beyond this many standard deviations a bound takes nothing away (2e-9 of the probability).
const IDLE_SIGMAS: f64 = 6.0;
/// Excess below which a constraint counts as holding: 1 mm, 1 mm/s, 1 mrad.
const TOLERANCE: f64 = 1e-3;
/// A refresh that changes a row's mean by less than this many standard deviations, and its variance by less than
/// this part, has converged.
const CONVERGED: f64 = 1e-3;
/// Smallest part of a row's prior variance that one constraint leaves (1 % of the standard deviation). Taking a site out
/// of the state again loses digits with the square of this ratio; the mean is not affected.
const LEAST_VARIANCE: f64 = 1e-4;
/// Sweeps in which rows are linearised anew. Later ones keep them: with fixed rows the sites settle.
const LINEARISING_SWEEPS: u32 = 3;
/// Widest tolerance that a course is enlarged to, rad (89°).
const WIDEST_TOLERANCE_RAD: f64 = 1.553_343_034_274_953_4;

/// What a row has contributed: exp(−½ precision y² + shift y), y = row·X.
#[derive(Clone, Copy)]
struct Site {
    row: SparseRow,
    precision: f64,
    shift: f64,
}

/// One constraint's work within a call.
struct Task {
    constraint: Constraint,
    before: f64,
    rows: Option<Rows>,
    sites: [Option<Site>; 3],
    enlargements: u32,
    acted: bool,
    idle: bool,
    skipped: Option<SkipReason>,
}

struct Engine<'a> {
    state: &'a mut DVector<f64>,
    covariance: &'a mut DMatrix<f64>,
    options: &'a ConstraintOptions,
    /// Pc of the row at hand.
    gain: DVector<f64>,
    /// Whether a site was taken out of the covariance, which costs digits.
    took_out: bool,
    /// State and covariance as they came.
    prior: (DVector<f64>, DMatrix<f64>),
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
    let prior = (state.clone(), covariance.clone());
    let gain = DVector::zeros(state.len());
    let mut engine = Engine { state, covariance, options, gain, took_out: false, prior };
    let max_sweeps = match options.method {
        Method::Sequential { max_sweeps } | Method::ExpectationPropagation { max_sweeps, .. } => max_sweeps,
    };
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
    if engine.took_out {
        engine.rebuild(&tasks);
    }
    tasks.iter().filter_map(|task| task.report(&engine.prior.0, engine.state, options)).collect()
}

impl Task {
    fn new(
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
            return Ok(false);
        }
        let idle = |bounded: &BoundedRow| is_idle(bounded, state, covariance);
        // An idle constraint may still be violated when another one has moved its phones: it is looked at again.
        Ok(!options.act_when_inside || rows.iter().flatten().all(idle))
    }

    fn report(
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
            let moved = super::rows::position(prior, phone).zip(super::rows::position(state, phone));
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
            .value(self.state, self.options.horizon_s)
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
        let turned = self.turned_rows(task, sweep)?;
        let Some(given) = turned.or(task.rows) else { return Ok(0.0) };
        let (mut rows, mut policy) = (given, self.options.enlargement);
        if let Constraint::Heading { phone, course_rad, tolerance_rad } = task.constraint
            && policy != Enlargement::Fixed
        {
            // A course's half-planes have no width of their own: the tolerance is enlarged for all of them, before the
            // first, on the state without this constraint.
            self.remove_all(task);
            let motion =
                Motion::of(self.state, phone, self.options.horizon_s).ok_or(SkipReason::NotFinite)?;
            (rows, task.enlargements) = self.enlarged_heading(&motion, course_rad, tolerance_rad)?;
            policy = Enlargement::Fixed;
        }
        if self.skips_ahead_row(task) {
            rows[0] = None;
        }
        let mut change = 0.0f64;
        for index in 0..rows.len() {
            if turned.is_some() && !self.take_out(&mut task.sites[index]) {
                continue;
            }
            if let Constraint::Distance { phones, minimum_m, maximum_m } = task.constraint
                && (index, turned.is_some()) == (0, true)
            {
                self.settle(&mut rows, DistanceBounds { phones, minimum_m, maximum_m });
            }
            // Whether a row acts is asked of the bounds as given; how it acts, of the enlarged ones.
            let Some((bounded, given)) = rows[index].zip(given[index]) else { continue };
            let inside = given.interval.contains(given.row.times(self.state));
            if inside && !self.options.act_when_inside && task.sites[index].is_none() {
                continue;
            }
            let (site, enlargements, moved) = self.apply(&bounded, policy, task.sites[index])?;
            task.enlargements = task.enlargements.max(enlargements);
            task.sites[index] = Some(site);
            task.acted = true;
            change = change.max(moved);
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
                rows_at(&task.constraint, self.state, self.covariance, self.options).map(Some)
            }
            _ => Ok(None),
        }
    }

    /// Turns a distance's rows until the truncation of the state as it stands (the cavity) keeps the distance
    /// in bounds or no longer changes it.
    fn settle(&mut self, rows: &mut Rows, bounds: DistanceBounds) {
        let mut last_m = f64::INFINITY;
        for _ in 0..self.options.max_relinearisations {
            let Some((bounded, difference)) = rows[0].zip(bounds.difference(self.state)) else { return };
            let Ok(law) = self.project(&bounded.row) else { return };
            let Some(truncation) = truncate(law, bounded.interval, self.options.enlargement) else { return };
            let step = (truncation.moments.mean - law.mean) / law.variance;
            let (i, j) = (STATES_PER_PHONE * bounds.phones.0, STATES_PER_PHONE * bounds.phones.1);
            let relative_gain = self.gain.fixed_rows::<3>(i) - self.gain.fixed_rows::<3>(j);
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
            *rows = bounds.rows(&direction, self.covariance, self.options.distance_model);
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
                    mean: bounded.row.times(self.state),
                    variance: bounded.row.variance(self.covariance),
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

    /// Truncates the state by one row, in place of the row's former site. Returns the site, the enlargements, and the
    /// change of the row's law in standard deviations.
    fn apply(
        &mut self,
        bounded: &BoundedRow,
        policy: Enlargement,
        former: Option<Site>,
    ) -> Result<(Site, u32, f64), SkipReason> {
        let law = self.project(&bounded.row)?;
        let former = former.unwrap_or(Site { row: bounded.row, precision: 0.0, shift: 0.0 });
        let cavity = with_site(law, -former.precision, -former.shift);
        if !is_law(cavity) {
            return Ok((former, 0, 0.0));
        }
        let Truncation { moments, enlargements } =
            truncate(cavity, bounded.interval, policy).ok_or(SkipReason::NotFinite)?;
        let cavity_precision = 1.0 / cavity.variance;
        let most = 1.0 / (LEAST_VARIANCE * bounded.row.variance(&self.prior.1));
        let precision = (1.0 / moments.variance - cavity_precision).max(0.0).min(most);
        // Whatever the precision, the mean becomes that within the interval.
        let shift = moments.mean * (precision + cavity_precision) - cavity.mean * cavity_precision;
        let mut site = Site { row: bounded.row, precision, shift };
        if let Method::ExpectationPropagation { damping, .. } = self.options.method
            && former.precision > 0.0
        {
            let keep = damping.clamp(0.0, 0.99);
            site.precision += keep * (former.precision - site.precision);
            site.shift += keep * (former.shift - site.shift);
        }
        let updated = with_site(cavity, site.precision, site.shift);
        let moved = (updated.mean - law.mean).abs() / law.variance.sqrt();
        let moved = moved.max((updated.variance / law.variance).ln().abs());
        if moved < CONVERGED && former.precision > 0.0 {
            return Ok((former, enlargements, moved));
        }
        self.update(law, updated)?;
        Ok((site, enlargements, moved))
    }

    /// Takes a site out of the state and its slot. When rounding next to an equality leaves no law without it, the site
    /// stays in both and the answer is no.
    fn take_out(&mut self, slot: &mut Option<Site>) -> bool {
        let Some(site) = *slot else { return true };
        let Ok(law) = self.project(&site.row) else { return false };
        let cavity = with_site(law, -site.precision, -site.shift);
        let is_out = is_law(cavity) && self.update(law, cavity).is_ok();
        if is_out {
            *slot = None;
            self.took_out = true;
        }
        is_out
    }

    /// The prior with all sites as they now are, each brought in once: what the state is, without the rounding of sites
    /// that went in and out. Every step takes something away from the covariance, so it stays one.
    fn rebuild(&mut self, tasks: &[Task]) {
        self.state.copy_from(&self.prior.0);
        self.covariance.copy_from(&self.prior.1);
        for site in tasks.iter().flat_map(|task| task.sites.iter().flatten()) {
            if let Ok(law) = self.project(&site.row) {
                // A step that is not finite is not taken; the state is then as if without this site.
                let _ = self.update(law, with_site(law, site.precision, site.shift));
            }
        }
    }

    /// Takes all of a constraint's sites out.
    fn remove_all(&mut self, task: &mut Task) {
        for slot in &mut task.sites {
            self.take_out(slot);
        }
    }

    /// The law of row·X, with Pc left in `gain`.
    fn project(&mut self, row: &SparseRow) -> Result<Gaussian, SkipReason> {
        if !row.fits(self.state.len()) {
            return Err(SkipReason::UnknownPhone);
        }
        row.covariance_times(self.covariance, &mut self.gain);
        let law = Gaussian { mean: row.times(self.state), variance: row.times(&self.gain) };
        if !(law.mean.is_finite() && self.gain.iter().all(|element| element.is_finite())) {
            Err(SkipReason::NotFinite)
        } else if law.variance > 0.0 {
            Ok(law)
        } else {
            Err(SkipReason::NoVariance)
        }
    }

    /// Gives the projected row other moments: a rank-one update along `gain`.
    fn update(&mut self, from: Gaussian, to: Gaussian) -> Result<(), SkipReason> {
        let step = (to.mean - from.mean) / from.variance;
        // Dividing twice keeps the square of a small variance from underflowing.
        let factor = (to.variance - from.variance) / from.variance / from.variance;
        if !(step.is_finite() && factor.is_finite()) {
            return Err(SkipReason::NotFinite);
        }
        self.state.axpy(step, &self.gain, 1.0);
        // Products of the same two factors on both sides of the diagonal: exactly symmetric.
        let root = factor.abs().sqrt();
        self.gain *= root;
        let sign = factor.signum();
        for (column, element) in self.gain.iter().enumerate() {
            self.covariance.column_mut(column).axpy(sign * element, &self.gain, 1.0);
        }
        Ok(())
    }
}

/// Whether mean and variance make a law.
fn is_law(law: Gaussian) -> bool {
    law.mean.is_finite() && law.variance > 0.0 && law.variance.is_finite()
}

/// A law times exp(−½ precision y² + shift y).
fn with_site(law: Gaussian, precision: f64, shift: f64) -> Gaussian {
    let denominator = 1.0 + precision * law.variance;
    Gaussian { mean: (law.mean + shift * law.variance) / denominator, variance: law.variance / denominator }
}

/// The rows of a constraint at a state; none when it has nothing to say there.
fn rows_at(
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

/// Whether a row's interval takes nothing noticeable from its law.
fn is_idle(bounded: &BoundedRow, state: &DVector<f64>, covariance: &DMatrix<f64>) -> bool {
    let margin = IDLE_SIGMAS * bounded.row.variance(covariance).max(0.0).sqrt();
    let mean = bounded.row.times(state);
    mean - margin >= bounded.interval.lower && mean + margin <= bounded.interval.upper
}
