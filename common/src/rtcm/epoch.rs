//! Messages of one instant to one epoch.

use super::msm::Message;
use crate::gnss::{EpochFlag, Observation, ObservationEpoch};
use crate::skips::Skips;
use crate::time::GpsTime;

/// After this many messages in a row that are older than the last epoch, it is the last epoch's time that was wrong.
const BACKWARD_LIMIT: u32 = 10;

/// Collects the epoch in work.
#[derive(Clone, Debug)]
pub(super) struct Assembler {
    pending: Option<ObservationEpoch>,
    /// The epoch given out last.
    closed: Option<ObservationEpoch>,
    /// Whether the multiple-message bit of this stream can be trusted to mark an epoch's last message.
    trust_last: bool,
    backward: u32,
}

impl Default for Assembler {
    fn default() -> Self {
        Self { pending: None, closed: None, trust_last: true, backward: 0 }
    }
}

impl Assembler {
    /// Whether a message of this time still belongs to the present or to a new epoch; one that is late is counted.
    pub(super) fn admits(&mut self, time: GpsTime, skips: &mut Skips) -> bool {
        let last = self.pending.as_ref().or(self.closed.as_ref()).map(|epoch| epoch.time_gps);
        let Some(last) = last.filter(|last| time < *last) else {
            self.backward = 0;
            return true;
        };
        self.backward += 1;
        if self.backward > BACKWARD_LIMIT {
            skips.add("the stream's time stepped back", || format!("from {last} to {time}"));
            self.backward = 0;
            return true;
        }
        skips.add("message older than the epoch before it", || format!("{time} after {last}"));
        false
    }

    /// Takes a message's observations; gives the epochs that it completes (its own, and one before it that lacked a last
    /// message).
    pub(super) fn add(
        &mut self,
        time: GpsTime,
        message: &Message,
        observations: Vec<Observation>,
        skips: &mut Skips,
    ) -> [Option<ObservationEpoch>; 2] {
        if self.belongs_to_closed(time, &observations, skips) {
            return [None, None];
        }
        let same = self.pending.as_ref().is_some_and(|pending| pending.time_gps == time);
        let before = if same { None } else { self.close() };
        let pending = self.pending.get_or_insert_with(|| ObservationEpoch {
            time_gps: time,
            flag: EpochFlag::Ok,
            observations: Vec::with_capacity(observations.len()),
        });
        for observation in observations {
            if pending.observations.iter().any(|known| is_same(known, &observation)) {
                skips.add("signal twice in one epoch", || {
                    format!("{} {} at {time}", observation.satellite, observation.signal)
                });
            } else {
                pending.observations.push(observation);
            }
        }
        let own = if self.trust_last && !message.more_follow { self.close() } else { None };
        [before, own]
    }

    /// Gives out the epoch in work at the stream's end. Unless only time ends this stream's epochs, a message is missing.
    pub(super) fn finish(&mut self, skips: &mut Skips) -> Option<ObservationEpoch> {
        let epoch = self.close()?;
        if self.trust_last {
            skips
                .add("last epoch lacks messages that were announced, kept", || format!("{}", epoch.time_gps));
        }
        Some(epoch)
    }

    /// Gives out the epoch in work.
    fn close(&mut self) -> Option<ObservationEpoch> {
        let epoch = self.pending.take()?;
        self.closed = Some(epoch.clone());
        Some(epoch).filter(|epoch| !epoch.observations.is_empty())
    }

    /// Whether the message comes after its epoch's last one. When it brings something new, the stream marks last
    /// messages wrongly, and from here on only a change of time ends an epoch.
    fn belongs_to_closed(&mut self, time: GpsTime, observations: &[Observation], skips: &mut Skips) -> bool {
        let Some(closed) = self.closed.as_ref().filter(|closed| closed.time_gps == time) else {
            return false;
        };
        if observations.iter().all(|o| closed.observations.iter().any(|known| is_same(known, o))) {
            skips.add("message repeated", || format!("at {time}"));
        } else {
            skips.add("message after the one marked as its epoch's last", || {
                format!("at {time}; from here on an epoch lasts until the time changes")
            });
            self.trust_last = false;
        }
        true
    }
}

fn is_same(a: &Observation, b: &Observation) -> bool {
    (a.satellite, a.signal) == (b.satellite, b.signal)
}
