//! What kind of error an isolated phone has.
//!
//! Its epoch-wise solutions of position and velocity over the last seconds are compared with the filters of its companions, the phones that are bound to be near
//! it. Its own filter would not do: robust weights hold it back for many seconds, and a position that is moved shows in its velocity. Each kind says what position and velocity are from some
//! instant on; before it the phone agrees. The kind and instant that fit best count, unless another kind fits nearly as well. Everything is
//! horizontal.
//!
//! | kind | position relative to the companions | velocity |
//! |:--|:--|:--|
//! | wrong place | constant | theirs |
//! | drifting | grows steadily | theirs |
//! | wrong clock | along their velocity, proportional to it | theirs some time ago, or later |
//! | frozen | its own position is constant while they move | any |
//! | left behind | changes as the difference of the velocities says | not theirs |

use std::collections::VecDeque;

use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::plane_at;
use crate::constraint::FreePhone;
use crate::frames::{Ecef, EcefVector};
use crate::time::GpsTime;
use crate::wire::EpochMessage;

/// Length of the history, s.
const HISTORY_S: f64 = 45.0;
/// Minimum time between its moments, s.
const INTERVAL_S: f64 = 0.5;
/// Minimum standard deviation of an epoch-wise position, m.
const LEAST_SIGMA_M: f64 = 2.0;
/// Minimum number of moments from the begin of the error on.
const FEWEST: usize = 4;
/// Standard deviation of the difference of two velocities, m/s, beside that of the own Doppler.
const VELOCITY_SIGMA_MPS: f64 = 0.3;
/// Share of a position's misfit that counts, because errors of successive solutions are alike.
const POSITION_SHARE: f64 = 0.5;
/// Largest misfit of one value, in squared standard deviations.
const LARGEST_MISFIT: f64 = 12.0;
/// Misfit of a velocity of which a kind says nothing.
const FREE_VELOCITY: f64 = 1.0;
/// Misfit by which the kind must be better than any other.
const ADVANTAGE: f64 = 3.0;
/// Further misfit of a frozen position, so that a phone that stands by its own velocity too is left behind.
const FROZEN: f64 = 6.0;
/// Errors of a clock that are looked for, in steps of [`LAG_STEP_S`].
const LAG_STEPS: std::ops::RangeInclusive<i32> = 3..=30;
const LAG_STEP_S: f64 = 0.1;
/// Maximum rate of a drift, m/s: one to be followed is slow.
const FASTEST_DRIFT_MPS: f64 = 5.0;
/// Minimum way of the companions by which a position is seen to be frozen, m.
const LEAST_WAY_M: f64 = 20.0;
/// Minimum mean difference of velocities of a phone that moves otherwise, in standard deviations.
const LEAST_APART_SIGMAS: f64 = 1.5;
/// Share of its way from the companions that its velocity may leave unexplained: one that jumps does not move there.
const LARGEST_UNEXPLAINED: f64 = 0.5;

/// Kind of error of an isolated phone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ErrorKind {
    /// Its position is displaced by a constant vector.
    WrongPlace,
    /// Its position moves away steadily, which its velocity does not show.
    Drifting,
    /// Its position does not move while the others do, which its velocity does not show, or after a jump.
    Frozen,
    /// Its epochs belong to another second.
    WrongClock,
    /// It moves otherwise than the others, as its velocity shows: it stayed behind, or is in another vehicle.
    LeftBehind,
    /// None of these, or several.
    #[default]
    Unknown,
}

impl ErrorKind {
    /// In words, as the end of a sentence.
    pub const fn in_words(self) -> &'static str {
        match self {
            Self::WrongPlace => "its position is displaced by a constant vector (wrong-place)",
            Self::Drifting => "its position drifts away steadily (drifting)",
            Self::Frozen => "its position does not move while the others do (frozen)",
            Self::WrongClock => "its epochs belong to another second (wrong-clock)",
            Self::LeftBehind => "it stays behind or moves otherwise than the others (left-behind)",
            Self::Unknown => "the kind of its error is unknown",
        }
    }
}

/// A phone at an epoch of the group.
#[derive(Clone, Copy, Debug)]
pub(in crate::fusion) struct Seen {
    /// Position and velocity of its filter, which no constraint touches.
    pub(super) position: Ecef,
    velocity: EcefVector,
    /// Epoch-wise position at the epoch's time, and the standard deviation of a component, m.
    pub(super) solution: Option<(Ecef, f64)>,
    /// Velocity by the epoch's Doppler, or else that of the filter, and the standard deviation of a component, m/s.
    own_velocity: (EcefVector, f64),
}

