//! Waiting rules and time of a live group, as described at the head of [`super`].

use std::cmp::Ordering;
use std::time::Duration;

use crate::skips::Reason;
use crate::time::GpsTime;

use super::track::{Presence, Track};
use super::{Aligner, Next, UNKNOWN_INTERVAL_S, UNPACED_SPEED};

/// Speed (epoch time per wall time) below which a phone counts as falling behind.
const SLOW_SPEED: f64 = 0.9;
/// Minimum lag, s, of a phone that counts as being of another time and not as late.
const ANOTHER_TIME_S: f64 = 60.0;

/// Time of a call by the caller's steady clock, and GPS time by the clock of the hub's computer.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    now: Duration,
    wall_gps: Option<GpsTime>,
}

/// A bucket given out: its latest time and the arrival of its first message.
#[derive(Clone, Copy, Debug)]
pub(super) struct FusedBucket {
    pub(super) time: GpsTime,
    pub(super) arrived: Duration,
}

/// A notice about a phone for the user.
#[derive(Clone, Debug, PartialEq)]
pub struct Notice {
    /// Index of the phone.
    pub phone: usize,
    /// Kind of the notice.
    pub kind: NoticeKind,
    /// Text for the user.
    pub text: String,
}

/// Kind of a [`Notice`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoticeKind {
    /// The phone sends nothing, and the group does not wait for it.
    Silent,
    /// The phone sends times that the group has passed, and the group does not wait for it.
    Behind,
    /// The phone sends times that the group has not reached.
    Ahead,
    /// The phone is on time again.
    OnTime,
    /// The group returned to the earlier time of the phone.
    WentBack,
}

/// Support for a time, compared field by field in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Support {
    /// Whether one of the supporting phones agrees with the hub's clock.
    agrees_with_clock: bool,
    /// Number of supporting phones with a position.
    positions: usize,
    phones: usize,
}

impl Aligner {
    /// Ends waits that have become too long at `now`; `wall_gps` is GPS time by the hub's clock, if known. Returns `true` if something
    /// changed:
    /// then call [`Aligner::pop_ready`] and this function again.
    pub fn go_on(&mut self, now: Duration, wall_gps: Option<GpsTime>) -> bool {
        if !self.live {
            return false;
        }
        self.clock = Clock { now, wall_gps };
        let wait = self.options.maximum_wait;
        while let Some(bucket) = self.fused.pop_front_if(|bucket| now.saturating_sub(bucket.arrived) >= wait)
        {
            self.fused_before_gps = self.fused_before_gps.max(Some(bucket.time));
        }
        let released = self.release_phones_ahead();
        let back = self.return_to_earlier_time();
        self.end_overdue_wait() || released || back
    }

    /// Notices since the last call.
    pub fn notices(&mut self) -> Vec<Notice> {
        std::mem::take(&mut self.notices)
    }

    /// Whether the group's time went back since the last call, so that the next bucket may be earlier than those before.
    pub fn went_back(&mut self) -> bool {
        std::mem::take(&mut self.went_back)
    }

    /// Longest wait at `now` of a message that must not wait longer than [`super::AlignOptions::maximum_wait`].
    #[cfg(test)]
    pub(super) fn longest_wait(&mut self, now: Duration) -> Duration {
        let heads = self.heads();
        let waited = heads.into_iter().filter_map(|(_, phone)| {
            let front = self.tracks.get(phone).filter(|track| !track.ahead)?.queue.front()?.arrived;
            self.is_paced(phone, now).then(|| now.saturating_sub(front))
        });
        waited.max().unwrap_or_default()
    }

    /// Makes the group wait for the phone from now on.
    pub(super) fn mark_running(&mut self, phone: usize) {
        let Some(track) = self.tracks.get_mut(phone) else { return };
        track.presence = Presence::Running;
        if std::mem::take(&mut track.left_behind) {
            let text = "on time again".to_owned();
            self.notices.push(Notice { phone, kind: NoticeKind::OnTime, text });
        }
    }

    /// Whether an epoch of `time` arriving at `now` is at most `maximum_wait` later than the other phones' epochs of that time.
    pub(super) fn is_in_time(&self, time: GpsTime, now: Duration) -> bool {
        let wait = self.options.maximum_wait;
        let first = self.fused.partition_point(|bucket| bucket.time < time);
        let bucket = self.fused.get(first).filter(|bucket| bucket.time - time <= wait.as_secs_f64());
        self.fused_before_gps < Some(time)
            && bucket.is_some_and(|bucket| now.saturating_sub(bucket.arrived) < wait)
    }

    /// Whether another phone has sent a time near `time`.
    pub(super) fn is_confirmed_by_others(&self, phone: usize, time: GpsTime) -> bool {
        let far_s = 2.0 * self.options.maximum_wait.as_secs_f64();
        let others = self.tracks.iter().enumerate().filter(|(other, _)| *other != phone);
        others.filter_map(|(_, track)| track.newest()).any(|newest| (time - newest).abs() <= far_s)
    }

