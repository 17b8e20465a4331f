//! One phone's messages on their way into buckets.

use std::collections::VecDeque;
use std::time::Duration;

use crate::integrity::Verdict;
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;
use crate::wire::EpochMessage;

use super::AlignOptions;

/// Most messages of a phone held back for confirmation.
const MAXIMUM_HELD: usize = 4;
/// Steps between a phone's epochs that differ by no more than this factor are regular: a recording of one epoch every two hours.
const REGULAR: f64 = 1.5;
/// Places of a phone's epochs in time that are remembered, for one [`AlignOptions::maximum_wait`].
const MARKS: u32 = 16;
/// Whether a bucket waits for a phone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Presence {
    /// Messages will come.
    #[default]
    Running,
    /// Left behind or not there; its next message that is on time makes it run.
    Away,
    /// No message will come.
    Finished,
}

#[derive(Debug)]
pub(super) struct Waiting {
    pub(super) message: EpochMessage,
    pub(super) arrived: Duration,
}

/// Where a message stands among those of its phone.
pub(super) enum Place {
    /// It goes on where the phone was.
    Follows,
    /// It follows some that were held back, in order of time, which are believed now.
    Confirms(Vec<Waiting>),
    /// It is far from everything else.
    Unknown,
}

/// What became of a message.
pub(super) enum Accepted {
    Queued,
    /// Its time is fused already.
    TooLate,
    /// It does not follow the one before it.
    Refused,
}

#[derive(Debug, Default)]
pub(super) struct Track {
    pub(super) queue: VecDeque<Waiting>,
    /// Messages whose time is not confirmed, at most [`MAXIMUM_HELD`].
    pub(super) held: Vec<Waiting>,
    pub(super) presence: Presence,
    /// Time of the last message that was believed.
    pub(super) latest: Option<GpsTime>,
    /// The step to it from the one before, s.
    step_s: Option<f64>,
    /// When the last message came that could be fused.
    pub(super) progress: Option<Duration>,
    /// When the last message came that was believed, and its time; also of one that came too late.
    pub(super) spoken: Option<(Duration, GpsTime)>,
    /// When anything came last.
    pub(super) heard: Option<Duration>,
    marks: VecDeque<(Duration, GpsTime)>,
    /// Whether its last message has a position that the agent does not warn of.
    pub(super) has_position: bool,
    /// Whether it is of a later time than the group's.
    pub(super) ahead: bool,
    /// Since when.
    pub(super) ahead_since: Duration,
    /// Whether it was left behind and has not been on time since.
    pub(super) left_behind: bool,
    pub(super) skips: Skips,
}

impl Track {
    pub(super) fn time(&self, position: usize) -> Option<GpsTime> {
        self.queue.get(position).map(|waiting| waiting.message.time_gps)
    }

    /// The time of the last message that was believed, of an agent that is gone only while it waits.
    pub(super) fn newest(&self) -> Option<GpsTime> {
        let waiting = self.queue.back().map(|waiting| waiting.message.time_gps);
        waiting.max(self.spoken.map(|(_, time)| time))
    }

    /// Where a message stands. Live, a step back is believed once the phone has not gone on where it was for some time.
    pub(super) fn place(&mut self, waiting: &Waiting, options: &AlignOptions, live: bool) -> Place {
        let (time, now) = (waiting.message.time_gps, waiting.arrived);
        self.heard = Some(now);
        let wait_s = options.maximum_wait.as_secs_f64();
        let most_s = self.step_s.map_or(0.0, |step_s| REGULAR * step_s).max(options.maximum_step_s);
        let follows = |latest: GpsTime| {
            let step_s = time - latest;
            step_s <= most_s && !(live && step_s < -wait_s)
        };
        if self.latest.is_some_and(follows) {
            return Place::Follows;
        }
        let goes_back = self.latest.is_some_and(|latest| time < latest);
        let goes_on = self.spoken.is_some_and(|(at, _)| now.saturating_sub(at) < options.maximum_wait);
        if goes_back && goes_on {
            return Place::Unknown;
        }
        let confirmed = self.confirmed_by(time, options);
        let Some(first) = confirmed.first().map(|first| first.message.time_gps) else {
            return Place::Unknown;
        };
        if goes_back {
            self.go_back_to(first);
        }
        Place::Confirms(confirmed)
    }

    /// Takes out what was held back and is believed by a message of `time`: the one that it follows closely, or those to
    /// which it is a further regular step.
    fn confirmed_by(&mut self, time: GpsTime, options: &AlignOptions) -> Vec<Waiting> {
        let near = |held: &Waiting| {
            let step_s = time - held.message.time_gps;
            step_s > 0.0 && step_s <= options.maximum_step_s
        };
        if let Some(position) = self.held.iter().position(near) {
            return vec![self.held.remove(position)];
        }
        let Some(last) = self.held.last().map(|last| last.message.time_gps) else { return Vec::new() };
        let before = self.held.len().checked_sub(2).and_then(|position| self.held.get(position));
        let before = before.map(|before| before.message.time_gps);
        let is_regular = |from: GpsTime| {
            let (first_s, second_s) = (last - from, time - last);
            first_s > 0.0 && second_s > 0.0 && second_s <= REGULAR * first_s && first_s <= REGULAR * second_s
        };
        if self.latest.is_some_and(is_regular) {
            return self.held.pop().into_iter().collect();
        }
        match before.filter(|before| is_regular(*before)) {
            Some(_) => self.held.split_off(self.held.len() - 2),
            None => Vec::new(),
        }
    }

