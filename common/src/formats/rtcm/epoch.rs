//! Messages of one instant to one epoch.

use std::collections::BTreeMap;

use crate::gnss::{EpochFlag, Observation, ObservationEpoch, SatelliteId, SignalCode};
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;

/// Which kind of message says an observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Family {
    /// Multiple signal messages.
    Msm,
    /// Messages 1001 to 1004 and 1009 to 1012. They give way to the others: their resolution is coarser.
    Legacy,
}

/// What one message brings.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// The epoch.
    pub(super) time: GpsTime,
    /// Of which kind the message is.
    pub(super) family: Family,
    /// Whether the message announces another one of its epoch.
    pub(super) more_follow: bool,
    /// Its observations.
    pub(super) observations: Vec<Observation>,
}

/// An epoch in work.
#[derive(Clone, Debug)]
struct Collected {
    time: GpsTime,
    observations: Vec<(Family, Observation)>,
}

impl Collected {
    fn count(&self, wanted: impl Fn(Family, &Observation) -> bool) -> usize {
        self.observations.iter().filter(|(family, known)| wanted(*family, known)).count()
    }

    fn has(&self, family: Family, observation: &Observation) -> bool {
        self.count(|of, known| of == family && is_same(known, observation)) > 0
    }

    /// Whether a multiple signal message has said already what a legacy message says.
    fn outranks(&self, family: Family, observation: &Observation) -> bool {
        family == Family::Legacy
            && self.count(|of, known| of == Family::Msm && is_same_band(known, observation)) > 0
    }

    /// Removes what a legacy message said of a signal that a multiple signal message now says; gives how many that were.
    fn give_way(&mut self, family: Family, observation: &Observation) -> usize {
        let before = self.observations.len();
        if family == Family::Msm {
            self.observations.retain(|(of, known)| *of == Family::Msm || !is_same_band(known, observation));
        }
        before - self.observations.len()
    }
}

/// Collects the epoch in work.
#[derive(Clone, Debug)]
pub(super) struct Assembler {
    pending: Option<Collected>,
    /// The epoch given out last.
    closed: Option<Collected>,
    /// Of which kind each signal's last phase was.
    phase_families: BTreeMap<(SatelliteId, SignalCode), Family>,
    /// Whether the multiple-message bit of this stream can be trusted to mark an epoch's last message.
    trust_last: bool,
}

impl Default for Assembler {
    fn default() -> Self {
        Self { pending: None, closed: None, phase_families: BTreeMap::new(), trust_last: true }
    }
}

impl Assembler {
    /// Takes a message's observations; gives the epochs that it completes (its own, and one before it that lacked a last
    /// message).
    pub(super) fn add(&mut self, part: Part, skips: &mut Skips) -> [Option<ObservationEpoch>; 2] {
        let Part { time, family, more_follow, observations } = part;
        if self.belongs_to_closed(time, family, &observations, skips) {
            return [None, None];
        }
        let same = self.pending.as_ref().is_some_and(|pending| pending.time == time);
        let before = if same { None } else { self.close() };
        let pending = self
            .pending
            .get_or_insert_with(|| Collected { time, observations: Vec::with_capacity(observations.len()) });
        for observation in observations {
            let describe = || format!("{} {} at {time}", observation.satellite, observation.signal);
            if pending.has(family, &observation) {
                skips.add(Reason::SignalTwice, describe);
            } else if pending.outranks(family, &observation) {
                skips.add(Reason::LegacyObservationOutranked, describe);
            } else {
                (0..pending.give_way(family, &observation))
                    .for_each(|_| skips.add(Reason::LegacyObservationOutranked, describe));
                pending.observations.push((family, observation));
            }
        }
        let own = if self.trust_last && !more_follow { self.close() } else { None };
        [before, own]
    }

    /// Gives out the epoch in work at the stream's end. Unless only time ends this stream's epochs, a message is missing.
    pub(super) fn finish(&mut self, skips: &mut Skips) -> Option<ObservationEpoch> {
        let epoch = self.close()?;
        if self.trust_last {
            skips.add(Reason::LastEpochLacksMessages, || format!("{}", epoch.time_gps));
        }
        Some(epoch)
    }

    /// Gives out the epoch in work.
    fn close(&mut self) -> Option<ObservationEpoch> {
        let collected = self.pending.take()?;
        let time_gps = collected.time;
        let given = collected.observations.iter().map(|(family, o)| self.continued(*family, *o)).collect();
        self.closed = Some(collected);
        Some(ObservationEpoch { time_gps, flag: EpochFlag::Ok, observations: given })
            .filter(|epoch| !epoch.observations.is_empty())
    }

    /// Where the kind of message changes, the phase may have a step of whole cycles.
    fn continued(&mut self, family: Family, mut observation: Observation) -> Observation {
        if observation.carrier_phase_cycles.is_some() {
            let before = self.phase_families.insert((observation.satellite, observation.signal), family);
            observation.loss_of_lock.cycle_slip |= before.is_some_and(|before| before != family);
        }
        observation
    }

    /// Whether the message comes after its epoch's last one. When it brings something new, the stream marks last
    /// messages wrongly, and from here on only a change of time ends an epoch.
    fn belongs_to_closed(
        &mut self,
        time: GpsTime,
        family: Family,
        observations: &[Observation],
        skips: &mut Skips,
    ) -> bool {
        let Some(closed) = self.closed.as_ref().filter(|closed| closed.time == time) else {
            return false;
        };
        let outranked = observations.iter().filter(|o| closed.outranks(family, o)).count();
        if outranked > 0 && outranked == observations.len() {
            (0..outranked)
                .for_each(|_| skips.add(Reason::LegacyObservationOutranked, || format!("at {time}")));
        } else if observations.iter().all(|o| closed.has(family, o) || closed.outranks(family, o)) {
            skips.add(Reason::MessageRepeated, || format!("at {time}"));
        } else {
            skips.add(Reason::MessageAfterLastOfEpoch, || {
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

/// The indicators of legacy messages do not tell signals of a band apart as well as the masks do.
fn is_same_band(a: &Observation, b: &Observation) -> bool {
    (a.satellite, a.signal.band) == (b.satellite, b.signal.band)
}
