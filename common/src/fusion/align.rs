//! Epochs of several phones brought together by GPS time. No I/O, no clock of its own.
//!
//! Phones' epochs are sub-millisecond to half a second apart, start and stop at different seconds and may come at
//! different rates. The messages of each phone are in order; those of different phones arrive in any interleaving.
//!
//! **Rule.** The earliest waiting message is the anchor of a bucket. The other phones' earliest messages, in order of
//! time, join it while each
//! - lies within the tolerance (half an epoch interval) of the anchor, and
//! - for every member from before it, is simultaneous (20 ms) with it or not nearer to that phone's next message.
//!
//! The first that does not join ends the bucket, so that nothing left behind is earlier than any member: the latest times of
//! the buckets never decrease. A bucket is complete when the rule can be decided, that is, when every phone that still runs has
//! a message waiting, and a next one where the rule asks for it. What is decided thus depends on the messages
//! alone and never on when they arrived.
//!
//! Three or more phones whose epochs are spread over more than the tolerance fall into alternating buckets; all messages are
//! used even so.
//!
//! **Absurd times.** One message with a wrong date must not turn all later ones into steps backwards. A phone's first message, and one
//! that is far from the one before it, is held back until the phone's next message follows closely, or is one more of regular steps
//! (three epochs two hours apart), and is dropped when that does not. Live, the first is believed at once when it is of the time of another phone.
//!
//! **Live.** Phones come late, lag, fall silent, or send epochs of another time. With W = [`AlignOptions::maximum_wait`] and
//! [`Aligner::go_on`] called often:
//!
//! - **No message waits for a phone longer than W after its arrival.** Then the phones that it waits for are left behind: nobody waits for
//!   them until they are on time again, and what they send of a time that is fused already is counted and dropped.
//! - Two kinds of messages are nobody's live position and may wait longer: those of a phone that has finished, and those of one that
//!   delivered, within the last W, more than [`UNPACED`] · W of epochs (a recording read as fast as it goes, a history being fetched).
//!   They wait as long as each phone before them delivers something that can be fused at least every W.
//! - Only a message that can be fused counts: not one of a time that is fused already, not one whose date is not believed, and not that
//!   an agent is there or that its history is being asked for.
//! - A phone is on time again when one of its messages can be fused, or comes at most W after the others' of its time.
//!
//! **Which time is the group's.** A phone may lag because its link is slow, or be right while those that wait for it are ahead of time.
//! Where a phone that speaks is to be left behind, and does not fall behind further, the two times are weighed (`weight`): first by the hub's own
//! clock, when one of them agrees with it within W; then by the number of phones with a position, of phones at all, and last by which is nearer
//! to the hub's clock. The phones of a time that is too light are *ahead*: their messages wait until the group has
//! come so far, and nobody waits for them. When those who made the group's time are outweighed later, it goes back
//! ([`Aligner::went_back`]): no phone can lock the others out for good.

mod live;
mod track;

use std::collections::VecDeque;
use std::time::Duration;

use crate::skips::{Reason, Skips};
use crate::time::GpsTime;
use crate::wire::EpochMessage;

use live::{Clock, Given};
pub use live::{Notice, NoticeKind};
use track::{Accepted, Place, Presence, Track, Waiting};

/// Live: most messages of a phone that wait for the others; at 1 Hz some hours and some hundred megabytes.
const MAXIMUM_WAITING: usize = 20_000;
/// Live: speed (epoch time per wall time) above which a phone counts as not paced by any clock.
pub const UNPACED: f64 = 100.0;

/// Why the aligner drops epochs that an agent published and nobody else gave.
pub const LOSSES: [Reason; 3] = [Reason::EpochTooLate, Reason::EpochWentBack, Reason::TooManyEpochsWait];
/// Epochs of one bucket, by phone; `None` where a phone has none.
pub type Bucket = Vec<Option<EpochMessage>>;

/// How epochs are brought together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignOptions {
    /// Largest distance from a bucket's anchor, s: half of the slowest phone's epoch interval.
    pub tolerance_s: f64,
    /// Messages this close count as simultaneous, s. Two messages of one phone must be further apart.
    pub simultaneous_s: f64,
    /// A message further ahead of the phone's previous one must be confirmed by the next, s, unless the steps are regular.
    pub maximum_step_s: f64,
    /// Live: so long a message waits for other phones, from its arrival on.
    pub maximum_wait: Duration,
}