    /// Whether a time is near the group's time, if there is one.
    pub(super) fn is_near(&self, time: GpsTime) -> bool {
        let far_s = 2.0 * self.options.maximum_wait.as_secs_f64();
        self.fused_to_gps.is_none_or(|fused_to_gps| (time - fused_to_gps).abs() <= far_s)
    }

    /// Latest time up to which phones ahead of the group take part; `None` if no phone is ahead or no other phone has sent a time.
    pub(super) fn limit_for_phones_ahead(&self) -> Option<GpsTime> {
        let any_ahead = self.tracks.iter().any(|track| track.ahead);
        let others = self.tracks.iter().filter(|track| !track.ahead && track.presence != Presence::Finished);
        let newest = others.filter_map(Track::newest).max()?;
        any_ahead.then(|| newest + self.longest_tolerance_s())
    }

    /// Maximum difference of messages of one bucket by the phones' present intervals, s.
    fn longest_tolerance_s(&self) -> f64 {
        let intervals = self.tracks.iter().map(|track| track.interval_s().unwrap_or(UNKNOWN_INTERVAL_S));
        self.options.tolerance_s.unwrap_or_else(|| 0.5 * intervals.fold(0.0, f64::max))
    }

    /// Leaves one phone behind, or declares one ahead, when a message has waited for too long.
    fn end_overdue_wait(&mut self) -> bool {
        let (now, wait) = (self.clock.now, self.options.maximum_wait);
        let Next::Blocked(blockers) = self.next() else { return false };
        for (_, waiting) in self.heads() {
            for &blocker in &blockers {
                let since = self.waits_since(waiting, blocker);
                if since.is_some_and(|since| now.saturating_sub(since) >= wait) {
                    self.resolve_wait(blocker, waiting);
                    return true;
                }
            }
        }
        false
    }

    /// Begin of the time that a phone's first message waits for another phone, as far as it counts.
    fn waits_since(&mut self, waiting: usize, blocker: usize) -> Option<Duration> {
        let is_paced = self.is_paced(waiting, self.clock.now);
        let track = self.tracks.get(waiting).filter(|track| !track.ahead)?;
        let arrived = track.queue.front()?.arrived;
        let last_queued = self.tracks.get(blocker)?.last_queued;
        Some(if is_paced { arrived } else { last_queued.map_or(arrived, |queued| queued.max(arrived)) })
    }

    /// Whether the epochs of a phone arrive at the rate of measurement, so that they must not wait.
    fn is_paced(&mut self, phone: usize, now: Duration) -> bool {
        let window = self.options.maximum_wait;
        self.tracks.get_mut(phone).is_some_and(|track| {
            track.presence != Presence::Finished
                && track.advance_s(now, window) <= UNPACED_SPEED * window.as_secs_f64()
        })
    }

    /// Ends a wait that is too long: the waiting phone is ahead of the group, or its message came before its time and is fused without
    /// the blocking phone, or the blocking phone is left behind.
    fn resolve_wait(&mut self, blocker: usize, waiting: usize) {
        let blocker_time = self.current_time(blocker);
        let waiting_time = self.tracks.get(waiting).and_then(Track::newest);
        if let (Some(behind), Some(ahead)) = (blocker_time, waiting_time)
            && behind < ahead
            && !self.is_slow(blocker)
            && self.has_more_support(behind, ahead)
        {
            self.note_ahead(waiting, ahead - behind);
        } else if blocker_time.is_some() && self.came_early(waiting, blocker) {
            if let Some(track) = self.tracks.get_mut(blocker) {
                track.presence = Presence::Excused;
            }
        } else {
            self.leave_behind(blocker, blocker_time, waiting_time);
        }
    }

