//! The joint filter: adding, predicting, updating and removing phones.

use std::collections::BTreeMap;

use nalgebra::{Cholesky, DMatrix, DVector, Matrix3, SMatrix, Vector3};

use super::consider::Consider;
use super::noise_level::NoiseLevel;
use super::process::Step;
use super::slots::{Interval, Slot};
use super::standing::Standing;
use super::{FilterOptions, PhoneState, STATES_PER_PHONE};
use crate::frames::{Ecef, EcefVector, LocalFrame};
use crate::gnss::ClockGroup;
use crate::integrity::Verdict;
use crate::solve::{PointSolution, VelocitySolution};
use crate::time::GpsTime;

/// Maximum length of a prediction step, s.
const LONGEST_STEP_S: f64 = 1.0;
/// Distance after which a phone's vertical is computed again, m (0.001° of tilt).
const VERTICAL_VALID_M: f64 = 100.0;
/// Standard deviation of a new phone's acceleration, m/s².
const NEW_ACCELERATION_SIGMA_MPS2: f64 = 1.5;
/// Standard deviation of a velocity from Doppler above which it is not used, m/s.
const USELESS_VELOCITY_MPS: f64 = 15.0;
/// Added to the standard deviation of a velocity from Doppler, m/s, because one epoch may contain an outlier.
const DOPPLER_FLOOR_MPS: f64 = 0.5;

/// Number of a phone's intervals without a measurement after which it is initialised anew.
const GAP_INTERVALS: f64 = 3.5;
/// Number of consecutive updates with most pseudoranges or most range rates rejected after which a phone is lost.
const LOST_AFTER: u32 = 5;
/// Distance of a reliable solution of the epoch beyond which a prediction is wrong, m and in standard deviations.
const FAR_M: f64 = 150.0;
const FAR_SIGMAS: f64 = 6.0;
/// Factors on the covariances of the epoch-wise solution at initialisation, by its verdict.
const START_INFLATION: f64 = 4.0;
const UNRELIABLE_INFLATION: f64 = 100.0;

/// Gaussian distribution over the states of all present phones.
///
/// Phones are identified by the caller's numbers; [`JointFilter::slot`] gives the slot of a phone. The states of a phone are consecutive:
/// nine kinematic ones, and the biases of its clock groups.
#[derive(Clone, Debug)]
pub struct JointFilter {
    pub(super) options: FilterOptions,
    time_gps: GpsTime,
    pub(super) mean: DVector<f64>,
    pub(super) covariance: DMatrix<f64>,
    pub(super) consider: Option<Consider>,
    pub(super) slots: Vec<Slot>,
    /// Intervals of the phones, by their number; they outlive the phones' states.
    intervals: BTreeMap<usize, Interval>,
}

/// Numbers of measurements of one kind in an update.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Kept {
    /// Measurements with a weight above zero.
    pub kept: usize,
    /// All measurements.
    pub offered: usize,
}

/// Initial state of a new phone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Position, m.
    pub position: Ecef,
    /// Covariance of the position, m².
    pub position_covariance: Matrix3<f64>,
    /// Velocity, if measured.
    pub velocity: Option<VelocitySolution>,
}

impl Start {
    /// Initial state from an epoch-wise solution, with inflated covariances, because one epoch may contain an outlier; more for a solution
    /// that RAIM does not call reliable.
    pub fn at_solution(solution: &PointSolution, verdict: Verdict) -> Self {
        let inflation = if verdict == Verdict::Reliable { START_INFLATION } else { UNRELIABLE_INFLATION };
        let floor = Matrix3::identity() * DOPPLER_FLOOR_MPS.powi(2);
        let widened =
            |v: VelocitySolution| VelocitySolution { covariance: v.covariance * inflation + floor, ..v };
        // A velocity with an uncertainty above that of an unknown one contains no information.
        let useful = |v: &VelocitySolution| v.covariance.diagonal().max() < USELESS_VELOCITY_MPS.powi(2);
        Self {
            position: solution.position,
            position_covariance: solution.position_covariance * inflation,
            velocity: solution.velocity.map(widened).filter(useful),
        }
    }
}

