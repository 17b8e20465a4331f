//! Which observation messages are let through: in order of time, although a message or all those of a system may have a wrong time.
//!
//! - A message far ahead of the stream waits for the next one: what goes on from there confirms it, what goes on from before shows that it was
//!   wrong. So no system moves the others' clock, and a gap costs nothing.
//! - Messages that are late are left out. When more of them come than the systems ahead of them can outweigh, it is the stream that was set
//!   back, or was ahead by mistake. GLONASS, which does not send the time of the week, weighs less than the others.
//! - At the beginning GLONASS waits for a message with the time of the week.

use crate::formats::time_order::LONG_STEP_S;
use crate::gnss::Constellation;
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;

/// Number of late messages after which the gate decides which systems are late.
const LATE_LIMIT: u32 = 10;
/// Largest number of messages that wait.
const MOST_WAITING: usize = 16;

/// What becomes of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ruling {
    /// It is let through.
    Admitted,
    /// It is left out, and counted.
    Late,
    /// It is far ahead of the stream.
    Ahead,
}

/// Messages that are far ahead of the stream, all of one system and instant.
#[derive(Clone, Debug)]
pub(super) struct Ahead {
    pub(super) time: GpsTime,
    pub(super) constellation: Constellation,
    /// As they came.
    pub(super) messages: Vec<Vec<u8>>,
}

impl Ahead {
    /// One message.
    pub(super) fn new(time: GpsTime, constellation: Constellation, message: &[u8]) -> Self {
        Self { time, constellation, messages: vec![message.to_vec()] }
    }

    /// Adds a message of the same system and instant.
    pub(super) fn add(&mut self, message: &[u8]) {
        if self.messages.len() < MOST_WAITING {
            self.messages.push(message.to_vec());
        }
    }
}

/// Lets messages through or not.
#[derive(Clone, Debug, Default)]
pub(super) struct Gate {
    /// The time of the message that was let through last.
    last: Option<GpsTime>,
    /// Late messages since these began to be counted, and whose they are.
    late: u32,
    late_systems: Systems,
    /// Whose messages were let through since then.
    admitted_systems: Systems,
    /// What waits to be confirmed.
    pub(super) ahead: Option<Box<Ahead>>,
    /// GLONASS messages that wait for the time of the week.
    early: Vec<Vec<u8>>,
}

/// A set of systems, a bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Systems(u8);

impl Systems {
    const fn add(&mut self, constellation: Constellation) {
        self.0 |= 1 << constellation as u8;
    }

    /// The systems that send the time of the week count twice.
    const fn weight(self) -> u32 {
        let glonass = self.0 >> Constellation::Glonass as u8 & 1;
        2 * self.0.count_ones() - glonass as u32
    }
}

impl Gate {
    /// Whether a message of this time still belongs to the present or to a new epoch. One that is let through is the stream's last from now on; one
    /// that is late is counted.
    pub(super) fn rule(&mut self, time: GpsTime, constellation: Constellation, skips: &mut Skips) -> Ruling {
        let ruling = match self.last {
            Some(last) if time < last => self.rule_late(time, last, constellation, skips),
            Some(last) if time - last > LONG_STEP_S => Ruling::Ahead,
            _ => Ruling::Admitted,
        };
        if ruling == Ruling::Admitted {
            self.pass(time, constellation);
        }
        ruling
    }

    fn rule_late(
        &mut self,
        time: GpsTime,
        last: GpsTime,
        constellation: Constellation,
        skips: &mut Skips,
    ) -> Ruling {
        self.late += 1;
        self.late_systems.add(constellation);
        let is_decided = self.late > LATE_LIMIT;
        let is_set_back = is_decided && self.late_systems.weight() > self.admitted_systems.weight();
        if is_decided {
            self.count_anew();
        }
        if is_set_back {
            skips.add(Reason::StreamTimeSteppedBack, || format!("from {last} to {time}"));
            return Ruling::Admitted;
        }
        skips.add(Reason::MessageOlderThanEpoch, || format!("{constellation:?}: {time} after {last}"));
        Ruling::Late
    }

