//! When a recording was made, found before it is decoded.
//!
//! Observation messages lack the week, those of GLONASS even the day, and what stands for it (a date that somebody gave, a file's last change) may
//! be wrong. Ephemerides state their week, but come later in the stream, and one of them may be wrong. So a recording is looked through first: where its
//! observations go on, the week on which most satellites agree is the right one, and where no ephemeris tells, the one that follows from what stands for it.

mod place;

use self::place::Claims;
use super::clock::{SentTime, StreamClock};
use super::date::Claim;
use super::{MAX_BYTES_BEFORE_FIRST_FRAME, RtcmOptions, ephemeris, frame, glonass};
use crate::formats::bits::Bits;
use crate::gnss::Constellation;
use crate::skips::Skips;
use crate::time::{GpsTime, SECONDS_PER_DAY, SECONDS_PER_WEEK};

/// A longer step, forward or back, begins another part of a recording, s.
const PART_S: f64 = 3_600.0;
/// Parts that are told apart at most.
const MOST_PARTS: usize = 1_000;
/// A file system's clock may be in another time zone, s.
const LAST_CHANGE_SLACK_S: f64 = 14.0 * 3_600.0;
/// The same where the day is searched for and not the week, s.
const LAST_CHANGE_SLACK_OF_DAYS_S: f64 = 3_600.0;

/// What stands for a recording's date.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DatingHint {
    /// It begins near an instant.
    Near(GpsTime),
    /// It does not end after an instant, the file's last change.
    NotAfter(GpsTime),
}

/// When a recording was made.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamDates {
    begins: GpsTime,
    changes: Vec<(u64, GpsTime)>,
    are_stated: bool,
    moved_s: f64,
}

impl StreamDates {
    /// The beginning.
    pub const fn begins(&self) -> GpsTime {
        self.begins
    }

    /// Where the date is not that of what came before, or not known from it: frames and instants, in order.
    pub(super) fn changes(&self) -> &[(u64, GpsTime)] {
        &self.changes
    }

    /// Whether ephemerides in the stream state the week.
    pub const fn are_stated(&self) -> bool {
        self.are_stated
    }

    /// How far the beginning is from where the hint alone would have it, s: whole weeks, or days of GLONASS alone.
    pub const fn moved_s(&self) -> f64 {
        self.moved_s
    }
}

/// Looks through a recording for its dates.
#[derive(Clone, Debug)]
pub struct Dating {
    hint: DatingHint,
    framer: frame::Framer,
    /// By the observations that tell the time of the week.
    weekly: Track,
    /// By GLONASS'.
    glonass: Track,
    /// Ephemerides without observations.
    alone: Claims,
    /// As the hint has it.
    clock: StreamClock,
    skips: Skips,
}

impl Dating {
    /// At the beginning of a recording. `leap_seconds` as in [`RtcmOptions`], near the hint.
    pub fn new(hint: DatingHint, leap_seconds: u8) -> Self {
        let (DatingHint::Near(near) | DatingHint::NotAfter(near)) = hint;
        let clock = RtcmOptions { near, leap_seconds }.clock();
        Self {
            hint,
            framer: frame::Framer::default(),
            weekly: Track::new(clock),
            glonass: Track::new(clock),
            alone: Claims::default(),
            clock,
            skips: Skips::default(),
        }
    }

    /// Takes the next bytes.
    pub fn feed(&mut self, bytes: &[u8]) {
        self.framer.push(bytes);
        self.drain(false);
    }

    /// Valid frames so far.
    pub const fn frames(&self) -> u64 {
        self.framer.frames()
    }

    /// Whether so many bytes have come without a frame that this is no stream of RTCM 3.
    pub const fn is_hopeless(&self) -> bool {
        self.framer.frames() == 0 && self.framer.outside() >= MAX_BYTES_BEFORE_FIRST_FRAME
    }

    /// The dates; `None` when nothing in the stream has any.
    pub fn finish(mut self) -> Option<StreamDates> {
        self.drain(true);
        if let Some(dates) = self.weekly.dates(SECONDS_PER_WEEK, self.hint) {
            return Some(dates);
        }
        // Where no date tells more, GLONASS' days of the week are as good as weeks.
        let has_dates = self.glonass.parts.iter().any(|part| !part.claims.is_empty());
        let step_s = if self.glonass.has_days && !has_dates { SECONDS_PER_WEEK } else { SECONDS_PER_DAY };
        if let Some(dates) = self.glonass.dates(step_s, self.hint) {
            return Some(dates);
        }
        let begins = self.alone.agreed(self.clock.now())?;
        let weeks = ((begins - self.clock.now()) / SECONDS_PER_WEEK).round();
        let moved_s = weeks * SECONDS_PER_WEEK;
        Some(StreamDates { begins, changes: Vec::new(), are_stated: true, moved_s })
    }

