//! Messages of one phone before they enter buckets.

use std::collections::VecDeque;
use std::time::Duration;

use crate::integrity::Verdict;
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;
use crate::wire::EpochMessage;

use super::AlignOptions;

/// Maximum number of messages of a phone held back for confirmation.
const MAXIMUM_HELD: usize = 4;
/// Maximum ratio of successive steps that count as regular, as in a recording with one epoch every two hours.
const REGULAR_STEP_RATIO: f64 = 1.5;
/// Number of marks kept per [`AlignOptions::maximum_wait`].
const MARKS_PER_WAIT: u32 = 16;
/// Number of last steps by which the interval of a phone is measured.
const MAXIMUM_STEPS: usize = 8;
/// Minimum number of steps by which the interval of a phone is measured.
const FEWEST_STEPS: usize = 2;
/// Interval that is assumed of a phone without any step, for the minimum step to its second message, s.
const SHORTEST_INTERVAL_S: f64 = 0.01;

/// Whether buckets wait for a phone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Presence {
    /// Buckets wait for the phone.
    #[default]
    Running,
    /// The next bucket does not wait for the phone, because the message that waits came before its time; later ones do.
    Excused,
    /// Left behind or absent; its next message on time makes it running.
    Away,
    /// The phone delivers no more messages.
    Finished,
}

/// Date and arrival of a message with a confirmed date.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mark {
    /// Arrival by the caller's steady clock.
    pub(super) arrived: Duration,
    pub(super) time: GpsTime,
}

#[derive(Debug)]
pub(super) struct ReceivedEpoch {
    pub(super) message: EpochMessage,
    pub(super) arrived: Duration,
    /// Interval of the phone at this message, s; `None` before it is queued, or while it is not known.
    pub(super) interval_s: Option<f64>,
}

/// Relation of a message's date to the earlier messages of its phone.
pub(super) enum DateCheck {
    /// The date follows that of the previous message.
    Follows,
    /// The date confirms these held messages, in order of time.
    Confirms(Vec<ReceivedEpoch>),
    /// The date is far from all others and needs confirmation.
    Unconfirmed,
}

/// Result of queueing a message.
pub(super) enum Accepted {
    Queued,
    /// The time of the message is fused already.
    TooLate(Box<EpochMessage>),
    /// The message is not later than the previous one.
    Refused,
}

#[derive(Debug, Default)]
pub(super) struct Track {
    pub(super) queue: VecDeque<ReceivedEpoch>,
    /// Messages without a confirmed date, at most [`MAXIMUM_HELD`].
    pub(super) held: Vec<ReceivedEpoch>,
    pub(super) presence: Presence,
    /// Time of the last message with a confirmed date.
    pub(super) latest: Option<GpsTime>,
    /// Last steps between messages with a confirmed date up to `latest`, s, at most [`MAXIMUM_STEPS`].
    steps_s: VecDeque<f64>,
    /// Arrival of the last queued message.
    pub(super) last_queued: Option<Duration>,
    /// Last message with a confirmed date, even if it was too late; `None` after the agent left.
    pub(super) last_confirmed: Option<Mark>,
    /// Arrival of the last message of any kind.
    pub(super) last_arrival: Option<Duration>,
    marks: VecDeque<Mark>,
    /// Whether the last message has a position without a warning of the agent.
    pub(super) has_position: bool,
    /// Whether the phone is ahead of the group's time.
    pub(super) ahead: bool,
    /// Begin of `ahead`, by the caller's steady clock.
    pub(super) ahead_since: Duration,
    /// Whether the phone was left behind and has not been on time since.
    pub(super) left_behind: bool,
    pub(super) skips: Skips,
}

impl Track {
    pub(super) fn time(&self, position: usize) -> Option<GpsTime> {
        self.queue.get(position).map(|received| received.message.time_gps)
    }

    /// Whether the next bucket waits for the phone.
    pub(super) fn is_awaited(&self) -> bool {
        self.presence == Presence::Running && !self.ahead
    }

    /// Latest confirmed time; after the agent left, that of the waiting messages only.
    pub(super) fn newest(&self) -> Option<GpsTime> {
        let received = self.queue.back().map(|received| received.message.time_gps);
        received.max(self.last_confirmed.map(|mark| mark.time))
    }

