//! Positions collected for scoring against truth.

use std::collections::BTreeMap;

use cofix_common::accuracy::{Accuracy, Claim, Protection, Solution, Spans, Truth, score, time_shift};
use cofix_common::filter::PhoneState;
use cofix_common::frames::Ecef;
use cofix_common::fusion::engine::{FusedEpoch, FusedPhone};
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;
use serde::Serialize;

use super::tally::extended;

/// Accuracy by phone; `None` for phones without a score.
pub type ByPhone = BTreeMap<String, Option<Accuracy>>;

/// True position of a phone; `None` without truth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reference {
    /// At the receive time of the phone's message: scores the agent's estimates.
    pub at_message: Option<Ecef>,
    /// At the common time of the epoch: scores the hub's estimate, and is drawn.
    pub at_epoch: Option<Ecef>,
}

impl Reference {
    /// Looks the truth of one phone up at both times of an epoch.
    pub fn look_up(epoch: &FusedEpoch, phone: usize, truth: impl Fn(GpsTime) -> Option<Ecef>) -> Self {
        let message = epoch.phones.get(phone).and_then(|p| p.message.as_ref());
        Self { at_message: message.and_then(|m| truth(m.time_gps)), at_epoch: truth(epoch.time_gps) }
    }
}

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

/// How the truth of a phone matches the session.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TruthReport {
    /// First row, GPS time.
    pub first_gps: Option<String>,
    /// Last row, GPS time.
    pub last_gps: Option<String>,
    /// Rows within the group's span.
    pub rows: usize,
    /// Those of a quality that counts.
    pub counted_rows: usize,
    /// Seconds to add to its times for a distinctly better fit; null when they fit, or the phone did not move.
    pub shift_s: Option<f64>,
    /// Median horizontal distance of the fused positions from the truth as it is, m; only with a shift.
    pub median_m: Option<f64>,
    /// The same after the shift, m.
    pub shifted_median_m: Option<f64>,
}

#[derive(Debug, Default)]
struct PhoneScores {
    name: String,
    truth: Option<Truth>,
    span: Option<(GpsTime, GpsTime)>,
    wls: Vec<Solution>,
    local: Vec<Solution>,
    joint: Vec<Solution>,
    /// What the agent's integrity monitoring said of the epoch-wise positions.
    claims: Vec<Claim>,
    /// What it said of the local filter's positions.
    local_claims: Vec<Claim>,
    /// What the hub said of the fused positions.
    fused_claims: Vec<Claim>,
}

/// Collects positions and scores them at the end.
#[derive(Debug)]
pub struct Scores {
    phones: Vec<PhoneScores>,
    qualities: Vec<u8>,
    /// Of the messages of all phones.
    span: Option<(GpsTime, GpsTime)>,
}

impl Scores {
    /// For phones with their truth, of which rows of these qualities count.
    pub fn new(phones: Vec<(String, Option<Truth>)>, qualities: Vec<u8>) -> Self {
        let phone = |(name, truth)| PhoneScores { name, truth, ..PhoneScores::default() };
        Self { phones: phones.into_iter().map(phone).collect(), qualities, span: None }
    }

    /// Adds an epoch. Phones without truth cost no memory.
    pub fn push(&mut self, epoch: &FusedEpoch) {
        for message in epoch.phones.iter().filter_map(|phone| phone.message.as_ref()) {
            self.span = Some(extended(self.span, message.time_gps));
        }
        for (scores, phone) in self.phones.iter_mut().zip(&epoch.phones) {
            if scores.truth.is_some() {
                scores.push(epoch.time_gps, phone);
            }
        }
    }

    /// Adds an epoch of a phone that came too late to be fused.
    pub fn late(&mut self, phone: usize, message: &EpochMessage) {
        self.span = Some(extended(self.span, message.time_gps));
        if let Some(scores) = self.phones.get_mut(phone).filter(|scores| scores.truth.is_some()) {
            scores.push_message(message);
        }
    }

    /// The true position of a phone at a time, where rows of a counted quality give it.
    pub fn truth_at(&self, phone: usize, time: GpsTime) -> Option<Ecef> {
        self.phones.get(phone)?.position_at(time, &self.qualities)
    }

    /// The phones' true positions, where rows of a counted quality give them.
    pub fn references(&self, epoch: &FusedEpoch) -> Vec<Reference> {
        let reference = |(index, scores): (usize, &PhoneScores)| {
            Reference::look_up(epoch, index, |time| scores.position_at(time, &self.qualities))
        };
        self.phones.iter().enumerate().map(reference).collect()
    }

