//! Android's numbers of satellites, signals and states of tracking (developer.android.com, `GnssStatus` and `GnssMeasurement`) in
//! RINEX terms. Logs of phones and tables that were made from them hold these.

use crate::gnss::{Constellation, SatelliteId, SignalCode};
use crate::skips::Reason;

/// A carrier may be this far from its nominal frequency, Hz: phones print it as a 32-bit float (64 Hz) and some round.
const FREQUENCY_TOLERANCE_HZ: f64 = 200e3;
/// Largest offset from the frequency of a GLONASS channel, Hz.
const CHANNEL_TOLERANCE_HZ: f64 = 100e3;
/// `MultipathIndicator` of a signal in which multipath is detected.
pub(crate) const MULTIPATH_DETECTED: i64 = 1;

/// Bits of `GnssMeasurement.State` (Android API).
pub mod state {
    /// Code lock.
    pub const CODE_LOCK: u32 = 1;
    /// Lock on the subframes, of 6 s, of GPS, QZSS, BeiDou D1 and NavIC (whose own last 12 s).
    pub const SUBFRAME_SYNC: u32 = 1 << 2;
    /// Time of week decoded from the signal.
    pub const TOW_DECODED: u32 = 1 << 3;
    /// The time is known only modulo some milliseconds.
    pub const MSEC_AMBIGUOUS: u32 = 1 << 4;
    /// Lock on GLONASS' strings, of 2 s.
    pub const GLO_STRING_SYNC: u32 = 1 << 6;
    /// GLONASS time of day decoded from the signal.
    pub const GLO_TOD_DECODED: u32 = 1 << 7;
    /// Lock on the subframes, of 0.6 s, of BeiDou D2.
    pub const BDS_D2_SUBFRAME_SYNC: u32 = 1 << 9;
    /// Lock on Galileo's E1B or E1C code.
    pub const GAL_E1BC_CODE_LOCK: u32 = 1 << 10;
    /// Lock on Galileo E1C's secondary code, which lasts 100 ms.
    pub const GAL_E1C_2ND_CODE_LOCK: u32 = 1 << 11;
    /// Lock on Galileo E1B's pages, of 2 s.
    pub const GAL_E1B_PAGE_SYNC: u32 = 1 << 12;
    /// Lock on the messages of augmentation satellites, of 1 s.
    pub const SBAS_SYNC: u32 = 1 << 13;
    /// Time of week known by other means than this signal.
    pub const TOW_KNOWN: u32 = 1 << 14;
    /// GLONASS time of day known by other means than this signal.
    pub const GLO_TOD_KNOWN: u32 = 1 << 15;
}

/// `AccumulatedDeltaRangeState`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RangeState(pub(crate) u32);

impl RangeState {
    /// Whether the accumulated delta range is valid.
    pub(crate) const fn is_valid(self) -> bool {
        self.0 & 1 != 0
    }

    /// Whether the lock was lost since the last measurement of the signal: reset or cycle slip.
    pub(crate) const fn is_lock_lost(self) -> bool {
        self.0 & (1 << 1 | 1 << 2) != 0
    }

    /// Whether the phone tells half cycles and has not resolved that of the signal.
    pub(crate) const fn has_half_cycle(self) -> bool {
        self.0 & 1 << 4 != 0 && self.0 & 1 << 3 == 0
    }
}

/// A word of bits, which Android prints as a signed 32-bit number.
pub(crate) fn bits(value: i64) -> Option<u32> {
    u32::try_from(value).ok().or_else(|| i32::try_from(value).ok().map(i32::cast_unsigned))
}

/// `CodeType`, which is the attribute in RINEX.
pub(crate) const fn code_type(field: &[u8]) -> Option<u8> {
    match field {
        [letter @ b'A'..=b'Z'] => Some(*letter),
        _ => None,
    }
}

/// A band of a system.
struct Band {
    digit: u8,
    /// Attribute of the signal that phones track where they say no code type.
    usual: u8,
}

