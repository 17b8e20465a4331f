//! The filters of a group, and the joint distribution of its phones at one time.
//!
//! Every phone has a filter of its own, which no constraint touches. So a wrong constraint never spoils a state, and a constraint that holds
//! all the time is one piece of information, whatever the phones' rates. The filters' errors are dependent through the errors that
//! all phones share (see [`crate::filter::SharedErrors`]). With feedback, as in Peng 2023, a joint filter that goes on with the
//! constrained state runs beside them.

use nalgebra::{DMatrix, DVector};

use super::engine::EngineOptions;
use crate::filter::{JointFilter, PhoneState, STATES_PER_PHONE, Start, UpdateReport};
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;
use crate::wire::EpochMessage;

/// Filters of a group.
pub(super) struct Filters {
    /// One per phone of the group.
    free: Vec<JointFilter>,
    /// With feedback: the filter over all phones that goes on with the constrained state.
    fed_back: Option<JointFilter>,
}

/// Joint distribution of the phones that have a state: nine kinematic states each, in this order.
#[derive(Clone, Debug)]
pub(super) struct GroupState {
    phones: Vec<usize>,
    pub mean: DVector<f64>,
    /// The filters' covariance, which decides the gains.
    pub covariance: DMatrix<f64>,
    /// The second covariance, which is stated; `None` where it is the first.
    pub second: Option<DMatrix<f64>>,
}

impl Filters {
    pub fn new(phones: usize, options: &EngineOptions) -> Self {
        let free = (0..phones).map(|_| JointFilter::new(options.filter)).collect();
        Self { free, fed_back: options.feedback.then(|| JointFilter::new(options.filter)) }
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
        if let Some(joint) = &mut self.fed_back {
            admit(free, phone, message, names, &mut uncounted);
            admit(joint, phone, message, names, skips)
        } else {
            admit(free, phone, message, names, skips)
        }
    }

    /// Removes phones whose silence is too long for prediction, and predicts the others to `time_gps`.
    pub fn predict(&mut self, time_gps: GpsTime, names: &[String], skips: &mut Skips) {
        let mut uncounted = Skips::default();
        let counted = self.fed_back.is_none();
        for filter in &mut self.free {
            drop_silent(filter, time_gps, names, if counted { skips } else { &mut uncounted });
            filter.predict(time_gps);
        }
        if let Some(joint) = &mut self.fed_back {
            drop_silent(joint, time_gps, names, skips);
            joint.predict(time_gps);
        }
    }

    /// The distribution without constraints.
    pub fn free(&self) -> GroupState {
        GroupState::of(&self.free)
    }

    /// The distribution that constraints act on.
    pub fn prior(&self) -> Option<GroupState> {
        self.fed_back.as_ref().map(|joint| {
            let phones = joint.phones().collect();
            let (mean, covariance) = joint.kinematic();
            GroupState { phones, mean, covariance, second: None }
        })
    }

    /// With feedback: the filter goes on with this distribution.
    pub fn go_on_with(&mut self, constrained: &GroupState) {
        if let Some(joint) = &mut self.fed_back {
            joint.go_on_with(&constrained.mean, &constrained.covariance);
        }
    }
}

impl GroupState {
    fn of(filters: &[JointFilter]) -> Self {
        let present: Vec<&JointFilter> = filters.iter().filter(|filter| !filter.is_empty()).collect();
        let n = STATES_PER_PHONE * present.len();
        let (mut mean, mut covariance, mut second) =
            (DVector::zeros(n), DMatrix::zeros(n, n), DMatrix::zeros(n, n));
        for (slot, filter) in present.iter().enumerate() {
            let at = STATES_PER_PHONE * slot;
            let Some(state) = filter.state(0) else { continue };
            mean.fixed_rows_mut::<STATES_PER_PHONE>(at).copy_from(&state.mean);
            let block = filter.kinematic().1;
            covariance.fixed_view_mut::<STATES_PER_PHONE, STATES_PER_PHONE>(at, at).copy_from(&block);
            second.fixed_view_mut::<STATES_PER_PHONE, STATES_PER_PHONE>(at, at).copy_from(&state.covariance);
            for (earlier, other) in present.iter().enumerate().take(slot) {
                let to = STATES_PER_PHONE * earlier;
                let block = filter.shared_with(other);
                second.fixed_view_mut::<STATES_PER_PHONE, STATES_PER_PHONE>(at, to).copy_from(&block);
                second
                    .fixed_view_mut::<STATES_PER_PHONE, STATES_PER_PHONE>(to, at)
                    .copy_from(&block.transpose());
            }
        }
        let phones = present.iter().flat_map(|filter| filter.phones()).collect();
        Self { phones, mean, covariance, second: Some(second) }
    }