    /// What waits of a later time than the phone is at now is not of it any more.
    fn go_back_to(&mut self, time: GpsTime) {
        while let Some(later) = self.queue.pop_back_if(|waiting| waiting.message.time_gps >= time) {
            self.skips.add(Reason::EpochWentBack, || describe(&later.message, Some(time), None));
        }
        self.latest = None;
        self.marks.clear();
    }

    /// Queues a message whose time is believed, or counts why not; `too_late`: what that is called of one whose time is fused already.
    pub(super) fn accept(
        &mut self,
        waiting: Waiting,
        options: &AlignOptions,
        done_to: Option<GpsTime>,
        too_late: Reason,
    ) -> Accepted {
        let (time, now) = (waiting.message.time_gps, waiting.arrived);
        if let Some(reason) = refusal(time, self.latest, options.simultaneous_s) {
            self.skips.add(reason, || describe(&waiting.message, self.latest, done_to));
            return Accepted::Refused;
        }
        let latest = self.latest.replace(time);
        self.step_s = latest.map(|latest| time - latest);
        self.spoken = Some((now, time));
        self.mark(now, time, options.maximum_wait);
        let is_doubtful = matches!(waiting.message.raim.verdict, Verdict::Unreliable(_));
        self.has_position = waiting.message.wls.is_some() && !is_doubtful;
        if done_to.is_some_and(|done_to| time < done_to) {
            self.skips.add(too_late, || describe(&waiting.message, latest, done_to));
            return Accepted::TooLate;
        }
        self.progress = Some(now);
        self.queue.push_back(waiting);
        self.drop_held();
        Accepted::Queued
    }

    /// Holds a message back until the next confirms it.
    pub(super) fn hold(&mut self, waiting: Waiting) {
        if self.held.iter().any(|held| held.message.time_gps == waiting.message.time_gps) {
            self.skips.add(Reason::EpochReceivedTwice, || describe(&waiting.message, self.latest, None));
            return;
        }
        if self.held.len() >= MAXIMUM_HELD {
            self.drop_held();
        }
        self.held.push(waiting);
    }

    pub(super) fn drop_held(&mut self) {
        for held in std::mem::take(&mut self.held) {
            self.skips.add(Reason::EpochFarFromNeighbours, || describe(&held.message, self.latest, None));
        }
    }

    fn mark(&mut self, now: Duration, time: GpsTime, window: Duration) {
        self.forget_marks(now, window);
        if self.marks.back().is_none_or(|(last, _)| now.saturating_sub(*last) >= window / MARKS) {
            self.marks.push_back((now, time));
        }
    }

    fn forget_marks(&mut self, now: Duration, window: Duration) {
        while self.marks.pop_front_if(|(at, _)| now.saturating_sub(*at) >= window).is_some() {}
    }

    /// How far its epochs have come within the last `window`, s.
    pub(super) fn advance_s(&mut self, now: Duration, window: Duration) -> f64 {
        self.forget_marks(now, window);
        match (self.marks.front(), self.spoken) {
            (Some((_, first)), Some((_, last))) => last - *first,
            _ => 0.0,
        }
    }

    /// How many times as fast as time its epochs come, as far as the last marks tell.
    pub(super) fn speed(&self) -> Option<f64> {
        let (first_at, first) = self.marks.front()?;
        let (last_at, last) = self.marks.back()?;
        let elapsed_s = last_at.saturating_sub(*first_at).as_secs_f64();
        (elapsed_s > 0.0).then(|| (*last - *first) / elapsed_s)
    }
}

/// Why a message cannot follow the one before it.
fn refusal(time: GpsTime, previous: Option<GpsTime>, simultaneous_s: f64) -> Option<Reason> {
    let previous = previous?;
    if time == previous {
        Some(Reason::EpochReceivedTwice)
    } else if time < previous {
        Some(Reason::EpochOutOfOrder)
    } else if time - previous <= simultaneous_s {
        Some(Reason::EpochTooSoon)
    } else {
        None
    }
}

fn describe(message: &EpochMessage, previous: Option<GpsTime>, done_to: Option<GpsTime>) -> String {
    let text = |time: Option<GpsTime>| time.map_or_else(|| "none".to_owned(), |time| time.to_string());
    format!(
        "sequence {} at {}; the phone's previous epoch {}, fused up to {}",
        message.sequence,
        message.time_gps,
        text(previous),
        text(done_to)
    )
}