impl Default for AlignOptions {
    fn default() -> Self {
        Self {
            tolerance_s: 0.5,
            simultaneous_s: 0.02,
            maximum_step_s: 300.0,
            maximum_wait: Duration::from_secs(5),
        }
    }
}

/// Brings the epochs of a group together.
#[derive(Debug)]
pub struct Aligner {
    tracks: Vec<Track>,
    options: AlignOptions,
    /// The latest time in any bucket so far.
    done_to: Option<GpsTime>,
    live: bool,
    clock: Clock,
    /// Live: what was given out of the last messages that arrived.
    given: VecDeque<Given>,
    /// The latest time given out before those.
    given_before: Option<GpsTime>,
    /// What people should know.
    notices: Vec<Notice>,
    went_back: bool,
}

/// Whether the rule can be decided yet.
enum Decision {
    Join,
    End,
    /// Not without the next message of this phone.
    Wait(usize),
}

/// What comes next.
enum Next {
    Nothing,
    /// The phones of the next bucket.
    Bucket(Vec<usize>),
    /// Not decided without a message of one of these.
    Blocked(Vec<usize>),
}

impl Aligner {
    /// For `phones` phones, all of which will deliver: buckets wait for each until [`Aligner::finish`].
    pub fn new(phones: usize, options: AlignOptions) -> Self {
        Self {
            tracks: (0..phones).map(|_| Track::default()).collect(),
            options,
            done_to: None,
            live: false,
            clock: Clock::default(),
            given: VecDeque::new(),
            given_before: None,
            notices: Vec::new(),
            went_back: false,
        }
    }

    /// For `phones` phones that come and go: call [`Aligner::go_on`] often.
    pub fn live(phones: usize, options: AlignOptions) -> Self {
        Self { live: true, ..Self::new(phones, options) }
    }

    /// Takes a message of the phone with index `phone`, received at `now` by any steady clock. A message that is not later than
    /// the phone's previous one, or than a bucket already given out, is counted and dropped.
    pub fn push(&mut self, phone: usize, message: EpochMessage, now: Duration) {
        let (options, live) = (self.options, self.live);
        let is_new = self.tracks.get(phone).is_some_and(|track| track.latest.is_none());
        let vouched = live && is_new && self.others_vouch_for(phone, message.time_gps);
        let Some(track) = self.tracks.get_mut(phone) else { return };
        if live && track.queue.len() >= MAXIMUM_WAITING {
            track.skips.add(Reason::TooManyEpochsWait, || {
                format!("sequence {} at {}; {MAXIMUM_WAITING} wait", message.sequence, message.time_gps)
            });
            return;
        }
        let waiting = Waiting { message, arrived: now };
        match track.place(&waiting, &options, live) {
            Place::Follows => self.accept(phone, waiting),
            Place::Unknown if vouched => self.join(phone, waiting),
            Place::Confirms(confirmed) => {
                for held in confirmed {
                    self.join(phone, held);
                }
                self.accept(phone, waiting);
            }
            Place::Unknown => {
                let time = waiting.message.time_gps;
                track.hold(waiting);
                // Its time is not believed yet, but the phone is there.
                if live && self.is_near(time) {
                    self.run(phone);
                }
            }
        }
    }

    /// The phone will deliver nothing more; what it has delivered still counts.
    pub fn finish(&mut self, phone: usize) {
        let Some(track) = self.tracks.get_mut(phone) else { return };
        // The only messages of a phone have nothing to contradict them.
        let only = if track.latest.is_none() { std::mem::take(&mut track.held) } else { Vec::new() };
        track.drop_held();
        for held in only {
            self.accept(phone, held);
        }
        if let Some(track) = self.tracks.get_mut(phone) {
            track.presence = Presence::Finished;
        }
    }

    /// The phone is gone for now: buckets do not wait for it until its next message.
    pub fn leave(&mut self, phone: usize) {
        if let Some(track) = self.tracks.get_mut(phone) {
            track.presence = Presence::Away;
            track.spoken = None;
        }
    }

    /// The next bucket, if it is complete.
    pub fn pop_ready(&mut self) -> Option<Bucket> {
        match self.next() {
            Next::Bucket(members) => Some(self.take(&members)),
            Next::Nothing | Next::Blocked(_) => None,
        }
    }

    /// What was dropped of a phone's messages.
    pub fn skips(&self, phone: usize) -> Option<&Skips> {
        self.tracks.get(phone).map(|track| &track.skips)
    }

