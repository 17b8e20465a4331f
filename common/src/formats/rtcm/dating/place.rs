//! The place of a recording's parts on the time axis, by what ephemerides state.

use super::{Part, StreamDates};
use crate::formats::rtcm::date::Claim;
use crate::time::GpsTime;

/// Satellites that are heard at most.
pub(super) const MOST_CLAIMS: usize = 256;
/// A stream of ephemerides begins within this of their reference times, s.
const AGREEMENT_S: f64 = 43_200.0;

/// What satellites state, each once, and at which time of the stream.
#[derive(Clone, Debug, Default)]
pub(super) struct Claims(Vec<(Claim, GpsTime)>);

impl Claims {
    /// A satellite's first word counts, or the first that is not next to the end of a week or day.
    pub(super) fn add(&mut self, claim: Claim, now: GpsTime) {
        let is_clear = |claim: &Claim| claim.candidates(now).count() == 1;
        let has_room = self.0.len() < MOST_CLAIMS;
        match self.0.iter_mut().find(|(known, _)| known.satellite == claim.satellite) {
            Some(known) if !is_clear(&known.0) && is_clear(&claim) => *known = (claim, now),
            None if has_room => self.0.push((claim, now)),
            Some(_) | None => {}
        }
    }

    /// How many steps the stream must be moved so that most satellites agree; `None` when none says anything. Of several answers the one
    /// that is `preferred` counts, or else the one that the weeks support as they were sent.
    fn steps(&self, step_s: f64, preferred: f64) -> Option<f64> {
        let of = |(claim, now): &(Claim, GpsTime), steps: f64| {
            let moved = *now + steps * step_s;
            let is_near = |time: GpsTime| ((time - moved) / step_s).round() == 0.0;
            let mut candidates = claim.candidates(moved);
            let as_sent = candidates.next().unwrap_or(moved);
            // The other is of a reference time next to the week that was sent, which is that of the transmission then, and not yet to come.
            let is_other = |other| is_near(other) && (other > as_sent || moved.week() >= as_sent.week());
            (is_near(as_sent) || candidates.any(is_other), is_near(as_sent))
        };
        let weight = |steps: f64| {
            let supporters = self.0.iter().map(|claim| of(claim, steps));
            supporters.fold(
                (0_usize, steps == preferred, 0_usize),
                |(all, is_preferred, likeliest), (any, first)| {
                    (all + usize::from(any), is_preferred, likeliest + usize::from(first))
                },
            )
        };
        let answers = self.0.iter().flat_map(|(claim, now)| {
            let now = *now + preferred * step_s;
            claim.candidates(now).map(move |time| preferred + ((time - now) / step_s).round())
        });
        let answers = answers.chain([preferred]);
        let best = answers
            .map(|steps| (weight(steps), steps))
            .max_by(|(a, x), (b, y)| a.cmp(b).then((y - preferred).abs().total_cmp(&(x - preferred).abs())));
        best.filter(|((supporters, ..), _)| *supporters > 0).map(|(_, steps)| steps)
    }

    /// Whether nobody has said anything.
    pub(super) const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The first reference time of those on which most satellites agree, if there is any. Of several answers the one nearest to `near`.
    pub(super) fn agreed(&self, near: GpsTime) -> Option<GpsTime> {
        let about = |claim: &Claim, time: GpsTime| {
            claim.candidates(time).find(|candidate| (*candidate - time).abs() <= AGREEMENT_S)
        };
        let supporters = |time| self.0.iter().filter(|(claim, _)| about(claim, time).is_some()).count();
        let answers = self.0.iter().flat_map(|(claim, _)| claim.candidates(near));
        let weighed = answers.map(|time| (supporters(time), (time - near).abs(), time));
        let (.., best) = weighed.max_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)))?;
        self.0.iter().find_map(|(claim, _)| about(claim, best))
    }
}

/// The dates of a recording's parts, which are moved by whole steps: each as its ephemerides say, one without any like the one before it, and all by
/// `by_hint` steps where there are no ephemerides at all.
pub(super) fn dates(parts: &[Part], step_s: f64, by_hint: f64) -> Option<StreamDates> {
    let mut preferred = by_hint;
    let mut stated = Vec::with_capacity(parts.len());
    for part in parts {
        let steps = part.claims.steps(step_s, preferred);
        preferred = steps.unwrap_or(preferred);
        stated.push(steps);
    }
    let first = stated.iter().flatten().next().copied();
    let mut before = first.unwrap_or(by_hint);
    let mut changes = Vec::with_capacity(parts.len());
    for (part, own) in parts.iter().zip(stated) {
        before = own.unwrap_or(before);
        changes.push((part.frame, part.begins + before * step_s));
    }
    // What comes before the first observation belongs to it.
    let (frame, begins) = changes.first_mut()?;
    *frame = 0;
    let begins = *begins;
    let moved_s = begins - (parts.first()?.begins + by_hint * step_s);
    Some(StreamDates { begins, changes, are_stated: first.is_some(), moved_s })
}
