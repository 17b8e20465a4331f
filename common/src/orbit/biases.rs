//! Group delay corrections from observable-specific biases.
//!
//! Biases and clocks of a network belong together: with each pseudorange reduced by its bias, P − c·OSB, the ionosphere-free pair of the
//! clocks has no remaining bias, and every single signal agrees with the clocks up to one constant per system (a convention of the product,
//! absorbed by a receiver clock). The same constant separates OSB from the TGD of navigation messages, so both are mixed within a system
//! only after it has been estimated (`datum_m`).

use std::collections::BTreeMap;

use super::records::{BiasFile, CodeBias};
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::gnss::{Constellation, SatelliteId, SignalCode};
use crate::time::GpsTime;

/// Tolerance for files that end a day at its last second, s.
const GRACE_S: f64 = 1.0;
/// Minimum number of satellites for estimating the constant between biases and navigation messages.
const MIN_COMMON_SATELLITES: usize = 3;

/// Biases of all satellites.
#[derive(Clone, Debug, Default)]
pub(super) struct Biases {
    satellites: BTreeMap<SatelliteId, BTreeMap<SignalCode, Vec<CodeBias>>>,
    span: Option<(GpsTime, GpsTime)>,
}

impl Biases {
    /// Adds a file. Of several valid biases the one with the latest start is used, and of those the one added first.
    pub(super) fn add(&mut self, file: BiasFile) {
        for bias in file.biases {
            // An open end is far in the future; the span serves only as information.
            let end = bias.end.unwrap_or_else(|| GpsTime::from_nanos(i64::MAX));
            let (first, last) = self.span.unwrap_or((bias.start, end));
            self.span = Some((first.min(bias.start), last.max(end)));
            let windows = self.satellites.entry(bias.satellite).or_default().entry(bias.signal).or_default();
            // Inserted before those with the same start: the search runs from the end, so the first added is found first.
            let at = windows.partition_point(|other| other.start < bias.start);
            windows.insert(at, bias);
        }
    }

    /// Whether any satellite of a system has a bias for the signal.
    pub(super) fn cover(&self, constellation: Constellation, signal: SignalCode, time: GpsTime) -> bool {
        self.of(constellation).any(|satellite| self.correction_m(satellite, signal, time).is_some())
    }

    /// Satellites of a system with a bias.
    fn of(&self, constellation: Constellation) -> impl Iterator<Item = SatelliteId> {
        let whole = SatelliteId::new(constellation, 0)..=SatelliteId::new(constellation, u8::MAX);
        self.satellites.range(whole).map(|(satellite, _)| *satellite)
    }

    /// Metres to add to a pseudorange, −c·OSB, from the bias of the signal or of its substitute (see [`stand_ins`]).
    pub(super) fn correction_m(
        &self,
        satellite: SatelliteId,
        signal: SignalCode,
        time: GpsTime,
    ) -> Option<f64> {
        let signals = self.satellites.get(&satellite)?;
        let bias_s = |attribute: u8| {
            in_force(signals.get(&SignalCode::new(signal.band, attribute))?, time).map(|bias| bias.bias_s)
        };
        let own = bias_s(signal.attribute);
        let bias_s = own.or_else(|| {
            stand_ins(satellite.constellation, signal).iter().find_map(|attribute| bias_s(*attribute))
        })?;
        Some(-SPEED_OF_LIGHT_MPS * bias_s)
    }

    /// The constant between biases and corrections by another rule, m: the median over satellites with both.
    pub(super) fn datum_m(
        &self,
        constellation: Constellation,
        signal: SignalCode,
        time: GpsTime,
        rule_m: impl Fn(SatelliteId) -> Option<f64>,
    ) -> Option<f64> {
        let difference =
            |satellite: SatelliteId| Some(self.correction_m(satellite, signal, time)? - rule_m(satellite)?);
        let mut differences: Vec<f64> = self.of(constellation).filter_map(difference).collect();
        differences.sort_by(f64::total_cmp);
        let middle = differences.len() / 2;
        let upper = differences.get(middle).copied()?;
        if differences.len() < MIN_COMMON_SATELLITES {
            return None;
        }
        let lower =
            if differences.len().is_multiple_of(2) { differences.get(middle - 1).copied()? } else { upper };
        Some(0.5 * (lower + upper))
    }

    /// From the earliest start to the latest end of all biases.
    pub(super) const fn span(&self) -> Option<(GpsTime, GpsTime)> {
        self.span
    }
}

/// The valid bias with the latest start.
fn in_force(windows: &[CodeBias], time: GpsTime) -> Option<&CodeBias> {
    let begun = windows.partition_point(|bias| bias.start <= time);
    let holds = |bias: &&CodeBias| bias.end.is_none_or(|end| time <= end + GRACE_S);
    windows.get(..begun)?.iter().rev().find(holds)
}