    /// Checks the date of a message. In a live group a step backwards is accepted if no message with a confirmed date came within
    /// `maximum_wait`.
    pub(super) fn check_date(
        &mut self,
        received: &ReceivedEpoch,
        options: &AlignOptions,
        live: bool,
    ) -> DateCheck {
        let (time, now) = (received.message.time_gps, received.arrived);
        self.last_arrival = Some(now);
        let wait_s = options.maximum_wait.as_secs_f64();
        let most_s =
            self.steps_s.back().map_or(0.0, |step_s| REGULAR_STEP_RATIO * step_s).max(options.maximum_step_s);
        let follows = |latest: GpsTime| {
            let step_s = time - latest;
            step_s <= most_s && !(live && step_s < -wait_s)
        };
        if self.latest.is_some_and(follows) {
            return DateCheck::Follows;
        }
        let goes_back = self.latest.is_some_and(|latest| time < latest);
        let goes_on =
            self.last_confirmed.is_some_and(|mark| now.saturating_sub(mark.arrived) < options.maximum_wait);
        if goes_back && goes_on {
            return DateCheck::Unconfirmed;
        }
        let confirmed = self.confirmed_by(time, options);
        let Some(first) = confirmed.first().map(|first| first.message.time_gps) else {
            return DateCheck::Unconfirmed;
        };
        if goes_back {
            self.rewind_to(first);
        }
        DateCheck::Confirms(confirmed)
    }

    /// Removes and returns the held messages confirmed by a message of `time`: the message that it follows closely, or those that make
    /// regular steps with it.
    fn confirmed_by(&mut self, time: GpsTime, options: &AlignOptions) -> Vec<ReceivedEpoch> {
        let near = |held: &ReceivedEpoch| {
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
            first_s > 0.0
                && second_s > 0.0
                && second_s <= REGULAR_STEP_RATIO * first_s
                && first_s <= REGULAR_STEP_RATIO * second_s
        };
        if self.latest.is_some_and(is_regular) {
            return self.held.pop().into_iter().collect();
        }
        match before.filter(|before| is_regular(*before)) {
            Some(_) => self.held.split_off(self.held.len() - 2),
            None => Vec::new(),
        }
    }

    /// Drops waiting messages from `time` on, after a step backwards of the phone.
    fn rewind_to(&mut self, time: GpsTime) {
        while let Some(later) = self.queue.pop_back_if(|received| received.message.time_gps >= time) {
            self.skips.add(Reason::EpochWentBack, || describe(&later.message, Some(time), None));
        }
        self.latest = None;
        self.marks.clear();
    }

    /// Queues a message with a confirmed date or counts the reason against it; `too_late` is the reason if its time is fused already.
    pub(super) fn accept(
        &mut self,
        mut received: ReceivedEpoch,
        options: &AlignOptions,
        fused_to_gps: Option<GpsTime>,
        too_late: Reason,
    ) -> Accepted {
        let (time, now) = (received.message.time_gps, received.arrived);
        let too_soon_s =
            options.simultaneous_within_s(lower_quartile(&self.steps_s).unwrap_or(SHORTEST_INTERVAL_S));
        if let Some(reason) = refusal(time, self.latest, too_soon_s) {
            self.skips.add(reason, || describe(&received.message, self.latest, fused_to_gps));
            return Accepted::Refused;
        }
        let latest = self.latest.replace(time);
        self.count_step(latest.map(|latest| time - latest));
        received.interval_s = self.interval_s();
        let mark = Mark { arrived: now, time };
        self.last_confirmed = Some(mark);
        self.remember(mark, options.maximum_wait);
        let is_doubtful = matches!(received.message.raim.verdict, Verdict::Unreliable(_));
        self.has_position = received.message.wls.is_some() && !is_doubtful;
        if fused_to_gps.is_some_and(|fused_to_gps| time < fused_to_gps) {
            self.skips.add(too_late, || describe(&received.message, latest, fused_to_gps));
            return Accepted::TooLate(Box::new(received.message));
        }
        self.last_queued = Some(now);
        self.queue.push_back(received);
        self.drop_held();
        Accepted::Queued
    }

    /// Interval between messages, s, by the last steps; `None` before the second step.
    pub(super) fn interval_s(&self) -> Option<f64> {
        let is_known = self.steps_s.len() >= FEWEST_STEPS;
        lower_quartile(&self.steps_s).filter(|_| is_known).map(with_two_digits)
    }

    /// Remembers a step; `None` after a step backwards, with which the phone starts anew.
    fn count_step(&mut self, step_s: Option<f64>) {
        if step_s.is_none() {
            self.steps_s.clear();
        }
        self.steps_s.extend(step_s);
        if self.steps_s.len() > MAXIMUM_STEPS {
            self.steps_s.pop_front();
        }
    }

