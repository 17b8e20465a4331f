//! Protection levels of the solution of one epoch.
//!
//! **Solution separation** (ARAIM baseline algorithm: Blanch et al., "Baseline advanced RAIM user algorithm and possible improvements", IEEE TAES
//! 51, 2015). Under each hypothesis k (a satellite is faulty, a constellation is faulty) the solution without the suspects has no fault. Its
//! difference from the solution of all, Δ_k, and its own uncertainty bound the error of the latter: |x̂ − x| ≤ |Δ_k| + |x̂_k − x|. The level L of an
//! axis fulfils 2Q((L − b_0)/σ_0) + Σ_k p_k Q((L − D_k − b_k)/σ_k) ≤ P, with D_k = max(T_k, |Δ_k|), the threshold T_k of the separation test,
//! and the effect b of nominal biases. Where the paper stops at a failed separation test, D_k grows instead, and the level still holds. Hypotheses of two
//! faults at once, and those that leave no solution, are not monitored; their probability is taken off P.
//!
//! **Slope** (Brown 1992): the largest ratio of horizontal or vertical error to the root of the test statistic among faults of one measurement,
//! times the root of the noncentrality that the test detects. ARP is the same with the root of the threshold.

use nalgebra::{Cholesky, Matrix3, U3, Vector3};
use serde::{Deserialize, Serialize};

use super::checks::{UNCHECKABLE, count_excluded};
use super::options::{ProtectionOptions, RaimOptions};
use crate::frames::LocalFrame;
use crate::gnss::{Constellation, SatelliteId};
use crate::measurement::CorrectedObservation;
use crate::solve::Fit;
use crate::solve::elimination::Row;
use crate::statistics::normal::{two_sided_threshold, upper_tail};

/// Halvings of the interval in which a level lies. Its upper end is taken.
const HALVINGS: usize = 4;
/// Number of standard deviations beyond which a normal variable does not count (10⁻¹⁵).
const NEVER_SIGMAS: f64 = 8.0;
/// Share of a group's weight below which nothing is left in it.
const EMPTY: f64 = 1e-9;
/// Information below this fraction of the rows' total is rounding error.
const NEGLIGIBLE: f64 = 1e-10;

/// Horizontal and vertical protection level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProtectionLevels {
    /// HPL, m.
    pub horizontal_m: f64,
    /// VPL, m.
    pub vertical_m: f64,
}

impl ProtectionLevels {
    /// The smaller of each of two levels, where there are two.
    pub(crate) fn smallest(one: Option<Self>, other: Option<Self>) -> Option<Self> {
        match (one, other) {
            (Some(one), Some(other)) => Some(one.smaller(other)),
            (one, other) => one.or(other),
        }
    }

    /// The smaller of each.
    const fn smaller(self, other: Self) -> Self {
        Self {
            horizontal_m: self.horizontal_m.min(other.horizontal_m),
            vertical_m: self.vertical_m.min(other.vertical_m),
        }
    }

    /// The levels, if both are finite.
    pub(super) fn finite(self) -> Option<Self> {
        (self.horizontal_m.is_finite() && self.vertical_m.is_finite()).then_some(self)
    }
}

/// Levels by the largest slope.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SlopeLevels {
    /// Horizontally, m.
    pub horizontal_m: f64,
    /// Vertically, m.
    pub vertical_m: f64,
    /// Approximate radial-error protected, m.
    pub arp_m: f64,
}