impl JointFilter {
    /// A filter without phones.
    pub fn new(options: FilterOptions) -> Self {
        Self {
            options,
            time_gps: GpsTime::default(),
            mean: DVector::zeros(0),
            covariance: DMatrix::zeros(0, 0),
            consider: (!options.shared.are_none()).then(|| Consider::new(options.shared)),
            slots: Vec::new(),
            intervals: BTreeMap::new(),
        }
    }

    /// Time of the state, GPS time.
    pub const fn time_gps(&self) -> GpsTime {
        self.time_gps
    }

    /// Number of phones present.
    pub const fn len(&self) -> usize {
        self.slots.len()
    }

    /// Whether no phone is present.
    pub const fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Slot of a phone, if it is present.
    pub fn slot(&self, phone: usize) -> Option<usize> {
        self.slots.iter().position(|slot| slot.phone == phone)
    }

    /// Adds a phone, independent of the others, at the filter's time (at `time_gps` if it is the first).
    pub fn insert(&mut self, phone: usize, time_gps: GpsTime, start: &Start) {
        if self.is_empty() {
            self.time_gps = time_gps;
        }
        if let Some(slot) = self.slot(phone) {
            self.remove(slot);
        }
        let n = self.mean.len();
        let states = STATES_PER_PHONE;
        self.mean.resize_vertically_mut(n + states, 0.0);
        self.covariance.resize_mut(n + states, n + states, 0.0);
        self.mean.fixed_rows_mut::<3>(n).copy_from(&start.position.0);
        self.covariance.fixed_view_mut::<3, 3>(n, n).copy_from(&start.position_covariance);
        let unknown = Matrix3::identity() * self.options.start_speed_mps.powi(2);
        let velocity = start
            .velocity
            .unwrap_or(VelocitySolution { velocity: EcefVector::new(0.0, 0.0, 0.0), covariance: unknown });
        self.mean.fixed_rows_mut::<3>(n + 3).copy_from(&velocity.velocity.0);
        self.covariance.fixed_view_mut::<3, 3>(n + 3, n + 3).copy_from(&velocity.covariance);
        for axis in n + 6..n + 9 {
            self.covariance[(axis, axis)] = NEW_ACCELERATION_SIGMA_MPS2.powi(2);
        }
        if let Some(consider) = &mut self.consider {
            consider.insert(n, &self.covariance);
        }
        let up = LocalFrame::at(start.position).up();
        self.slots.push(Slot {
            phone,
            at: n,
            up,
            up_at: start.position,
            measured: time_gps,
            reference: None,
            biases: Vec::new(),
            kept: None,
            is_tied: false,
            codes_rejected: 0,
            rates_rejected: 0,
            far: 0,
            noise_level: NoiseLevel::default(),
            standing: Standing::default(),
        });
        self.intervals.entry(phone).or_default().take(time_gps);
    }

    /// Removes a phone; the others keep their joint distribution (marginalisation).
    pub fn remove(&mut self, slot: usize) {
        if slot >= self.slots.len() {
            return;
        }
        let (at, states) = (self.slots[slot].at, self.slots[slot].len());
        self.slots.remove(slot);
        self.remove_states(at, states);
    }

    /// Removes states from the joint distribution (marginalisation); those of later phones move up.
    pub(super) fn remove_states(&mut self, at: usize, states: usize) {
        for later in self.slots.iter_mut().filter(|slot| slot.at > at) {
            later.at -= states;
        }
        let mean = std::mem::replace(&mut self.mean, DVector::zeros(0));
        self.mean = mean.remove_rows(at, states);
        let covariance = std::mem::replace(&mut self.covariance, DMatrix::zeros(0, 0));
        self.covariance = covariance.remove_rows(at, states).remove_columns(at, states);
        if let Some(consider) = &mut self.consider {
            consider.remove(at, states);
        }
    }

