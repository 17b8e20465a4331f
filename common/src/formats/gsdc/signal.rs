//! Android's numbers and the challenge's names to satellites and signals.

use crate::formats::gnsslogger::{android_satellite, channel_only};
use crate::formats::integer::integer;
use crate::gnss::{Constellation, SatelliteId, SignalCode};

/// The satellite of a constellation type and a number, both Android's. `None` for augmentation satellites, unknown types, and
/// GLONASS satellites of which only the frequency channel is known (93-106).
pub(super) fn satellite(constellation: &str, number: &str) -> Option<SatelliteId> {
    let satellite = android_satellite(integer(constellation)?, integer(number)?).ok()?;
    (satellite.constellation != Constellation::Sbas).then_some(satellite)
}

/// A GLONASS satellite of which only the frequency channel is known, by its number, and the channel.
pub(super) fn by_channel(constellation: &str, number: &str) -> Option<(SatelliteId, i8)> {
    let (constellation, number) = (integer(constellation)?, integer(number)?);
    let channel = channel_only(constellation, number)?;
    Some((SatelliteId::new(Constellation::Glonass, u8::try_from(number).ok()?), channel))
}

/// The signal of a name such as `GPS_L1`, `GAL_E5A`, `BDS_B1I` (2021) or `GPS_L5_Q`, `GAL_E1_C_P`, `BDS_B1_I` (since 2022).
/// `code_type` is Android's code letter, which is RINEX's attribute; without one, the letter at the name's end, or that which
/// phones most often track. (The last letter of `GAL_E1_C_P` says pilot, not P code.)
pub(super) fn signal(constellation: Constellation, name: &str, code_type: &str) -> Option<SignalCode> {
    let band_name: String = name.split('_').skip(1).collect();
    let (band, usual) = match constellation {
        Constellation::Gps if band_name.starts_with("L1") => (b'1', b'C'),
        Constellation::Gps if band_name.starts_with("L5") => (b'5', b'X'),
        Constellation::Qzss if band_name.starts_with(['L', 'J']) => match band_name.as_bytes().get(1)? {
            b'1' => (b'1', b'C'),
            b'5' => (b'5', b'X'),
            _ => return None,
        },
        Constellation::Glonass if band_name.starts_with("G1") => (b'1', b'C'),
        Constellation::Galileo if band_name.starts_with("E1") => (b'1', b'C'),
        Constellation::Galileo if band_name.starts_with("E5A") => (b'5', b'X'),
        Constellation::Galileo if band_name.starts_with("E5B") => (b'7', b'X'),
        Constellation::Beidou if band_name.starts_with("B1I") => (b'2', b'I'),
        Constellation::Beidou if band_name.starts_with("B1C") => (b'1', b'X'),
        Constellation::Beidou if band_name.starts_with("B2A") => (b'5', b'X'),
        Constellation::Navic if band_name.starts_with("L5") => (b'5', b'A'),
        _ => return None,
    };
    let can_be = |letter: u8| {
        let code = SignalCode::new(band, letter);
        letter.is_ascii_uppercase() && code.has_pseudorange() && code.exists(constellation)
    };
    let last = name.rsplit('_').next().unwrap_or_default();
    let attribute = match (code_type.as_bytes(), last.as_bytes()) {
        ([letter], _) if can_be(*letter) => *letter,
        (_, [letter]) if band != b'1' && can_be(*letter) => *letter,
        _ => usual,
    };
    Some(SignalCode::new(band, attribute))
}

