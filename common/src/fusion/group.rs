//! The filters of a group, and the distribution of its phones at one time.
//!
//! Every phone has a filter of its own, which no constraint touches. So a wrong constraint never spoils a state, and a constraint that holds
//! all the time is one piece of information, whatever the phones' rates. The filters' errors are dependent through the errors that
//! all phones share (see [`crate::filter::SharedErrors`]). With feedback, as in Peng 2023, a joint filter that goes on with the
//! constrained state runs beside them.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, Vector3};

use super::engine::EngineOptions;
use crate::constraint::FreePhone;
use crate::constraint::second::Between;
use crate::filter::{Admitted, JointFilter, PhoneEpoch, PhoneState, STATES_PER_PHONE, Unsound, UpdateReport};
use crate::integrity::RaimOptions;
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;
use crate::wire::EpochMessage;

/// Filters of a group.
pub(super) struct Filters {
    /// One per phone of the group.
    free: Vec<JointFilter>,
    /// With feedback: the filter over all phones that goes on with the constrained state.
    fed_back: Option<JointFilter>,
    /// Tests of the innovations.
    tests: RaimOptions,
}

/// The phones that have a state, each with a filter of its own, without constraints. A phone's place among them is its slot.
#[derive(Clone, Debug, Default)]
pub(super) struct FreeGroup {
    slots: Slots,
    pub phones: Vec<FreePhone>,
    /// The covariances that are stated.
    pub stated: Vec<PhoneMatrix>,
}

/// Joint distribution of the phones of the filter with feedback: nine kinematic states each, in this order.
#[derive(Clone, Debug)]
pub(super) struct JointGroup {
    pub slots: Slots,
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
}

/// Slots of the phones that have a state.
#[derive(Clone, Debug, Default)]
pub(super) struct Slots(Vec<Option<usize>>);

/// What is given out of a group, by slot.
pub(super) struct Output {
    pub states: Vec<PhoneState>,
    /// Covariances of the positions of pairs, in their order.
    pub pairs: Vec<Matrix3<f64>>,
}

type PhoneMatrix = SMatrix<f64, STATES_PER_PHONE, STATES_PER_PHONE>;

impl Filters {
    pub fn new(phones: usize, options: &EngineOptions) -> Self {
        let free = (0..phones).map(|_| JointFilter::new(options.filter)).collect();
        let fed_back = options.feedback.then(|| JointFilter::new(options.filter));
        Self { free, fed_back, tests: options.integrity.clone() }
    }

    /// Takes the message of a phone. Returns what its filter made of it, unless it started the phone.
    pub fn admit(
        &mut self,
        phone: usize,
        message: &EpochMessage,
        names: &[String],
        skips: &mut Skips,
    ) -> Option<UpdateReport> {
        let mut uncounted = Skips::default();
        let free = self.free.get_mut(phone)?;
        let wls = message.wls.as_ref().map(|solution| (solution, message.raim.verdict));
        let epoch = PhoneEpoch {
            time_gps: message.time_gps,
            observations: &message.observations,
            changes_since_gps: message.changes_since_gps,
            wls,
            tests: Some(&self.tests),
        };
        let name = &message.phone;
        if let Some(joint) = &mut self.fed_back {
            count(&free.admit(phone, &epoch), name, &epoch, names, &mut uncounted);
            let admitted = joint.admit(phone, &epoch);
            count(&admitted, name, &epoch, names, skips);
            admitted.update
        } else {
            let admitted = free.admit(phone, &epoch);
            count(&admitted, name, &epoch, names, skips);
            admitted.update
        }
    }

    /// Removes phones whose silence is too long for prediction, and predicts the others to `time_gps`.
    pub fn predict(&mut self, time_gps: GpsTime, names: &[String], skips: &mut Skips) {
        let mut uncounted = Skips::default();
        let counted = self.fed_back.is_none();
        for filter in &mut self.free {
            let silent = filter.drop_silent(time_gps);
            count_silent(&silent, time_gps, names, if counted { skips } else { &mut uncounted });
            filter.predict(time_gps);
        }
        if let Some(joint) = &mut self.fed_back {
            count_silent(&joint.drop_silent(time_gps), time_gps, names, skips);
            joint.predict(time_gps);
        }
    }

    /// The distribution without constraints.
    pub fn free(&self) -> FreeGroup {
        let mut group = FreeGroup::default();
        for filter in &self.free {
            let whole = filter.state(0).zip(filter.gain_covariance(0));
            group.slots.push(whole.is_some());
            if let Some((PhoneState { mean, covariance }, gains)) = whole {
                group.phones.push(FreePhone::new(mean, gains));
                group.stated.push(covariance);
            }
        }
        group
    }

    /// Displacements of the phones' positions by lasting faults of one satellite (see [`JointFilter::faults`]), of all phones together: a constraint
    /// hands the fault of one phone on to the others. `None` if nothing bounds them.
    pub fn faults(&self) -> Option<Vec<Vector3<f64>>> {
        let present = self.free.iter().filter(|filter| !filter.is_empty());
        let of_each: Option<Vec<Vec<Vector3<f64>>>> = present.map(|filter| filter.faults(0)).collect();
        of_each.map(|faults| faults.concat())
    }