    fn drain(&mut self, ended: bool) {
        while let Some(message) = self.framer.next(ended, MAX_BYTES_BEFORE_FIRST_FRAME, &mut self.skips) {
            self.message(&message);
        }
    }

    fn message(&mut self, bytes: &[u8]) {
        let frame = self.framer.frames();
        match super::sent_time(bytes) {
            Some((Constellation::Sbas, _)) => {}
            Some((Constellation::Glonass, sent)) => {
                self.glonass.observed(frame, Constellation::Glonass, sent);
            }
            Some((constellation, sent)) => self.weekly.observed(frame, constellation, sent),
            None => {
                if let Some(claim) = self.claim(bytes) {
                    self.alone.add(claim, self.clock.now());
                    self.weekly.claimed(claim);
                    self.glonass.claimed(claim);
                }
            }
        }
    }

    fn claim(&self, bytes: &[u8]) -> Option<Claim> {
        match Bits::new(bytes).unsigned(12).ok()? {
            number @ (1019 | 1042 | 1044..=1046) => Some(ephemeris::read(bytes, number).ok()?.claim()),
            1020 => glonass::read(bytes).ok()?.claim(&self.clock),
            _ => None,
        }
    }
}

/// The observations of a recording by their times, and what ephemerides say beside them.
#[derive(Clone, Debug)]
struct Track {
    clock: StreamClock,
    /// The last time of each system.
    systems: Vec<(Constellation, GpsTime)>,
    parts: Vec<Part>,
    /// Stated before the first observation.
    early: Vec<Claim>,
    /// Whether GLONASS' day of the week was believed at the beginning.
    has_days: bool,
}

/// Observations without a long step.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// The first frame.
    frame: u64,
    begins: GpsTime,
    ends: GpsTime,
    claims: Claims,
}

impl Track {
    const fn new(clock: StreamClock) -> Self {
        Self { clock, systems: Vec::new(), parts: Vec::new(), early: Vec::new(), has_days: false }
    }

    fn observed(&mut self, frame: u64, constellation: Constellation, sent: SentTime) {
        let Some(resolved) = self.clock.resolve(constellation, sent) else { return };
        let time = resolved.time;
        let own = self.systems.iter_mut().find(|(system, _)| *system == constellation);
        let before = own.as_ref().map(|(_, time)| *time);
        match own {
            Some((_, last)) => *last = time,
            None => self.systems.push((constellation, time)),
        }
        let Some(part) = self.parts.last_mut() else {
            self.has_days = sent.has_day() && !resolved.contradicts_day;
            return self.begin_part(frame, time);
        };
        let is_with_others = (time - part.ends).abs() <= PART_S;
        // A system that is hours off the others, but goes on from itself, says nothing.
        let steps = before.is_some_and(|before| (time - before).abs() > PART_S);
        if is_with_others {
            part.ends = part.ends.max(time);
            self.clock.set(time);
        } else if steps && self.parts.len() < MOST_PARTS {
            self.begin_part(frame, time);
        }
    }

    fn begin_part(&mut self, frame: u64, time: GpsTime) {
        let mut claims = Claims::default();
        for claim in std::mem::take(&mut self.early) {
            claims.add(claim, time);
        }
        self.parts.push(Part { frame, begins: time, ends: time, claims });
        self.clock.set(time);
    }

    fn claimed(&mut self, claim: Claim) {
        match self.parts.last_mut() {
            Some(part) => part.claims.add(claim, part.ends),
            None if self.early.len() < place::MOST_CLAIMS => self.early.push(claim),
            None => {}
        }
    }

    /// When the parts were recorded: whole steps from where they are by the hint.
    fn dates(&self, step_s: f64, hint: DatingHint) -> Option<StreamDates> {
        let ends = self.parts.last()?.ends;
        let by_hint = match hint {
            DatingHint::Near(_) => 0.0,
            DatingHint::NotAfter(time) => {
                let is_week = step_s > SECONDS_PER_DAY;
                let slack_s = if is_week { LAST_CHANGE_SLACK_S } else { LAST_CHANGE_SLACK_OF_DAYS_S };
                ((time - ends + slack_s) / step_s).floor()
            }
        };
        place::dates(&self.parts, step_s, by_hint)
    }
}