/// Protection levels by solution separation; `None` if the promised probability cannot be kept: too few satellites, or too many possible faults.
pub(super) fn separation_levels(
    observations: &[CorrectedObservation],
    fit: &Fit,
    options: &ProtectionOptions,
) -> Option<ProtectionLevels> {
    let rows: Vec<Row> = fit.rows().map(|(_, row)| row).collect();
    let satellites: Vec<SatelliteId> = fit.rows().map(|(i, _)| observations[i].satellite).collect();
    let left_m = |(i, _): (usize, Row)| options.ionosphere_share * observations[i].shared.ionosphere_m;
    let solver = Solver {
        rows: &rows,
        ionosphere_m: fit.rows().map(left_m).collect(),
        axes: LocalFrame::at(fit.position()).rotation_ecef_to_enu().transpose(),
        bias_m: options.nominal_bias_m,
        scale: noise_scale(fit, observations),
    };
    let all = Sums::of(&rows, fit.groups());
    let nominal = solver.solve(&all, |_| true)?;

    let priors = [options.satellite_fault, options.constellation_fault];
    let suspects = Suspect::all(&satellites);
    let total: f64 = suspects.iter().map(|suspect| priors[suspect.kind()]).sum();
    let mut unmonitored = 0.5 * total * total;
    let limit_sigmas = two_sided_threshold(options.false_alarm / (3.0 * suspects.len().max(1) as f64));
    let mut modes = Vec::with_capacity(suspects.len());
    for suspect in suspects {
        let is_kept = |i: usize| !suspect.includes(satellites[i]);
        let mut left = all.clone();
        for (_, row) in rows.iter().enumerate().filter(|(i, _)| !is_kept(*i)) {
            left.remove(row);
        }
        match solver.solve(&left, is_kept) {
            Some(solution) => modes.push(solution.as_mode(suspect.kind(), &nominal, limit_sigmas)),
            None => unmonitored += priors[suspect.kind()],
        }
    }
    let budget = options.misleading - unmonitored;
    if budget <= 0.0 {
        return None;
    }
    let level = |axis: usize, of: &Quantiles| Along { nominal: &nominal, modes: &modes, axis }.level_m(of);
    let horizontal = Quantiles::new(budget / 4.0, modes.len(), priors);
    let vertical = Quantiles::new(budget / 2.0, modes.len(), priors);
    let horizontal_m = level(0, &horizontal).hypot(level(1, &horizontal));
    let levels = ProtectionLevels { horizontal_m, vertical_m: level(2, &vertical) };
    levels.finite()
}

/// Factor on the stated standard deviations of the measurements: the ratio of the residuals to what the stochastic model expects, where it is above
/// 1, times √(1 + k) after k exclusions. Where faults had to be excluded, what passed the tests is worse than elsewhere: in a street the
/// levels without that factor bound all errors of the epochs without an exclusion, and 90 % of those with four.
fn noise_scale(fit: &Fit, observations: &[CorrectedObservation]) -> f64 {
    let dof = fit.degrees_of_freedom();
    let ratio = if dof == 0 { 1.0 } else { (fit.weighted_square_sum() / dof as f64).sqrt().max(1.0) };
    ratio * (1.0 + f64::from(count_excluded(observations))).sqrt()
}

/// What may be faulty.
#[derive(Clone, Copy)]
enum Suspect {
    Satellite(SatelliteId),
    Constellation(Constellation),
}

impl Suspect {
    /// All satellites, then all constellations.
    fn all(satellites: &[SatelliteId]) -> Vec<Self> {
        let mut distinct = satellites.to_vec();
        distinct.sort_unstable();
        distinct.dedup();
        let mut constellations: Vec<Constellation> = distinct.iter().map(|s| s.constellation).collect();
        constellations.dedup();
        let satellites = distinct.into_iter().map(Self::Satellite);
        satellites.chain(constellations.into_iter().map(Self::Constellation)).collect()
    }

    /// Place of its prior.
    const fn kind(self) -> usize {
        match self {
            Self::Satellite(_) => 0,
            Self::Constellation(_) => 1,
        }
    }

    fn includes(self, satellite: SatelliteId) -> bool {
        match self {
            Self::Satellite(suspect) => suspect == satellite,
            Self::Constellation(suspect) => suspect == satellite.constellation,
        }
    }
}

/// Sums over the rows of a clock group.
#[derive(Clone, Copy, Default)]
struct GroupSum {
    weight: f64,
    h: Vector3<f64>,
    y: f64,
    hh: Matrix3<f64>,
    hy: Vector3<f64>,
}

impl GroupSum {
    fn add(&mut self, row: &Row, sign: f64) {
        let weight = sign * row.weight;
        self.weight += weight;
        self.h += row.h * weight;
        self.y += row.y * weight;
        self.hh.ger(weight, &row.h, &row.h, 1.0);
        self.hy += row.h * (row.y * weight);
    }
}

/// Sums of all groups, from which rows can be taken away.
#[derive(Clone)]
struct Sums {
    groups: Vec<GroupSum>,
    /// Total weights of all rows by group.
    totals: Vec<f64>,
}

impl Sums {
    fn of(rows: &[Row], group_count: usize) -> Self {
        let mut groups = vec![GroupSum::default(); group_count];
        for row in rows {
            groups[row.group].add(row, 1.0);
        }
        let totals = groups.iter().map(|group| group.weight).collect();
        Self { groups, totals }
    }

