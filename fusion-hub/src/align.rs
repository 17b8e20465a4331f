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
//! **Live.** A phone may come late, lag or fall silent. [`Aligner::drop_silent`] stops waiting for phones of which nothing was heard for
//! too long; the next message makes them run again, also one that is of a time fused already (counted and dropped). How long is too long:
//! - a phone that has spoken: [`AlignOptions::maximum_wait`] of silence. One that lags but speaks is waited for.
//! - a phone that has not spoken: so long after the others' earliest message; longer when its agent is known to be there.
//! - when all that waits is far ahead of the phone ([`AlignOptions::maximum_lead_s`]): longer. Another day's file or a wrong clock
//!   must not carry the group away from the others.
//! - a phone whose missing messages are being fetched ([`Aligner::expect`]): counted from the end of that.
//! - a phone that is as far behind the majority, and does not catch up, is not waited for at all.

use std::collections::VecDeque;
use std::time::Duration;

use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;

/// Most messages of a phone held back for confirmation.
const MAXIMUM_HELD: usize = 4;
/// Live: most messages of a phone that wait for the others; at 1 Hz some hours and some hundred megabytes.
const MAXIMUM_WAITING: usize = 20_000;
/// Live: a phone that has not spoken is waited for so many times as long as one that fell silent.
const ABSENT_FACTOR: u32 = 2;
/// Live: likewise when its agent is there: it reads its files, or its history is on the way.
const EXPECTED_FACTOR: u32 = 6;
/// Live: likewise when all that waits is far ahead of it.
const LEAD_FACTOR: u32 = 12;
/// Live: a phone that is behind and runs so many times as fast as time catches up.
const CATCHING_UP: f64 = 2.0;

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
    /// Live: so long a phone may be silent, and the group waits for it.
    pub maximum_wait: Duration,
    /// Live: so far a phone may be ahead of the others, or behind the majority, s.
    pub maximum_lead_s: f64,
}

impl AlignOptions {
    /// Live: a phone may be silent for `latency`, and lag twice as much.
    pub fn with_latency(latency: Duration) -> Self {
        Self { maximum_wait: latency, maximum_lead_s: 2.0 * latency.as_secs_f64(), ..Self::default() }
    }
}

