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
//! that is far ahead of the one before it, is held back until the phone's next message follows closely, and is dropped
//! when that does not.
//!
//! **Live.** A phone may fall silent. [`Aligner::pop_overdue`] closes a bucket whose anchor has waited too long, and stops waiting for
//! the silent phones until they speak again. What they then say of the time before is late: counted and dropped.

use std::collections::VecDeque;
use std::time::Duration;

use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;

/// Most messages of a phone held back for confirmation.
const MAXIMUM_HELD: usize = 4;

/// Epochs of one bucket, by phone; `None` where a phone has none.
pub type Bucket = Vec<Option<EpochMessage>>;

/// How epochs are brought together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignOptions {
    /// Largest distance from a bucket's anchor, s: half of the slowest phone's epoch interval.
    pub tolerance_s: f64,
    /// Messages this close count as simultaneous, s. Two messages of one phone must be further apart.
    pub simultaneous_s: f64,
    /// A message further ahead of the phone's previous one must be confirmed by the next, s.
    pub maximum_step_s: f64,
    /// How long [`Aligner::pop_overdue`] lets an anchor wait.
    pub maximum_wait: Duration,
}

impl Default for AlignOptions {
    fn default() -> Self {
        Self {
            tolerance_s: 0.5,
            simultaneous_s: 0.02,
            maximum_step_s: 300.0,
            maximum_wait: Duration::from_millis(1_500),
        }
    }
}

/// Whether a bucket waits for a phone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Presence {
    /// Messages will come.
    Running,
    /// Not there (yet), or silent for too long; its next message makes it run.
    Away,
    /// No message will come.
    Finished,
}

#[derive(Debug)]
struct Waiting {
    message: EpochMessage,
    arrived: Duration,
}

#[derive(Debug)]
struct Track {
    queue: VecDeque<Waiting>,
    /// Messages whose time is not confirmed, at most [`MAXIMUM_HELD`].
    held: Vec<Waiting>,
    presence: Presence,
    latest: Option<GpsTime>,
    skips: Skips,
}

impl Track {
    fn time(&self, position: usize) -> Option<GpsTime> {
        self.queue.get(position).map(|waiting| waiting.message.time_gps)
    }

    /// Queues a message, unless it is too early.
    fn accept(&mut self, waiting: Waiting, options: &AlignOptions, done_to: Option<GpsTime>) {
        let time = waiting.message.time_gps;
        if let Some(reason) = refusal(time, self.latest, done_to, options.simultaneous_s) {
            self.skips.add(reason, || describe(&waiting.message, self.latest, done_to));
            return;
        }
        self.latest = Some(time);
        self.presence = Presence::Running;
        self.queue.push_back(waiting);
        self.drop_held();
    }

    /// Holds a message back until the next confirms it.
    fn hold(&mut self, waiting: Waiting) {
        if self.held.iter().any(|held| held.message.time_gps == waiting.message.time_gps) {
            self.skips.add("epoch received twice", || describe(&waiting.message, self.latest, None));
            return;
        }
        if self.held.len() >= MAXIMUM_HELD {
            self.drop_held();
        }
        self.held.push(waiting);
    }

