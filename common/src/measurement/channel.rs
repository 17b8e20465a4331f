//! GLONASS satellites that a phone knows by their frequency channel only.
//!
//! Two satellites share a channel, at opposite places of one orbital plane (GLONASS ICD, L1 and L2, edition 5.1, 3.3.1.1), so
//! that of both at most one is above the horizon.

use super::{Corrector, PreparedObservation};
use crate::constants::{EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS};
use crate::frames::{Ecef, LocalFrame};
use crate::gnss::{Constellation, EpochFlag, Observation, ObservationEpoch, SatelliteId};
use crate::skips::Reason;
use crate::time::GpsTime;

/// Slots that satellites have (GLONASS ICD: 24, and room for three more).
const SLOTS: std::ops::RangeInclusive<u8> = 1..=27;
/// A pseudorange fits when the receiver clock that it gives is this near to that of the other satellites, m. A wrong satellite
/// gives one that is hundreds of kilometres off; an approximate position and clocks of different systems, a few.
const MOST_FROM_CLOCK_M: f64 = 2e4;

/// An observation of a GLONASS satellite whose slot the phone does not know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelObservation {
    /// Frequency channel, −7 to 6.
    pub channel: i8,
    /// The observation; its satellite's number stands for nothing.
    pub observation: Observation,
}

impl Corrector {
    /// The observations with the slots of the satellites that are on their channels by the products, above the horizon of
    /// `position` and fit: their pseudoranges give the receiver clock of the satellites that are `known`. What no single
    /// satellite explains is counted.
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
                .filter(|satellite| self.fits(*satellite, observation, (position, clock_m), time_gps));
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

    /// Whether a satellite is above the horizon and its pseudorange gives a receiver clock.
    fn fits(
        &self,
        satellite: SatelliteId,
        observation: &Observation,
        (position, clock_m): (Ecef, f64),
        time_gps: GpsTime,
    ) -> bool {
        let Some(pseudorange_m) = observation.pseudorange_m else { return false };
        let sent = time_gps - pseudorange_m / SPEED_OF_LIGHT_MPS;
        let Ok(state) = self.products().satellite_state(satellite, sent) else { return false };
        let line = (state.position - position).0;
        if LocalFrame::at(position).direction(&line.normalize()).elevation_rad < 0.0 {
            return false;
        }
        let at_rest = pseudorange_m + SPEED_OF_LIGHT_MPS * state.clock_s - range_m(state.position, position);
        (at_rest - clock_m).abs() <= MOST_FROM_CLOCK_M
    }
}

/// The distance that a signal travels, the Earth's rotation meanwhile taken into account (the Sagnac term), m.
fn range_m(satellite: Ecef, receiver: Ecef) -> f64 {
    let turned = satellite.0.x * receiver.0.y - satellite.0.y * receiver.0.x;
    satellite.distance_m(receiver) + EARTH_ROTATION_RADPS / SPEED_OF_LIGHT_MPS * turned
}

/// The receiver clock by the median of the observations, m; `None` without any.
fn median_clock_m(known: &[PreparedObservation], position: Ecef) -> Option<f64> {
    let mut clocks_m: Vec<f64> =
        known.iter().map(|prepared| prepared.pseudorange_m - range_m(prepared.position, position)).collect();
    clocks_m.sort_by(f64::total_cmp);
    clocks_m.get(clocks_m.len() / 2).copied()
}