    /// Whether, by the hub's clock, the blocking phone is on time and the first message of the waiting phone came before its time, and by
    /// more than the blocking phone is off.
    fn came_early(&self, waiting: usize, blocker: usize) -> bool {
        let Clock { now, wall_gps: Some(wall) } = self.clock else { return false };
        let lead_s =
            |time: GpsTime, arrived: Duration| time - wall + now.saturating_sub(arrived).as_secs_f64();
        let head = self.tracks.get(waiting).and_then(|track| track.queue.front());
        let head_s = head.map(|head| lead_s(head.message.time_gps, head.arrived));
        let last = self.tracks.get(blocker).and_then(|track| track.last_confirmed);
        let blocker_s = last.map(|last| lead_s(last.time, last.arrived).abs());
        let wait_s = self.options.maximum_wait.as_secs_f64();
        blocker_s.zip(head_s).is_some_and(|(off_s, lead_s)| off_s <= wait_s && off_s < lead_s)
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

    fn leave_behind(&mut self, phone: usize, behind: Option<GpsTime>, waiting: Option<GpsTime>) {
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
            _ if track
                .last_arrival
                .is_some_and(|at| self.clock.now.saturating_sub(at).as_secs_f64() < wait_s) =>
            {
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

    /// Clears `ahead` of phones that the group has come near to, that have more support, or when the rest of the group is silent.
    fn release_phones_ahead(&mut self) -> bool {
        let (now, wait_s) = (self.clock.now, self.options.maximum_wait.as_secs_f64());
        let mut released = false;
        for phone in 0..self.tracks.len() {
            let Some(track) = self.tracks.get(phone).filter(|t| t.ahead && t.ahead_since < now) else {
                continue;
            };
            let newest = track.newest();
            let others =
                (0..self.tracks.len()).filter(|other| self.tracks.get(*other).is_some_and(|t| !t.ahead));
            let group = others.filter_map(|other| self.current_time(other)).max();
            let is_near = group.zip(newest).is_some_and(|(group, newest)| newest - group <= wait_s);
            let alone = group.is_none();
            if !(alone
                || is_near
                || newest.zip(group).is_some_and(|(newest, group)| self.has_more_support(newest, group)))
            {
                continue;
            }
            let Some(track) = self.tracks.get_mut(phone) else { continue };
            track.ahead = false;
            if is_near {
                // They waited for the group; from now on they wait for phones.
                track.queue.iter_mut().for_each(|waiting| waiting.arrived = now);
            }
            released = true;
        }
        released
    }

    /// Returns to the earlier time of a phone whose support exceeds that of the group's present time.
    fn return_to_earlier_time(&mut self) -> bool {
        let Some(fused_to_gps) = self.fused_to_gps else { return false };
        let far_s = 2.0 * self.options.maximum_wait.as_secs_f64();
        for phone in 0..self.tracks.len() {
            let Some(time) = self.current_time(phone).filter(|time| fused_to_gps - *time > far_s) else {
                continue;
            };
            let recent = Some(self.options.maximum_wait);
            if self.is_slow(phone)
                || self.support(time, fused_to_gps, recent) <= self.support(fused_to_gps, time, None)
            {
                continue;
            }
            for track in &mut self.tracks {
                let is_ahead = track.newest().is_some_and(|newest| newest - time > far_s);
                (track.ahead, track.ahead_since) = (is_ahead, self.clock.now);
            }
            self.fused_to_gps = None;
            self.fused.clear();
            self.fused_before_gps = None;
            self.went_back = true;
            let back_s = fused_to_gps - time;
            let text = format!(
                "the group's time goes back by {back_s:.0} s to that of this phone: more speaks for it"
            );
            self.notices.push(Notice { phone, kind: NoticeKind::WentBack, text });
            return true;
        }
        false
    }

    /// Time of the phone's last message with a confirmed date, if it arrived within `maximum_wait`.
    fn current_time(&self, phone: usize) -> Option<GpsTime> {
        let track = self.tracks.get(phone).filter(|track| track.presence != Presence::Finished)?;
        let last = track.last_confirmed?;
        (self.clock.now.saturating_sub(last.arrived) < self.options.maximum_wait).then_some(last.time)
    }

    fn is_slow(&self, phone: usize) -> bool {
        self.tracks.get(phone).and_then(Track::speed).is_some_and(|speed| speed < SLOW_SPEED)
    }

    fn newest_of_others(&self, phone: usize) -> Option<GpsTime> {
        let others = self.tracks.iter().enumerate().filter(|(other, track)| *other != phone && !track.ahead);
        others.filter_map(|(_, track)| track.newest()).max()
    }

    /// Whether time `one` has more support than time `other`.
    fn has_more_support(&self, one: GpsTime, other: GpsTime) -> bool {
        let recent = Some(self.options.maximum_wait);
        match self.support(one, other, recent).cmp(&self.support(other, one, recent)) {
            Ordering::Equal => match self.clock.wall_gps {
                Some(wall) => (one - wall).abs() < (other - wall).abs(),
                None => one > other,
            },
            ordering => ordering == Ordering::Greater,
        }
    }

    /// Support for a time: the phones nearer to it than to `other`, and heard within `recent`.
    fn support(&self, time: GpsTime, other: GpsTime, recent: Option<Duration>) -> Support {
        let Clock { now, wall_gps } = self.clock;
        let mut support = Support::default();
        for track in self.tracks.iter().filter(|track| track.presence != Presence::Finished) {
            let Some(last) = track.last_confirmed else { continue };
            let age = now.saturating_sub(last.arrived);
            if recent.is_some_and(|recent| age >= recent)
                || (last.time - time).abs() >= (last.time - other).abs()
            {
                continue;
            }
            let off_s = wall_gps.map(|wall| (last.time + age.as_secs_f64() - wall).abs());
            support.agrees_with_clock |=
                off_s.is_some_and(|off_s| off_s <= self.options.maximum_wait.as_secs_f64());
            support.positions += usize::from(track.has_position);
            support.phones += 1;
        }
        support
    }
}

/// Text on why a phone is behind; `slow` is its speed if that is too low.
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
