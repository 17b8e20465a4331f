//! Signal masks (DF395) to RINEX signals.

use crate::gnss::{Constellation, SignalCode};

/// The signal of a bit of the signal mask, 1-32 (RTCM 10403.3, tables 3.5-91, -96, -99, -105, -108; for B2b, 25-27, its amendment
/// 2). `None` for a reserved bit.
pub(super) const fn signal(constellation: Constellation, bit: u8) -> Option<SignalCode> {
    let (band, attribute) = match constellation {
        Constellation::Gps => match bit {
            2 => (b'1', b'C'),
            3 => (b'1', b'P'),
            4 => (b'1', b'W'),
            8 => (b'2', b'C'),
            9 => (b'2', b'P'),
            10 => (b'2', b'W'),
            15 => (b'2', b'S'),
            16 => (b'2', b'L'),
            17 => (b'2', b'X'),
            22 => (b'5', b'I'),
            23 => (b'5', b'Q'),
            24 => (b'5', b'X'),
            30 => (b'1', b'S'),
            31 => (b'1', b'L'),
            32 => (b'1', b'X'),
            _ => return None,
        },
        Constellation::Glonass => match bit {
            2 => (b'1', b'C'),
            3 => (b'1', b'P'),
            8 => (b'2', b'C'),
            9 => (b'2', b'P'),
            _ => return None,
        },
        Constellation::Galileo => match bit {
            2 => (b'1', b'C'),
            3 => (b'1', b'A'),
            4 => (b'1', b'B'),
            5 => (b'1', b'X'),
            6 => (b'1', b'Z'),
            8 => (b'6', b'C'),
            9 => (b'6', b'A'),
            10 => (b'6', b'B'),
            11 => (b'6', b'X'),
            12 => (b'6', b'Z'),
            14 => (b'7', b'I'),
            15 => (b'7', b'Q'),
            16 => (b'7', b'X'),
            18 => (b'8', b'I'),
            19 => (b'8', b'Q'),
            20 => (b'8', b'X'),
            22 => (b'5', b'I'),
            23 => (b'5', b'Q'),
            24 => (b'5', b'X'),
            _ => return None,
        },
        Constellation::Qzss => match bit {
            2 => (b'1', b'C'),
            9 => (b'6', b'S'),
            10 => (b'6', b'L'),
            11 => (b'6', b'X'),
            15 => (b'2', b'S'),
            16 => (b'2', b'L'),
            17 => (b'2', b'X'),
            22 => (b'5', b'I'),
            23 => (b'5', b'Q'),
            24 => (b'5', b'X'),
            30 => (b'1', b'S'),
            31 => (b'1', b'L'),
            32 => (b'1', b'X'),
            _ => return None,
        },
        Constellation::Beidou => match bit {
            2 => (b'2', b'I'),
            3 => (b'2', b'Q'),
            4 => (b'2', b'X'),
            8 => (b'6', b'I'),
            9 => (b'6', b'Q'),
            10 => (b'6', b'X'),
            14 => (b'7', b'I'),
            15 => (b'7', b'Q'),
            16 => (b'7', b'X'),
            22 => (b'5', b'D'),
            23 => (b'5', b'P'),
            24 => (b'5', b'X'),
            25 => (b'7', b'D'),
            26 => (b'7', b'P'),
            27 => (b'7', b'Z'),
            30 => (b'1', b'D'),
            31 => (b'1', b'P'),
            32 => (b'1', b'X'),
            _ => return None,
        },
        Constellation::Navic | Constellation::Sbas => return None,
    };
    Some(SignalCode::new(band, attribute))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every signal of the tables is on a band that its system transmits, and no two bits mean the same.
    #[test]
    fn signals_exist_and_differ() {
        for (constellation, count) in [
            (Constellation::Gps, 15),
            (Constellation::Glonass, 4),
            (Constellation::Galileo, 19),
            (Constellation::Qzss, 13),
            (Constellation::Beidou, 18),
        ] {
            let mut signals: Vec<_> = (0..=40).filter_map(|bit| signal(constellation, bit)).collect();
            assert!(signals.iter().all(|s| s.frequency_hz(constellation, Some(0)).is_some()));
            signals.sort();
            signals.dedup();
            assert_eq!(signals.len(), count, "{constellation:?}");
        }
    }
}
