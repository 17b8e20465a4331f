//! Table of signals: the observation codes of every system, with the RINEX version of their introduction.
//!
//! All formats with signal codes are checked against this table: RINEX 2 to 4, Compact RINEX, Bias-SINEX, GnssLogger text,
//! challenge tables, RTCM 3 and the messages between agent and hub.

use super::{Constellation, SatelliteId, SignalCode};
use crate::skips::Reason;

/// Attribute of an unknown tracking mode (RINEX 3.05, 5.2.17).
const UNKNOWN_TRACKING: u8 = b' ';
/// Attribute of codeless tracking, which has phase, Doppler and C/N0, but no pseudorange.
const CODELESS: u8 = b'N';
/// Largest satellite number of BeiDou-2; higher numbers belong to BeiDou-3.
const LAST_BEIDOU_2: u8 = 18;

/// Attributes of a band, and the RINEX version (times 100) of their introduction.
struct Row {
    constellation: Constellation,
    band: u8,
    since: u16,
    attributes: &'static [u8],
}

const fn row(constellation: Constellation, band: u8, since: u16, attributes: &'static [u8]) -> Row {
    Row { constellation, band, since, attributes }
}

/// RINEX 3.00 to 3.05, tables 4 to 10; RINEX 4.00 to 4.02, tables 9 to 15.
const TABLE: &[Row] = &[
    row(Constellation::Gps, b'1', 300, b"CSLXPWYMN"),
    row(Constellation::Gps, b'1', 401, b"R"),
    row(Constellation::Gps, b'2', 300, b"CDSLXPWYMN"),
    row(Constellation::Gps, b'2', 401, b"R"),
    row(Constellation::Gps, b'5', 300, b"IQX"),
    row(Constellation::Glonass, b'1', 300, b"CP"),
    row(Constellation::Glonass, b'2', 300, b"CP"),
    row(Constellation::Glonass, b'3', 301, b"IQX"),
    row(Constellation::Glonass, b'4', 304, b"ABX"),
    row(Constellation::Glonass, b'6', 304, b"ABX"),
    row(Constellation::Galileo, b'1', 300, b"ABCXZ"),
    row(Constellation::Galileo, b'5', 300, b"IQX"),
    row(Constellation::Galileo, b'6', 300, b"ABCXZ"),
    row(Constellation::Galileo, b'7', 300, b"IQX"),
    row(Constellation::Galileo, b'8', 300, b"IQX"),
    row(Constellation::Sbas, b'1', 300, b"C"),
    row(Constellation::Sbas, b'5', 300, b"IQX"),
    row(Constellation::Qzss, b'1', 301, b"CSLXZ"),
    row(Constellation::Qzss, b'1', 400, b"EB"),
    row(Constellation::Qzss, b'2', 301, b"SLX"),
    row(Constellation::Qzss, b'5', 301, b"IQX"),
    row(Constellation::Qzss, b'5', 304, b"DPZ"),
    row(Constellation::Qzss, b'6', 301, b"SLX"),
    row(Constellation::Qzss, b'6', 304, b"EZ"),
    // B1I, called 1I, 1Q and 1X in RINEX 3.02 only.
    row(Constellation::Beidou, b'2', 300, b"IQX"),
    // B1C and B1A, the latter as A in 3.04 and as S, L and Z since.
    row(Constellation::Beidou, b'1', 304, b"DPXAN"),
    row(Constellation::Beidou, b'1', 305, b"SLZ"),
    row(Constellation::Beidou, b'5', 304, b"DPX"),
    row(Constellation::Beidou, b'6', 300, b"IQX"),
    row(Constellation::Beidou, b'6', 304, b"A"),
    row(Constellation::Beidou, b'6', 305, b"DPZ"),
    row(Constellation::Beidou, b'7', 300, BEIDOU_2_ON_BAND_7),
    row(Constellation::Beidou, b'7', 304, BEIDOU_3_ON_BAND_7),
    row(Constellation::Beidou, b'8', 304, b"DPX"),
    row(Constellation::Navic, b'1', 401, b"DPX"),
    row(Constellation::Navic, b'5', 303, b"ABCX"),
    row(Constellation::Navic, b'9', 303, b"ABCX"),
];
/// Attributes of B2I (BeiDou-2).
const BEIDOU_2_ON_BAND_7: &[u8] = b"IQX";
/// Attributes of B2b (BeiDou-3).
const BEIDOU_3_ON_BAND_7: &[u8] = b"DPZ";