    /// The accuracy so far.
    pub fn methods(&self) -> Methods {
        let by_phone = |solutions: fn(&PhoneScores) -> &[Solution]| {
            let entry =
                |scores: &PhoneScores| (scores.name.clone(), self.accuracy(scores, solutions(scores)));
            self.phones.iter().map(entry).collect()
        };
        let mut wls: ByPhone = by_phone(|scores| &scores.wls);
        let mut local: ByPhone = by_phone(|scores| &scores.local);
        let mut joint: ByPhone = by_phone(|scores| &scores.joint);
        for scores in &self.phones {
            for (by_phone, claims) in [
                (&mut wls, &scores.claims),
                (&mut local, &scores.local_claims),
                (&mut joint, &scores.fused_claims),
            ] {
                if let Some(Some(accuracy)) = by_phone.get_mut(&scores.name) {
                    accuracy.protection = scores.protection(claims, &self.qualities);
                }
            }
        }
        Methods { wls, local, joint }
    }

    /// Phones that are not scored, and why.
    pub fn unscored(&self) -> BTreeMap<String, String> {
        let reason = |scores: &PhoneScores| {
            let reason = match (&scores.truth, scores.span) {
                (None, _) => "it has no truth".to_owned(),
                (Some(_), None) => "it has no epochs".to_owned(),
                (Some(truth), Some(span)) => match unmatched(truth, span, &self.qualities) {
                    Some(reason) => reason,
                    None if self.is_scored(scores) => return None,
                    None => "it has no position within half an interval of a row of its truth".to_owned(),
                },
            };
            Some((scores.name.clone(), reason))
        };
        self.phones.iter().filter_map(reason).collect()
    }

    /// How truths match the session, by phone.
    pub fn truths(&self) -> BTreeMap<String, TruthReport> {
        let report = |scores: &PhoneScores| {
            Some((
                scores.name.clone(),
                scores.truth_report(scores.truth.as_ref()?, self.span, &self.qualities),
            ))
        };
        self.phones.iter().filter_map(report).collect()
    }

    fn is_scored(&self, scores: &PhoneScores) -> bool {
        [&scores.wls, &scores.local, &scores.joint]
            .into_iter()
            .any(|solutions| self.accuracy(scores, solutions).is_some())
    }

    fn accuracy(&self, scores: &PhoneScores, solutions: &[Solution]) -> Option<Accuracy> {
        let spans = Spans { group: self.span?, recording: scores.span? };
        score(scores.truth.as_ref()?, &self.qualities, spans, solutions)
    }
}

impl PhoneScores {
    fn push(&mut self, time_gps: GpsTime, phone: &FusedPhone) {
        if let Some(message) = &phone.message {
            self.push_message(message);
        }
        let fused = phone.state.as_ref().zip(phone.verdict);
        self.fused_claims.extend(
            fused.map(|(state, verdict)| Claim::of(time_gps, state.position(), verdict, phone.protection)),
        );
        self.joint.extend(phone.state.as_ref().map(|state| claimed(time_gps, state)));
    }

    /// Adds what an agent made of an epoch, in order of time.
    fn push_message(&mut self, message: &EpochMessage) {
        let time = message.time_gps;
        self.span = Some(extended(self.span, time));
        if let Some(wls) = &message.wls {
            let (position, covariance) = (wls.position, wls.position_covariance);
            insert(&mut self.wls, Solution { time_gps: time, position, covariance });
            let raim = &message.raim;
            self.claims.push(Claim::of(time, position, raim.verdict, raim.protection));
        }
        if let Some(state) = &message.local {
            insert(&mut self.local, claimed(time, state));
        }
        let local = message.local.as_ref().zip(message.local_integrity);
        self.local_claims.extend(
            local.map(|(state, report)| Claim::of(time, state.position(), report.verdict, report.protection)),
        );
    }

    fn protection(&self, claims: &[Claim], qualities: &[u8]) -> Protection {
        self.truth
            .as_ref()
            .map_or_else(Protection::default, |truth| Protection::score(truth, qualities, claims))
    }

    fn position_at(&self, time: GpsTime, qualities: &[u8]) -> Option<Ecef> {
        self.truth.as_ref()?.at(time, qualities).map(|point| point.position)
    }

    fn truth_report(&self, truth: &Truth, group: Option<(GpsTime, GpsTime)>, counted: &[u8]) -> TruthReport {
        let all: Vec<u8> = (0..=u8::MAX).collect();
        let rows = |qualities: &[u8]| {
            let is_inside = |time: &GpsTime| group.is_some_and(|(first, last)| (first..=last).contains(time));
            truth.times(qualities).filter(is_inside).count()
        };
        // The best positions available.
        let solutions = [&self.joint, &self.local, &self.wls].into_iter().find(|list| !list.is_empty());
        let shift = solutions.and_then(|solutions| time_shift(truth, counted, solutions));
        TruthReport {
            first_gps: truth.span().map(|(first, _)| first.iso()),
            last_gps: truth.span().map(|(_, last)| last.iso()),
            rows: rows(&all),
            counted_rows: rows(counted),
            shift_s: shift.map(|shift| shift.shift_s),
            median_m: shift.and_then(|shift| shift.median_m),
            shifted_median_m: shift.map(|shift| shift.shifted_median_m),
        }
    }
}

/// Puts a solution into its place by time.
fn insert(solutions: &mut Vec<Solution>, solution: Solution) {
    let place = solutions.partition_point(|other| other.time_gps <= solution.time_gps);
    solutions.insert(place, solution);
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
