//! Satellite systems and satellites.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// A satellite navigation system. The order is that of reports and of clock columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Constellation {
    /// GPS, letter G.
    Gps,
    /// GLONASS, letter R.
    Glonass,
    /// Galileo, letter E.
    Galileo,
    /// BeiDou, letter C.
    Beidou,
    /// QZSS, letter J.
    Qzss,
    /// NavIC, letter I.
    Navic,
    /// Satellite-based augmentation, letter S.
    Sbas,
}

impl Constellation {
    /// Constellation of a RINEX letter.
    pub const fn from_letter(letter: char) -> Option<Self> {
        Some(match letter {
            'G' => Self::Gps,
            'R' => Self::Glonass,
            'E' => Self::Galileo,
            'C' => Self::Beidou,
            'J' => Self::Qzss,
            'I' => Self::Navic,
            'S' => Self::Sbas,
            _ => return None,
        })
    }

    /// The RINEX letter.
    pub const fn letter(self) -> char {
        match self {
            Self::Gps => 'G',
            Self::Glonass => 'R',
            Self::Galileo => 'E',
            Self::Beidou => 'C',
            Self::Qzss => 'J',
            Self::Navic => 'I',
            Self::Sbas => 'S',
        }
    }
}

/// A satellite: system and number as RINEX writes them (G07, C21).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SatelliteId {
    /// The system.
    pub constellation: Constellation,
    /// Number within the system, 1-99 (GPS and BeiDou: PRN; GLONASS and Galileo: slot or SVID).
    pub number: u8,
}

/// Error for a text that is not a satellite.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{text}' is not a satellite; write a system letter and a number from 1 to 99, for example G07")]
pub struct SatelliteIdError {
    text: String,
}

impl SatelliteId {
    /// A satellite of a system.
    pub const fn new(constellation: Constellation, number: u8) -> Self {
        Self { constellation, number }
    }

    /// A satellite from three bytes as in RINEX and SP3; a blank in the tens place counts as zero, and the letter may be upper or lower
    /// case.
    pub const fn from_bytes(bytes: [u8; 3]) -> Option<Self> {
        let letter = bytes[0].to_ascii_uppercase() as char;
        let Some(constellation) = Constellation::from_letter(letter) else { return None };
        let tens = match bytes[1] {
            b' ' => 0,
            d @ b'0'..=b'9' => d - b'0',
            _ => return None,
        };
        let ones = match bytes[2] {
            d @ b'0'..=b'9' => d - b'0',
            _ => return None,
        };
        let number = tens * 10 + ones;
        if number == 0 { None } else { Some(Self { constellation, number }) }
    }

    /// BeiDou satellites in geostationary orbit (C01-C05, C59-C63) with the broadcast orbit in a rotated frame
    /// (BDS-SIS-ICD-B1I, table 5-11).
    pub const fn is_beidou_geostationary(self) -> bool {
        matches!(self.constellation, Constellation::Beidou) && (self.number <= 5 || self.number >= 59)
    }
}

impl fmt::Display for SatelliteId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{:02}", self.constellation.letter(), self.number)
    }
}

impl fmt::Debug for SatelliteId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl FromStr for SatelliteId {
    type Err = SatelliteIdError;
    fn from_str(text: &str) -> Result<Self, SatelliteIdError> {
        <[u8; 3]>::try_from(text.as_bytes())
            .ok()
            .and_then(Self::from_bytes)
            .ok_or_else(|| SatelliteIdError { text: text.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn satellites_round_trip_and_reject() {
        for text in ["G01", "C36", "E27", "R05", "J02"] {
            assert_eq!(text.parse::<SatelliteId>().unwrap().to_string(), text);
        }
        assert_eq!(SatelliteId::from_bytes(*b"G 7").unwrap().to_string(), "G07");
        assert_eq!(SatelliteId::from_bytes(*b"g07").unwrap().to_string(), "G07");
        for text in ["X01", "G00", "G1", "G100", "Gxx", "", "é1"] {
            assert!(text.parse::<SatelliteId>().is_err(), "{text}");
        }
    }
}