/// Number of systems and band digits in [`ATTRIBUTES`].
const SYSTEMS: usize = 7;
const BANDS: usize = 10;

/// Attributes of every system's bands, one bit per letter: a fast form of the table for every line of a phone's log.
const ATTRIBUTES: [[u32; BANDS]; SYSTEMS] = attributes();

const fn attributes() -> [[u32; BANDS]; SYSTEMS] {
    let mut bits = [[0; BANDS]; SYSTEMS];
    let mut at = 0;
    while at < TABLE.len() {
        let Row { constellation, band, attributes, .. } = &TABLE[at];
        let mut letter = 0;
        while letter < attributes.len() {
            bits[*constellation as usize][(*band - b'0') as usize] |= 1 << (attributes[letter] - b'A');
            letter += 1;
        }
        at += 1;
    }
    bits
}

/// Whether a system has a band with this attribute; a blank attribute matches any of the band.
fn has(constellation: Constellation, band: u8, attribute: u8) -> bool {
    let of_system = ATTRIBUTES.get(constellation as usize);
    let of_band = of_system.and_then(|bands| bands.get(usize::from(band.wrapping_sub(b'0'))));
    let bits = of_band.copied().unwrap_or(0);
    match attribute {
        UNKNOWN_TRACKING => bits != 0,
        b'A'..=b'Z' => bits & 1 << (attribute - b'A') != 0,
        _ => false,
    }
}

impl SignalCode {
    /// RINEX version (times 100) that introduced a signal of a system, `None` if there is no such signal. A blank attribute
    /// matches any signal of the band.
    pub fn since(self, constellation: Constellation) -> Option<u16> {
        let is_it = |row: &&Row| {
            row.constellation == constellation
                && row.band == self.band
                && (self.attribute == UNKNOWN_TRACKING || row.attributes.contains(&self.attribute))
        };
        TABLE.iter().filter(is_it).map(|row| row.since).min()
    }

    /// Whether a system has the signal; for a pair, whether it has the first signal and the second band.
    pub fn exists(self, constellation: Constellation) -> bool {
        match self.bands_of_pair() {
            Some((first, second)) => {
                has(constellation, first, self.attribute) && has(constellation, second, UNKNOWN_TRACKING)
            }
            None => has(constellation, self.band, self.attribute),
        }
    }

    /// Whether the signal has pseudoranges, which codeless tracking has not.
    pub const fn has_pseudorange(self) -> bool {
        self.attribute != CODELESS
    }
}

impl SatelliteId {
    /// Reason for which the satellite cannot transmit a signal; `None` if it can.
    ///
    /// The two BeiDou generations are distinguished only at 1207.14 MHz, where group delays differ: B2I of
    /// BeiDou-2 and B2b of BeiDou-3 (BDS-SIS-ICD-B1I, 5.2.4.10; BDS-SIS-ICD-B2b, 4.1). Elsewhere the code alone identifies the signal.
    pub fn cannot_send(self, signal: SignalCode) -> Option<Reason> {
        if !signal.exists(self.constellation) {
            return Some(Reason::SignalNotOfSystem);
        }
        let of_others = if self.is_beidou_3() { BEIDOU_2_ON_BAND_7 } else { BEIDOU_3_ON_BAND_7 };
        let is_on_band_7 = self.constellation == Constellation::Beidou && signal.band == b'7';
        (is_on_band_7 && of_others.contains(&signal.attribute))
            .then_some(Reason::BeidouSignalOfOtherGeneration)
    }