    /// Covariances of the errors of different phones of [`Filters::free`].
    pub fn shared(&self) -> Shared<'_> {
        Shared(self.free.iter().filter(|filter| !filter.is_empty()).collect())
    }

    /// With feedback: the distribution that constraints act on.
    pub fn joint(&self) -> Option<JointGroup> {
        self.fed_back.as_ref().map(|joint| {
            let mut slots = Slots(vec![None; self.free.len()]);
            for (slot, phone) in joint.phones().enumerate() {
                slots.0[phone] = Some(slot);
            }
            let (mean, covariance) = joint.kinematic();
            JointGroup { slots, mean, covariance }
        })
    }

    /// With feedback: the filter goes on with this distribution.
    pub fn go_on_with(&mut self, constrained: &JointGroup) {
        if let Some(joint) = &mut self.fed_back {
            joint.go_on_with(&constrained.mean, &constrained.covariance);
        }
    }
}

/// Filters of the phones that have a state, by slot.
pub(super) struct Shared<'a>(Vec<&'a JointFilter>);

impl Between for Shared<'_> {
    fn between<const N: usize>(&self, a: usize, b: usize) -> SMatrix<f64, N, N> {
        self.0[a].shared_with(self.0[b])
    }
}

impl Slots {
    /// Takes the next phone of the group.
    fn push(&mut self, is_present: bool) {
        let slot = self.0.iter().flatten().count();
        self.0.push(is_present.then_some(slot));
    }

    /// Slot of a phone.
    pub fn of(&self, phone: usize) -> Option<usize> {
        self.0.get(phone).copied().flatten()
    }
}

impl FreeGroup {
    /// Slots of the phones.
    pub const fn slots(&self) -> &Slots {
        &self.slots
    }

    /// State of the phone in a slot.
    pub fn state(&self, slot: usize) -> Option<PhoneState> {
        let (phone, covariance) = self.phones.get(slot).zip(self.stated.get(slot))?;
        Some(PhoneState { mean: phone.mean, covariance: *covariance })
    }
}

impl JointGroup {
    /// What is given out of all phones and these pairs, which are in the distribution.
    pub fn output(&self, pairs: &[(usize, usize)]) -> Output {
        let at = |slot: usize| STATES_PER_PHONE * slot;
        let own = |slot: usize| {
            self.covariance.fixed_view::<STATES_PER_PHONE, STATES_PER_PHONE>(at(slot), at(slot))
        };
        let state = |slot: usize| PhoneState {
            mean: self.mean.fixed_rows::<STATES_PER_PHONE>(at(slot)).into_owned(),
            covariance: own(slot).into_owned(),
        };
        let pair = |(a, b): &(usize, usize)| self.covariance.fixed_view::<3, 3>(at(*a), at(*b)).into_owned();
        Output {
            states: (0..self.mean.len() / STATES_PER_PHONE).map(state).collect(),
            pairs: pairs.iter().map(pair).collect(),
        }
    }
}

impl Output {
    /// Standard deviation of the distance between the phones of two slots along the line between them, m; `between` is the covariance of their
    /// positions.
    pub fn distance_sigma_m(&self, (a, b): (usize, usize), between: &Matrix3<f64>) -> Option<f64> {
        let (a, b) = self.states.get(a).zip(self.states.get(b))?;
        let u = (a.position() - b.position()).0.try_normalize(1e-9)?;
        let position = |state: &PhoneState| state.covariance.fixed_view::<3, 3>(0, 0).into_owned();
        let relative = position(a) + position(b) - between - between.transpose();
        Some(u.dot(&(relative * u)).max(0.0).sqrt())
    }
}

/// Counts what became of an epoch in a filter.
fn count(admitted: &Admitted, name: &str, epoch: &PhoneEpoch<'_>, names: &[String], skips: &mut Skips) {
    let time_gps = epoch.time_gps;
    if let Some(late_s) = admitted.late_s {
        skips.add(Reason::EpochBeforeFilterTime, || format!("{name} at {time_gps}, {late_s:.3} s late"));
    }
    count_silent(&admitted.silent, time_gps, names, skips);
    if admitted.was_lost {
        skips.add(Reason::LostPhoneRestarted, || {
            format!("{name} at {time_gps}: its measurements contradict the prediction")
        });
    }
    let unsound = || format!("state not sound after {name} at {time_gps}");
    if admitted.unsound != Unsound::None {
        skips.add(Reason::PhoneTakenOutOfFilter, unsound);
    }
    if admitted.unsound == Unsound::All {
        skips.add(Reason::JointFilterRestarted, unsound);
    }
}

/// Counts phones that were removed since their silence was too long for prediction.
fn count_silent(silent: &[(usize, f64)], time_gps: GpsTime, names: &[String], skips: &mut Skips) {
    for (phone, silence_s) in silent {
        let name = names.get(*phone).map_or("?", String::as_str);
        skips.add(Reason::SilentPhoneDropped, || format!("{name} at {time_gps} after {silence_s:.1} s"));
    }
}