/// The name of the signal on a carrier, where a row has none: that of a satellite for which its maker had no orbit.
pub(super) fn name_on(constellation: Constellation, frequency_hz: f64) -> Option<&'static str> {
    /// Carriers are printed as 32-bit floats and rounded, Hz.
    const TOLERANCE_HZ: f64 = 200e3;
    let names: &[(f64, &str)] = match constellation {
        Constellation::Gps => &[(1_575.42e6, "GPS_L1"), (1_176.45e6, "GPS_L5")],
        Constellation::Qzss => &[(1_575.42e6, "QZS_L1"), (1_176.45e6, "QZS_L5")],
        Constellation::Galileo => &[(1_575.42e6, "GAL_E1"), (1_176.45e6, "GAL_E5A"), (1_207.14e6, "GAL_E5B")],
        Constellation::Beidou => {
            &[(1_561.098e6, "BDS_B1I"), (1_575.42e6, "BDS_B1C"), (1_176.45e6, "BDS_B2A")]
        }
        Constellation::Navic => &[(1_176.45e6, "IRN_L5")],
        Constellation::Glonass if (1.597e9..1.607e9).contains(&frequency_hz) => return Some("GLO_G1"),
        _ => &[],
    };
    names
        .iter()
        .find(|(carrier_hz, _)| (carrier_hz - frequency_hz).abs() <= TOLERANCE_HZ)
        .map(|(_, name)| *name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_both_generations_are_known() {
        let known =
            |constellation, name, code_type| signal(constellation, name, code_type).unwrap().to_string();
        assert_eq!(known(Constellation::Gps, "GPS_L1", ""), "1C");
        assert_eq!(known(Constellation::Gps, "GPS_L1_CA", "C"), "1C");
        assert_eq!(known(Constellation::Gps, "GPS_L5_Q", "Q"), "5Q");
        assert_eq!(known(Constellation::Galileo, "GAL_E5A", ""), "5X");
        assert_eq!(known(Constellation::Galileo, "GAL_E1_C_P", "C"), "1C");
        assert_eq!(known(Constellation::Beidou, "BDS_B1_I", "I"), "2I");
        assert_eq!(known(Constellation::Beidou, "BDS_B1C", ""), "1X");
        assert_eq!(known(Constellation::Beidou, "BDS_B2A_P", "P"), "5P");
        assert_eq!(known(Constellation::Qzss, "QZS_J5", ""), "5X");
        assert_eq!(known(Constellation::Qzss, "QZS_L5_Q", ""), "5Q");
        assert_eq!(known(Constellation::Gps, "GPS_L5_Q", ""), "5Q");
        assert_eq!(known(Constellation::Galileo, "GAL_E5A_Q", ""), "5Q");
        assert_eq!(known(Constellation::Galileo, "GAL_E1_C_P", ""), "1C");
        assert_eq!(known(Constellation::Beidou, "BDS_B1_I", ""), "2I");
        assert_eq!(known(Constellation::Glonass, "GLO_G1_CA", "C"), "1C");
        // Some chips call every code C.
        assert_eq!(known(Constellation::Beidou, "BDS_B1C", "C"), "1X");
        assert_eq!(known(Constellation::Beidou, "BDS_B1_I", "C"), "2I");
        assert_eq!(known(Constellation::Gps, "GPS_L5_Q", "C"), "5Q");
        assert_eq!(signal(Constellation::Gps, "GAL_E1", ""), None);
        assert_eq!(signal(Constellation::Gps, "", ""), None);
    }

    #[test]
    fn carriers_have_names() {
        use Constellation::{Beidou, Galileo, Glonass, Gps};
        for (system, frequency_hz, expected) in [
            (Gps, 1_575_420_030.0, Some("1C")),
            (Gps, 1_176_450_050.0, Some("5X")),
            (Glonass, 1_598_062_460.0, Some("1C")),
            (Galileo, 1_207_140_000.0, Some("7X")),
            (Beidou, 1_561_097_980.0, Some("2I")),
            (Gps, 1_561_097_980.0, None),
            (Glonass, f64::NAN, None),
        ] {
            let found = name_on(system, frequency_hz).and_then(|name| signal(system, name, ""));
            assert_eq!(found.map(|code| code.to_string()).as_deref(), expected, "{system:?} {frequency_hz}");
        }
    }

    #[test]
    fn satellites_have_their_rinex_numbers() {
        assert_eq!(satellite("1", "5").unwrap().to_string(), "G05");
        assert_eq!(satellite("4", "194").unwrap().to_string(), "J02");
        assert_eq!(satellite("4", "1").unwrap().to_string(), "J01");
        assert_eq!(satellite("4", "10").unwrap().to_string(), "J10");
        assert_eq!(satellite("5", "59").unwrap().to_string(), "C59");
        assert_eq!(satellite("1.0", "5.0").unwrap().to_string(), "G05");
        assert_eq!(satellite("6", "3.2e1").unwrap().to_string(), "E32");
        for (constellation, number) in [
            ("1", "33"),
            ("3", "97"),
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
