//! Codes of one BeiDou generation that a recording gives to the other one too.

use super::{Constellation, Observation, SatelliteId, SignalCode};

/// Attributes of B2I at 1207.14 MHz that an epoch gives to satellites of BeiDou-3, which do not send it.
///
/// Who wrote the epoch calls another signal so (B2a or B2b), and what it calls so of BeiDou-2 may be that signal as well: metres
/// of group delay and ionosphere. So the code is not used of any satellite of that epoch. This holds for RINEX 3 and later, whose
/// codes name signals; signal numbers of RTCM and bands of RINEX 2 are common to both generations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Misnamed {
    /// A bit for each letter.
    attributes: u32,
}

impl Misnamed {
    /// Notes a signal of an epoch.
    pub fn note(&mut self, satellite: SatelliteId, signal: SignalCode) {
        if satellite.is_beidou_3() && signal.band == b'7' && satellite.cannot_send(signal).is_some() {
            self.attributes |= bit(signal.attribute);
        }
    }

    /// Takes out of an epoch's observations what was noted, and tells each to `count`.
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
