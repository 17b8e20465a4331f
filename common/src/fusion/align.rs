//! Alignment of the epochs of several phones by GPS time. No I/O, no clock of its own.
//!
//! Receive times of different phones differ by less than a millisecond to half an interval. Phones start and stop at different seconds and may
//! have different rates. Messages of one phone are in order; messages of different phones arrive in any order.
//!
//! **Rule.** The earliest waiting message is the anchor of a bucket. The earliest messages of the other phones join it in order of time
//! while each, for every earlier member,
//! - lies within the tolerance of it (half of the longer interval of the two phones), and
//! - is simultaneous with it (20 ms, or a quarter of the shorter interval if that is less) or not nearer to the next message of that
//!   member's phone.
//!
//! The first message that does not join ends the bucket. Remaining messages are therefore never earlier than a member, and the latest times
//! of successive buckets never decrease. A bucket is complete when the rule can be decided: every running phone has a message waiting, and
//! a second one where the rule needs it. The decision depends on the messages alone, not on their arrival times.
//!
//! **Intervals.** The interval of a phone at one of its messages is the lower quartile of its last eight steps up to that message, rounded
//! to two significant digits: a quarter of the steps may be too short and more than half may be gaps, and the jitter of time tags does not
//! change it. A phone with less than two steps counts as one of 1 Hz. The interval follows from the messages of the phone alone, so that
//! the decision does too. A fixed tolerance ([`AlignOptions::tolerance_s`]) replaces that by intervals.
//!
//! Three or more phones with epochs spread over more than the tolerance fall into alternating buckets; all messages are used nevertheless.
//!
//! **Wrong dates.** One message with a wrong date must not make all later messages look like steps backwards. The first message of a phone,
//! and every message far from the previous one, is held back until the next message of the phone confirms it: by following closely, or by
//! continuing regular steps (three epochs two hours apart). A message without confirmation is dropped. In a live group the first message is
//! accepted at once if its time is near that of another phone.
//!
//! **Live groups.** Phones start late, lag, fall silent, or send epochs of another time. With W = [`AlignOptions::maximum_wait`] and
//! frequent calls of [`Aligner::go_on`]:
//!
//! - **No message waits for a phone longer than W after its arrival.** After W the missing phones are left behind: the group does not wait
//!   for them until they are on time again, and their messages for times already fused are counted and dropped. A phone that is on time by
//!   the hub's clock is not left behind for a message that came before its time: that message is fused without it.
//! - Two kinds of messages are not a current position and may wait longer: messages of a finished phone, and messages of a phone that
//!   delivered more than [`UNPACED_SPEED`] · W of epochs within the last W (a recording read at full speed, or a history being fetched).
//!   They wait as long as each missing phone delivers a fusable message at least every W.
//! - A message is fusable if its time is not fused yet and its date is confirmed. The presence of an agent or a pending history request
//!   does not count.
//! - A phone is on time again when one of its messages is fusable, or arrives at most W after the other phones' messages of that time.
//!
//! **Time of the group.** A lagging phone may have a slow link, or it may be right while the phones waiting for it have a clock that is
//! ahead. Before a phone that still sends and does not fall behind further is left behind, the support of the two times is compared
//! (`Support`): first agreement of a phone with the hub's clock within W, then the number of phones with a position, then the number of
//! phones, last the smaller difference to the hub's clock. Phones at the time with less support are *ahead*: their messages wait until the
//! group reaches that time, and the group does not wait for these phones. If an earlier time gains more support later, the group returns to
//! it ([`Aligner::went_back`]), so that no phone can exclude the others permanently.

mod live;
mod track;

use std::collections::VecDeque;
use std::time::Duration;

use crate::skips::{Reason, Skips};
use crate::time::GpsTime;
use crate::wire::EpochMessage;

use live::{Clock, FusedBucket};
pub use live::{Notice, NoticeKind};
use track::{Accepted, DateCheck, Presence, ReceivedEpoch, Track};

/// Interval of a phone whose interval is not known yet, s.
const UNKNOWN_INTERVAL_S: f64 = 1.0;
/// Maximum difference of simultaneous messages as a part of the interval.
const SIMULTANEOUS_SHARE: f64 = 0.25;
/// Live: maximum number of waiting messages per phone; some hours at 1 Hz, some hundred megabytes.
const MAXIMUM_WAITING: usize = 20_000;
/// Live: speed (epoch time per wall time) above which a phone counts as unpaced, i.e. as sending faster than it measures.
pub const UNPACED_SPEED: f64 = 100.0;

