//! Observation types of RINEX 2 as those of RINEX 3.

use super::types::{ObservationKind, ObservationType};
use crate::formats::decimal::integer;
use crate::formats::text::columns;
use crate::gnss::{Constellation, SignalCode};

/// Systems that a RINEX 2 file may hold; all share one list of types.
pub(super) const SYSTEMS_2: [Constellation; 6] = [
    Constellation::Gps,
    Constellation::Glonass,
    Constellation::Galileo,
    Constellation::Beidou,
    Constellation::Qzss,
    Constellation::Sbas,
];

/// Types on one line.
const PER_LINE: usize = 9;

/// The list in the header, over several lines.
#[derive(Clone, Debug, Default)]
pub(super) struct TypeList {
    codes: Vec<[u8; 2]>,
    remaining: usize,
}

impl TypeList {
    /// Takes a '# / TYPES OF OBSERV' line; `None` when it cannot be read.
    pub(super) fn line(&mut self, line: &[u8]) -> Option<()> {
        let count = columns(line, 0, 6);
        if count.iter().any(|b| *b != b' ') {
            self.codes.clear();
            self.remaining = usize::try_from(integer(count)?).ok()?;
        }
        for index in 0..self.remaining.min(PER_LINE) {
            let code = columns(line, 6 + 6 * index, 12 + 6 * index).trim_ascii();
            let code = code.first_chunk::<2>().filter(|_| code.len() == 2)?;
            self.codes.push(code.map(|letter| letter.to_ascii_uppercase()));
            self.remaining -= 1;
        }
        Some(())
    }

    /// Whether there is any type.
    pub(super) const fn is_empty(&self) -> bool {
        self.codes.is_empty()
    }

    /// Number of types.
    pub(super) const fn len(&self) -> usize {
        self.codes.len()
    }

    /// The types for one system. Columns of signals that the system does not have keep their place.
    pub(super) fn of(&self, constellation: Constellation) -> Vec<ObservationType> {
        self.codes.iter().map(|code| self.observation_type(*code, constellation)).collect()
    }

    fn observation_type(&self, [letter, band]: [u8; 2], constellation: Constellation) -> ObservationType {
        let kind = match letter {
            b'C' | b'P' => ObservationKind::Pseudorange,
            b'L' => ObservationKind::CarrierPhase,
            b'D' => ObservationKind::Doppler,
            b'S' => ObservationKind::SignalStrength,
            _ => ObservationKind::Other,
        };
        // Phase, Doppler and strength do not say which code was tracked: that whose pseudorange is in the list.
        let precise = match letter {
            b'P' => true,
            b'C' => false,
            _ if band == b'2' => self.has(*b"P2") || !self.has(*b"C2"),
            _ => self.has(*b"P1") && !self.has(*b"C1") && band == b'1',
        };
        let signal = signal(band, precise, constellation);
        ObservationType {
            kind: if signal.is_some() { kind } else { ObservationKind::Other },
            signal: signal.unwrap_or(SignalCode::new(band, b' ')),
            scale: 1.0,
        }
    }

    fn has(&self, code: [u8; 2]) -> bool {
        self.codes.contains(&code)
    }
}

/// The signal that RINEX 2.11 means by a band (table A1, with the usual reading for the systems that it does not name).
/// GPS under anti-spoofing has W where RINEX 2 says P. RINEX 2.12 has letters for the civil codes: A is C/A on L1, B is L1C,
/// C is L2C, D is GLONASS' C/A on L2.
const fn signal(band: u8, precise: bool, constellation: Constellation) -> Option<SignalCode> {
    use Constellation::{Beidou, Galileo, Glonass, Gps, Qzss, Sbas};
    let (band, attribute) = match (constellation, band, precise) {
        (Gps, b'1' | b'2', true) => (band, b'W'),
        (Glonass, b'1' | b'2', true) => (band, b'P'),
        (Gps | Glonass | Qzss | Sbas, b'1', false) | (Glonass, b'2', false) => (band, b'C'),
        (Gps | Glonass | Qzss | Sbas, b'A', false) => (b'1', b'C'),
        (Gps | Qzss, b'B', false) => (b'1', b'X'),
        (Gps | Qzss, b'C', false) => (b'2', b'X'),
        (Glonass, b'D', false) => (b'2', b'C'),
        (Gps | Qzss, b'2', _)
        | (Gps | Qzss | Sbas, b'5', _)
        | (Galileo, b'1' | b'5' | b'6' | b'7' | b'8', _) => (band, b'X'),
        (Beidou, b'1' | b'2', _) => (b'2', b'I'),
        (Beidou, b'6' | b'7', _) => (band, b'I'),
        _ => return None,
    };
    Some(SignalCode::new(band, attribute))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn codes(line: &str, constellation: Constellation) -> Vec<String> {
        let mut list = TypeList::default();
        list.line(line.as_bytes()).unwrap();
        list.of(constellation).iter().map(|t| format!("{:?} {}", t.kind, t.signal)).collect()
    }

    #[test]
    fn types_are_named_as_in_rinex_3() {
        let line = "     7    L1    C1    L2    P2    P1    D2    S1";
        assert_eq!(
            codes(line, Constellation::Gps),
            [
                "CarrierPhase 1C",
                "Pseudorange 1C",
                "CarrierPhase 2W",
                "Pseudorange 2W",
                "Pseudorange 1W",
                "Doppler 2W",
                "SignalStrength 1C"
            ]
        );
        assert_eq!(codes("     2    C1    C5", Constellation::Glonass), ["Pseudorange 1C", "Other 5 "]);
        assert_eq!(codes("     2    P1    L1", Constellation::Gps), ["Pseudorange 1W", "CarrierPhase 1W"]);
        assert_eq!(codes("     2    C2    L2", Constellation::Gps), ["Pseudorange 2X", "CarrierPhase 2X"]);
    }

    #[test]
    fn letters_of_version_2_12_are_civil_codes() {
        let line = "     7    P1    CA    LA    CB    CC    SC    CD";
        let gps = ["Pseudorange 1W", "Pseudorange 1C", "CarrierPhase 1C", "Pseudorange 1X", "Pseudorange 2X"];
        assert_eq!(codes(line, Constellation::Gps)[..5], gps);
        assert_eq!(codes(line, Constellation::Gps)[5], "SignalStrength 2X");
        assert!(codes(line, Constellation::Gps)[6].starts_with("Other"));
        let glonass = codes(line, Constellation::Glonass);
        assert_eq!(glonass[1..3], ["Pseudorange 1C", "CarrierPhase 1C"]);
        assert!(glonass[3].starts_with("Other"));
        assert_eq!(glonass[6], "Pseudorange 2C");
    }

    #[test]
    fn a_list_goes_on_over_lines() {
        let mut list = TypeList::default();
        list.line(b"    11    L1    L2    C1    P2    P1    S1    S2    D1    D2").unwrap();
        list.line(b"          C5    L5").unwrap();
        assert_eq!(list.of(Constellation::Gps).len(), 11);
        assert!(list.line(b"    xx    L1").is_none());
    }
}