impl Seen {
    /// A phone with its filter and the message of this epoch.
    pub fn new(filter: &FreePhone, message: Option<&EpochMessage>, time_gps: GpsTime) -> Self {
        let vector = |from: usize| filter.mean.fixed_rows::<3>(from).into_owned();
        let (position, velocity) = (Ecef(vector(0)), EcefVector(vector(3)));
        let solution = message.and_then(|message| {
            let solution = message.wls.as_ref()?;
            let carried = EcefVector(velocity.0 * (time_gps - message.time_gps));
            let sigma_m = (solution.position_covariance.trace() / 3.0).sqrt().max(LEAST_SIGMA_M);
            Some((solution.position + carried, sigma_m))
        });
        let doppler = message.and_then(|message| message.wls.as_ref()?.velocity.as_ref());
        let own_velocity = doppler.map_or((velocity, 0.0), |solution| {
            (solution.velocity, (solution.covariance.trace() / 3.0).sqrt())
        });
        Self { position, velocity, solution, own_velocity }
    }

    pub fn speed_mps(&self) -> f64 {
        self.velocity.0.norm()
    }
}

/// The last moments of a phone.
#[derive(Clone, Debug, Default)]
pub(super) struct History(VecDeque<Moment>);

/// A phone and the mean of its companions at an epoch.
#[derive(Clone, Copy, Debug)]
struct Moment {
    time_gps: GpsTime,
    /// Epoch-wise position.
    own: Ecef,
    sigma_m: f64,
    velocity: EcefVector,
    velocity_sigma_mps: f64,
    others: Ecef,
    others_velocity: EcefVector,
}

impl History {
    /// Takes a phone and its companions, if the phone has a solution and the last moment is long enough ago.
    pub fn take(&mut self, time_gps: GpsTime, phone: &Seen, companions: &[Seen]) {
        let age_s = |earlier: &Moment| time_gps - earlier.time_gps;
        self.0.retain(|moment| (0.0..=HISTORY_S).contains(&age_s(moment)));
        let is_due = self.0.back().is_none_or(|last| age_s(last) >= INTERVAL_S);
        let Some((own, sigma_m)) = phone.solution.filter(|_| is_due && !companions.is_empty()) else {
            return;
        };
        let count = companions.len() as f64;
        let sum = |of: fn(&Seen) -> Vector3<f64>| companions.iter().map(of).sum::<Vector3<f64>>() / count;
        self.0.push_back(Moment {
            time_gps,
            own,
            sigma_m,
            velocity: phone.own_velocity.0,
            velocity_sigma_mps: VELOCITY_SIGMA_MPS.hypot(phone.own_velocity.1),
            others: Ecef(sum(|seen| seen.position.0)),
            others_velocity: EcefVector(sum(|seen| seen.velocity.0)),
        });
    }

    /// The kind of error that the phone has at the last moment.
    pub fn kind(&self) -> ErrorKind {
        let Some(first) = self.0.front() else { return ErrorKind::Unknown };
        let plane = plane_at(first.others);
        let step = |moment: &Moment| Step {
            time_s: moment.time_gps - first.time_gps,
            own_m: plane * (moment.own - first.others).0,
            sigma_m: moment.sigma_m,
            own_mps: plane * moment.velocity.0,
            velocity_sigma_mps: moment.velocity_sigma_mps,
            others_m: plane * (moment.others - first.others).0,
            others_mps: plane * moment.others_velocity.0,
        };
        Track(self.0.iter().map(step).collect()).kind()
    }
}

/// A moment in the horizontal plane.
#[derive(Clone, Copy, Debug)]
struct Step {
    time_s: f64,
    own_m: Vector2<f64>,
    sigma_m: f64,
    own_mps: Vector2<f64>,
    velocity_sigma_mps: f64,
    others_m: Vector2<f64>,
    others_mps: Vector2<f64>,
}

impl Step {
    fn offset_m(&self) -> Vector2<f64> {
        self.own_m - self.others_m
    }

    fn difference_mps(&self) -> Vector2<f64> {
        self.own_mps - self.others_mps
    }

    /// Misfit of a position with this offset from the companions.
    fn position_misfit(&self, offset_m: Vector2<f64>) -> f64 {
        let squared = (self.offset_m() - offset_m).norm_squared() / self.sigma_m.powi(2);
        POSITION_SHARE * squared.min(LARGEST_MISFIT)
    }

    fn velocity_misfit(&self, velocity_mps: Vector2<f64>) -> f64 {
        let squared = (self.own_mps - velocity_mps).norm_squared() / self.velocity_sigma_mps.powi(2);
        squared.min(LARGEST_MISFIT)
    }