impl Default for AlignOptions {
    fn default() -> Self {
        Self {
            tolerance_s: 0.5,
            simultaneous_s: 0.02,
            maximum_step_s: 300.0,
            maximum_wait: Duration::from_secs(5),
            maximum_lead_s: 10.0,
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
    /// What was heard of it, refused or not.
    heard: Option<Heard>,
    /// Since when its agent is known to be there.
    here_since: Option<Duration>,
    /// Whether it is known to be far ahead of the others.
    ahead: bool,
    /// Whether it is known to be far behind the others.
    astray: bool,
    skips: Skips,
}

/// The first and the last that was heard of a phone since its agent came: time of arrival and time of the epoch.
#[derive(Clone, Copy, Debug)]
struct Heard {
    first: (Duration, GpsTime),
    last: (Duration, GpsTime),
}

impl Heard {
    /// How many times as fast as time its epochs come; `None` when it is too early to tell.
    fn speed(&self, least: Duration) -> Option<f64> {
        let elapsed = self.last.0.saturating_sub(self.first.0);
        (elapsed >= least && !elapsed.is_zero()).then(|| (self.last.1 - self.first.1) / elapsed.as_secs_f64())
    }
}

impl Track {
    fn time(&self, position: usize) -> Option<GpsTime> {
        self.queue.get(position).map(|waiting| waiting.message.time_gps)
    }

    /// Notes that the phone speaks.
    fn hear(&mut self, time: GpsTime, now: Duration) {
        let first = self.heard.map_or((now, time), |heard| heard.first);
        self.heard = Some(Heard { first, last: (now, time) });
    }

    /// Queues a message, unless it is too early. Either way the phone runs.
    fn accept(&mut self, waiting: Waiting, options: &AlignOptions, done_to: Option<GpsTime>) {
        let time = waiting.message.time_gps;
        self.presence = Presence::Running;
        self.hear(time, waiting.arrived);
        if let Some(reason) = refusal(time, self.latest, done_to, options.simultaneous_s) {
            self.skips.add(reason, || describe(&waiting.message, self.latest, done_to));
            return;
        }
        self.latest = Some(time);
        self.queue.push_back(waiting);
        self.drop_held();
    }

    /// Holds a message back until the next confirms it.
    fn hold(&mut self, waiting: Waiting) {
        // Its time is not believed yet, but the phone is there.
        if self.presence == Presence::Away {
            self.presence = Presence::Running;
        }
        if let Some(heard) = &mut self.heard {
            heard.last.0 = waiting.arrived;
        } else {
            self.here_since.get_or_insert(waiting.arrived);
        }
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
    live: bool,
    /// What people should know.
    notices: Vec<Notice>,
}

/// Something about a phone that people should know.
#[derive(Clone, Debug, PartialEq)]
pub struct Notice {
    /// The phone's index.
    pub phone: usize,
    /// In words.
    pub text: String,
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
        let track = |_| Track {
            queue: VecDeque::new(),
            held: Vec::new(),
            presence: Presence::Running,
            latest: None,
            heard: None,
            here_since: None,
            ahead: false,
            astray: false,
            skips: Skips::default(),
        };
        let tracks = (0..phones).map(track).collect();
        Self { tracks, options, done_to: None, live: false, notices: Vec::new() }
    }

    /// For `phones` phones that come and go: call [`Aligner::drop_silent`] now and then.
    pub fn live(phones: usize, options: AlignOptions) -> Self {
        Self { live: true, ..Self::new(phones, options) }
    }

    /// Takes a message of the phone with index `phone`, received at `now` by any steady clock. A message that is not later than
    /// the phone's previous one, or than a bucket already given out, is counted and dropped.
    pub fn push(&mut self, phone: usize, message: EpochMessage, now: Duration) {
        let (options, done_to) = (self.options, self.done_to);
        let live = self.live;
        let Some(track) = self.tracks.get_mut(phone) else { return };
        if live && track.queue.len() >= MAXIMUM_WAITING {
            track.skips.add("too many epochs wait for the other phones", || {
                format!("sequence {} at {}; {MAXIMUM_WAITING} wait", message.sequence, message.time_gps)
            });
            return;
        }
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
            track.here_since = None;
        }
    }

    /// The phone's agent has appeared at `now`: its messages will come, or its history is on the way.
    pub fn arrive(&mut self, phone: usize, now: Duration) {
        if let Some(track) = self.tracks.get_mut(phone) {
            if track.presence != Presence::Running {
                track.presence = Presence::Running;
                track.heard = None;
            }
            track.here_since = Some(now);
        }
    }

    /// Messages of the phone are being fetched at `now`: it is not silent.
    pub fn expect(&mut self, phone: usize, now: Duration) {
        let Some(track) = self.tracks.get_mut(phone) else { return };
        if track.presence != Presence::Running {
            return self.arrive(phone, now);
        }
        match &mut track.heard {
            Some(heard) => heard.last.0 = now,
            None => track.here_since = Some(now),
        }
    }

    /// The next bucket, if it is complete.
    pub fn pop_ready(&mut self) -> Option<Bucket> {
        let waited_for = |track: &Track| track.presence == Presence::Running && track.queue.is_empty();
        if self.tracks.iter().any(waited_for) {
            return None;
        }
        self.members().map(|members| self.take(&members))
    }

    /// Stops waiting for phones of which nothing was heard for too long while others wait for them; `true` when there was one, so that
    /// [`Aligner::pop_ready`] may have a bucket.
    pub fn drop_silent(&mut self, now: Duration) -> bool {
        let Some((anchor, first)) = self.heads().first().copied() else { return false };
        let waiting = self.tracks.get(first).and_then(|track| track.queue.front());
        let Some(arrived) = waiting.map(|waiting| waiting.arrived) else { return false };
        let mut dropped = false;
        for phone in 0..self.tracks.len() {
            dropped |=
                self.is_silent(phone, (anchor, arrived), now) || self.is_astray(phone, (anchor, arrived));
        }
        if dropped {
            return true;
        }
        self.note_lead(anchor, first, now.saturating_sub(arrived));
        false
    }

    /// Whether the group waits for a phone that is silent; it is away then.
    fn is_silent(&mut self, phone: usize, (anchor, arrived): (GpsTime, Duration), now: Duration) -> bool {
        let options = self.options;
        let Some(track) = self.tracks.get_mut(phone) else { return false };
        // One message is waiting where the rule asks for two.
        if track.presence != Presence::Running || track.queue.len() > 1 {
            return false;
        }
        let (since, factor) = match (track.heard, track.here_since) {
            (Some(heard), _) if anchor - heard.last.1 > options.maximum_lead_s => (heard.last.0, LEAD_FACTOR),
            (Some(heard), _) => (heard.last.0, 1),
            (None, Some(here)) => (here, EXPECTED_FACTOR),
            (None, None) => (arrived, ABSENT_FACTOR),
        };
        let silent = now.saturating_sub(since.max(arrived)) >= options.maximum_wait * factor;
        if silent {
            track.presence = Presence::Away;
            track.here_since = None;
        }
        silent
    }

    /// Whether the group waits for a phone that is far behind most others and does not catch up; it is away then.
    fn is_astray(&mut self, phone: usize, (anchor, arrived): (GpsTime, Duration)) -> bool {
        let options = self.options;
        let (others_behind, others_ahead) = self.split_others(phone, anchor);
        let Some(track) = self.tracks.get_mut(phone) else { return false };
        let Some(heard) = track.heard else { return false };
        let lag_s = anchor - heard.last.1;
        let slow = heard.speed(options.maximum_wait).is_some_and(|speed| speed < CATCHING_UP);
        let astray = track.presence == Presence::Running
            && track.queue.is_empty()
            && lag_s > options.maximum_lead_s
            && slow
            // After a gap of all phones it may just be the last to speak.
            && heard.last.0 > arrived
            && others_ahead >= 2
            && others_ahead > others_behind + 1;
        if astray {
            track.presence = Presence::Away;
            if !std::mem::replace(&mut track.astray, true) {
                let text =
                    format!("{lag_s:.0} s behind the other phones and not waited for: is its clock right?");
                track.skips.add("phone far behind the others: not waited for", || text.clone());
                self.notices.push(Notice { phone, text });
            }
        }
        astray
    }

    /// How many other running phones are far behind the anchor, and how many are near it.
    fn split_others(&self, phone: usize, anchor: GpsTime) -> (usize, usize) {
        let (mut behind, mut ahead) = (0, 0);
        for (_, track) in self.tracks.iter().enumerate().filter(|(other, _)| *other != phone) {
            let last = track.time(0).or(track.heard.map(|heard| heard.last.1));
            let Some(last) = last.filter(|_| track.presence == Presence::Running) else { continue };
            let lag_s = anchor - last;
            behind += usize::from(lag_s > self.options.maximum_lead_s);
            ahead += usize::from(lag_s.abs() <= self.options.maximum_lead_s);
        }
        (behind, ahead)
    }

    /// Counts and names a phone whose messages wait because they are far ahead of the others.
    fn note_lead(&mut self, anchor: GpsTime, first: usize, waited: Duration) {
        let options = self.options;
        let blocked = |track: &Track| track.presence == Presence::Running && track.queue.is_empty();
        let last = |track: &Track| track.heard.map(|heard| heard.last.1);
        let blocking = self.tracks.iter().filter(|track| blocked(track)).filter_map(last).max();
        let Some(lead_s) = blocking.map(|time| anchor - time) else { return };
        if lead_s <= options.maximum_lead_s || waited < options.maximum_wait {
            return;
        }
        let Some(track) = self.tracks.get_mut(first) else { return };
        if !std::mem::replace(&mut track.ahead, true) {
            let text = format!(
                "{lead_s:.0} s ahead of the other phones, and waits for them: is it of the same time?"
            );
            track.skips.add("phone far ahead of the others: held back", || text.clone());
            self.notices.push(Notice { phone: first, text });
        }
    }

    /// What people should know since the last call.
    pub fn notices(&mut self) -> Vec<Notice> {
        std::mem::take(&mut self.notices)
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

    /// The phones of the next bucket; `None` when there is no message, or when the rule cannot be decided yet.
    fn members(&self) -> Option<Vec<usize>> {
        let heads = self.heads();
        let (&(anchor, first), others) = heads.split_first()?;
        let mut members = vec![(anchor, first)];
        for &(time, phone) in others {
            if time - anchor > self.options.tolerance_s {
                break;
            }
            match self.joins(time, &members) {
                Decision::Join => members.push((time, phone)),
                Decision::End => break,
                Decision::Wait => return None,
            }
        }
        Some(members.into_iter().map(|(_, phone)| phone).collect())
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
                None if track.presence == Presence::Running => return Decision::Wait,
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
