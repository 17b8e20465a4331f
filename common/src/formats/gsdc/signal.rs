//! Android's numbers and the challenge's names to satellites and signals.

use crate::formats::android;
use crate::formats::integer::integer;
use crate::gnss::{Constellation, SatelliteId, SignalCode};

/// Beginnings of the names of bands, and the bands.
const BANDS: [(Constellation, &str, u8); 14] = [
    (Constellation::Gps, "L1", b'1'),
    (Constellation::Gps, "L5", b'5'),
    (Constellation::Qzss, "L1", b'1'),
    (Constellation::Qzss, "L5", b'5'),
    (Constellation::Qzss, "J1", b'1'),
    (Constellation::Qzss, "J5", b'5'),
    (Constellation::Glonass, "G1", b'1'),
    (Constellation::Galileo, "E1", b'1'),
    (Constellation::Galileo, "E5A", b'5'),
    (Constellation::Galileo, "E5B", b'7'),
    (Constellation::Beidou, "B1I", b'2'),
    (Constellation::Beidou, "B1C", b'1'),
    (Constellation::Beidou, "B2A", b'5'),
    (Constellation::Navic, "L5", b'5'),
];

/// The satellite of a constellation type and a number, both Android's, and the frequency channel of a GLONASS satellite of which
/// only that is known. `None` for augmentation satellites and unknown types.
pub(super) fn satellite(constellation: &str, number: &str) -> Option<(SatelliteId, Option<i8>)> {
    let (constellation, number) = (integer(constellation)?, integer(number)?);
    if let Some((satellite, channel)) = android::channel_only(constellation, number) {
        return Some((satellite, Some(channel)));
    }
    let satellite = android::satellite(constellation, number).ok()?;
    (satellite.constellation != Constellation::Sbas).then_some((satellite, None))
}

/// The signal of a name such as `GPS_L1`, `GAL_E5A`, `BDS_B1I` (2021) or `GPS_L5_Q`, `GAL_E1_C_P`, `BDS_B1_I` (since 2022).
/// `code_type` is Android's; without one, the letter at the name's end counts, or that which phones most often track. (The last
/// letter of `GAL_E1_C_P` says pilot, not P code.)
pub(super) fn signal(satellite: SatelliteId, name: &str, code_type: &str) -> Option<SignalCode> {
    let (_, band_name) = name.split_once('_')?;
    let begins_with = |start: &str| {
        let mut letters = band_name.bytes().filter(|byte| *byte != b'_');
        start.bytes().all(|byte| letters.next() == Some(byte))
    };
    let is_it = |(system, start, _): &&(Constellation, &str, u8)| {
        *system == satellite.constellation && begins_with(start)
    };
    let (_, _, band) = BANDS.iter().find(is_it)?;
    let last = band_name.rsplit('_').next().filter(|_| *band != b'1');
    let letters = [Some(code_type), last].into_iter().flatten();
    android::signal_on(satellite, *band, letters.filter_map(|letter| android::code_type(letter.as_bytes())))
}

/// The signal on a carrier, where a row has no name: that of a satellite for which its maker had no orbit.
pub(super) fn signal_at(satellite: SatelliteId, frequency_hz: f64, code_type: &str) -> Option<SignalCode> {
    let code_type = android::code_type(code_type.as_bytes());
    android::signal(satellite, Some(frequency_hz), code_type).map(|signal| signal.code)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_both_generations_are_known() {
        let known = |constellation, name, code_type| {
            signal(SatelliteId::new(constellation, 1), name, code_type).unwrap().to_string()
        };
        assert_eq!(known(Constellation::Gps, "GPS_L1", ""), "1C");
        assert_eq!(known(Constellation::Gps, "GPS_L1_CA", "C"), "1C");
        assert_eq!(known(Constellation::Gps, "GPS_L5_Q", "Q"), "5Q");
        assert_eq!(known(Constellation::Galileo, "GAL_E5A", ""), "5Q");
        assert_eq!(known(Constellation::Galileo, "GAL_E1_C_P", "C"), "1C");
        assert_eq!(known(Constellation::Beidou, "BDS_B1_I", "I"), "2I");
        assert_eq!(known(Constellation::Beidou, "BDS_B1C", ""), "1P");
        assert_eq!(known(Constellation::Beidou, "BDS_B2A_P", "P"), "5P");
        assert_eq!(known(Constellation::Qzss, "QZS_J5", ""), "5Q");
        assert_eq!(known(Constellation::Qzss, "QZS_L5_Q", ""), "5Q");
        assert_eq!(known(Constellation::Gps, "GPS_L5_Q", ""), "5Q");
        assert_eq!(known(Constellation::Galileo, "GAL_E5A_Q", ""), "5Q");
        assert_eq!(known(Constellation::Galileo, "GAL_E1_C_P", ""), "1C");
        assert_eq!(known(Constellation::Beidou, "BDS_B1_I", ""), "2I");
        assert_eq!(known(Constellation::Glonass, "GLO_G1_CA", "C"), "1C");
        // Some chips call every code C.
        assert_eq!(known(Constellation::Beidou, "BDS_B1C", "C"), "1P");
        assert_eq!(known(Constellation::Beidou, "BDS_B1_I", "C"), "2I");
        assert_eq!(known(Constellation::Gps, "GPS_L5_Q", "C"), "5Q");
        for name in ["GAL_E1", "GPS", ""] {
            assert_eq!(signal(SatelliteId::new(Constellation::Gps, 1), name, ""), None, "{name}");
        }
    }

    #[test]
    fn rows_without_a_name_go_by_their_carrier() {
        use Constellation::{Beidou, Galileo, Glonass, Gps};
        for (system, frequency_hz, expected) in [
            (Gps, 1_575_420_030.0, Some("1C")),
            (Gps, 1_176_450_050.0, Some("5Q")),
            (Glonass, 1_598_062_460.0, Some("1C")),
            (Galileo, 1_207_140_000.0, Some("7Q")),
            (Beidou, 1_561_097_980.0, Some("2I")),
            (Gps, 1_561_097_980.0, None),
            (Glonass, f64::NAN, None),
        ] {
            let found = signal_at(SatelliteId::new(system, 1), frequency_hz, "");
            assert_eq!(found.map(|code| code.to_string()).as_deref(), expected, "{system:?} {frequency_hz}");
        }
    }

    #[test]
    fn satellites_have_their_rinex_numbers() {
        for (constellation, number, expected) in [
            ("1", "5", "G05"),
            ("4", "194", "J02"),
            ("4", "1", "J01"),
            ("4", "10", "J10"),
            ("5", "59", "C59"),
            ("1.0", "5.0", "G05"),
            ("6", "3.2e1", "E32"),
        ] {
            let (satellite, channel) = satellite(constellation, number).unwrap();
            assert_eq!((satellite.to_string().as_str(), channel), (expected, None));
        }
        assert_eq!(satellite("3", "97"), Some((SatelliteId::new(Constellation::Glonass, 97), Some(-3))));
        for (constellation, number) in [
            ("1", "33"),
            ("3", "28"),
            ("2", "131"),
            ("0", "1"),
            ("1", "0"),
            ("4", "11"),
            ("1", ""),
            ("1", "nan"),
            ("inf", "1"),
            ("1", "1.5"),
        ] {
            assert_eq!(satellite(constellation, number), None, "{constellation} {number}");
        }
    }
}
