//! Signal codes of one BeiDou generation that a recording also assigns to the other generation.

use super::{Constellation, Observation, SatelliteId, SignalCode};

/// Attributes of B2I at 1207.14 MHz that an epoch assigns to satellites of BeiDou-3, which do not transmit it.
///
/// The writer of such an epoch uses the code for another signal (B2a or B2b), possibly of BeiDou-2 satellites too, with errors of metres
/// of group delay and ionosphere. The code is therefore not used for any satellite of that epoch. This holds for RINEX 3 and later, whose
/// codes name signals; signal numbers of RTCM and bands of RINEX 2 are common to both generations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Misnamed {
    /// One bit per letter.
    attributes: u32,
}

impl Misnamed {
    /// Checks a signal of an epoch.
    pub fn note(&mut self, satellite: SatelliteId, signal: SignalCode) {
        if satellite.is_beidou_3() && signal.band == b'7' && satellite.cannot_send(signal).is_some() {
            self.attributes |= bit(signal.attribute);
        }
    }

    /// Removes the observations with misnamed codes, and passes each to `count`.
    pub fn leave_out(self, observations: &mut Vec<Observation>, mut count: impl FnMut(&Observation)) {
        if self.attributes == 0 {
            return;
        }
        observations.retain(|observation| {
            let signal = observation.signal;
            let is_beidou = observation.satellite.constellation == Constellation::Beidou;
            let is_noted = is_beidou && signal.band == b'7' && self.attributes & bit(signal.attribute) != 0;
            if is_noted {
                count(observation);
            }
            !is_noted
        });
    }
}

const fn bit(attribute: u8) -> u32 {
    if attribute.is_ascii_uppercase() { 1 << (attribute - b'A') } else { 0 }
}