    fn remove(&mut self, row: &Row) {
        self.groups[row.group].add(row, -1.0);
    }

    /// Groups that still have measurements.
    fn present(&self) -> impl Iterator<Item = &GroupSum> {
        let pairs = self.groups.iter().zip(&self.totals);
        pairs.filter(|(group, total)| group.weight > EMPTY * **total).map(|(group, _)| group)
    }

    /// Normal equations without the clocks.
    fn normal(&self) -> (Matrix3<f64>, Vector3<f64>) {
        let (mut normal, mut rhs) = (Matrix3::zeros(), Vector3::zeros());
        for group in self.present() {
            normal += group.hh;
            normal.ger(-1.0 / group.weight, &group.h, &group.h, 1.0);
            rhs += group.hy - group.h * (group.y / group.weight);
        }
        (normal, rhs)
    }

    /// Mean of the partial derivatives of a group with measurements.
    fn mean(&self, group: usize) -> Vector3<f64> {
        self.groups[group].h / self.groups[group].weight
    }
}

/// Solution of some of the rows, along the three axes east, north, up.
#[allow(clippy::struct_field_names)] // all in metres
struct Solution {
    /// Position less that of all rows, m.
    offset_m: Vector3<f64>,
    /// Standard deviation by the noise of the rows, m.
    noise_m: Vector3<f64>,
    /// The same with what is left of the ionosphere, m.
    sigma_m: Vector3<f64>,
    /// Largest effect of nominal biases, m.
    bias_m: Vector3<f64>,
}

struct Solver<'a> {
    rows: &'a [Row],
    /// Standard deviation of what is left of the ionospheric delay of each row, m. It is one error, which all rows have with one sign.
    ionosphere_m: Vec<f64>,
    /// Columns: east, north, up.
    axes: Matrix3<f64>,
    bias_m: f64,
    /// Factor on the standard deviations of the rows.
    scale: f64,
}

impl Solver<'_> {
    /// Solution of the rows in `sums`, which are those that are kept.
    fn solve(&self, sums: &Sums, is_kept: impl Fn(usize) -> bool) -> Option<Solution> {
        let (normal, rhs) = sums.normal();
        let factor = factor(&normal)?;
        let gains = factor.solve(&self.axes);
        let (bias_m, ionosphere_m) = self.common_m(sums, is_kept, &gains);
        let noise_m = self.axes.component_mul(&gains).row_sum_tr().map(f64::sqrt) * self.scale;
        let sigma_m = noise_m.zip_map(&ionosphere_m, f64::hypot);
        Some(Solution { offset_m: gains.tr_mul(&rhs), noise_m, sigma_m, bias_m })
    }

    /// Σ|s_i|·b and Σs_i·I_i along each axis, with the gain s_i of each row, nominal biases b and what is left of the ionosphere I_i.
    fn common_m(
        &self,
        sums: &Sums,
        is_kept: impl Fn(usize) -> bool,
        gains: &Matrix3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let means: Vec<Vector3<f64>> = (0..sums.groups.len()).map(|group| sums.mean(group)).collect();
        let (mut absolute, mut ionosphere_m) = (Vector3::zeros(), Vector3::zeros());
        for (i, row) in self.rows.iter().enumerate().filter(|(i, _)| is_kept(*i)) {
            let gain = gains.tr_mul(&(row.h - means[row.group])) * row.weight;
            absolute += gain.abs();
            ionosphere_m.axpy(self.ionosphere_m[i], &gain, 1.0);
        }
        (absolute * self.bias_m, ionosphere_m)
    }
}

/// Cholesky factor of normal equations; `None` for a singular geometry.
fn factor(normal: &Matrix3<f64>) -> Option<Cholesky<f64, U3>> {
    let factor = Cholesky::new(*normal)?;
    let smallest = factor.l_dirty().diagonal().min();
    (smallest * smallest > NEGLIGIBLE * normal.trace()).then_some(factor)
}

/// A hypothesis along the three axes: the error exceeds `offset_m` by more than k·`sigma_m` with probability Q(k).
struct Mode {
    kind: usize,
    offset_m: Vector3<f64>,
    sigma_m: Vector3<f64>,
}

impl Solution {
    fn as_mode(&self, kind: usize, nominal: &Self, limit_sigmas: f64) -> Mode {
        // Of nested least squares with the same weights the difference has the difference of the variances.
        let separation =
            self.noise_m.zip_map(&nominal.noise_m, |own, all| (own * own - all * all).max(0.0).sqrt());
        let threshold_m = separation * limit_sigmas;
        let difference_m = (self.offset_m - nominal.offset_m).abs();
        Mode { kind, offset_m: threshold_m.sup(&difference_m) + self.bias_m, sigma_m: self.sigma_m }
    }
}

