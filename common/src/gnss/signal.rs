//! Signals by their RINEX 3 band and attribute, and the receiver clocks that they share.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::Constellation;
use crate::constants::SPEED_OF_LIGHT_MPS;

/// A tracked signal: the RINEX 3 band digit and attribute letter ("1C", "5X", "2I").
///
/// The frequency depends on the constellation too: band 2 is 1227.60 MHz for GPS, 1561.098 MHz for BeiDou.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SignalCode {
    /// RINEX band digit, `b'1'` to `b'9'`.
    pub band: u8,
    /// RINEX attribute letter.
    pub attribute: u8,
}

/// One receiver clock (with its hardware bias): a constellation on one RINEX band.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ClockGroup {
    /// The system.
    pub constellation: Constellation,
    /// RINEX band digit.
    pub band: u8,
}

impl SignalCode {
    /// From the two characters of a RINEX observation code after its type letter.
    pub const fn new(band: u8, attribute: u8) -> Self {
        Self { band, attribute }
    }

    /// Carrier frequency, Hz (RINEX 3.05, tables 4-10). `None` for a band that the system does not transmit on.
    /// GLONASS bands 1 and 2 need the frequency channel `glonass_channel` (−7…6) and are `None` without it.
    pub fn frequency_hz(self, constellation: Constellation, glonass_channel: Option<i8>) -> Option<f64> {
        use Constellation::{Beidou, Galileo, Glonass, Gps, Navic, Qzss, Sbas};
        let mhz = match (constellation, self.band) {
            (Gps | Galileo | Qzss | Sbas | Beidou, b'1') => 1575.42,
            (Gps | Qzss, b'2') => 1227.60,
            (Gps | Galileo | Qzss | Sbas | Beidou | Navic, b'5') => 1176.45,
            (Beidou, b'2') => 1561.098,
            (Galileo | Beidou, b'7') => 1207.14,
            (Galileo | Qzss, b'6') => 1278.75,
            (Beidou, b'6') => 1268.52,
            (Galileo | Beidou, b'8') => 1191.795,
            (Glonass, b'1') => 1602.0 + 0.5625 * f64::from(glonass_channel?),
            (Glonass, b'2') => 1246.0 + 0.4375 * f64::from(glonass_channel?),
            (Glonass, b'3') => 1202.025,
            (Glonass, b'4') => 1600.995,
            (Glonass, b'6') => 1248.06,
            (Navic, b'9') => 2492.028,
            _ => return None,
        };
        Some(mhz * 1e6)
    }

    /// Carrier wavelength, m. See [`SignalCode::frequency_hz`].
    pub fn wavelength_m(self, constellation: Constellation, glonass_channel: Option<i8>) -> Option<f64> {
        self.frequency_hz(constellation, glonass_channel).map(|f| SPEED_OF_LIGHT_MPS / f)
    }
}

impl fmt::Display for SignalCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.band as char, self.attribute as char)
    }
}

impl fmt::Debug for SignalCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl fmt::Display for ClockGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.constellation.letter(), self.band as char)
    }
}

impl fmt::Debug for ClockGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequencies_follow_the_constellation() {
        let b1i = SignalCode::new(b'2', b'I');
        assert_eq!(b1i.frequency_hz(Constellation::Beidou, None), Some(1_561_098_000.0));
        assert_eq!(b1i.frequency_hz(Constellation::Gps, None), Some(1_227_600_000.0));
        let g1 = SignalCode::new(b'1', b'C');
        assert_eq!(g1.frequency_hz(Constellation::Glonass, None), None);
        assert_eq!(g1.frequency_hz(Constellation::Glonass, Some(-7)), Some(1_598_062_500.0));
    }
}