    /// Removes the phones whose last measurement is longer before `time_gps` than the maximum gap, or than 3.5 of their own intervals if
    /// these are longer. Returns their numbers and the length of
    /// their silence, s.
    pub fn drop_silent(&mut self, time_gps: GpsTime) -> Vec<(usize, f64)> {
        let limit_s = |phone| {
            let interval_s = self.intervals.get(&phone).and_then(Interval::seconds).unwrap_or_default();
            self.options.maximum_gap_s.max(GAP_INTERVALS * interval_s)
        };
        let silent: Vec<(usize, f64)> = self
            .slots
            .iter()
            .map(|slot| (slot.phone, time_gps - slot.measured))
            .filter(|(phone, silence_s)| *silence_s > limit_s(*phone))
            .collect();
        for (phone, _) in &silent {
            if let Some(slot) = self.slot(*phone) {
                self.remove(slot);
            }
        }
        silent
    }

    /// Predicts all phones to `time_gps`; a time at or before the filter's has no effect. [`JointFilter::drop_silent`] must be called
    /// before, to bound the length of the prediction.
    pub fn predict(&mut self, time_gps: GpsTime) {
        let total_s = time_gps - self.time_gps;
        if total_s <= 0.0 || self.is_empty() {
            return;
        }
        let steps = (total_s / LONGEST_STEP_S).ceil().max(1.0);
        let step = Step::new(total_s / steps, &self.options.process);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // a small number, after `drop_silent`
        for _ in 0..steps as u64 {
            self.advance(&step);
            if let Some(consider) = &mut self.consider {
                consider.age(total_s / steps);
            }
        }
        self.time_gps = time_gps;
    }

    fn advance(&mut self, step: &Step) {
        let at: Vec<usize> = self.slots.iter().map(|slot| slot.at).collect();
        step.advance_mean(&mut self.mean, &at);
        step.advance_covariance(&mut self.covariance, &at);
        // Rounding differs between columns and rows; P is exactly symmetric everywhere else.
        self.covariance.fill_upper_triangle_with_lower_triangle();
        if let Some(consider) = &mut self.consider {
            step.advance_covariance(&mut consider.covariance, &at);
            consider.covariance.fill_upper_triangle_with_lower_triangle();
            step.advance_columns(&mut consider.cross, &at);
        }
        for slot in 0..self.slots.len() {
            let up = self.vertical(slot);
            let (at, biases) =
                (self.slots[slot].at, self.slots[slot].first_bias()..self.slots[slot].behind_biases());
            // A bias that is free at every epoch is opened again by the update.
            let walk_m2ps = Some(self.options.bias_walk_m2ps).filter(|walk| walk.is_finite());
            let walk_m2 = walk_m2ps.unwrap_or_default() * step.seconds();
            let second = self.consider.as_mut().map(|consider| &mut consider.covariance);
            for covariance in std::iter::once(&mut self.covariance).chain(second) {
                step.add_noise(covariance, at, &up, &self.options.process);
                for bias in biases.clone() {
                    covariance[(bias, bias)] += walk_m2;
                }
            }
        }
    }

    fn vertical(&mut self, slot: usize) -> Vector3<f64> {
        let position = self.position(slot);
        let known = &mut self.slots[slot];
        if known.up_at.distance_m(position) > VERTICAL_VALID_M {
            known.up = LocalFrame::at(position).up();
            known.up_at = position;
        }
        known.up
    }

    pub(super) fn position(&self, slot: usize) -> Ecef {
        self.position_at(self.slots[slot].at)
    }

    /// Position in three consecutive states.
    pub(super) fn position_at(&self, at: usize) -> Ecef {
        Ecef::new(self.mean[at], self.mean[at + 1], self.mean[at + 2])
    }

    /// Records an update of a phone: how many of its pseudoranges and range rates were kept.
    pub(super) fn mark_measured(&mut self, slot: usize, codes: Kept, rates: Kept) {
        let (time_gps, slot) = (self.time_gps, &mut self.slots[slot]);
        self.intervals.entry(slot.phone).or_default().take(time_gps);
        slot.measured = time_gps;
        let count = |before: u32, kept: Kept| if 2 * kept.kept < kept.offered { before + 1 } else { 0 };
        slot.codes_rejected = count(slot.codes_rejected, codes);
        slot.rates_rejected = count(slot.rates_rejected, rates);
    }