/// Attributes of signals whose bias substitutes a missing one, best first. The data part, the pilot and the combination of a signal have
/// the same modulation and differ by some tenths of a nanosecond. GPS and GLONASS civil codes differ by up to 2 ns from the precise code of
/// the band, which is still better than no correction. L1C (GPS) is a separate signal on L1.
const fn stand_ins(constellation: Constellation, signal: SignalCode) -> &'static [u8] {
    match (constellation, signal.band, signal.attribute) {
        (Constellation::Gps | Constellation::Qzss, b'1', b'S' | b'L' | b'X') => b"XLSCW",
        (Constellation::Gps | Constellation::Qzss, b'1', _) => b"WPYC",
        (Constellation::Gps | Constellation::Qzss, b'2', _) => b"XLSCWPY",
        (Constellation::Glonass, _, _) => b"CPXIQ",
        // B1C and B1A, B2a and similar: data and pilot; B1I, B2I, B3I: I, Q, X; E1: B and C.
        _ => b"XCQPIDBLSZA",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skips::Skips;

    fn start() -> GpsTime {
        GpsTime::from_week_tow(2_118, 0.0)
    }

    fn bias(satellite: &str, code: [u8; 2], bias_ns: f64) -> CodeBias {
        let signal = SignalCode::new(code[0], code[1]);
        let end = Some(start() + 86_400.0);
        CodeBias {
            satellite: satellite.parse().unwrap(),
            signal,
            start: start(),
            end,
            bias_s: bias_ns * 1e-9,
        }
    }

    fn biases(list: &[CodeBias]) -> Biases {
        let mut biases = Biases::default();
        biases.add(BiasFile { biases: list.to_vec(), skips: Skips::default() });
        biases
    }

    fn correction_ns(biases: &Biases, satellite: &str, code: [u8; 2], after_s: f64) -> Option<f64> {
        let signal = SignalCode::new(code[0], code[1]);
        let metres = biases.correction_m(satellite.parse().unwrap(), signal, start() + after_s)?;
        Some((metres / SPEED_OF_LIGHT_MPS * 1e12).round() / 1e3)
    }

    #[test]
    fn a_signal_has_its_own_bias_or_that_of_its_nearest_relative() {
        let known = biases(&[
            bias("G01", *b"1C", 2.0),
            bias("G01", *b"1W", 3.0),
            bias("G02", *b"1W", 4.0),
            bias("E01", *b"5Q", 5.0),
        ]);
        assert_eq!(correction_ns(&known, "G01", *b"1C", 0.0), Some(-2.0));
        assert_eq!(correction_ns(&known, "G01", *b"1W", 0.0), Some(-3.0));
        assert_eq!(correction_ns(&known, "G02", *b"1C", 0.0), Some(-4.0));
        assert_eq!(correction_ns(&known, "E01", *b"5X", 0.0), Some(-5.0));
        assert_eq!(correction_ns(&known, "E01", *b"1X", 0.0), None);
        assert_eq!(correction_ns(&known, "G03", *b"1C", 0.0), None);
        assert!(!known.cover(Constellation::Galileo, SignalCode::new(b'1', b'C'), start()));
        assert!(known.cover(Constellation::Galileo, SignalCode::new(b'5', b'I'), start()));
    }

    #[test]
    fn biases_hold_in_their_window_and_the_first_named_file_counts() {
        let mut known = biases(&[bias("G01", *b"1C", 2.0)]);
        known.add(BiasFile { biases: vec![bias("G01", *b"1C", 9.0)], skips: Skips::default() });
        let tomorrow = CodeBias { start: start() + 86_400.0, end: None, ..bias("G01", *b"1C", 3.0) };
        known.add(BiasFile { biases: vec![tomorrow], skips: Skips::default() });
        assert_eq!(correction_ns(&known, "G01", *b"1C", -0.1), None);
        assert_eq!(correction_ns(&known, "G01", *b"1C", 86_399.9), Some(-2.0));
        assert_eq!(correction_ns(&known, "G01", *b"1C", 86_400.0), Some(-3.0));
        assert_eq!(correction_ns(&known, "G01", *b"1C", 1e7), Some(-3.0));
        let one = biases(&[bias("G01", *b"1C", 2.0)]);
        assert_eq!(correction_ns(&one, "G01", *b"1C", 86_401.1), None);
        assert!(!one.cover(Constellation::Gps, SignalCode::new(b'1', b'C'), start() + 86_402.0));
    }

    #[test]
    fn the_constant_is_the_median_of_satellites_that_have_both() {
        let known = biases(&[
            bias("G01", *b"1C", 1.0),
            bias("G02", *b"1C", 2.0),
            bias("G03", *b"1C", 3.0),
            bias("G04", *b"1C", 4.0),
        ]);
        let signal = SignalCode::new(b'1', b'C');
        // Rules with a 10 m difference, and one outlier.
        let rule = |satellite: SatelliteId| {
            let own = known.correction_m(satellite, signal, start()).unwrap() - 10.0;
            match satellite.number {
                1 => Some(own - 500.0),
                4 => None,
                _ => Some(own),
            }
        };
        let datum = known.datum_m(Constellation::Gps, signal, start(), rule).unwrap();
        assert!((datum - 10.0).abs() < 1e-9);
        let few = |satellite: SatelliteId| (satellite.number < 3).then_some(0.0);
        assert_eq!(known.datum_m(Constellation::Gps, signal, start(), few), None);
    }
}
