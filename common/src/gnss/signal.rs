//! Signals by their RINEX 3 band and attribute, and their receiver clocks.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::{Constellation, SatelliteId};
use crate::constants::SPEED_OF_LIGHT_MPS;

/// A tracked signal: the RINEX 3 band digit and attribute letter ("1C", "5X", "2I").
///
/// The frequency depends on the constellation too: band 2 is 1227.60 MHz for GPS, 1561.098 MHz for BeiDou.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SignalCode {
    /// RINEX band digit, `b'1'` to `b'9'`; for a pair a letter, see [`SignalCode::pair`].
    pub band: u8,
    /// RINEX attribute letter, blank for an unknown tracking mode; for a pair that of the first signal.
    pub attribute: u8,
}

/// A satellite's signal.
pub type SignalKey = (SatelliteId, SignalCode);

/// One receiver clock (with its hardware bias): a constellation on one RINEX band, or on a pair of bands.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ClockGroup {
    /// The system.
    pub constellation: Constellation,
    /// RINEX band digit, or the letter of a pair ([`SignalCode::pair`]).
    pub band: u8,
}

/// Number of possible first bands of a pair: 1, and 2 for BeiDou's B1I.
const FIRST_BANDS: u8 = 2;
/// Number of possible second bands of a pair: 1 to 9.
const SECOND_BANDS: u8 = 9;

impl SignalCode {
    /// A signal from the two characters of a RINEX observation code after its type letter.
    pub const fn new(band: u8, attribute: u8) -> Self {
        Self { band, attribute }
    }

    /// Signal code of a combination of two signals, of which the first is on band 1 or 2. RINEX has no such code; here the band is a
    /// letter for both bands, so that every pair of bands has its own clock group. `None` for other bands.
    pub fn pair(first: Self, second: Self) -> Option<Self> {
        let place = |band: u8, count: u8| band.checked_sub(b'1').filter(|place| *place < count);
        let band = place(first.band, FIRST_BANDS)? * SECOND_BANDS + place(second.band, SECOND_BANDS)?;
        Some(Self { band: b'A' + band, attribute: first.attribute })
    }

    /// The RINEX band digits of a [`SignalCode::pair`]; `None` for a single signal.
    pub fn bands_of_pair(self) -> Option<(u8, u8)> {
        let place = self.band.checked_sub(b'A').filter(|place| *place < FIRST_BANDS * SECOND_BANDS)?;
        Some((b'1' + place / SECOND_BANDS, b'1' + place % SECOND_BANDS))
    }

    /// Carrier frequency, Hz (RINEX 3.05, tables 4-10). `None` for a pair, and for a band on which the system does not transmit.
    /// GLONASS bands 1 and 2 need the frequency channel `glonass_channel` (−7…6) and are `None` without it.
    pub fn frequency_hz(self, constellation: Constellation, glonass_channel: Option<i8>) -> Option<f64> {
        use Constellation::{Beidou, Galileo, Glonass, Gps, Navic, Qzss, Sbas};
        let mhz = match (constellation, self.band) {
            (Gps | Galileo | Qzss | Sbas | Beidou | Navic, b'1') => 1575.42,
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
        match self.bands_of_pair() {
            Some((first, second)) => write!(f, "{}+{}", first as char, second as char),
            None => write!(f, "{}{}", self.band as char, self.attribute as char),
        }
    }
}

impl fmt::Debug for SignalCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl fmt::Display for ClockGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let signal = SignalCode { band: self.band, attribute: b'X' };
        match signal.bands_of_pair() {
            Some(_) => write!(f, "{}{signal}", self.constellation.letter()),
            None => write!(f, "{}{}", self.constellation.letter(), self.band as char),
        }
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

    #[test]
    fn pairs_have_names_of_their_own() {
        let mut seen = std::collections::BTreeSet::new();
        for first in [b'1', b'2'] {
            for second in b'1'..=b'9' {
                let pair =
                    SignalCode::pair(SignalCode::new(first, b'C'), SignalCode::new(second, b'Q')).unwrap();
                assert_eq!(pair.bands_of_pair(), Some((first, second)));
                assert!(seen.insert(pair.band) && pair.band.is_ascii_uppercase());
                assert_eq!(pair.frequency_hz(Constellation::Gps, None), None);
            }
        }
        let l5 = SignalCode::new(b'5', b'X');
        assert_eq!(SignalCode::pair(l5, SignalCode::new(b'1', b'C')), None);
        assert_eq!(l5.bands_of_pair(), None);
        let pair = SignalCode::pair(SignalCode::new(b'1', b'C'), l5).unwrap();
        let group = ClockGroup { constellation: Constellation::Galileo, band: pair.band };
        assert_eq!((pair.to_string(), group.to_string()), ("1+5".to_owned(), "E1+5".to_owned()));
    }
}