    /// Misfit of a phone that moves as its companions do.
    fn misfit(&self, offset_m: Vector2<f64>) -> f64 {
        self.position_misfit(offset_m) + self.velocity_misfit(self.others_mps)
    }
}

/// The moments of a phone, in order of time.
struct Track(Vec<Step>);

impl Track {
    fn kind(&self) -> ErrorKind {
        let misfits = self.misfits();
        let Some((kind, least)) = misfits.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)) else {
            return ErrorKind::Unknown;
        };
        let is_clear = |(other, misfit): &(ErrorKind, f64)| *other == kind || *misfit >= least + ADVANTAGE;
        if least.is_finite() && misfits.iter().all(is_clear) { kind } else { ErrorKind::Unknown }
    }

    /// The misfit of each kind with the begin that suits it best.
    fn misfits(&self) -> [(ErrorKind, f64); 5] {
        let begins = 0..(self.0.len() + 1).saturating_sub(FEWEST);
        let before =
            |begin: usize| self.0[..begin].iter().map(|step| step.misfit(Vector2::zeros())).sum::<f64>();
        let splits: Vec<(f64, &[Step])> = begins.map(|begin| (before(begin), &self.0[begin..])).collect();
        let least = |of: &dyn Fn(&[Step]) -> f64| {
            splits.iter().map(|(before, wrong)| before + of(wrong)).fold(f64::INFINITY, f64::min)
        };
        [
            (ErrorKind::WrongPlace, least(&displaced)),
            (ErrorKind::Drifting, least(&drifting)),
            (ErrorKind::Frozen, least(&frozen)),
            (ErrorKind::WrongClock, least(&|wrong| self.of_another_time(wrong))),
            (ErrorKind::LeftBehind, least(&apart)),
        ]
    }

    fn of_another_time(&self, wrong: &[Step]) -> f64 {
        let lags_s = LAG_STEPS.flat_map(|steps| [steps, -steps]).map(|steps| f64::from(steps) * LAG_STEP_S);
        let misfit = |lag_s: f64| wrong.iter().map(|step| self.lag_misfit(step, lag_s)).sum::<f64>();
        lags_s.map(misfit).fold(f64::INFINITY, f64::min)
    }

    /// Misfit of a moment that was this time ago. Of what is not known yet the velocity is that of now.
    fn lag_misfit(&self, step: &Step, lag_s: f64) -> f64 {
        let then_mps = self.others_mps(step.time_s - lag_s).unwrap_or(step.others_mps);
        let between_mps = (then_mps + step.others_mps) / 2.0;
        step.position_misfit(-lag_s * between_mps) + step.velocity_misfit(then_mps)
    }

    /// Velocity of the companions between two moments.
    fn others_mps(&self, time_s: f64) -> Option<Vector2<f64>> {
        let after = self.0.partition_point(|step| step.time_s < time_s);
        let (a, b) = (self.0.get(after.checked_sub(1)?)?, self.0.get(after)?);
        let share = (time_s - a.time_s) / (b.time_s - a.time_s);
        Some(a.others_mps + (b.others_mps - a.others_mps) * share)
    }
}

fn displaced(wrong: &[Step]) -> f64 {
    let offset_m = median(wrong, Step::offset_m);
    wrong.iter().map(|step| step.misfit(offset_m)).sum()
}

fn drifting(wrong: &[Step]) -> f64 {
    let begin_s = wrong.first().map_or(0.0, |step| step.time_s);
    let weight = |step: &Step| (step.time_s - begin_s) / step.sigma_m.powi(2);
    let product: Vector2<f64> = wrong.iter().map(|step| step.offset_m() * weight(step)).sum();
    let square: f64 = wrong.iter().map(|step| (step.time_s - begin_s) * weight(step)).sum();
    let rate_mps = product / square;
    if rate_mps.norm() > FASTEST_DRIFT_MPS {
        return f64::INFINITY;
    }
    wrong.iter().map(|step| step.misfit(rate_mps * (step.time_s - begin_s))).sum()
}

fn frozen(wrong: &[Step]) -> f64 {
    let way_m = wrong.first().zip(wrong.last()).map_or(0.0, |(a, b)| (b.others_m - a.others_m).norm());
    if way_m < LEAST_WAY_M {
        return f64::INFINITY;
    }
    let place_m = median(wrong, |step| step.own_m);
    let misfit = |step: &Step| step.position_misfit(place_m - step.others_m) + FREE_VELOCITY;
    FROZEN + wrong.iter().map(misfit).sum::<f64>()
}