    /// Whether a time is that of the stream's present or of what follows it without a long step.
    pub(super) fn goes_on(&self, time: GpsTime) -> bool {
        self.last.is_none_or(|last| (0.0..=LONG_STEP_S).contains(&(time - last)))
    }

    /// Whether a time is before the stream's present.
    pub(super) fn is_late(&self, time: GpsTime) -> bool {
        self.last.is_some_and(|last| time < last)
    }

    fn count_anew(&mut self) {
        self.late = 0;
        (self.late_systems, self.admitted_systems) = (Systems::default(), Systems::default());
    }

    /// The stream is at an instant.
    pub(super) fn pass(&mut self, time: GpsTime, constellation: Constellation) {
        self.last = Some(time);
        if self.late > 0 {
            self.admitted_systems.add(constellation);
        }
    }

    /// Keeps a GLONASS message at the beginning of the stream. Not when so many have come that there is no other system.
    pub(super) fn keep_early(&mut self, message: &[u8]) -> bool {
        let is_kept = self.early.len() < MOST_WAITING;
        if is_kept {
            self.early.push(message.to_vec());
        }
        is_kept
    }

    /// Whether messages wait for the time of the week.
    pub(super) const fn has_early(&self) -> bool {
        !self.early.is_empty()
    }

    /// The stream begins at about an instant: what is not of about it will be late or far ahead.
    pub(super) fn begin(&mut self, time: GpsTime) {
        self.last = self.last.or(Some(time + -LONG_STEP_S));
    }

    /// The messages that wait for the time of the week.
    pub(super) fn release_early(&mut self) -> Vec<Vec<u8>> {
        std::mem::take(&mut self.early)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Constellation::{Beidou, Galileo, Glonass, Gps};

    fn at(seconds: f64) -> GpsTime {
        GpsTime::from_week_tow(2_118, 100_000.0) + seconds
    }

    /// How many messages of the last system are let through of epochs of these systems, whose times are off by seconds.
    fn admitted(offsets: &[(Constellation, f64)]) -> Vec<usize> {
        let (mut gate, mut skips) = (Gate::default(), Skips::default());
        let mut counts = vec![0; offsets.len()];
        for second in 0..30 {
            for ((constellation, offset_s), count) in offsets.iter().zip(&mut counts) {
                let time = at(f64::from(second) + offset_s);
                *count += usize::from(gate.rule(time, *constellation, &mut skips) == Ruling::Admitted);
            }
        }
        counts
    }

    #[test]
    fn a_system_hours_off_costs_no_other() {
        const HOURS_S: f64 = 3.0 * 3_600.0;
        assert_eq!(admitted(&[(Gps, 0.0), (Glonass, 0.0)]), [30, 30]);
        for off in [HOURS_S, -HOURS_S] {
            assert_eq!(admitted(&[(Gps, 0.0), (Glonass, off)]), [30, 0], "{off}");
            assert_eq!(admitted(&[(Gps, 0.0), (Beidou, off), (Galileo, 0.0)]), [30, 0, 30], "{off}");
            assert_eq!(admitted(&[(Gps, 0.0), (Beidou, off)]), [30, 0], "{off}: the first is believed");
        }
        // Wrong from the first message on, until the others outweigh it.
        assert_eq!(admitted(&[(Glonass, HOURS_S), (Gps, 0.0)]), [11, 20]);
        assert_eq!(admitted(&[(Beidou, HOURS_S), (Gps, 0.0), (Galileo, 0.0)]), [6, 25, 25]);
    }

    #[test]
    fn a_stream_set_back_goes_on() {
        let (mut gate, mut skips) = (Gate::default(), Skips::default());
        assert_eq!(gate.rule(at(5_000.0), Gps, &mut skips), Ruling::Admitted);
        let rulings: Vec<_> =
            (0..12).map(|second| gate.rule(at(f64::from(second)), Gps, &mut skips)).collect();
        assert_eq!(rulings[9..], [Ruling::Late, Ruling::Admitted, Ruling::Admitted]);
        assert_eq!(skips.count(Reason::StreamTimeSteppedBack), 1);
    }
}