const fn band(digit: u8, usual: u8) -> Band {
    Band { digit, usual }
}

/// Attribute of the signal of BeiDou-3 at 1207.14 MHz, as phones track it. BeiDou-2 sends another one there.
const B2B: u8 = b'D';

/// Bands to look for; the first is the primary one.
const BANDS: [(Constellation, &[Band]); 7] = [
    (Constellation::Gps, &[band(b'1', b'C'), band(b'5', b'Q'), band(b'2', b'L')]),
    (Constellation::Glonass, &[band(b'1', b'C'), band(b'2', b'C')]),
    (
        Constellation::Galileo,
        &[band(b'1', b'C'), band(b'5', b'Q'), band(b'7', b'Q'), band(b'6', b'C'), band(b'8', b'Q')],
    ),
    (
        Constellation::Beidou,
        &[
            band(b'2', b'I'),
            band(b'1', b'P'),
            band(b'5', b'P'),
            band(b'7', b'I'),
            band(b'6', b'I'),
            band(b'8', b'P'),
        ],
    ),
    (Constellation::Qzss, &[band(b'1', b'C'), band(b'5', b'Q'), band(b'2', b'L'), band(b'6', b'L')]),
    (Constellation::Sbas, &[band(b'1', b'C'), band(b'5', b'I')]),
    (Constellation::Navic, &[band(b'5', b'A'), band(b'9', b'A')]),
];

/// The satellite of `ConstellationType` and `Svid` (`GnssStatus.getSvid`), or the reason why there is none.
pub(crate) fn satellite(constellation_type: i64, svid: i64) -> Result<SatelliteId, Reason> {
    use Constellation::{Beidou, Galileo, Glonass, Gps, Navic, Qzss, Sbas};
    let (constellation, number) = match (constellation_type, svid) {
        (1, 1..=32) => (Gps, svid),
        (2, 120..=158 | 183..=192) => (Sbas, svid - 100),
        (3, 1..=27) => (Glonass, svid),
        (3, 93..=106) => return Err(Reason::GlonassSatelliteByChannelOnly),
        (4, 193..=202) => (Qzss, svid - 192),
        // As in the challenge tables of 2021.
        (4, 1..=10) => (Qzss, svid),
        (5, 1..=63) => (Beidou, svid),
        // Some chips count from 201 on.
        (5, 201..=263) => (Beidou, svid - 200),
        (6, 1..=36) => (Galileo, svid),
        (7, 1..=14) => (Navic, svid),
        (1..=7, _) => return Err(Reason::SatelliteNumberOutOfRange),
        _ => return Err(Reason::UnknownConstellationType),
    };
    let number = u8::try_from(number).map_err(|_| Reason::SatelliteNumberOutOfRange)?;
    Ok(SatelliteId::new(constellation, number))
}

/// A GLONASS satellite of which the phone knows the frequency channel only, and the channel: its `Svid`, 93 to 106, is 100 more.
pub(crate) fn channel_only(constellation_type: i64, svid: i64) -> Option<(SatelliteId, i8)> {
    if constellation_type != 3 || !(93..=106).contains(&svid) {
        return None;
    }
    let satellite = SatelliteId::new(Constellation::Glonass, u8::try_from(svid).ok()?);
    Some((satellite, i8::try_from(svid - 100).ok()?))
}

/// A signal and, for GLONASS, its frequency channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Signal {
    pub(crate) code: SignalCode,
    pub(crate) glonass_channel: Option<i8>,
    /// A code type that the band does not have; the usual one stands in its place.
    pub(crate) odd_code_type: Option<u8>,
}