    /// Compares a phone's predicted position with the epoch's own solution, if RAIM calls it reliable.
    pub fn compare(&mut self, slot: usize, solution: &PointSolution, verdict: Verdict) {
        if verdict != Verdict::Reliable || slot >= self.slots.len() {
            return;
        }
        let at = self.slots[slot].at;
        let difference = solution.position - self.position(slot);
        let expected = self.stated().fixed_view::<3, 3>(at, at) + solution.position_covariance;
        let normalised =
            Cholesky::new(expected).map_or(0.0, |factor| difference.0.dot(&factor.solve(&difference.0)));
        let is_far = difference.norm() > FAR_M && normalised > FAR_SIGMAS * FAR_SIGMAS;
        let slot = &mut self.slots[slot];
        slot.far = if is_far { slot.far + 1 } else { 0 };
    }

    /// Whether the prediction of a phone has, for five consecutive epochs, contradicted most of its pseudoranges, most of its range rates, or
    /// the reliable solution of the epoch (see [`JointFilter::compare`]). The prediction is then wrong, and the phone should be initialised
    /// again.
    pub fn is_lost(&self, slot: usize) -> bool {
        let worst = |slot: &Slot| slot.codes_rejected.max(slot.rates_rejected).max(slot.far);
        self.slots.get(slot).is_some_and(|slot| worst(slot) >= LOST_AFTER)
    }

    /// Time since the last measurement of a phone, s; `None` at its start.
    pub(super) fn silence_s(&self, slot: usize) -> f64 {
        self.slots.get(slot).map_or(0.0, |slot| self.time_gps - slot.measured)
    }

    /// Adds a state with this value and variance at the end of a phone's.
    pub(super) fn insert_bias(&mut self, slot: usize, group: ClockGroup, value_m: f64, variance_m2: f64) {
        let index = self.slots[slot].behind_biases();
        self.slots[slot].biases.push(group);
        for later in self.slots.iter_mut().skip(slot + 1) {
            later.at += 1;
        }
        let mean = std::mem::replace(&mut self.mean, DVector::zeros(0));
        self.mean = mean.insert_row(index, value_m);
        let widened = |matrix: &mut DMatrix<f64>| {
            let given = std::mem::replace(matrix, DMatrix::zeros(0, 0));
            *matrix = given.insert_row(index, 0.0).insert_column(index, 0.0);
            matrix[(index, index)] = variance_m2;
        };
        widened(&mut self.covariance);
        if let Some(consider) = &mut self.consider {
            widened(&mut consider.covariance);
            consider.insert_row(index);
        }
    }

    /// Makes a state independent of all others, with this value and variance.
    pub(super) fn reopen(&mut self, index: usize, value_m: f64, variance_m2: f64) {
        self.mean[index] = value_m;
        let reopened = |matrix: &mut DMatrix<f64>| {
            matrix.row_mut(index).fill(0.0);
            matrix.column_mut(index).fill(0.0);
            matrix[(index, index)] = variance_m2;
        };
        reopened(&mut self.covariance);
        if let Some(consider) = &mut self.consider {
            reopened(&mut consider.covariance);
            consider.cross.row_mut(index).fill(0.0);
        }
    }

    /// State of one phone.
    pub fn state(&self, slot: usize) -> Option<PhoneState> {
        let at = self.slots.get(slot)?.at;
        Some(PhoneState {
            mean: self.mean.fixed_rows::<STATES_PER_PHONE>(at).into_owned(),
            covariance: self.stated().fixed_view::<STATES_PER_PHONE, STATES_PER_PHONE>(at, at).into_owned(),
        })
    }

    /// Covariance of the kinematic states of one phone that decides the gains.
    pub(crate) fn gain_covariance(
        &self,
        slot: usize,
    ) -> Option<SMatrix<f64, STATES_PER_PHONE, STATES_PER_PHONE>> {
        let at = self.slots.get(slot)?.at;
        Some(self.covariance.fixed_view::<STATES_PER_PHONE, STATES_PER_PHONE>(at, at).into_owned())
    }