    /// Holds a message back until the next one confirms its date.
    pub(super) fn hold(&mut self, received: ReceivedEpoch) {
        if self.held.iter().any(|held| held.message.time_gps == received.message.time_gps) {
            self.skips.add(Reason::EpochReceivedTwice, || describe(&received.message, self.latest, None));
            return;
        }
        if self.held.len() >= MAXIMUM_HELD {
            self.drop_held();
        }
        self.held.push(received);
    }

    pub(super) fn drop_held(&mut self) {
        for held in std::mem::take(&mut self.held) {
            self.skips.add(Reason::EpochFarFromNeighbours, || describe(&held.message, self.latest, None));
        }
    }

    fn remember(&mut self, mark: Mark, window: Duration) {
        let now = mark.arrived;
        self.forget_marks(now, window);
        if self.marks.back().is_none_or(|last| now.saturating_sub(last.arrived) >= window / MARKS_PER_WAIT) {
            self.marks.push_back(mark);
        }
    }

    fn forget_marks(&mut self, now: Duration, window: Duration) {
        while self.marks.pop_front_if(|mark| now.saturating_sub(mark.arrived) >= window).is_some() {}
    }

    /// Advance of the epoch time within the last `window`, s.
    pub(super) fn advance_s(&mut self, now: Duration, window: Duration) -> f64 {
        self.forget_marks(now, window);
        match (self.marks.front(), self.last_confirmed) {
            (Some(first), Some(last)) => last.time - first.time,
            _ => 0.0,
        }
    }

    /// Speed of the phone, epoch time per wall time, from the remembered marks.
    pub(super) fn speed(&self) -> Option<f64> {
        let (first, last) = (self.marks.front()?, self.marks.back()?);
        let elapsed_s = last.arrived.saturating_sub(first.arrived).as_secs_f64();
        (elapsed_s > 0.0).then(|| (last.time - first.time) / elapsed_s)
    }
}

/// The value that a quarter of the steps is shorter than.
fn lower_quartile(steps_s: &VecDeque<f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = steps_s.iter().copied().collect();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get(sorted.len() / 4).copied()
}

/// A positive value rounded to two significant digits.
fn with_two_digits(value: f64) -> f64 {
    let unit = 10.0_f64.powf(value.log10().floor() - 1.0);
    (value / unit).round() * unit
}

/// Reason for which a message cannot follow the previous one.
fn refusal(time: GpsTime, previous: Option<GpsTime>, too_soon_s: f64) -> Option<Reason> {
    let previous = previous?;
    if time == previous {
        Some(Reason::EpochReceivedTwice)
    } else if time < previous {
        Some(Reason::EpochOutOfOrder)
    } else if time - previous <= too_soon_s {
        Some(Reason::EpochTooSoon)
    } else {
        None
    }
}

fn describe(message: &EpochMessage, previous: Option<GpsTime>, fused_to_gps: Option<GpsTime>) -> String {
    let text = |time: Option<GpsTime>| time.map_or_else(|| "none".to_owned(), |time| time.to_string());
    format!(
        "sequence {} at {}; the phone's previous epoch {}, fused up to {}",
        message.sequence,
        message.time_gps,
        text(previous),
        text(fused_to_gps)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn interval_s(steps_s: &[f64]) -> Option<f64> {
        let mut track = Track::default();
        for step_s in steps_s {
            track.count_step(Some(*step_s));
        }
        track.interval_s()
    }

    #[test]
    fn intervals_are_those_of_most_steps_and_rounded() {
        assert_eq!((interval_s(&[]), interval_s(&[1.0])), (None, None));
        for (steps_s, expected_s) in [
            (&[1.001, 0.999][..], 1.0),
            (&[7.0, 1.0, 4.0], 1.0),
            (&[5.001, 5.0, 15.0, 5.003, 0.2, 10.0, 5.002], 5.0),
            (&[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 30.0, 30.0, 29.998, 30.002, 30.001, 30.0], 30.0),
            (&[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.1, 0.101, 0.099], 0.1),
            (&[0.0099, 0.0101, 0.01, 0.01], 0.01),
        ] {
            assert_eq!(interval_s(steps_s), Some(expected_s), "{steps_s:?}");
        }
    }

    #[test]
    fn after_a_step_backwards_the_interval_is_measured_anew() {
        let mut track = Track::default();
        for step_s in [Some(1.0), Some(1.0), Some(1.0), None, Some(1.0)] {
            track.count_step(step_s);
        }
        assert_eq!(track.interval_s(), None);
    }
}
