//! When observation messages are: their time, and whether they are let through.

use super::RtcmDecoder;
use super::clock::{Resolved, SentTime, StreamClock};
use super::gate::{Ahead, Ruling};
use crate::formats::bits::Bits;
use crate::formats::time_order::LONG_STEP_S;
use crate::gnss::Constellation;
use crate::skips::Reason;
use crate::time::GpsTime;

impl RtcmDecoder {
    /// The time of an observation message that is let through; the stream's clock follows it.
    pub(super) fn admitted(
        &mut self,
        bytes: &[u8],
        constellation: Constellation,
        sent: SentTime,
    ) -> Option<GpsTime> {
        if !self.clock.is_running() && !self.begins(bytes, constellation, sent) {
            return None;
        }
        let Some(mut resolved) = self.clock.resolve(constellation, sent) else {
            self.impossible(bytes, sent);
            return None;
        };
        if self.gate.ahead.is_some() {
            resolved = self.compare_with_ahead(bytes, constellation, sent, resolved)?;
        }
        let time = resolved.time;
        match self.gate.rule(time, constellation, &mut self.skips) {
            Ruling::Admitted => {}
            Ruling::Late => return None,
            Ruling::Ahead => {
                self.gate.ahead = Some(Box::new(Ahead::new(time, constellation, bytes)));
                return None;
            }
        }
        if resolved.contradicts_day {
            self.skips.add(Reason::GlonassDayContradictsStream, || format!("{sent:?} at {time}"));
        }
        self.clock.learn_day(sent, resolved);
        self.clock.set(time);
        Some(time)
    }

    fn impossible(&mut self, bytes: &[u8], sent: SentTime) {
        self.skips.add(Reason::MessageImpossibleTime, || {
            let number = Bits::new(bytes).unsigned(12).unwrap_or_default();
            format!("message {number}: {sent:?}")
        });
    }

    /// At the beginning: whether a message tells the time. GLONASS, which says at most the day of the week, waits for others.
    fn begins(&mut self, bytes: &[u8], constellation: Constellation, sent: SentTime) -> bool {
        let Some(Resolved { time, .. }) = self.clock.resolve(constellation, sent) else {
            // It is counted as what it is.
            return true;
        };
        if constellation != Constellation::Glonass {
            self.release_early(Some(time));
        } else if self.gate.keep_early(bytes) {
            return false;
        } else {
            self.release_early(None);
        }
        true
    }

    /// The stream begins at about an instant that is known.
    pub(super) fn begin_at(&mut self, time: GpsTime) {
        self.clock.set(time);
        self.gate.begin(time);
    }

    /// Takes up the GLONASS messages that waited for the time of the week; without a time theirs begins the stream.
    fn release_early(&mut self, time: Option<GpsTime>) {
        if let Some(time) = time.filter(|_| self.gate.has_early()) {
            self.begin_at(time);
        }
        for message in self.gate.release_early() {
            if !self.clock.is_running() {
                self.begin_with_glonass(&message);
            }
            self.message(&message);
        }
    }

    /// The first GLONASS message of a stream without other systems sets the clock, by its day of the week and where that was to be.
    fn begin_with_glonass(&mut self, message: &[u8]) {
        if let Some((_, sent)) = super::sent_time(message)
            && let Some(Resolved { time, .. }) = self.clock.resolve(Constellation::Glonass, sent)
        {
            self.clock.set(time);
        }
    }

    /// Nothing more comes that could confirm or contradict what waits.
    pub(super) fn release_waiting(&mut self) {
        if self.gate.has_early() {
            self.release_early(None);
        }
        if let Some(ahead) = self.gate.ahead.take() {
            self.confirm(*ahead);
        }
    }

    /// What a message tells of those that are far ahead and wait: confirmed they are taken up, contradicted left out. Gives the message's own time, unless
    /// it joins them.
    fn compare_with_ahead(
        &mut self,
        bytes: &[u8],
        constellation: Constellation,
        sent: SentTime,
        mut resolved: Resolved,
    ) -> Option<Resolved> {
        let mut ahead = self.gate.ahead.take()?;
        // GLONASS' day is the one nearest to the others' time.
        let near_ahead = self.clock.at(ahead.time).resolve(constellation, sent);
        if let Some(other) = near_ahead.filter(|other| is_about(other.time, ahead.time)) {
            resolved = other;
        } else if ahead.constellation == Constellation::Glonass {
            ahead.time = redated(&self.clock, &ahead, resolved.time).unwrap_or(ahead.time);
        }
        let time = resolved.time;
        let goes_on = self.gate.goes_on(time);
        if self.gate.is_late(time) {
            // It says nothing about what comes next.
            self.gate.ahead = Some(ahead);
            return Some(resolved);
        }
        if !goes_on && time == ahead.time && constellation == ahead.constellation {
            ahead.add(bytes);
            self.gate.ahead = Some(ahead);
            return None;
        }
        if goes_on || time < ahead.time && !is_about(time, ahead.time) {
            let count = ahead.messages.len();
            for _ in 0..count {
                self.skips.add(Reason::MessageFarAhead, || {
                    format!("{:?}: {}, then {time}", ahead.constellation, ahead.time)
                });
            }
        } else {
            self.confirm(*ahead);
        }
        Some(resolved)
    }

    /// Takes up messages that waited.
    fn confirm(&mut self, ahead: Ahead) {
        self.clock.set(ahead.time);
        self.gate.pass(ahead.time, ahead.constellation);
        for message in ahead.messages {
            self.message(&message);
        }
    }
}

/// The time of GLONASS messages that wait, by the day that is nearest to an instant, if that is about it.
fn redated(clock: &StreamClock, ahead: &Ahead, near: GpsTime) -> Option<GpsTime> {
    let (_, sent) = super::sent_time(ahead.messages.first()?)?;
    let resolved = clock.at(near).resolve(Constellation::Glonass, sent)?;
    Some(resolved.time).filter(|time| is_about(*time, near))
}

fn is_about(a: GpsTime, b: GpsTime) -> bool {
    (a - b).abs() <= LONG_STEP_S
}
