//! The dataset's names of satellites and signals in RINEX terms.

use crate::gnss::{Constellation, SatelliteId, SignalCode};

/// First and last index of each system's satellites, and the difference between index and number within the system.
const RANGES: [(Constellation, u8, u8, u8); 4] = [
    (Constellation::Gps, 1, 35, 0),
    (Constellation::Glonass, 36, 65, 35),
    (Constellation::Galileo, 66, 100, 65),
    (Constellation::Beidou, 101, 165, 100),
];

/// Signals by the observation code without its letter. BeiDou's B1I and B1Q have the names of RINEX 3.02, `1I` and `1Q`.
const SIGNALS: [(Constellation, &[&[u8; 2]]); 4] = [
    (Constellation::Gps, &[b"1C", b"1S", b"1L", b"1X", b"2C", b"2S", b"2L", b"2X", b"5I", b"5Q", b"5X"]),
    (Constellation::Glonass, &[b"1C", b"1P", b"2C", b"2P"]),
    (
        Constellation::Galileo,
        &[b"1A", b"1B", b"1C", b"1X", b"1Z", b"5I", b"5Q", b"5X", b"7I", b"7Q", b"7X", b"8I", b"8Q", b"8X"],
    ),
    (
        Constellation::Beidou,
        &[b"1I", b"1Q", b"2I", b"2Q", b"1D", b"1P", b"5D", b"5P", b"5X", b"7I", b"7Q", b"6I", b"6Q"],
    ),
];

/// The satellite of an index; `None` outside the ranges.
pub(super) fn satellite(index: u8) -> Option<SatelliteId> {
    let (constellation, _, _, offset) =
        RANGES.into_iter().find(|(_, first, last, _)| (*first..=*last).contains(&index))?;
    Some(SatelliteId::new(constellation, index - offset))
}

/// The signal of an observation code such as `L1C`; `None` for one that the system does not have. BeiDou's `L1X` is not taken:
/// it is B1I with B1Q in RINEX 3.02 and B1C later.
pub(super) fn signal(constellation: Constellation, code: &str) -> Option<SignalCode> {
    let &[b'L', band, attribute] = code.as_bytes() else { return None };
    let known = SIGNALS.iter().find(|(system, _)| *system == constellation)?.1;
    known.iter().find(|name| ***name == [band, attribute])?;
    let is_b1i = constellation == Constellation::Beidou && matches!((band, attribute), (b'1', b'I' | b'Q'));
    Some(SignalCode::new(if is_b1i { b'2' } else { band }, attribute))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_are_satellites() {
        for (index, name) in [
            (1, "G01"),
            (35, "G35"),
            (36, "R01"),
            (65, "R30"),
            (66, "E01"),
            (100, "E35"),
            (101, "C01"),
            (165, "C65"),
        ] {
            assert_eq!(satellite(index).unwrap().to_string(), name);
        }
        assert_eq!((satellite(0), satellite(166)), (None, None));
    }

    #[test]
    fn codes_are_signals_of_their_system() {
        use Constellation::{Beidou, Galileo, Glonass, Gps};
        for (system, code, expected) in [
            (Gps, "L1C", Some("1C")),
            (Gps, "L5X", Some("5X")),
            (Glonass, "L1C", Some("1C")),
            (Galileo, "L1X", Some("1X")),
            (Galileo, "L5X", Some("5X")),
            (Beidou, "L1I", Some("2I")),
            (Beidou, "L2I", Some("2I")),
            (Beidou, "L1P", Some("1P")),
            (Beidou, "L1C", None),
            (Beidou, "L1X", None),
            (Gps, "L1I", None),
            (Gps, "C1C", None),
            (Gps, "L1", None),
            (Gps, "L1CC", None),
            (Gps, "", None),
        ] {
            assert_eq!(signal(system, code).map(|s| s.to_string()).as_deref(), expected, "{system:?} {code}");
        }
    }
}