/// Moves by its own velocity, from where it was up to a second after it left the companions.
fn apart(wrong: &[Step]) -> f64 {
    let Some(first) = wrong.first() else { return f64::INFINITY };
    let begins_s = [0.0, 0.5, 1.0];
    begins_s
        .map(|begin_s| apart_from(first.difference_mps() * begin_s, wrong))
        .into_iter()
        .fold(f64::INFINITY, f64::min)
}

/// The same with an offset from the companions at the first of these moments, m.
fn apart_from(mut offset_m: Vector2<f64>, wrong: &[Step]) -> f64 {
    let (mut sigmas, mut misfit) = (0.0, 0.0);
    for (before, step) in wrong.iter().zip(wrong.iter().skip(1)) {
        let mean_mps = (before.difference_mps() + step.difference_mps()) / 2.0;
        offset_m += mean_mps * (step.time_s - before.time_s);
        sigmas += step.difference_mps().norm() / step.velocity_sigma_mps;
        misfit += step.position_misfit(offset_m) + FREE_VELOCITY;
    }
    let is_way_explained = wrong.last().is_some_and(|last| {
        let unexplained_m = (last.offset_m() - offset_m).norm();
        unexplained_m <= LARGEST_UNEXPLAINED * last.offset_m().norm() + last.sigma_m
    });
    let is_apart = sigmas >= LEAST_APART_SIGMAS * wrong.len().saturating_sub(1) as f64;
    if is_apart && is_way_explained { misfit } else { f64::INFINITY }
}

/// Median of each component.
fn median(steps: &[Step], of: impl Fn(&Step) -> Vector2<f64>) -> Vector2<f64> {
    let component = |axis: usize| {
        let mut values: Vec<f64> = steps.iter().map(|step| of(step)[axis]).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    Vector2::new(component(0), component(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A group on a bend with 0.1 rad/s at 12 m/s, without noise; `own` gives the phone's position and velocity at a second since its error began.
    fn kind(own: impl Fn(f64) -> (Vector2<f64>, Vector2<f64>)) -> ErrorKind {
        let step = |second: i32| {
            let time_s = f64::from(second);
            let (others_m, others_mps) = bend(time_s);
            let (own_m, own_mps) = if time_s < 0.0 { (others_m, others_mps) } else { own(time_s) };
            Step { time_s, own_m, sigma_m: 5.0, own_mps, velocity_sigma_mps: 0.3, others_m, others_mps }
        };
        Track((-20..12).map(step).collect()).kind()
    }

    fn bend(time_s: f64) -> (Vector2<f64>, Vector2<f64>) {
        let (sin, cos) = (0.1 * time_s).sin_cos();
        (Vector2::new(120.0 * (1.0 - cos), 120.0 * sin), Vector2::new(12.0 * sin, 12.0 * cos))
    }

    #[test]
    fn each_kind_is_told() {
        let beside = |time_s: f64, offset_m: Vector2<f64>| {
            let (position_m, velocity_mps) = bend(time_s);
            (position_m + offset_m, velocity_mps)
        };
        let east = Vector2::new(1.0, 0.0);
        assert_eq!(kind(|time_s| beside(time_s, 30.0 * east)), ErrorKind::WrongPlace);
        assert_eq!(kind(|time_s| beside(time_s, 2.0 * time_s * east)), ErrorKind::Drifting);
        assert_eq!(kind(|time_s| (bend(0.0).0, bend(time_s).1)), ErrorKind::Frozen);
        assert_eq!(kind(|time_s| bend(time_s - 1.0)), ErrorKind::WrongClock);
        assert_eq!(kind(|time_s| bend(time_s + 1.0)), ErrorKind::WrongClock);
        assert_eq!(kind(|_| (bend(0.0).0, Vector2::zeros())), ErrorKind::LeftBehind);
        assert_eq!(kind(|time_s| (5.0 * time_s * east, 5.0 * east)), ErrorKind::LeftBehind);
    }

    #[test]
    fn what_fits_several_kinds_or_none_is_unknown() {
        assert_eq!(kind(bend), ErrorKind::Unknown);
        let jumping = |time_s: f64| Vector2::new(200.0 * (7.0 * time_s).sin(), 200.0 * (5.0 * time_s).cos());
        assert_eq!(kind(|time_s| (bend(time_s).0 + jumping(time_s), bend(time_s).1)), ErrorKind::Unknown);
        assert_eq!(History::default().kind(), ErrorKind::Unknown);
    }
}
