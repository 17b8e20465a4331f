//! Displacement of a phone and change of its clock by robust least squares from changes of range.

use nalgebra::{Cholesky, U3, Vector3};

use crate::filter::RobustWeights;
use crate::frames::Ecef;
use crate::gnss::{ClockGroup, SignalKey};
use crate::solve::elimination::{Eliminated, Row};

/// Minimum number of changes: two more than displacement and clock need.
const FEWEST: usize = 6;
/// Rounds of reweighting.
const ROUNDS: usize = 8;
/// Change of all robust factors below which the rounds end.
const SETTLED: f64 = 0.02;
/// Residuals in standard deviations of the epoch.
const ROBUST: RobustWeights = RobustWeights { keep: 2.0, reject: 4.0 };
/// Ratio of standard deviation and median absolute value of a normal variable.
const SIGMA_PER_MEDIAN: f64 = 1.4826;

/// Where a change of range comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Source {
    /// Two phases.
    Phase,
    /// A Doppler that is the mean over the interval.
    Doppler,
}

/// Change of range of one signal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change {
    /// Place of the observation.
    pub index: usize,
    pub key: SignalKey,
    pub group: ClockGroup,
    /// Where the change comes from.
    pub source: Source,
    /// Change of range and receiver clock, m.
    pub value_m: f64,
    /// Rates by Doppler at this epoch and the one before, m/s, beside a phase.
    pub rates_mps: Option<(f64, f64)>,
    pub geometry: Geometry,
}

/// How a change depends on the displacement of the phone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Geometry {
    /// Position of the satellite at the epoch before.
    pub satellite_before: Ecef,
    /// Change of range of a phone that stands still, m.
    still_m: f64,
    /// Partial derivatives of the change with respect to the displacement.
    h: Vector3<f64>,
}

/// Result of a fit.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// Robust factor of each change; 0: left out.
    pub factors: Vec<f64>,
    /// Residual of each change, m.
    pub residuals_m: Vec<f64>,
    /// Share of a residual's variance that is not taken up by the unknowns.
    pub redundancies: Vec<f64>,
    /// Standard deviation of the residuals in units of the expected one, at least 1.
    pub scale: f64,
}

impl Geometry {
    /// Geometry of a satellite at `satellite` and, at the epoch before, at `satellite_before`, for a phone about `position`.
    pub fn new(satellite: Ecef, satellite_before: Ecef, position: Ecef) -> Self {
        let (now, then) = (satellite - position, satellite_before - position);
        let h = -0.5 * (now.0.normalize() + then.0.normalize());
        Self { satellite_before, still_m: now.norm() - then.norm(), h }
    }
}

/// Fits displacement and clock. `moved` is the displacement from which the search for outliers starts, if known. `None` if fewer than six
/// changes remain, or their geometry is singular.
pub(super) fn fit(changes: &[Change], weights: &[f64], moved: Option<Vector3<f64>>) -> Option<Fit> {
    if changes.len() < FEWEST {
        return None;
    }
    let row = |(change, weight): (&Change, &f64)| Row {
        h: change.geometry.h,
        group: 0,
        y: change.value_m - change.geometry.still_m,
        weight: *weight,
    };
    let mut rows: Vec<Row> = changes.iter().zip(weights).map(row).collect();
    let start = moved.or_else(|| solve(&rows).map(|(eliminated, factor)| factor.solve(&eliminated.rhs)))?;
    let mut fit = Fit::about(&rows, weights, &start, None);
    let mut round = 0;
    let (eliminated, factor) = loop {
        for ((row, weight), factor) in rows.iter_mut().zip(weights).zip(&fit.factors) {
            row.weight = weight * factor;
        }
        if fit.factors.iter().filter(|factor| **factor > 0.0).count() < FEWEST {
            return None;
        }
        let (eliminated, factor) = solve(&rows)?;
        let displacement = factor.solve(&eliminated.rhs);
        let before = std::mem::take(&mut fit.factors);
        fit = Fit::about(&rows, weights, &displacement, Some(eliminated.clock(0, &displacement)));
        let is_settled = fit.factors.iter().zip(&before).all(|(new, old)| (new - old).abs() < SETTLED);
        round += 1;
        if is_settled || round == ROUNDS {
            break (eliminated, factor);
        }
    };
    let taken = |row: &Row| {
        let h = eliminated.centred(row);
        row.weight * (h.dot(&factor.solve(&h)) + 1.0 / eliminated.group_weight(0))
    };
    fit.redundancies = rows.iter().map(|row| (1.0 - taken(row)).max(0.0)).collect();
    fit.residuals_m.iter().all(|residual| residual.is_finite()).then_some(fit)
}

/// Normal equations of rows with one clock, and their factor; `None` for a singular geometry.
fn solve(rows: &[Row]) -> Option<(Eliminated, Cholesky<f64, U3>)> {
    let eliminated = Eliminated::new(rows, 1);
    let factor = eliminated.factor()?;
    Some((eliminated, factor))
}

impl Fit {
    /// Residuals about a displacement and their robust factors. Without a clock it is the median.
    fn about(rows: &[Row], weights: &[f64], displacement: &Vector3<f64>, clock_m: Option<f64>) -> Self {
        let beyond: Vec<f64> = rows.iter().map(|row| row.y - row.h.dot(displacement)).collect();
        let clock_m = clock_m.unwrap_or_else(|| median(&beyond));
        let residuals_m: Vec<f64> = beyond.iter().map(|y| y - clock_m).collect();
        let standardised = residuals_m.iter().zip(weights).map(|(residual, weight)| residual * weight.sqrt());
        let standardised: Vec<f64> = standardised.collect();
        let sizes: Vec<f64> = standardised.iter().map(|value| value.abs()).collect();
        let scale = (SIGMA_PER_MEDIAN * median(&sizes)).max(1.0);
        let factors = standardised.iter().map(|value| ROBUST.factor(value / scale)).collect();
        Self { factors, residuals_m, redundancies: Vec::new(), scale }
    }
}

/// Median; 0 without values.
pub(super) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    if sorted.is_empty() {
        return 0.0;
    }
    let middle = sorted.len() / 2;
    *sorted.select_nth_unstable_by(middle, f64::total_cmp).1
}