    /// Place of a phone in the distribution.
    pub fn slot(&self, phone: usize) -> Option<usize> {
        self.phones.iter().position(|present| *present == phone)
    }

    /// State of the phone in a slot.
    pub fn state(&self, slot: usize) -> Option<PhoneState> {
        if slot >= self.phones.len() {
            return None;
        }
        let at = slot * STATES_PER_PHONE;
        Some(PhoneState {
            mean: self.mean.fixed_rows::<STATES_PER_PHONE>(at).into_owned(),
            covariance: self.stated().fixed_view::<STATES_PER_PHONE, STATES_PER_PHONE>(at, at).into_owned(),
        })
    }

    /// The covariance that is stated.
    pub fn stated(&self) -> &DMatrix<f64> {
        self.second.as_ref().unwrap_or(&self.covariance)
    }

    /// Standard deviation of the distance between two phones along the line between them, m.
    pub fn distance_sigma_m(&self, a: usize, b: usize) -> Option<f64> {
        let line = self.state(a)?.position() - self.state(b)?.position();
        let u = line.0.try_normalize(1e-9)?;
        let (ra, rb) = (a * STATES_PER_PHONE, b * STATES_PER_PHONE);
        let block = |i: usize, j: usize| self.stated().fixed_view::<3, 3>(i, j);
        let relative = block(ra, ra) + block(rb, rb) - block(ra, rb) - block(rb, ra);
        Some(u.dot(&(relative * u)).max(0.0).sqrt())
    }
}

/// Updates a filter with a message, or starts the phone from the message's solution.
fn admit(
    filter: &mut JointFilter,
    phone: usize,
    message: &EpochMessage,
    names: &[String],
    skips: &mut Skips,
) -> Option<UpdateReport> {
    if !filter.is_empty() && message.time_gps < filter.time_gps() {
        let (name, time) = (&message.phone, message.time_gps);
        let late_s = filter.time_gps() - time;
        skips.add(Reason::EpochBeforeFilterTime, || format!("{name} at {time}, {late_s:.3} s late"));
        return None;
    }
    drop_silent(filter, message.time_gps, names, skips);
    filter.predict(message.time_gps);
    let slot = filter.slot(phone);
    if let Some((slot, solution)) = slot.zip(message.wls.as_ref()) {
        filter.compare(slot, solution, message.raim.verdict);
    }
    let lost = slot.is_some_and(|slot| filter.is_lost(slot));
    let mut update = None;
    match (slot, &message.wls) {
        (_, Some(solution)) if slot.is_none() || lost => {
            if lost {
                skips.add(Reason::LostPhoneRestarted, || {
                    format!(
                        "{} at {}: its pseudoranges contradict the prediction",
                        message.phone, message.time_gps
                    )
                });
            }
            filter.insert(phone, message.time_gps, &Start::at_solution(solution, message.raim.verdict));
        }
        (Some(slot), _) if !message.observations.is_empty() => {
            update = Some(filter.update(slot, &message.observations));
        }
        _ => {}
    }
    remove_unsound(filter, phone, message, skips);
    update
}

/// Removes the phone whose message made the state unusable; if that does not help, all phones.
fn remove_unsound(filter: &mut JointFilter, phone: usize, message: &EpochMessage, skips: &mut Skips) {
    if filter.is_sound() {
        return;
    }
    let describe = || format!("state not sound after {} at {}", message.phone, message.time_gps);
    if let Some(slot) = filter.slot(phone) {
        filter.remove(slot);
        skips.add(Reason::PhoneTakenOutOfFilter, describe);
    }
    if !filter.is_sound() {
        filter.clear();
        skips.add(Reason::JointFilterRestarted, describe);
    }
}

/// Removes phones whose silence is too long for prediction.
fn drop_silent(filter: &mut JointFilter, time_gps: GpsTime, names: &[String], skips: &mut Skips) {
    for (phone, silence_s) in filter.drop_silent(time_gps) {
        let name = names.get(phone).map_or("?", String::as_str);
        skips.add(Reason::SilentPhoneDropped, || format!("{name} at {time_gps} after {silence_s:.1} s"));
    }
}