/// Numbers of standard deviations, fault-free and by kind of hypothesis, at which one hypothesis alone has some probability.
struct Sigmas {
    fault_free: f64,
    faulty: [f64; 2],
}

/// Numbers of standard deviations for a probability.
struct Quantiles {
    probability: f64,
    priors: [f64; 2],
    /// Each hypothesis with the whole probability.
    alone: Sigmas,
    /// Each with an equal share of it.
    shared: Sigmas,
}

impl Quantiles {
    fn new(probability: f64, modes: usize, priors: [f64; 2]) -> Self {
        // Q(k) = P/p is a two-sided 2P/p. A hypothesis that is less likely than P needs no level.
        let of = |probability: f64| Sigmas {
            fault_free: two_sided_threshold(probability),
            faulty: priors.map(|prior: f64| two_sided_threshold((2.0 * probability / prior).min(1.0))),
        };
        Self { probability, priors, alone: of(probability), shared: of(probability / (modes + 1) as f64) }
    }
}

/// One axis of the hypotheses.
struct Along<'a> {
    nominal: &'a Solution,
    modes: &'a [Mode],
    axis: usize,
}

impl Along<'_> {
    /// Smallest level that the error exceeds at most with the probability, rounded up a little.
    fn level_m(&self, quantiles: &Quantiles) -> f64 {
        let (mut low, mut high) = (self.largest_m(&quantiles.alone), self.largest_m(&quantiles.shared));
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if self.exceeded(middle, &quantiles.priors) > quantiles.probability {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }

    /// Largest level of the hypotheses one by one.
    fn largest_m(&self, sigmas: &Sigmas) -> f64 {
        let (axis, nominal) = (self.axis, self.nominal);
        let of_mode = |mode: &Mode| {
            let sigmas = sigmas.faulty[mode.kind];
            if sigmas > 0.0 { mode.offset_m[axis] + sigmas * mode.sigma_m[axis] } else { 0.0 }
        };
        let fault_free = nominal.bias_m[axis] + sigmas.fault_free * nominal.sigma_m[axis];
        self.modes.iter().map(of_mode).fold(fault_free, f64::max)
    }

    /// Probability that the error exceeds a level.
    fn exceeded(&self, level_m: f64, priors: &[f64; 2]) -> f64 {
        let (axis, nominal) = (self.axis, self.nominal);
        let of_mode = |mode: &Mode| {
            let sigmas = (level_m - mode.offset_m[axis]) / mode.sigma_m[axis];
            if sigmas > NEVER_SIGMAS { 0.0 } else { priors[mode.kind] * upper_tail(sigmas) }
        };
        let fault_free = 2.0 * upper_tail((level_m - nominal.bias_m[axis]) / nominal.sigma_m[axis]);
        fault_free + self.modes.iter().map(of_mode).sum::<f64>()
    }
}

/// Levels by the largest slope; `None` without redundancy, or if the error of a measurement does not show at all.
pub(super) fn slope_levels(fit: &Fit, options: &RaimOptions) -> Option<SlopeLevels> {
    let dof = fit.degrees_of_freedom();
    if dof == 0 {
        return None;
    }
    let frame = LocalFrame::at(fit.position());
    let (mut horizontal, mut vertical) = (0.0_f64, 0.0_f64);
    for i in 0..fit.len() {
        let (weight, variance) = (fit.weight(i), fit.residual_covariance(i, i));
        if variance * weight <= UNCHECKABLE {
            return None;
        }
        // An error b moves the position by K_i·b and the root of the noncentrality by w·√(C_v)_ii·b.
        let moved = frame.vector_ecef_to_enu(fit.effect_of(i));
        let seen = weight * variance.sqrt();
        horizontal = horizontal.max(moved.horizontal() / seen);
        vertical = vertical.max(moved.up.abs() / seen);
    }
    let detected = options.protection.detectable.value(dof).sqrt();
    let levels = SlopeLevels {
        horizontal_m: horizontal * detected,
        vertical_m: vertical * detected,
        arp_m: horizontal * options.global.threshold(dof).sqrt(),
    };
    (levels.horizontal_m.is_finite() && levels.vertical_m.is_finite()).then_some(levels)
}