    /// The covariance that is stated: the second one, if there are shared errors.
    pub(super) fn stated(&self) -> &DMatrix<f64> {
        self.consider.as_ref().map_or(&self.covariance, |consider| &consider.covariance)
    }

    /// Numbers of the phones, by slot.
    pub fn phones(&self) -> impl Iterator<Item = usize> + '_ {
        self.slots.iter().map(|slot| slot.phone)
    }

    /// Displacements of a phone's position, ECEF, by the largest lasting fault of each satellite that the filter's robust weights let pass.
    /// `None` without robust weights or without shared errors: then nothing bounds them.
    pub fn faults(&self, slot: usize) -> Option<Vec<Vector3<f64>>> {
        let at = self.slots.get(slot)?.at;
        let consider = self.consider.as_ref().filter(|_| self.options.robust.keep.is_finite())?;
        Some(consider.faults(at).collect())
    }

    /// Covariance of the first phone's errors with those of another filter's first phone, through the errors that they share.
    /// The first N states of each.
    pub(crate) fn shared_with<const N: usize>(&self, other: &Self) -> SMatrix<f64, N, N> {
        let both = self.consider.as_ref().zip(other.consider.as_ref());
        both.map_or_else(SMatrix::zeros, |(mine, theirs)| mine.between(0, theirs, 0))
    }

    /// Removes all phones.
    pub fn clear(&mut self) {
        *self = Self::new(self.options);
    }

    /// Mean and covariance of the kinematic states of all phones, nine each, by slot.
    pub fn kinematic(&self) -> (DVector<f64>, DMatrix<f64>) {
        let states = self.kinematic_states();
        let covariance = self.covariance.select_rows(&states).select_columns(&states);
        (self.mean.select_rows(&states), covariance)
    }

    /// Goes on with another distribution of the kinematic states; the other states follow by their covariance with them.
    ///
    /// With the regression A = P_xk P_kk⁻¹ of all states x on the kinematic ones k: x̂ ← x̂ + A(k̂' − k̂), P ← P + A(P'_kk − P_kk)Aᵀ. A
    /// covariance that cannot be factorised leaves everything as it is.
    pub fn go_on_with(&mut self, mean: &DVector<f64>, covariance: &DMatrix<f64>) {
        let states = self.kinematic_states();
        let (known_mean, known) = self.kinematic();
        let Some(factor) = Cholesky::new(known.clone()) else { return };
        let regression = factor.solve(&self.covariance.select_rows(&states)).transpose();
        self.mean += &regression * (mean - known_mean);
        self.covariance += &regression * (covariance - known) * regression.transpose();
        // What was computed exactly stays exact, and the rest symmetric.
        for (i, row) in states.iter().enumerate() {
            self.mean[*row] = mean[i];
            for (j, column) in states.iter().enumerate() {
                self.covariance[(*row, *column)] = covariance[(i, j)];
            }
        }
        self.covariance.fill_upper_triangle_with_lower_triangle();
    }

    fn kinematic_states(&self) -> Vec<usize> {
        self.slots.iter().flat_map(|slot| slot.at..slot.at + STATES_PER_PHONE).collect()
    }

    /// Whether the mean is finite and every variance positive and finite.
    pub fn is_sound(&self) -> bool {
        self.mean.iter().all(|x| x.is_finite())
            && self.covariance.diagonal().iter().all(|v| v.is_finite() && *v > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrity::Cause;
    use crate::measurement::CorrectedObservation;
    use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};
    use crate::solve::{solve_position, solve_velocity};

    const UNRELIABLE: Verdict = Verdict::Unreliable(Cause::TestsFailed);

    fn solution(observations: &[CorrectedObservation]) -> PointSolution {
        let fit = solve_position(observations, Receiver::in_wuhan().position).unwrap();
        fit.to_solution(solve_velocity(observations, fit.position())).unwrap()
    }

    fn at(second: f64) -> GpsTime {
        GpsTime::from_week_tow(2118, second)
    }

    /// A filter with one phone that was started at 0 s by its own solution.
    fn started() -> (JointFilter, Vec<CorrectedObservation>, PointSolution) {
        let observations = Receiver::in_wuhan().observe(&OPEN_SKY_DEG);
        let solution = solution(&observations);
        let mut filter = JointFilter::new(FilterOptions::default());
        filter.insert(0, at(0.0), &Start::at_solution(&solution, Verdict::Reliable));
        (filter, observations, solution)
    }

    fn sigmas(covariance: &Matrix3<f64>) -> Vector3<f64> {
        covariance.diagonal().map(f64::sqrt)
    }

    /// One epoch may contain an outlier that RAIM has not found.
    #[test]
    fn a_start_is_less_certain_than_its_solution() {
        let solution = solution(&Receiver::in_wuhan().observe(&OPEN_SKY_DEG));
        let ratios = |verdict| {
            let start = Start::at_solution(&solution, verdict);
            sigmas(&start.position_covariance).component_div(&sigmas(&solution.position_covariance))
        };
        assert!(ratios(Verdict::Reliable).iter().all(|ratio| (1.5..3.0).contains(ratio)));
        assert!(ratios(UNRELIABLE).iter().all(|ratio| (5.0..20.0).contains(ratio)));
        let doppler = |verdict| sigmas(&Start::at_solution(&solution, verdict).velocity.unwrap().covariance);
        let stated_mps = sigmas(&solution.velocity.unwrap().covariance);
        assert!(stated_mps.max() < 0.2, "{stated_mps} m/s");
        assert!(doppler(Verdict::Reliable).min() > 0.4, "{} m/s", doppler(Verdict::Reliable));
    }

    #[test]
    fn a_phone_may_be_silent_for_ten_seconds_or_for_three_of_its_own_intervals() {
        for (interval_s, kept_s, dropped_s) in [(1.0, 9.0, 11.0), (30.0, 90.0, 110.0)] {
            let (mut filter, observations, _) = started();
            for epoch in 1..=4 {
                filter.predict(at(interval_s * f64::from(epoch)));
                filter.update(0, &observations);
            }
            let last_s = 4.0 * interval_s;
            assert!(filter.drop_silent(at(last_s + kept_s)).is_empty(), "{interval_s} s");
            assert_eq!(filter.drop_silent(at(last_s + dropped_s)), [(0, dropped_s)], "{interval_s} s");
        }
    }

    /// Two thirds of the range rates are wrong, each by another amount, so that they agree on no manoeuvre. The pseudoranges are right.
    #[test]
    fn a_prediction_that_contradicts_its_range_rates_is_lost() {
        let (mut filter, observations, _) = started();
        let mut wrong = observations.clone();
        for (index, observation) in wrong.iter_mut().enumerate().filter(|(index, _)| index % 3 > 0) {
            let sign = [1.0, -1.0][index % 2];
            observation.range_rate.as_mut().unwrap().range_rate_mps += sign * 20.0 * (1.0 + index as f64);
        }
        for epoch in 1..=5 {
            assert!(!filter.is_lost(0), "epoch {epoch}");
            filter.predict(at(0.01 * f64::from(epoch)));
            let report = filter.update(0, &wrong);
            assert!(2 * report.rates.kept < report.rates.offered, "{report:?}");
            assert!(2 * report.codes.kept > report.codes.offered, "{report:?}");
        }
        assert!(filter.is_lost(0));
        filter.predict(at(0.06));
        filter.update(0, &observations);
        assert!(!filter.is_lost(0), "range rates that agree again end it");
    }

    #[test]
    fn a_prediction_far_from_five_reliable_solutions_in_succession_is_lost() {
        let (mut filter, _, near) = started();
        let far =
            PointSolution { position: near.position + EcefVector::new(200.0, 0.0, 0.0), ..near.clone() };
        for solution in [&far, &far, &far, &far, &near, &far, &far, &far, &far] {
            filter.compare(0, solution, Verdict::Reliable);
            assert!(!filter.is_lost(0));
        }
        filter.compare(0, &far, UNRELIABLE);
        assert!(!filter.is_lost(0), "a solution that is not reliable says nothing");
        filter.compare(0, &far, Verdict::Reliable);
        assert!(filter.is_lost(0));
    }
}