/// The signal on a carrier. Without a frequency, as in logs of 2016, it is the system's primary civil signal. `None` when
/// the system has no signal at that frequency.
pub(crate) fn signal(
    satellite: SatelliteId,
    frequency_hz: Option<f64>,
    code_type: Option<u8>,
) -> Option<Signal> {
    let constellation = satellite.constellation;
    let mut bands = bands(constellation)?;
    let (band, glonass_channel) = match frequency_hz {
        None => (bands.next()?, None),
        Some(frequency) if constellation == Constellation::Glonass => bands.find_map(|band| {
            let is_on = |channel: &i8| band.is_at(constellation, Some(*channel), frequency);
            Some((band, Some((-7..=6).find(is_on)?)))
        })?,
        Some(frequency) => (bands.find(|band| band.is_at(constellation, None, frequency))?, None),
    };
    let code = band.signal(satellite, code_type)?;
    Some(Signal {
        code,
        glonass_channel,
        odd_code_type: code_type.filter(|letter| *letter != code.attribute),
    })
}

/// The signal on a band, by the first of these code types that the satellite sends there, else the usual one.
pub(crate) fn signal_on(
    satellite: SatelliteId,
    band: u8,
    code_types: impl IntoIterator<Item = u8>,
) -> Option<SignalCode> {
    bands(satellite.constellation)?.find(|known| known.digit == band)?.signal(satellite, code_types)
}

fn bands(constellation: Constellation) -> Option<std::slice::Iter<'static, Band>> {
    BANDS.iter().find(|(system, _)| *system == constellation).map(|(_, bands)| bands.iter())
}

impl Band {
    fn is_at(&self, constellation: Constellation, glonass_channel: Option<i8>, frequency_hz: f64) -> bool {
        let tolerance_hz =
            if glonass_channel.is_some() { CHANNEL_TOLERANCE_HZ } else { FREQUENCY_TOLERANCE_HZ };
        SignalCode::new(self.digit, self.usual)
            .frequency_hz(constellation, glonass_channel)
            .is_some_and(|nominal| (nominal - frequency_hz).abs() <= tolerance_hz)
    }