    /// Whether the group waits for the phone.
    pub fn awaits(&self, phone: usize) -> bool {
        self.tracks.get(phone).is_some_and(|track| track.presence == Presence::Running && !track.ahead)
    }

    /// How long a message may wait.
    pub const fn maximum_wait(&self) -> Duration {
        self.options.maximum_wait
    }

    /// How many messages wait.
    pub fn waiting(&self) -> usize {
        self.tracks.iter().map(|track| track.queue.len() + track.held.len()).sum()
    }

    /// Queues a message, unless it is too early.
    fn accept(&mut self, phone: usize, waiting: Waiting) {
        self.accept_or(phone, waiting, Reason::EpochTooLate);
    }

    /// The same with the first message of a phone, which nobody could wait for.
    fn join(&mut self, phone: usize, first: Waiting) {
        let is_near = self.live && self.is_near(first.message.time_gps);
        self.accept_or(phone, first, if is_near { Reason::FirstEpochOfPhone } else { Reason::EpochTooLate });
    }

    fn accept_or(&mut self, phone: usize, waiting: Waiting, too_late: Reason) {
        let (options, done_to) = (self.options, self.done_to);
        let (time, now) = (waiting.message.time_gps, waiting.arrived);
        let Some(track) = self.tracks.get_mut(phone) else { return };
        match track.accept(waiting, &options, done_to, too_late) {
            Accepted::Queued => self.run(phone),
            Accepted::TooLate if self.live && self.is_in_time(time, now) => self.run(phone),
            Accepted::TooLate | Accepted::Refused => {}
        }
    }

    fn next(&self) -> Next {
        let absent = |(_, track): &(usize, &Track)| {
            track.presence == Presence::Running && track.queue.is_empty() && !track.ahead
        };
        let absent: Vec<usize> =
            self.tracks.iter().enumerate().filter(absent).map(|(phone, _)| phone).collect();
        if absent.is_empty() { self.members() } else { Next::Blocked(absent) }
    }

    /// The earliest message of each phone that has one, in order of time, phones in order at one time.
    fn heads(&self) -> Vec<(GpsTime, usize)> {
        let limit = self.limit_of_those_ahead();
        let head = |(phone, track): (usize, &Track)| {
            let time = track.time(0)?;
            (!track.ahead || limit.is_none_or(|limit| time <= limit)).then_some((time, phone))
        };
        let mut heads: Vec<_> = self.tracks.iter().enumerate().filter_map(head).collect();
        heads.sort_unstable();
        heads
    }

    /// The phones of the next bucket, when the rule can be decided.
    fn members(&self) -> Next {
        let heads = self.heads();
        let Some((&(anchor, first), others)) = heads.split_first() else { return Next::Nothing };
        let mut members = vec![(anchor, first)];
        for &(time, phone) in others {
            if time - anchor > self.options.tolerance_s {
                break;
            }
            match self.joins(time, &members) {
                Decision::Join => members.push((time, phone)),
                Decision::End => break,
                Decision::Wait(phone) => return Next::Blocked(vec![phone]),
            }
        }
        Next::Bucket(members.into_iter().map(|(_, phone)| phone).collect())
    }

    fn joins(&self, time: GpsTime, members: &[(GpsTime, usize)]) -> Decision {
        for &(member, phone) in members {
            let after_s = time - member;
            if after_s <= self.options.simultaneous_s {
                continue;
            }
            let Some(track) = self.tracks.get(phone) else { continue };
            match track.time(1) {
                Some(next) if next - time < after_s => return Decision::End,
                None if track.presence == Presence::Running && !track.ahead => return Decision::Wait(phone),
                _ => {}
            }
        }
        Decision::Join
    }

    fn take(&mut self, members: &[usize]) -> Bucket {
        let mut bucket: Bucket = self.tracks.iter().map(|_| None).collect();
        let mut arrived: Option<Duration> = None;
        for &phone in members {
            let message = self.tracks.get_mut(phone).and_then(|track| track.queue.pop_front());
            if let (Some(waiting), Some(slot)) = (message, bucket.get_mut(phone)) {
                self.done_to = self.done_to.max(Some(waiting.message.time_gps));
                arrived = Some(arrived.map_or(waiting.arrived, |first| first.min(waiting.arrived)));
                *slot = Some(waiting.message);
            }
        }
        if let (true, Some(time), Some(arrived)) = (self.live, self.done_to, arrived) {
            self.given.push_back(Given { time, arrived });
        }
        bucket
    }
}

#[cfg(test)]
mod live_tests;
#[cfg(test)]
mod tests;
