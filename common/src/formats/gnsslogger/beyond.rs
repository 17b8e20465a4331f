//! States of satellites, and observations of GLONASS satellites without a slot, which lines have beside usual observations.

use std::collections::BTreeMap;

use crate::gnss::{Observation, ObservationEpoch};
use crate::measurement::{ChannelObservation, GivenCorrections, RecordedEpoch, RecordedObservation};
use crate::time::GpsTime;

/// States and observations without a slot of an epoch.
#[derive(Clone, Debug, Default)]
pub(super) struct EpochBeyond {
    /// By the place of the observation in its epoch.
    given: BTreeMap<usize, GivenCorrections>,
    by_channel: Vec<ChannelObservation>,
}

impl EpochBeyond {
    /// Takes the state by the line of the observation at a place.
    pub(super) fn add_given(&mut self, place: usize, given: Option<GivenCorrections>) {
        if let Some(given) = given {
            self.given.insert(place, given);
        }
    }

    /// Takes an observation of a GLONASS satellite of which the phone knows the channel only.
    pub(super) fn add_by_channel(&mut self, channel: i8, observation: Observation) {
        self.by_channel.push(ChannelObservation { channel, observation });
    }

    /// Observations without a slot.
    pub(super) fn by_channel(&self) -> impl Iterator<Item = &Observation> {
        self.by_channel.iter().map(|known| &known.observation)
    }
}

/// The same for epochs that are complete and not given out yet.
#[derive(Clone, Debug, Default)]
pub(super) struct Beyond {
    epochs: BTreeMap<GpsTime, EpochBeyond>,
}

impl Beyond {
    /// Takes an epoch's, if it has any.
    pub(super) fn add(&mut self, time_gps: GpsTime, epoch: EpochBeyond) {
        if !epoch.given.is_empty() || !epoch.by_channel.is_empty() {
            self.epochs.insert(time_gps, epoch);
        }
    }

    /// The epoch, which is given out now, with the states of its lines; `None` if they have none. Earlier epochs are forgotten.
    pub(super) fn take(
        &mut self,
        epoch: &ObservationEpoch,
        glonass_channels: &BTreeMap<u8, i8>,
    ) -> Option<RecordedEpoch> {
        while self.epochs.first_key_value().is_some_and(|(time, _)| *time < epoch.time_gps) {
            self.epochs.pop_first();
        }
        let mut beyond = self.epochs.remove(&epoch.time_gps)?;
        let with_state = |(place, observation): (usize, &Observation)| {
            let satellite = observation.satellite;
            let channel = glonass_channels.get(&satellite.number).copied();
            RecordedObservation {
                observation: *observation,
                frequency_hz: observation.signal.frequency_hz(satellite.constellation, channel),
                given: beyond.given.remove(&place),
            }
        };
        let observations = epoch.observations.iter().enumerate().map(with_state).collect();
        Some(RecordedEpoch { time_gps: epoch.time_gps, observations, by_channel: beyond.by_channel })
    }
}