    fn signal(&self, satellite: SatelliteId, code_types: impl IntoIterator<Item = u8>) -> Option<SignalCode> {
        let mut codes = code_types
            .into_iter()
            .chain([self.usual, B2B])
            .map(|attribute| SignalCode::new(self.digit, attribute));
        codes.find(|code| code.has_pseudorange() && satellite.cannot_send(*code).is_none())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(kind: i64, svid: i64) -> String {
        satellite(kind, svid).map_or_else(|reason| reason.to_string(), |satellite| satellite.to_string())
    }

    #[test]
    fn satellites_by_type_and_number() {
        for (kind, svid, expected) in [
            (1, 7, "G07"),
            (2, 120, "S20"),
            (2, 192, "S92"),
            (3, 24, "R24"),
            (4, 193, "J01"),
            (4, 199, "J07"),
            (5, 60, "C60"),
            (5, 206, "C06"),
            (6, 36, "E36"),
            (7, 9, "I09"),
            (3, 28, Reason::SatelliteNumberOutOfRange.text()),
            (3, 93, Reason::GlonassSatelliteByChannelOnly.text()),
            (3, 106, Reason::GlonassSatelliteByChannelOnly.text()),
            (1, 0, Reason::SatelliteNumberOutOfRange.text()),
            (1, 193, Reason::SatelliteNumberOutOfRange.text()),
            (0, 7, Reason::UnknownConstellationType.text()),
        ] {
            assert_eq!(named(kind, svid), expected, "{kind} {svid}");
        }
    }

    #[test]
    fn channels_are_a_hundred_below_the_number() {
        let channel = |svid| channel_only(3, svid).map(|(satellite, channel)| (satellite.number, channel));
        assert_eq!((channel(93), channel(106)), (Some((93, -7)), Some((106, 6))));
        for (kind, svid) in [(3, 92), (3, 107), (1, 100), (3, 24), (3, i64::MIN), (3, 356)] {
            assert_eq!(channel_only(kind, svid), None, "{kind} {svid}");
        }
    }

    #[test]
    fn signals_by_frequency() {
        use Constellation::{Beidou, Galileo, Glonass, Gps, Navic, Qzss};
        let code = |system, hz: Option<f64>, kind: Option<u8>| {
            signal(SatelliteId::new(system, 1), hz, kind).map(|s| (s.code.to_string(), s.glonass_channel))
        };
        let plain = |text: &str| Some((text.to_owned(), None));
        assert_eq!(code(Gps, None, None), plain("1C"));
        assert_eq!(code(Gps, Some(1_176_450_050.0), Some(b'Q')), plain("5Q"));
        assert_eq!(code(Gps, Some(1_227_600_000.0), None), plain("2L"));
        assert_eq!(code(Galileo, Some(1_575_420_030.0), Some(b'B')), plain("1B"));
        assert_eq!(code(Galileo, Some(1_207_140_000.0), None), plain("7Q"));
        assert_eq!(code(Beidou, None, None), plain("2I"));
        assert_eq!(code(Beidou, Some(1_561_097_980.0), None), plain("2I"));
        assert_eq!(code(Beidou, Some(1_575_420_030.0), None), plain("1P"));
        assert_eq!(code(Beidou, Some(1_176_450_050.0), Some(b'X')), plain("5X"));
        assert_eq!(code(Qzss, Some(1_176_450_050.0), None), plain("5Q"));
        assert_eq!(code(Navic, None, None), plain("5A"));
        assert_eq!(code(Glonass, Some(1_599_750_020.0), Some(b'C')), Some(("1C".to_owned(), Some(-4))));
        assert_eq!(code(Glonass, Some(1_248_625_000.0), None), Some(("2C".to_owned(), Some(6))));
        assert_eq!(code(Glonass, None, None), plain("1C"));
        assert_eq!(code(Beidou, Some(1_191_795_000.0), None), plain("8P"));
        for (system, hz) in
            [(Gps, 1_561_098_000.0), (Glonass, 1_575_420_000.0), (Galileo, 0.0), (Gps, f64::MAX)]
        {
            assert_eq!(code(system, Some(hz), None), None);
        }
    }

    /// Some chips call every code C, or name a code where there is no frequency to tell the band.
    #[test]
    fn a_code_type_that_the_band_does_not_have_is_not_believed() {
        use Constellation::{Beidou, Galileo, Glonass, Gps, Qzss, Sbas};
        for (system, hz, letter, expected) in [
            (Gps, Some(1_176_450_050.0), b'C', "5Q"),
            (Gps, None, b'Q', "1C"),
            (Galileo, Some(1_176_450_050.0), b'C', "5Q"),
            (Beidou, Some(1_561_097_980.0), b'C', "2I"),
            (Beidou, Some(1_575_420_030.0), b'C', "1P"),
            (Glonass, Some(1_599_750_020.0), b'I', "1C"),
            (Qzss, Some(1_575_420_030.0), b'Q', "1C"),
            (Sbas, None, b'I', "1C"),
        ] {
            let found = signal(SatelliteId::new(system, 1), hz, Some(letter)).unwrap();
            assert_eq!((found.code.to_string().as_str(), found.odd_code_type), (expected, Some(letter)));
        }
        let l1c = signal(SatelliteId::new(Gps, 1), Some(1_575_420_030.0), Some(b'X')).unwrap();
        assert_eq!((l1c.code.to_string().as_str(), l1c.odd_code_type), ("1X", None));
    }

    #[test]
    fn beidous_generations_have_different_signals_on_one_frequency() {
        for (number, letter, expected, is_odd) in [
            (18, None, "7I", false),
            (18, Some(b'Q'), "7Q", false),
            (18, Some(b'P'), "7I", true),
            (19, None, "7D", false),
            (19, Some(b'P'), "7P", false),
            (19, Some(b'I'), "7D", true),
        ] {
            let satellite = SatelliteId::new(Constellation::Beidou, number);
            let found = signal(satellite, Some(1_207_140_000.0), letter).unwrap();
            assert_eq!(
                (found.code.to_string().as_str(), found.odd_code_type.is_some()),
                (expected, is_odd),
                "{satellite}"
            );
        }
    }
}
