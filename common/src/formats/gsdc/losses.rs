//! Losses of lock, with which the next phase of their signal is marked.

use std::collections::BTreeSet;

use crate::formats::lost_locks::{LostLocks, SignalKey};
use crate::formats::time_order::LONG_STEP_S;
use crate::gnss::{SatelliteId, SignalCode};
use crate::measurement::RecordedEpoch;
use crate::time::GpsTime;

/// Losses that wait for their epoch at most; of a minute there are some thousand.
const MAX_REFUSED: usize = 20_000;

/// Losses of lock by rows that give no observation, and losses whose signal has had no phase since.
#[derive(Clone, Debug, Default)]
pub(super) struct Losses {
    refused: BTreeSet<(GpsTime, SatelliteId, SignalCode)>,
    locks: LostLocks,
}

impl Losses {
    /// Takes a loss of lock by a row that is not used. Its time counts if it is not far ahead of the latest believed time;
    /// otherwise that time counts.
    pub(super) fn note(
        &mut self,
        (satellite, signal): SignalKey,
        time: Option<GpsTime>,
        latest: Option<GpsTime>,
    ) {
        let latest = latest.or(time).unwrap_or_default();
        let time = time.filter(|time| *time - latest <= LONG_STEP_S).unwrap_or(latest);
        self.refused.insert((time, satellite, signal));
        if self.refused.len() > MAX_REFUSED {
            self.take_first();
        }
    }

    /// The same if `is_lost`.
    pub(super) fn note_if(
        &mut self,
        is_lost: bool,
        signal: SignalKey,
        time: Option<GpsTime>,
        latest: Option<GpsTime>,
    ) {
        if is_lost {
            self.note(signal, time, latest);
        }
    }

    /// Marks the phases of an epoch, which come in order of time, that follow a loss of lock.
    pub(super) fn mark(&mut self, time_gps: GpsTime, epoch: &mut RecordedEpoch) {
        while self.refused.first().is_some_and(|(time, ..)| *time < time_gps) {
            self.take_first();
        }
        for recorded in &mut epoch.observations {
            let observation = &mut recorded.observation;
            let has_phase = observation.carrier_phase_cycles.is_some();
            let is_lost = observation.loss_of_lock.cycle_slip;
            observation.loss_of_lock.cycle_slip =
                self.locks.observe((observation.satellite, observation.signal), is_lost, has_phase);
        }
    }

    fn take_first(&mut self) {
        if let Some((_, satellite, signal)) = self.refused.pop_first() {
            self.locks.observe((satellite, signal), true, false);
        }
    }
}
