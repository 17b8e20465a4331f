//! Whom a live group waits for, and which time is its own. The rules stand at the head of [`super`].

use std::cmp::Ordering;
use std::time::Duration;

use crate::skips::Reason;
use crate::time::GpsTime;

use super::track::{Presence, Track};
use super::{Aligner, Next, UNPACED};

/// Speed (epoch time per wall time) below which a phone counts as falling behind.
const SLOW: f64 = 0.9;
/// Lag, s, from which on a phone counts as being of another time and not as late.
const ANOTHER_TIME_S: f64 = 60.0;

/// The time of a call, by the caller's steady clock, and GPS time by the clock of its computer.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    now: Duration,
    wall_gps: Option<GpsTime>,
}

/// A bucket that was given out: its time and when its first message had arrived.
#[derive(Clone, Copy, Debug)]
pub(super) struct Given {
    pub(super) time: GpsTime,
    pub(super) arrived: Duration,
}

/// Something about a phone that people should know.
#[derive(Clone, Debug, PartialEq)]
pub struct Notice {
    /// The phone's index.
    pub phone: usize,
    /// What it is.
    pub kind: NoticeKind,
    /// In words.
    pub text: String,
}

/// What a [`Notice`] is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoticeKind {
    /// The phone says nothing, and is not waited for.
    Silent,
    /// The phone speaks of a time that the group has passed, and is not waited for.
    Behind,
    /// The phone speaks of a time to which the group has not come.
    Ahead,
    /// The phone is on time again.
    OnTime,
    /// The group's time went back to that of the phone.
    WentBack,
}

/// What speaks for a time; the first that differs decides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Weight {
    /// Whether a phone of it agrees with the hub's clock.
    agrees_with_clock: bool,
    /// Phones with a position.
    positions: usize,
    phones: usize,
}

impl Aligner {
    /// Stops waiting for phones for which others have waited for too long at `now`; `wall_gps` is the time by the hub's own clock, as far
    /// as it is known. `true` when there was one, so that [`Aligner::pop_ready`] may have a bucket: call it again after that.
    pub fn go_on(&mut self, now: Duration, wall_gps: Option<GpsTime>) -> bool {
        if !self.live {
            return false;
        }
        self.clock = Clock { now, wall_gps };
        let wait = self.options.maximum_wait;
        while let Some(given) = self.given.pop_front_if(|given| now.saturating_sub(given.arrived) >= wait) {
            self.given_before = self.given_before.max(Some(given.time));
        }
        let released = self.release_those_ahead();
        let back = self.go_back();
        self.leave_behind() || released || back
    }

    /// What people should know since the last call.
    pub fn notices(&mut self) -> Vec<Notice> {
        std::mem::take(&mut self.notices)
    }

    /// Whether, since the last call, the group's time went back: the next bucket may be earlier than those before.
    pub fn went_back(&mut self) -> bool {
        std::mem::take(&mut self.went_back)
    }

    /// How long the longest of the messages that must not wait longer than [`super::AlignOptions::maximum_wait`] has waited at `now`.
    #[cfg(test)]
    pub(super) fn longest_wait(&mut self, now: Duration) -> Duration {
        let heads = self.heads();
        let waited = heads.into_iter().filter_map(|(_, phone)| {
            let front = self.tracks.get(phone).filter(|track| !track.ahead)?.queue.front()?.arrived;
            self.is_paced(phone, now).then(|| now.saturating_sub(front))
        });
        waited.max().unwrap_or_default()
    }

    /// The phone is waited for from now on.
    pub(super) fn run(&mut self, phone: usize) {
        let Some(track) = self.tracks.get_mut(phone) else { return };
        track.presence = Presence::Running;
        if std::mem::take(&mut track.left_behind) {
            let text = "on time again".to_owned();
            self.notices.push(Notice { phone, kind: NoticeKind::OnTime, text });
        }
    }

    /// Whether an epoch of `time` that arrives at `now` comes hardly later than those of the others.
    pub(super) fn is_in_time(&self, time: GpsTime, now: Duration) -> bool {
        let wait = self.options.maximum_wait;
        let first = self.given.partition_point(|given| given.time < time);
        let given = self.given.get(first).filter(|given| given.time - time <= wait.as_secs_f64());
        self.given_before < Some(time) && given.is_some_and(|given| now.saturating_sub(given.arrived) < wait)
    }

    /// Whether another phone has said that it is about that time.
    pub(super) fn others_vouch_for(&self, phone: usize, time: GpsTime) -> bool {
        let far_s = 2.0 * self.options.maximum_wait.as_secs_f64();
        let others = self.tracks.iter().enumerate().filter(|(other, _)| *other != phone);
        others.filter_map(|(_, track)| track.newest()).any(|newest| (time - newest).abs() <= far_s)
    }

