//! Android's names of satellites and signals in RINEX terms.

use crate::gnss::{Constellation, SatelliteId, SignalCode};
use crate::skips::Reason;

/// A carrier may be this far from its nominal frequency, Hz: phones print it as a 32-bit float (64 Hz) and some round.
const FREQUENCY_TOLERANCE_HZ: f64 = 200e3;
const GLONASS_G1_HZ: f64 = 1602e6;
const GLONASS_G1_STEP_HZ: f64 = 562.5e3;
const GLONASS_G2_HZ: f64 = 1246e6;
const GLONASS_G2_STEP_HZ: f64 = 437.5e3;
/// Widest offset from a channel's frequency, Hz.
const CHANNEL_TOLERANCE_HZ: f64 = 100e3;

/// A band of a system.
struct Band {
    digit: u8,
    /// Attribute of the signal that phones track where the log has no code type.
    usual: u8,
}

const fn band(digit: u8, usual: u8) -> Band {
    Band { digit, usual }
}

/// BeiDou-3's signal at 1207.14 MHz, as phones track it.
const B2B: SignalCode = SignalCode::new(b'7', b'D');

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

/// The satellite of `ConstellationType` and `Svid` (Android API, `GnssStatus.getSvid`), or the reason why there is none.
pub(crate) fn satellite(constellation_type: i64, svid: i64) -> Result<SatelliteId, Reason> {
    use Constellation::{Beidou, Galileo, Glonass, Gps, Navic, Qzss, Sbas};
    let (constellation, number) = match (constellation_type, svid) {
        (1, 1..=32) => (Gps, svid),
        (2, 120..=158 | 183..=192) => (Sbas, svid - 100),
        (3, 1..=32) => (Glonass, svid),
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

/// The frequency channel of a GLONASS satellite of which the phone knows nothing else: `Svid` 93 to 106 are 100 more than it
/// (Android API, `GnssStatus.getSvid`).
pub(crate) fn channel_only(constellation_type: i64, svid: i64) -> Option<i8> {
    let channel = i8::try_from(svid.checked_sub(100)?).ok()?;
    (constellation_type == 3 && (-7..=6).contains(&channel)).then_some(channel)
}

/// A signal and, for GLONASS, its frequency channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Signal {
    pub(super) code: SignalCode,
    pub(super) glonass_channel: Option<i8>,
    /// A code type that the band does not have; the usual one stands in its place.
    pub(super) odd_code_type: Option<u8>,
}

/// The signal on a carrier. Without a frequency, as in logs of 2016, it is the system's primary civil signal. `None` when
/// the system has no signal at that frequency.
pub(super) fn signal(
    satellite: SatelliteId,
    frequency_hz: Option<f64>,
    code_type: Option<u8>,
) -> Option<Signal> {
    let constellation = satellite.constellation;
    let bands = BANDS.iter().find(|(system, _)| *system == constellation)?.1;
    let (band, glonass_channel) = match frequency_hz {
        None => (bands.first()?, None),
        Some(frequency) if constellation == Constellation::Glonass => {
            let (digit, channel) = glonass(frequency)?;
            (bands.iter().find(|band| band.digit == digit)?, Some(channel))
        }
        Some(frequency) => (bands.iter().find(|band| band.is_at(constellation, frequency))?, None),
    };
    let can_be = |code: SignalCode| code.has_pseudorange() && satellite.cannot_send(code).is_none();
    let known = code_type.filter(|letter| can_be(SignalCode::new(band.digit, *letter)));
    // At 1207.14 MHz BeiDou-3 sends another signal than BeiDou-2.
    let usual = || Some(SignalCode::new(band.digit, band.usual)).filter(|code| can_be(*code)).unwrap_or(B2B);
    Some(Signal {
        code: known.map_or_else(usual, |letter| SignalCode::new(band.digit, letter)),
        glonass_channel,
        odd_code_type: code_type.filter(|_| known.is_none()),
    })
}

impl Band {
    fn is_at(&self, constellation: Constellation, frequency_hz: f64) -> bool {
        SignalCode::new(self.digit, self.usual)
            .frequency_hz(constellation, None)
            .is_some_and(|nominal| (nominal - frequency_hz).abs() <= FREQUENCY_TOLERANCE_HZ)
    }
}

/// Band and channel of a GLONASS carrier.
fn glonass(frequency_hz: f64) -> Option<(u8, i8)> {
    let on = |digit: u8, centre_hz: f64, step_hz: f64| {
        let channel = (-7..=6_i8)
            .find(|k| (centre_hz + f64::from(*k) * step_hz - frequency_hz).abs() <= CHANNEL_TOLERANCE_HZ)?;
        Some((digit, channel))
    };
    on(b'1', GLONASS_G1_HZ, GLONASS_G1_STEP_HZ).or_else(|| on(b'2', GLONASS_G2_HZ, GLONASS_G2_STEP_HZ))
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
        assert_eq!((channel_only(3, 93), channel_only(3, 106)), (Some(-7), Some(6)));
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
