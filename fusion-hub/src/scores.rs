//! Positions collected for scoring against truth.

use std::collections::BTreeMap;

use cofix_common::accuracy::{Accuracy, Solution, Truth, score};
use cofix_common::filter::PhoneState;
use cofix_common::frames::Ecef;
use cofix_common::time::GpsTime;
use serde::Serialize;

use crate::engine::{FusedEpoch, FusedPhone};
use crate::recorder::Reference;

/// Accuracy by phone; `None` for a phone that cannot be scored.
pub type ByPhone = BTreeMap<String, Option<Accuracy>>;

/// Accuracy by method and phone.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Methods {
    /// Epoch-wise weighted least squares, by the agent.
    pub wls: ByPhone,
    /// The agent's filter.
    pub local: ByPhone,
    /// The hub's filter with constraints.
    pub joint: ByPhone,
}

#[derive(Debug, Default)]
struct PhoneScores {
    name: String,
    truth: Option<Truth>,
    span: Option<(GpsTime, GpsTime)>,
    wls: Vec<Solution>,
    local: Vec<Solution>,
    joint: Vec<Solution>,
}

/// Collects positions and scores them at the end.
#[derive(Debug)]
pub struct Scores {
    phones: Vec<PhoneScores>,
    qualities: Vec<u8>,
}

impl Scores {
    /// For phones with their truth, of which rows of these qualities count.
    pub fn new(phones: Vec<(String, Option<Truth>)>, qualities: Vec<u8>) -> Self {
        let phone = |(name, truth)| PhoneScores { name, truth, ..PhoneScores::default() };
        Self { phones: phones.into_iter().map(phone).collect(), qualities }
    }

    /// Adds an epoch. Phones without truth cost no memory.
    pub fn push(&mut self, epoch: &FusedEpoch) {
        for (scores, phone) in self.phones.iter_mut().zip(&epoch.phones) {
            if scores.truth.is_some() {
                scores.push(epoch.time_gps, phone);
            }
        }
    }

    /// Where the phones truly were, as far as counted truth says so.
    pub fn references(&self, epoch: &FusedEpoch) -> Vec<Reference> {
        let reference = |(index, scores): (usize, &PhoneScores)| {
            Reference::look_up(epoch, index, |time| scores.position_at(time, &self.qualities))
        };
        self.phones.iter().enumerate().map(reference).collect()
    }

    /// The accuracy so far.
    pub fn methods(&self) -> Methods {
        let by_phone = |solutions: fn(&PhoneScores) -> &[Solution]| {
            let entry = |scores: &PhoneScores| {
                (scores.name.clone(), scores.accuracy(&self.qualities, solutions(scores)))
            };
            self.phones.iter().map(entry).collect()
        };
        Methods {
            wls: by_phone(|scores| &scores.wls),
            local: by_phone(|scores| &scores.local),
            joint: by_phone(|scores| &scores.joint),
        }
    }

    /// Phones that are not scored, and why.
    pub fn unscored(&self) -> BTreeMap<String, String> {
        let reason = |scores: &PhoneScores| {
            let reason = match (&scores.truth, scores.span) {
                (None, _) => "it has no truth".to_owned(),
                (Some(_), None) => "it has no epochs".to_owned(),
                (Some(truth), Some(span)) => unmatched(truth, span, &self.qualities)?,
            };
            Some((scores.name.clone(), reason))
        };
        self.phones.iter().filter_map(reason).collect()
    }
}

impl PhoneScores {
    fn push(&mut self, time_gps: GpsTime, phone: &FusedPhone) {
        if let Some(message) = &phone.message {
            let time = message.time_gps;
            let (first, last) = self.span.unwrap_or((time, time));
            self.span = Some((first.min(time), last.max(time)));
            self.wls.extend(message.wls.as_ref().map(|solution| Solution {
                time_gps: time,
                position: solution.position,
                covariance: solution.position_covariance,
            }));
            self.local.extend(message.local.as_ref().map(|state| claimed(time, state)));
        }
        self.joint.extend(phone.state.as_ref().map(|state| claimed(time_gps, state)));
    }

    fn position_at(&self, time: GpsTime, qualities: &[u8]) -> Option<Ecef> {
        self.truth.as_ref()?.at(time, qualities).map(|point| point.position)
    }

    fn accuracy(&self, qualities: &[u8], solutions: &[Solution]) -> Option<Accuracy> {
        score(self.truth.as_ref()?, qualities, self.span?, solutions)
    }
}

fn claimed(time_gps: GpsTime, state: &PhoneState) -> Solution {
    let covariance = state.covariance.fixed_view::<3, 3>(0, 0).into_owned();
    Solution { time_gps, position: state.position(), covariance }
}

/// Why a truth has no row for a recording, if so.
fn unmatched(truth: &Truth, (first, last): (GpsTime, GpsTime), qualities: &[u8]) -> Option<String> {
    if truth.times(qualities).any(|time| time >= first - 0.5 && time <= last + 0.5) {
        return None;
    }
    let covered = truth.span().map_or_else(|| "nothing".to_owned(), |(a, b)| format!("{a} to {b}"));
    Some(format!(
        "its truth has no row of quality {qualities:?} within its recording from {first} to {last} (it covers {covered})"
    ))
}