/// Reasons for dropping epochs that an agent published and no other phone replaced.
pub const LOSSES: [Reason; 3] = [Reason::EpochTooLate, Reason::EpochWentBack, Reason::TooManyEpochsWait];
/// Epochs of one bucket, indexed by phone; `None` for a phone without an epoch.
pub type Bucket = Vec<Option<EpochMessage>>;

/// Options of the alignment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignOptions {
    /// Maximum difference of the messages of one bucket, s; `None`: half of the longer interval of each two phones.
    pub tolerance_s: Option<f64>,
    /// Maximum difference of simultaneous messages, s, and never more than a quarter of the shorter interval of the two phones. Two
    /// messages of one phone must be further apart than this and than a quarter of its interval, whichever is less.
    pub simultaneous_s: f64,
    /// Maximum step between messages of one phone, s; a message after a longer step needs confirmation by the next one, unless the steps
    /// are regular.
    pub maximum_step_s: f64,
    /// Live: maximum time that a message waits for other phones after its arrival.
    pub maximum_wait: Duration,
}

impl Default for AlignOptions {
    fn default() -> Self {
        Self {
            tolerance_s: None,
            simultaneous_s: 0.02,
            maximum_step_s: 300.0,
            maximum_wait: Duration::from_secs(5),
        }
    }
}

impl AlignOptions {
    /// Maximum difference of simultaneous messages at an interval, s.
    fn simultaneous_within_s(&self, interval_s: f64) -> f64 {
        self.simultaneous_s.min(SIMULTANEOUS_SHARE * interval_s)
    }
}

/// Aligner of the epochs of a group.
#[derive(Debug)]
pub struct Aligner {
    tracks: Vec<Track>,
    options: AlignOptions,
    /// Latest time of all buckets given out.
    fused_to_gps: Option<GpsTime>,
    live: bool,
    clock: Clock,
    /// Live: buckets given out whose first message arrived within the last `maximum_wait`.
    fused: VecDeque<FusedBucket>,
    /// Latest time of the buckets removed from `fused`.
    fused_before_gps: Option<GpsTime>,
    /// Notices for the user since the last call of [`Aligner::notices`].
    notices: Vec<Notice>,
    /// Messages whose time was fused already, since the last call of [`Aligner::take_late`].
    late: Vec<(usize, EpochMessage)>,
    went_back: bool,
}

/// Decision on whether a message joins a bucket.
enum Decision {
    Join,
    End,
    /// Undecided before the next message of this phone.
    Wait(usize),
}

/// State of the next bucket.
enum Next {
    Nothing,
    /// Complete, with these phones.
    Bucket(Vec<usize>),
    /// Undecided before a message of one of these phones.
    Blocked(Vec<usize>),
}

impl Aligner {
    /// An aligner for `phones` phones that all deliver: buckets wait for each phone until [`Aligner::finish`].
    pub fn new(phones: usize, options: AlignOptions) -> Self {
        Self {
            tracks: (0..phones).map(|_| Track::default()).collect(),
            options,
            fused_to_gps: None,
            live: false,
            clock: Clock::default(),
            fused: VecDeque::new(),
            fused_before_gps: None,
            notices: Vec::new(),
            late: Vec::new(),
            went_back: false,
        }
    }

    /// An aligner for `phones` phones that come and go; [`Aligner::go_on`] must be called often.
    pub fn live(phones: usize, options: AlignOptions) -> Self {
        Self { live: true, ..Self::new(phones, options) }
    }

