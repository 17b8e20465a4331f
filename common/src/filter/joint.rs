//! The joint filter: adding, predicting, updating and removing phones.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::process::Step;
use super::{FilterOptions, PhoneState, STATES_PER_PHONE};
use crate::frames::{Ecef, EcefVector, LocalFrame};
use crate::integrity::Verdict;
use crate::solve::{PointSolution, VelocitySolution};
use crate::time::GpsTime;

/// Maximum length of a prediction step, s.
const LONGEST_STEP_S: f64 = 1.0;
/// Distance after which a phone's vertical is computed again, m (0.001° of tilt).
const VERTICAL_VALID_M: f64 = 100.0;
/// Standard deviations of a new phone's velocity without Doppler (m/s) and of its acceleration (m/s²).
const NEW_VELOCITY_SIGMA_MPS: f64 = 15.0;
const NEW_ACCELERATION_SIGMA_MPS2: f64 = 1.5;
/// Added to the standard deviation of a velocity from Doppler, m/s, because one epoch may contain an outlier.
const DOPPLER_FLOOR_MPS: f64 = 0.5;

/// Number of consecutive updates with most pseudoranges rejected after which a phone is lost.
const LOST_AFTER: u32 = 5;
/// Factors on the covariances of the epoch-wise solution at initialisation, by its verdict.
const START_INFLATION: f64 = 4.0;
const UNRELIABLE_INFLATION: f64 = 100.0;

/// Gaussian distribution over the states of all present phones.
///
/// Phones are identified by the caller's numbers; [`JointFilter::slot`] gives the slot of a phone. The nine states of slot s start at 9s.
#[derive(Clone, Debug)]
pub struct JointFilter {
    pub(super) options: FilterOptions,
    time_gps: GpsTime,
    pub(super) mean: DVector<f64>,
    pub(super) covariance: DMatrix<f64>,
    slots: Vec<Slot>,
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    phone: usize,
    up: Vector3<f64>,
    up_at: Ecef,
    measured: GpsTime,
    /// Number of consecutive updates that rejected most of their pseudoranges.
    rejecting: u32,
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
        // A velocity with an uncertainty above any car's speed contains no information.
        let useful = |v: &VelocitySolution| v.covariance.diagonal().max() < NEW_VELOCITY_SIGMA_MPS.powi(2);
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
            slots: Vec::new(),
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
        let unknown = Matrix3::identity() * NEW_VELOCITY_SIGMA_MPS.powi(2);
        let velocity = start
            .velocity
            .unwrap_or(VelocitySolution { velocity: EcefVector::new(0.0, 0.0, 0.0), covariance: unknown });
        self.mean.fixed_rows_mut::<3>(n + 3).copy_from(&velocity.velocity.0);
        self.covariance.fixed_view_mut::<3, 3>(n + 3, n + 3).copy_from(&velocity.covariance);
        for axis in n + 6..n + 9 {
            self.covariance[(axis, axis)] = NEW_ACCELERATION_SIGMA_MPS2.powi(2);
        }
        let up = LocalFrame::at(start.position).up();
        self.slots.push(Slot { phone, up, up_at: start.position, measured: time_gps, rejecting: 0 });
    }

    /// Removes a phone; the others keep their joint distribution (marginalisation).
    pub fn remove(&mut self, slot: usize) {
        if slot >= self.slots.len() {
            return;
        }
        self.slots.remove(slot);
        let (at, states) = (slot * STATES_PER_PHONE, STATES_PER_PHONE);
        let mean = std::mem::replace(&mut self.mean, DVector::zeros(0));
        self.mean = mean.remove_rows(at, states);
        let covariance = std::mem::replace(&mut self.covariance, DMatrix::zeros(0, 0));
        self.covariance = covariance.remove_rows(at, states).remove_columns(at, states);
    }

    /// Removes the phones whose last measurement is longer before `time_gps` than the maximum gap. Returns their numbers and the length of
    /// their silence, s.
    pub fn drop_silent(&mut self, time_gps: GpsTime) -> Vec<(usize, f64)> {
        let limit_s = self.options.maximum_gap_s;
        let silent: Vec<(usize, f64)> = self
            .slots
            .iter()
            .map(|slot| (slot.phone, time_gps - slot.measured))
            .filter(|(_, silence_s)| *silence_s > limit_s)
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
        }
        self.time_gps = time_gps;
    }

    fn advance(&mut self, step: &Step) {
        step.advance_mean(&mut self.mean);
        step.advance_covariance(&mut self.covariance);
        // Rounding differs between columns and rows; P is exactly symmetric everywhere else.
        self.covariance.fill_upper_triangle_with_lower_triangle();
        for slot in 0..self.slots.len() {
            let up = self.vertical(slot);
            step.add_noise(&mut self.covariance, slot * STATES_PER_PHONE, &up, &self.options.process);
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
        let at = slot * STATES_PER_PHONE;
        Ecef::new(self.mean[at], self.mean[at + 1], self.mean[at + 2])
    }

    /// Records an update that kept `kept` of `offered` pseudoranges.
    pub(super) fn mark_measured(&mut self, slot: usize, kept: usize, offered: usize) {
        let slot = &mut self.slots[slot];
        slot.measured = self.time_gps;
        slot.rejecting = if 2 * kept < offered { slot.rejecting + 1 } else { 0 };
    }

    /// Whether the prediction of a phone has contradicted most of its pseudoranges for five consecutive epochs. The prediction is then
    /// wrong, and the phone should be initialised again.
    pub fn is_lost(&self, slot: usize) -> bool {
        self.slots.get(slot).is_some_and(|slot| slot.rejecting >= LOST_AFTER)
    }

    /// State of one phone.
    pub fn state(&self, slot: usize) -> Option<PhoneState> {
        if slot >= self.slots.len() {
            return None;
        }
        let at = slot * STATES_PER_PHONE;
        Some(PhoneState {
            mean: self.mean.fixed_rows::<STATES_PER_PHONE>(at).into_owned(),
            covariance: self.covariance.fixed_view::<STATES_PER_PHONE, STATES_PER_PHONE>(at, at).into_owned(),
        })
    }

    /// Standard deviation of the distance between two phones along the line between them, m.
    pub fn distance_sigma_m(&self, a: usize, b: usize) -> Option<f64> {
        if a >= self.len() || b >= self.len() {
            return None;
        }
        let line = self.position(a) - self.position(b);
        let u = line.0.try_normalize(1e-9)?;
        let (ra, rb) = (a * STATES_PER_PHONE, b * STATES_PER_PHONE);
        let block = |i: usize, j: usize| self.covariance.fixed_view::<3, 3>(i, j);
        let relative = block(ra, ra) + block(rb, rb) - block(ra, rb) - block(rb, ra);
        Some(u.dot(&(relative * u)).max(0.0).sqrt())
    }

    /// Mean and covariance, mutable for the constraints.
    pub const fn distribution_mut(&mut self) -> (&mut DVector<f64>, &mut DMatrix<f64>) {
        (&mut self.mean, &mut self.covariance)
    }

    /// Whether the mean is finite and every variance positive and finite.
    pub fn is_sound(&self) -> bool {
        self.mean.iter().all(|x| x.is_finite())
            && self.covariance.diagonal().iter().all(|v| v.is_finite() && *v > 0.0)
    }
}