    /// Whether a time is about that of the group, as far as there is one.
    pub(super) fn is_near(&self, time: GpsTime) -> bool {
        let far_s = 2.0 * self.options.maximum_wait.as_secs_f64();
        self.done_to.is_none_or(|done_to| (time - done_to).abs() <= far_s)
    }

    /// Up to which time those that are ahead of the group take part; `None` when there is nobody to be ahead of.
    pub(super) fn limit_of_those_ahead(&self) -> Option<GpsTime> {
        let those_ahead = self.tracks.iter().any(|track| track.ahead);
        let others = self.tracks.iter().filter(|track| !track.ahead && track.presence != Presence::Finished);
        let newest = others.filter_map(Track::newest).max()?;
        those_ahead.then(|| newest + self.options.tolerance_s)
    }

    /// Leaves one phone behind, or says that one is ahead, when a message has waited for too long.
    fn leave_behind(&mut self) -> bool {
        let (now, wait) = (self.clock.now, self.options.maximum_wait);
        let Next::Blocked(blockers) = self.next() else { return false };
        for (_, waiting) in self.heads() {
            for &blocker in &blockers {
                let since = self.waits_since(waiting, blocker);
                if since.is_some_and(|since| now.saturating_sub(since) >= wait) {
                    self.settle(blocker, waiting);
                    return true;
                }
            }
        }
        false
    }

    /// Since when a phone's first message waits for another phone, as far as that counts.
    fn waits_since(&mut self, waiting: usize, blocker: usize) -> Option<Duration> {
        let is_paced = self.is_paced(waiting, self.clock.now);
        let track = self.tracks.get(waiting).filter(|track| !track.ahead)?;
        let arrived = track.queue.front()?.arrived;
        let progress = self.tracks.get(blocker)?.progress;
        Some(if is_paced { arrived } else { progress.map_or(arrived, |progress| progress.max(arrived)) })
    }

    /// Whether a phone's epochs come as it makes them, so that they must not wait.
    fn is_paced(&mut self, phone: usize, now: Duration) -> bool {
        let window = self.options.maximum_wait;
        self.tracks.get_mut(phone).is_some_and(|track| {
            track.presence != Presence::Finished
                && track.advance_s(now, window) <= UNPACED * window.as_secs_f64()
        })
    }

    /// One phone has waited for another for too long: either that one is left behind, or this one is ahead of the group.
    fn settle(&mut self, blocker: usize, waiting: usize) {
        let times = (self.speaks_of(blocker), self.tracks.get(waiting).and_then(Track::newest));
        if let (Some(behind), Some(ahead)) = times
            && behind < ahead
            && !self.is_slow(blocker)
            && self.outweighs(behind, ahead)
        {
            self.note_ahead(waiting, ahead - behind);
        } else {
            self.leave_out(blocker, times);
        }
    }

    fn note_ahead(&mut self, phone: usize, lead_s: f64) {
        let Some(track) = self.tracks.get_mut(phone) else { return };
        track.ahead = true;
        track.ahead_since = self.clock.now;
        let text = format!(
            "{lead_s:.0} s ahead of the other phones, so its epochs wait until the group has come so far: is its clock right, and is it a \
             recording of the same time?"
        );
        track.skips.add(Reason::PhoneAhead, || text.clone());
        self.notices.push(Notice { phone, kind: NoticeKind::Ahead, text });
    }

    fn leave_out(&mut self, phone: usize, (behind, waiting): (Option<GpsTime>, Option<GpsTime>)) {
        let newest = self.newest_of_others(phone).max(waiting);
        let wait_s = self.options.maximum_wait.as_secs_f64();
        let is_slow = self.is_slow(phone);
        let Some(track) = self.tracks.get_mut(phone) else { return };
        track.presence = Presence::Away;
        track.left_behind = true;
        let (kind, text) = match (behind, newest) {
            (Some(behind), Some(newest)) if newest > behind => {
                let lag_s = newest - behind;
                let why = why_behind(lag_s, track.speed().filter(|_| is_slow));
                let text = format!("{lag_s:.0} s behind the others' newest epoch, and not waited for: {why}");
                (NoticeKind::Behind, text)
            }
            _ if track.heard.is_some_and(|at| self.clock.now.saturating_sub(at).as_secs_f64() < wait_s) => {
                let text = format!(
                    "nothing that can be fused for {wait_s} s, and not waited for: its epochs are of another time or repeat themselves"
                );
                (NoticeKind::Behind, text)
            }
            _ => (NoticeKind::Silent, format!("no epoch for {wait_s} s: the others go on without it")),
        };
        if kind == NoticeKind::Behind {
            track.skips.add(Reason::PhoneBehind, || text.clone());
        }
        self.notices.push(Notice { phone, kind, text });
    }