    fn drop_held(&mut self) {
        for held in std::mem::take(&mut self.held) {
            self.skips.add("epoch far from its neighbours", || describe(&held.message, self.latest, None));
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
}

/// Whether the rule can be decided yet.
enum Decision {
    Join,
    End,
    Wait,
}

impl Aligner {
    /// For `phones` phones, all of which will deliver: buckets wait for each until [`Aligner::finish`].
    pub fn new(phones: usize, options: AlignOptions) -> Self {
        Self::with_presence(phones, options, Presence::Running)
    }

    /// For `phones` phones that come and go: buckets wait only for those that have spoken.
    pub fn live(phones: usize, options: AlignOptions) -> Self {
        Self::with_presence(phones, options, Presence::Away)
    }

    fn with_presence(phones: usize, options: AlignOptions, presence: Presence) -> Self {
        let track = |_| Track {
            queue: VecDeque::new(),
            held: Vec::new(),
            presence,
            latest: None,
            skips: Skips::default(),
        };
        Self { tracks: (0..phones).map(track).collect(), options, done_to: None }
    }

    /// Takes a message of the phone with index `phone`, received at `now` by any steady clock. A message that is not later than
    /// the phone's previous one, or than a bucket already given out, is counted and dropped.
    pub fn push(&mut self, phone: usize, message: EpochMessage, now: Duration) {
        let (options, done_to) = (self.options, self.done_to);
        let Some(track) = self.tracks.get_mut(phone) else { return };
        let waiting = Waiting { message, arrived: now };
        let step_s = |from: GpsTime| waiting.message.time_gps - from;
        let near = |from: GpsTime| step_s(from) > 0.0 && step_s(from) <= options.maximum_step_s;
        if track.latest.is_some_and(|latest| step_s(latest) <= options.maximum_step_s) {
            track.accept(waiting, &options, done_to);
        } else if let Some(position) = track.held.iter().position(|held| near(held.message.time_gps)) {
            let confirmed = track.held.remove(position);
            track.accept(confirmed, &options, done_to);
            track.accept(waiting, &options, done_to);
        } else {
            track.hold(waiting);
        }
    }

    /// The phone will deliver nothing more; what it has delivered still counts.
    pub fn finish(&mut self, phone: usize) {
        let (options, done_to) = (self.options, self.done_to);
        if let Some(track) = self.tracks.get_mut(phone) {
            // The only message of a phone has nothing to contradict it.
            if track.latest.is_none() && !track.held.is_empty() {
                let only = track.held.remove(0);
                track.accept(only, &options, done_to);
            }
            track.drop_held();
            track.presence = Presence::Finished;
        }
    }

    /// The phone is gone for now: buckets do not wait for it until its next message.
    pub fn leave(&mut self, phone: usize) {
        if let Some(track) = self.tracks.get_mut(phone) {
            track.presence = Presence::Away;
        }
    }

    /// The next bucket, if it is complete.
    pub fn pop_ready(&mut self) -> Option<Bucket> {
        let waited_for = |track: &Track| track.presence == Presence::Running && track.queue.is_empty();
        if self.tracks.iter().any(waited_for) {
            return None;
        }
        self.members(false).map(|members| self.take(&members))
    }

    /// The next bucket, complete or not, if its anchor has waited longer than the maximum. Phones that have nothing waiting then
    /// count as away.
    pub fn pop_overdue(&mut self, now: Duration) -> Option<Bucket> {
        let anchor = *self.heads().first()?;
        let arrived = self.tracks.get(anchor.1)?.queue.front()?.arrived;
        if now.saturating_sub(arrived) < self.options.maximum_wait {
            return None;
        }
        for track in &mut self.tracks {
            if track.presence == Presence::Running && track.queue.is_empty() {
                track.presence = Presence::Away;
            }
        }
        self.members(true).map(|members| self.take(&members))
    }

    /// What was dropped of a phone's messages.
    pub fn skips(&self, phone: usize) -> Option<&Skips> {
        self.tracks.get(phone).map(|track| &track.skips)
    }

    /// How many messages wait.
    pub fn waiting(&self) -> usize {
        self.tracks.iter().map(|track| track.queue.len() + track.held.len()).sum()
    }

    /// The earliest message of each phone that has one, in order of time, phones in order at one time.
    fn heads(&self) -> Vec<(GpsTime, usize)> {
        let head = |(phone, track): (usize, &Track)| track.time(0).map(|time| (time, phone));
        let mut heads: Vec<_> = self.tracks.iter().enumerate().filter_map(head).collect();
        heads.sort_unstable();
        heads
    }

    /// The phones of the next bucket; `None` when there is no message or, unless forced, when the rule cannot be decided yet.
    fn members(&self, forced: bool) -> Option<Vec<usize>> {
        let heads = self.heads();
        let (&(anchor, first), others) = heads.split_first()?;
        let mut members = vec![(anchor, first)];
        for &(time, phone) in others {
            if time - anchor > self.options.tolerance_s {
                break;
            }
            match self.joins(time, &members, forced) {
                Decision::Join => members.push((time, phone)),
                Decision::End => break,
                Decision::Wait => return None,
            }
        }
        Some(members.into_iter().map(|(_, phone)| phone).collect())
    }

    fn joins(&self, time: GpsTime, members: &[(GpsTime, usize)], forced: bool) -> Decision {
        for &(member, phone) in members {
            let after_s = time - member;
            if after_s <= self.options.simultaneous_s {
                continue;
            }
            let Some(track) = self.tracks.get(phone) else { continue };
            match track.time(1) {
                Some(next) if next - time < after_s => return Decision::End,
                None if track.presence == Presence::Running && !forced => return Decision::Wait,
                _ => {}
            }
        }
        Decision::Join
    }

    fn take(&mut self, members: &[usize]) -> Bucket {
        let mut bucket: Bucket = self.tracks.iter().map(|_| None).collect();
        for &phone in members {
            let message = self.tracks.get_mut(phone).and_then(|track| track.queue.pop_front());
            if let (Some(waiting), Some(slot)) = (message, bucket.get_mut(phone)) {
                self.done_to = self.done_to.max(Some(waiting.message.time_gps));
                *slot = Some(waiting.message);
            }
        }
        bucket
    }
}

/// Why a message cannot be taken.
fn refusal(
    time: GpsTime,
    previous: Option<GpsTime>,
    done_to: Option<GpsTime>,
    simultaneous_s: f64,
) -> Option<&'static str> {
    match previous {
        Some(previous) if time == previous => Some("epoch received twice"),
        Some(previous) if time < previous => Some("epoch out of order"),
        Some(previous) if time - previous <= simultaneous_s => Some("epoch too soon after the previous one"),
        _ if done_to.is_some_and(|done_to| time < done_to) => Some("epoch too late"),
        _ => None,
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

#[cfg(test)]
mod tests;
