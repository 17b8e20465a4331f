//! State of simulated satellites: message in force, signals and their delays.

use rand::Rng;
use rand_distr::StandardNormal;

use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::frames::LocalFrame;
use crate::gnss::{Constellation, SatelliteId, SignalCode};
use crate::orbit::{KeplerEphemeris, SatelliteState};
use crate::time::GpsTime;

use super::random::Streams;
use super::shared::{SharedErrors, SlowProcess};

/// Sine of the elevation below which a satellite is skipped early (−2°).
const FAR_BELOW_HORIZON: f64 = -0.035;

/// One satellite with all its messages.
#[derive(Clone, Debug)]
pub(super) struct SimulatedSatellite {
    messages: Vec<KeplerEphemeris>,
    id: SatelliteId,
    /// Standard normal draw for the delay of L5.
    l5_delay: f64,
    /// Standard normal draw for the error of orbit and clock in the message.
    signal_in_space: f64,
    /// Bias of unit variance, the same at all phones.
    bias: SlowProcess,
}

impl SimulatedSatellite {
    /// Groups messages, which are ordered by satellite and then by time, and draws the errors that are not in the messages, for a
    /// scenario of `duration_s`.
    pub(super) fn group(
        messages: &[KeplerEphemeris],
        streams: Streams,
        shared: &SharedErrors,
        duration_s: f64,
    ) -> Vec<Self> {
        let mut random = streams.satellite_errors();
        messages
            .chunk_by(|a, b| a.satellite == b.satellite)
            .enumerate()
            .filter_map(|(index, messages)| {
                let id = messages.first()?.satellite;
                let (l5_delay, signal_in_space) =
                    (random.sample(StandardNormal), random.sample(StandardNormal));
                let bias =
                    SlowProcess::new(duration_s, shared.time_constant_s, streams.satellite_bias(index));
                Some(Self { messages: messages.to_vec(), id, l5_delay, signal_in_space, bias })
            })
            .collect()
    }

    /// The satellite.
    pub(super) const fn id(&self) -> SatelliteId {
        self.id
    }

    /// State at `time` by the latest message whose reference time is not after it.
    pub(super) fn state(&self, time: GpsTime) -> Option<SatelliteState> {
        let index = self.messages.partition_point(|message| message.toe <= time).saturating_sub(1);
        self.messages.get(index).map(|message| message.state(time))
    }

    /// Fast check whether the satellite is above −2° at the origin of `frame`.
    pub(super) fn may_be_above_horizon(&self, time: GpsTime, frame: &LocalFrame) -> bool {
        self.state(time).is_some_and(|state| {
            let sight = (state.position - frame.origin()).0;
            sight.dot(&frame.up()) > FAR_BELOW_HORIZON * sight.norm()
        })
    }

    /// Signals that a phone tracks, the primary one first. Two of three GPS satellites transmit L5.
    pub(super) fn signals(&self, dual_frequency: bool) -> impl Iterator<Item = SignalCode> {
        let SatelliteId { constellation, number } = self.id;
        let primary = match constellation {
            Constellation::Beidou => SignalCode::new(b'2', b'I'),
            _ => SignalCode::new(b'1', b'C'),
        };
        let has_l5 = dual_frequency && constellation == Constellation::Gps && !number.is_multiple_of(3);
        std::iter::once(primary).chain(has_l5.then_some(SignalCode::new(b'5', b'X')))
    }

    /// Range error of the message in the direction of every phone, m; its standard deviation is `sigma_m`.
    pub(super) fn signal_in_space_m(&self, sigma_m: f64) -> f64 {
        sigma_m * self.signal_in_space
    }

    /// Slow range bias at `time_s` since the scenario's start, m.
    pub(super) fn bias_m(&self, shared: &SharedErrors, time_s: f64) -> f64 {
        shared.satellite_bias_sigma_m(self.id.constellation) * self.bias.at(time_s)
    }

    /// Delay of a signal relative to the broadcast clock, m: by the message, and on L5 `l5_sigma_m` times a constant
    /// that is in no message.
    pub(super) fn group_delay_m(&self, signal: SignalCode, l5_sigma_m: f64) -> f64 {
        if signal.band == b'5' {
            return l5_sigma_m * self.l5_delay;
        }
        let (first_s, second_s) = self.messages.first().map_or((0.0, 0.0), |message| message.group_delays_s);
        // I/NAV clocks refer to E1/E5b, the second delay of the message
        let delay_s = if self.id.constellation == Constellation::Galileo { second_s } else { first_s };
        SPEED_OF_LIGHT_MPS * delay_s
    }
}