    /// Phones ahead of a group that has come near them, that has fallen silent, or that they outweigh, are of its time now.
    fn release_those_ahead(&mut self) -> bool {
        let (now, wait_s) = (self.clock.now, self.options.maximum_wait.as_secs_f64());
        let mut released = false;
        for phone in 0..self.tracks.len() {
            let Some(track) = self.tracks.get(phone).filter(|t| t.ahead && t.ahead_since < now) else {
                continue;
            };
            let newest = track.newest();
            let others =
                (0..self.tracks.len()).filter(|other| self.tracks.get(*other).is_some_and(|t| !t.ahead));
            let group = others.filter_map(|other| self.speaks_of(other)).max();
            let is_near = group.zip(newest).is_some_and(|(group, newest)| newest - group <= wait_s);
            let alone = group.is_none();
            if !(alone
                || is_near
                || newest.zip(group).is_some_and(|(newest, group)| self.outweighs(newest, group)))
            {
                continue;
            }
            let Some(track) = self.tracks.get_mut(phone) else { continue };
            track.ahead = false;
            if is_near {
                // They waited for the group to come; from now on they wait for phones.
                track.queue.iter_mut().for_each(|waiting| waiting.arrived = now);
            }
            released = true;
        }
        released
    }

    /// The group goes back to the time of phones that outweigh those who made its time.
    fn go_back(&mut self) -> bool {
        let Some(done_to) = self.done_to else { return false };
        let far_s = 2.0 * self.options.maximum_wait.as_secs_f64();
        for phone in 0..self.tracks.len() {
            let Some(time) = self.speaks_of(phone).filter(|time| done_to - *time > far_s) else { continue };
            let recent = Some(self.options.maximum_wait);
            if self.is_slow(phone) || self.weight(time, done_to, recent) <= self.weight(done_to, time, None) {
                continue;
            }
            for track in &mut self.tracks {
                let is_ahead = track.newest().is_some_and(|newest| newest - time > far_s);
                (track.ahead, track.ahead_since) = (is_ahead, self.clock.now);
            }
            self.done_to = None;
            self.given.clear();
            self.given_before = None;
            self.went_back = true;
            let back_s = done_to - time;
            let text = format!(
                "the group's time goes back by {back_s:.0} s to that of this phone: more speaks for it"
            );
            self.notices.push(Notice { phone, kind: NoticeKind::WentBack, text });
            return true;
        }
        false
    }

    /// The time of which a phone speaks that was heard of late.
    fn speaks_of(&self, phone: usize) -> Option<GpsTime> {
        let track = self.tracks.get(phone).filter(|track| track.presence != Presence::Finished)?;
        let (at, time) = track.spoken?;
        (self.clock.now.saturating_sub(at) < self.options.maximum_wait).then_some(time)
    }

    fn is_slow(&self, phone: usize) -> bool {
        self.tracks.get(phone).and_then(Track::speed).is_some_and(|speed| speed < SLOW)
    }

    fn newest_of_others(&self, phone: usize) -> Option<GpsTime> {
        let others = self.tracks.iter().enumerate().filter(|(other, track)| *other != phone && !track.ahead);
        others.filter_map(|(_, track)| track.newest()).max()
    }

    /// Whether more speaks for one time than for another.
    fn outweighs(&self, one: GpsTime, other: GpsTime) -> bool {
        let recent = Some(self.options.maximum_wait);
        match self.weight(one, other, recent).cmp(&self.weight(other, one, recent)) {
            Ordering::Equal => match self.clock.wall_gps {
                Some(wall) => (one - wall).abs() < (other - wall).abs(),
                None => one > other,
            },
            ordering => ordering == Ordering::Greater,
        }
    }

    /// What speaks for a time: the phones that are nearer to it than to the other one, and were heard within `recent`.
    fn weight(&self, time: GpsTime, other: GpsTime, recent: Option<Duration>) -> Weight {
        let Clock { now, wall_gps } = self.clock;
        let mut weight = Weight::default();
        for track in self.tracks.iter().filter(|track| track.presence != Presence::Finished) {
            let Some((at, spoken)) = track.spoken else { continue };
            let age = now.saturating_sub(at);
            if recent.is_some_and(|recent| age >= recent) || (spoken - time).abs() >= (spoken - other).abs() {
                continue;
            }
            let off_s = wall_gps.map(|wall| (spoken + age.as_secs_f64() - wall).abs());
            weight.agrees_with_clock |=
                off_s.is_some_and(|off_s| off_s <= self.options.maximum_wait.as_secs_f64());
            weight.positions += usize::from(track.has_position);
            weight.phones += 1;
        }
        weight
    }
}

/// Why a phone is behind, as far as its epochs tell; `slow`: how fast they come when that is too slowly.
fn why_behind(lag_s: f64, slow: Option<f64>) -> String {
    match slow {
        Some(speed) => {
            format!(
                "its epochs come at {speed:.2} times the speed of time, so its link or its device is too slow"
            )
        }
        None if lag_s >= ANOTHER_TIME_S => {
            "is its clock right, and is it a recording of the same time?".to_owned()
        }
        None => "its epochs come too late by so much; a longer --latency waits for them".to_owned(),
    }
}