    /// Takes a message of the phone with index `phone`, received at `now` by any steady clock. A message that is not later than
    /// the previous message of the phone, or earlier than a bucket given out already, is counted and dropped.
    pub fn push(&mut self, phone: usize, message: EpochMessage, now: Duration) {
        let (options, live) = (self.options, self.live);
        let is_new = self.tracks.get(phone).is_some_and(|track| track.latest.is_none());
        let confirmed_by_others = live && is_new && self.is_confirmed_by_others(phone, message.time_gps);
        let Some(track) = self.tracks.get_mut(phone) else { return };
        if live && track.queue.len() >= MAXIMUM_WAITING {
            track.skips.add(Reason::TooManyEpochsWait, || {
                format!("sequence {} at {}; {MAXIMUM_WAITING} wait", message.sequence, message.time_gps)
            });
            return;
        }
        let waiting = ReceivedEpoch { message, arrived: now, interval_s: None };
        match track.check_date(&waiting, &options, live) {
            DateCheck::Follows => self.accept(phone, waiting),
            DateCheck::Unconfirmed if confirmed_by_others => self.accept_first(phone, waiting),
            DateCheck::Confirms(confirmed) => {
                for held in confirmed {
                    self.accept_first(phone, held);
                }
                self.accept(phone, waiting);
            }
            DateCheck::Unconfirmed => {
                let time = waiting.message.time_gps;
                track.hold(waiting);
                // The date is not confirmed yet, but the phone is present.
                if live && self.is_near(time) {
                    self.mark_running(phone);
                }
            }
        }
    }

    /// Declares that the phone delivers no more messages; its waiting messages still count.
    pub fn finish(&mut self, phone: usize) {
        let Some(track) = self.tracks.get_mut(phone) else { return };
        // If all messages of a phone are still held back, no other message contradicts their dates.
        let only = if track.latest.is_none() { std::mem::take(&mut track.held) } else { Vec::new() };
        track.drop_held();
        for held in only {
            self.accept(phone, held);
        }
        if let Some(track) = self.tracks.get_mut(phone) {
            track.presence = Presence::Finished;
        }
    }

    /// Declares the phone absent: buckets do not wait for it until its next message.
    pub fn leave(&mut self, phone: usize) {
        if let Some(track) = self.tracks.get_mut(phone) {
            track.presence = Presence::Away;
            track.last_confirmed = None;
        }
    }

    /// The next bucket, if it is complete.
    pub fn pop_ready(&mut self) -> Option<Bucket> {
        match self.next() {
            Next::Bucket(members) => Some(self.take(&members)),
            Next::Nothing | Next::Blocked(_) => None,
        }
    }

    /// The messages, with their phones, that came after their time was fused, since the last call. They are counted as dropped.
    pub fn take_late(&mut self) -> Vec<(usize, EpochMessage)> {
        std::mem::take(&mut self.late)
    }

    /// Counts of dropped messages of a phone by reason.
    pub fn skips(&self, phone: usize) -> Option<&Skips> {
        self.tracks.get(phone).map(|track| &track.skips)
    }

    /// Whether the group waits for the phone.
    pub fn awaits(&self, phone: usize) -> bool {
        let is_awaited = |track: &Track| track.is_awaited() || track.presence == Presence::Excused;
        self.tracks.get(phone).is_some_and(is_awaited)
    }

    /// Maximum waiting time of a message.
    pub const fn maximum_wait(&self) -> Duration {
        self.options.maximum_wait
    }

    /// Number of waiting messages.
    pub fn waiting(&self) -> usize {
        self.tracks.iter().map(|track| track.queue.len() + track.held.len()).sum()
    }

    /// Queues a message with a confirmed date, unless its time is fused already.
    fn accept(&mut self, phone: usize, waiting: ReceivedEpoch) {
        self.accept_or(phone, waiting, Reason::EpochTooLate);
    }

    /// Queues a first or held message; if it is too late but near the group's time, it is counted as [`Reason::FirstEpochOfPhone`].
    fn accept_first(&mut self, phone: usize, first: ReceivedEpoch) {
        let is_near = self.live && self.is_near(first.message.time_gps);
        self.accept_or(phone, first, if is_near { Reason::FirstEpochOfPhone } else { Reason::EpochTooLate });
    }

    fn accept_or(&mut self, phone: usize, waiting: ReceivedEpoch, too_late: Reason) {
        let (options, fused_to_gps) = (self.options, self.fused_to_gps);
        let (time, now) = (waiting.message.time_gps, waiting.arrived);
        let Some(track) = self.tracks.get_mut(phone) else { return };
        match track.accept(waiting, &options, fused_to_gps, too_late) {
            Accepted::Queued => self.mark_running(phone),
            Accepted::TooLate(message) => {
                self.late.push((phone, *message));
                if self.live && self.is_in_time(time, now) {
                    self.mark_running(phone);
                }
            }
            Accepted::Refused => {}
        }
    }

