//! GLONASS satellites that a phone knows by their frequency channel only.
//!
//! Two satellites at opposite positions of one orbital plane share a channel (GLONASS ICD, L1 and L2, edition 5.1, 3.3.1.1), so at most one
//! of both is above the horizon.

use super::correct::Corrector;
use super::given::ChannelObservation;
use super::prepared::PreparedObservation;
use crate::constants::{EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS};
use crate::frames::{Ecef, LocalFrame};
use crate::gnss::{Constellation, EpochFlag, Observation, ObservationEpoch, SatelliteId};
use crate::skips::Reason;
use crate::time::GpsTime;

/// Slot numbers (GLONASS ICD: 24, and room for three more).
const SLOTS: std::ops::RangeInclusive<u8> = 1..=27;
/// Maximum difference, m, between the receiver clock from a pseudorange and that of the other satellites. A wrong satellite differs by
/// hundreds of kilometres; an approximate position and the clocks of different systems differ by a few.
const MOST_FROM_CLOCK_M: f64 = 2e4;

impl Corrector {
    /// The observations with the slots found for them. A slot fits if the satellite is on the channel by the products, above the horizon of
    /// `position`, and its pseudorange gives the receiver clock of the satellites in `known`. Observations without exactly one fitting slot
    /// are counted.
    pub fn identify(
        &mut self,
        observations: &[ChannelObservation],
        known: &[PreparedObservation],
        position: Ecef,
        time_gps: GpsTime,
    ) -> ObservationEpoch {
        let mut identified = ObservationEpoch { time_gps, flag: EpochFlag::Ok, observations: Vec::new() };
        let clock_m = median_clock_m(known, position);
        for ChannelObservation { channel, observation } in observations {
            let Some(clock_m) = clock_m else {
                self.skips
                    .add(Reason::GlonassSlotWithoutOthers, || format!("channel {channel} at {time_gps}"));
                continue;
            };
            let mut fitting = SLOTS
                .map(|slot| SatelliteId::new(Constellation::Glonass, slot))
                .filter(|satellite| self.products().glonass_channel(*satellite, time_gps) == Some(*channel))
                .filter(|satellite| {
                    let implied_m = self.implied_clock_m(*satellite, observation, position, time_gps);
                    implied_m.is_some_and(|implied_m| (implied_m - clock_m).abs() <= MOST_FROM_CLOCK_M)
                });
            let found = match (fitting.next(), fitting.next()) {
                (Some(satellite), None) => Some(satellite),
                _ => None,
            };
            let is_known = |satellite: SatelliteId| {
                let same = |o: &Observation| (o.satellite, o.signal) == (satellite, observation.signal);
                known.iter().any(|prepared| same(&prepared.observation))
                    || identified.observations.iter().any(same)
            };
            if let Some(satellite) = found.filter(|satellite| !is_known(*satellite)) {
                self.skips.add(Reason::GlonassSlotFound, || {
                    format!("channel {channel} at {time_gps}: {satellite}")
                });
                identified.observations.push(Observation { satellite, ..*observation });
            } else {
                self.skips.add(Reason::GlonassSlotUnexplained, || format!("channel {channel} at {time_gps}"));
            }
        }
        identified
    }

    /// Receiver clock by the pseudorange of a satellite, m; `None` below the horizon.
    fn implied_clock_m(
        &self,
        satellite: SatelliteId,
        observation: &Observation,
        position: Ecef,
        time_gps: GpsTime,
    ) -> Option<f64> {
        let pseudorange_m = observation.pseudorange_m?;
        let sent = time_gps - pseudorange_m / SPEED_OF_LIGHT_MPS;
        let state = self.products().satellite_state(satellite, sent).ok()?;
        let line = (state.position - position).0;
        let is_below_horizon = LocalFrame::at(position).direction(&line.normalize()).elevation_rad < 0.0;
        let clock_m = pseudorange_m + SPEED_OF_LIGHT_MPS * state.clock_s - range_m(state.position, position);
        (!is_below_horizon).then_some(clock_m)
    }
}

/// Signal path length with the Earth's rotation during the travel time (Sagnac term), m.
fn range_m(satellite: Ecef, receiver: Ecef) -> f64 {
    let turned = satellite.0.x * receiver.0.y - satellite.0.y * receiver.0.x;
    satellite.distance_m(receiver) + EARTH_ROTATION_RADPS / SPEED_OF_LIGHT_MPS * turned
}

/// Receiver clock as the median over the observations, m; `None` without observations.
fn median_clock_m(known: &[PreparedObservation], position: Ecef) -> Option<f64> {
    let mut clocks_m: Vec<f64> =
        known.iter().map(|prepared| prepared.pseudorange_m - range_m(prepared.position, position)).collect();
    clocks_m.sort_by(f64::total_cmp);
    clocks_m.get(clocks_m.len() / 2).copied()
}