    /// Whether the satellite belongs to BeiDou's third generation, by its number.
    pub const fn is_beidou_3(self) -> bool {
        matches!(self.constellation, Constellation::Beidou) && self.number > LAST_BEIDOU_2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SYSTEMS: [Constellation; 7] = [
        Constellation::Gps,
        Constellation::Glonass,
        Constellation::Galileo,
        Constellation::Sbas,
        Constellation::Qzss,
        Constellation::Beidou,
        Constellation::Navic,
    ];

    /// All existing codes by system and band, listed independently of the table.
    const CODES: &str = "\
        G 1C1S1L1X1P1W1Y1M1N1R 2C2D2S2L2X2P2W2Y2M2N2R 5I5Q5X
        R 1C1P 2C2P 3I3Q3X 4A4B4X 6A6B6X
        E 1A1B1C1X1Z 5I5Q5X 6A6B6C6X6Z 7I7Q7X 8I8Q8X
        S 1C 5I5Q5X
        J 1C1S1L1X1Z1E1B 2S2L2X 5I5Q5X5D5P5Z 6S6L6X6E6Z
        C 1D1P1X1A1N1S1L1Z 2I2Q2X 5D5P5X 6I6Q6X6A6D6P6Z 7I7Q7X7D7P7Z 8D8P8X
        I 1D1P1X 5A5B5C5X 9A9B9C9X";

    #[test]
    fn every_code_of_every_system_exists_and_no_other() {
        let mut found = 0;
        for system in SYSTEMS {
            let line = CODES.lines().map(str::trim).find(|line| line.starts_with(system.letter())).unwrap();
            let known: Vec<&[u8]> = line[2..].split(' ').flat_map(|band| band.as_bytes().chunks(2)).collect();
            for (band, attribute) in
                (b'0'..=b'9').flat_map(|band| (b'A'..=b'Z').map(move |letter| (band, letter)))
            {
                let is_known = known.contains(&[band, attribute].as_slice());
                let signal = SignalCode::new(band, attribute);
                assert_eq!(signal.exists(system), is_known, "{system:?} {signal}");
                found += usize::from(is_known);
            }
            for band in b'0'..=b'9' {
                let is_known = known.iter().any(|code| code[0] == band);
                let blank = SignalCode::new(band, b' ');
                assert_eq!(blank.exists(system), is_known, "{system:?} {blank}");
                // A signal exists if and only if it has a frequency.
                assert_eq!(blank.frequency_hz(system, Some(0)).is_some(), is_known, "{system:?} {blank}");
            }
        }
        assert_eq!(found, CODES.bytes().filter(u8::is_ascii_digit).count());
    }

    #[test]
    fn the_version_that_brought_a_code_is_known() {
        for (system, code, since) in [
            (Constellation::Gps, b"1C", Some(300)),
            (Constellation::Beidou, b"2I", Some(300)),
            (Constellation::Beidou, b"1X", Some(304)),
            (Constellation::Beidou, b"1S", Some(305)),
            (Constellation::Beidou, b"7 ", Some(300)),
            (Constellation::Navic, b"1P", Some(401)),
            (Constellation::Beidou, b"1C", None),
        ] {
            assert_eq!(SignalCode::new(code[0], code[1]).since(system), since, "{system:?}");
        }
    }

    #[test]
    fn beidous_generations_differ_on_their_common_frequency() {
        let why = |satellite: &str, code: &[u8; 2]| {
            satellite.parse::<SatelliteId>().unwrap().cannot_send(SignalCode::new(code[0], code[1]))
        };
        for (code, of_2, of_3) in [
            (b"7I", None, Some(Reason::BeidouSignalOfOtherGeneration)),
            (b"7Q", None, Some(Reason::BeidouSignalOfOtherGeneration)),
            (b"7X", None, Some(Reason::BeidouSignalOfOtherGeneration)),
            (b"7D", Some(Reason::BeidouSignalOfOtherGeneration), None),
            (b"7P", Some(Reason::BeidouSignalOfOtherGeneration), None),
            (b"7Z", Some(Reason::BeidouSignalOfOtherGeneration), None),
            (b"7 ", None, None),
            (b"2I", None, None),
            (b"5P", None, None),
            (b"1C", Some(Reason::SignalNotOfSystem), Some(Reason::SignalNotOfSystem)),
        ] {
            assert_eq!((why("C18", code), why("C19", code)), (of_2, of_3), "{}", code.escape_ascii());
            assert_eq!((why("C01", code), why("C62", code)), (of_2, of_3), "{}", code.escape_ascii());
        }
        assert_eq!(why("E30", b"7Q"), None);
    }

    #[test]
    fn pairs_are_of_signals_that_exist() {
        let pair = |first: &[u8; 2], second: &[u8; 2]| {
            SignalCode::pair(SignalCode::new(first[0], first[1]), SignalCode::new(second[0], second[1]))
        };
        assert!(pair(b"1C", b"5Q").unwrap().exists(Constellation::Gps));
        assert!(pair(b"1 ", b"5Q").unwrap().exists(Constellation::Gps));
        assert!(!pair(b"1I", b"5Q").unwrap().exists(Constellation::Gps));
        assert!(!pair(b"1C", b"7Q").unwrap().exists(Constellation::Gps));
    }
}