    fn next(&self) -> Next {
        let absent = |(_, track): &(usize, &Track)| track.is_awaited() && track.queue.is_empty();
        let absent: Vec<usize> =
            self.tracks.iter().enumerate().filter(absent).map(|(phone, _)| phone).collect();
        if absent.is_empty() { self.members() } else { Next::Blocked(absent) }
    }

    /// The earliest message of each phone that has one, by time and then by phone.
    fn heads(&self) -> Vec<(GpsTime, usize)> {
        let limit = self.limit_for_phones_ahead();
        let head = |(phone, track): (usize, &Track)| {
            let time = track.time(0)?;
            (!track.ahead || limit.is_none_or(|limit| time <= limit)).then_some((time, phone))
        };
        let mut heads: Vec<_> = self.tracks.iter().enumerate().filter_map(head).collect();
        heads.sort_unstable();
        heads
    }

    /// The phones of the next bucket, if the rule can be decided.
    fn members(&self) -> Next {
        let heads = self.heads();
        let Some((&anchor, others)) = heads.split_first() else { return Next::Nothing };
        let mut members = vec![anchor];
        for &(time, phone) in others {
            match self.joins((time, phone), &members) {
                Decision::Join => members.push((time, phone)),
                Decision::End => break,
                Decision::Wait(phone) => return Next::Blocked(vec![phone]),
            }
        }
        Next::Bucket(members.into_iter().map(|(_, phone)| phone).collect())
    }

    fn joins(&self, (time, candidate): (GpsTime, usize), members: &[(GpsTime, usize)]) -> Decision {
        let is_far = |&(member, phone): &(GpsTime, usize)| time - member > self.tolerance_s(phone, candidate);
        if members.iter().any(is_far) {
            return Decision::End;
        }
        for &(member, phone) in members {
            let after_s = time - member;
            if after_s <= self.simultaneous_s(phone, candidate) {
                continue;
            }
            let Some(track) = self.tracks.get(phone) else { continue };
            match track.time(1) {
                Some(next) if next - time < after_s => return Decision::End,
                None if track.is_awaited() => return Decision::Wait(phone),
                _ => {}
            }
        }
        Decision::Join
    }

    /// Maximum difference of the first waiting messages of two phones in one bucket, s.
    fn tolerance_s(&self, one: usize, other: usize) -> f64 {
        let longer_s = || self.interval_s(one).max(self.interval_s(other));
        self.options.tolerance_s.unwrap_or_else(|| 0.5 * longer_s())
    }

    /// Maximum difference of the first waiting messages of two phones that are simultaneous, s.
    fn simultaneous_s(&self, one: usize, other: usize) -> f64 {
        self.options.simultaneous_within_s(self.interval_s(one).min(self.interval_s(other)))
    }

    /// Interval of a phone at its first waiting message, s.
    fn interval_s(&self, phone: usize) -> f64 {
        let first = self.tracks.get(phone).and_then(|track| track.queue.front());
        first.and_then(|first| first.interval_s).unwrap_or(UNKNOWN_INTERVAL_S)
    }

    fn take(&mut self, members: &[usize]) -> Bucket {
        let mut bucket: Bucket = self.tracks.iter().map(|_| None).collect();
        let mut arrived: Option<Duration> = None;
        for &phone in members {
            let message = self.tracks.get_mut(phone).and_then(|track| track.queue.pop_front());
            if let (Some(waiting), Some(slot)) = (message, bucket.get_mut(phone)) {
                self.fused_to_gps = self.fused_to_gps.max(Some(waiting.message.time_gps));
                arrived = Some(arrived.map_or(waiting.arrived, |first| first.min(waiting.arrived)));
                *slot = Some(waiting.message);
            }
        }
        for excused in self.tracks.iter_mut().filter(|track| track.presence == Presence::Excused) {
            excused.presence = Presence::Running;
        }
        if let (true, Some(time), Some(arrived)) = (self.live, self.fused_to_gps, arrived) {
            self.fused.push_back(FusedBucket { time, arrived });
        }
        bucket
    }
}

#[cfg(test)]
mod live_tests;
#[cfg(test)]
mod tests;
