//! Masks by name: constellations, satellites and signals that are excluded regardless of their measurements.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::gnss::{Constellation, Observation, SatelliteId, SignalCode};

/// An exclusion. As text, with the letters of RINEX: a constellation (`E`), a satellite (`G05`), a signal or all signals of a
/// band of either (`C:1C`, `E12:5X`, `G:5`), or of every constellation (`5X`, `5`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Exclusion {
    satellites: Satellites,
    signals: Signals,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Satellites {
    All,
    Of(Constellation),
    One(SatelliteId),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Signals {
    All,
    /// RINEX band digit.
    OnBand(u8),
    One(SignalCode),
}

/// Error for a text that is not an exclusion.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "'{text}' names nothing to exclude; write a constellation (one of G R E C J I S), a satellite (G05), a signal or band of either \
     (C:1C, E12:5X, G:5) or of all constellations (5X, 5)"
)]
pub struct ExclusionError {
    text: String,
}

impl Exclusion {
    /// Whether the exclusion names an observation.
    pub fn names(&self, observation: &Observation) -> bool {
        let satellite = observation.satellite;
        let is_of_satellite = match self.satellites {
            Satellites::All => true,
            Satellites::Of(constellation) => satellite.constellation == constellation,
            Satellites::One(one) => satellite == one,
        };
        is_of_satellite
            && match self.signals {
                Signals::All => true,
                Signals::OnBand(band) => observation.signal.band == band,
                Signals::One(signal) => observation.signal == signal,
            }
    }
}

impl FromStr for Exclusion {
    type Err = ExclusionError;

    fn from_str(text: &str) -> Result<Self, ExclusionError> {
        let parsed = match text.split_once(':') {
            Some((satellites, signals)) => parse_satellites(satellites).zip(parse_signals(signals)),
            None => parse_satellites(text)
                .map(|satellites| (satellites, Signals::All))
                .or_else(|| parse_signals(text).map(|signals| (Satellites::All, signals))),
        };
        let (satellites, signals) = parsed.ok_or_else(|| ExclusionError { text: text.to_owned() })?;
        Ok(Self { satellites, signals })
    }
}

fn parse_satellites(text: &str) -> Option<Satellites> {
    let mut letters = text.chars();
    match (letters.next(), letters.next()) {
        (Some(letter), None) => Constellation::from_letter(letter).map(Satellites::Of),
        // RINEX 2 writes a blank in the tens place.
        _ if text.contains(' ') => None,
        _ => text.parse().ok().map(Satellites::One),
    }
}

fn parse_signals(text: &str) -> Option<Signals> {
    match *text.as_bytes() {
        [band @ b'1'..=b'9'] => Some(Signals::OnBand(band)),
        [band @ b'1'..=b'9', attribute @ b'A'..=b'Z'] => Some(Signals::One(SignalCode::new(band, attribute))),
        _ => None,
    }
}

impl fmt::Display for Exclusion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let between = match (self.satellites, self.signals) {
            (Satellites::All, _) | (_, Signals::All) => "",
            _ => ":",
        };
        match self.satellites {
            Satellites::All => {}
            Satellites::Of(constellation) => write!(f, "{}", constellation.letter())?,
            Satellites::One(satellite) => write!(f, "{satellite}")?,
        }
        match self.signals {
            Signals::All => Ok(()),
            Signals::OnBand(band) => write!(f, "{between}{}", band as char),
            Signals::One(signal) => write!(f, "{between}{signal}"),
        }
    }
}

impl TryFrom<String> for Exclusion {
    type Error = ExclusionError;

    fn try_from(text: String) -> Result<Self, ExclusionError> {
        text.parse()
    }
}

impl From<Exclusion> for String {
    fn from(exclusion: Exclusion) -> Self {
        exclusion.to_string()
    }
}

/// Exclusions with a flag for those that have named an observation.
#[derive(Clone, Debug, Default)]
pub(super) struct Exclusions {
    list: Vec<(Exclusion, bool)>,
}

impl Exclusions {
    pub(super) fn new(list: &[Exclusion]) -> Self {
        Self { list: list.iter().map(|exclusion| (*exclusion, false)).collect() }
    }

    /// The first exclusion that names an observation; marks all that name it.
    pub(super) fn first(&mut self, observation: &Observation) -> Option<Exclusion> {
        let mut first = None;
        for (exclusion, has_met) in &mut self.list {
            if exclusion.names(observation) {
                *has_met = true;
                first = first.or(Some(*exclusion));
            }
        }
        first
    }

    /// Exclusions that have named no observation.
    pub(super) fn idle(&self) -> impl Iterator<Item = Exclusion> {
        self.list.iter().filter(|(_, has_met)| !has_met).map(|(exclusion, _)| *exclusion)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::LossOfLock;

    fn observation(satellite: &str, signal: [u8; 2]) -> Observation {
        Observation {
            satellite: satellite.parse().unwrap(),
            signal: SignalCode::new(signal[0], signal[1]),
            pseudorange_m: Some(2.2e7),
            carrier_phase_cycles: None,
            doppler_hz: None,
            cn0_dbhz: None,
            loss_of_lock: LossOfLock::default(),
        }
    }

    #[test]
    fn each_names_what_it_says_and_nothing_else() {
        let all = [
            observation("E12", *b"1C"),
            observation("E12", *b"5X"),
            observation("E13", *b"5X"),
            observation("G05", *b"5X"),
            observation("G05", *b"5Q"),
            observation("C12", *b"1C"),
        ];
        for (text, named) in [
            ("E", [true, true, true, false, false, false]),
            ("E12", [true, true, false, false, false, false]),
            ("G05", [false, false, false, true, true, false]),
            ("C:1C", [false, false, false, false, false, true]),
            ("E12:5X", [false, true, false, false, false, false]),
            ("E:5", [false, true, true, false, false, false]),
            ("5X", [false, true, true, true, false, false]),
            ("5", [false, true, true, true, true, false]),
            ("S", [false; 6]),
        ] {
            let exclusion: Exclusion = text.parse().unwrap();
            assert_eq!(all.each_ref().map(|o| exclusion.names(o)), named, "{text}");
            assert_eq!(exclusion.to_string(), text);
        }
    }

    #[test]
    fn what_names_nothing_is_refused_with_examples() {
        for text in [
            "", "e", "X", "G5", "G 5", "G005", "Galileo", "G:", ":1C", "C:L1", "C1C", "E:0", "1c", "12",
            "E:1CX", "é",
        ] {
            let error = text.parse::<Exclusion>().unwrap_err().to_string();
            assert!(error.contains(&format!("'{text}'")) && error.contains("C:1C"), "{error}");
        }
    }

    #[test]
    fn one_that_met_nothing_is_known_also_behind_others() {
        let mut exclusions = Exclusions::new(&["E", "E12", "R"].map(|text| text.parse().unwrap()));
        let first = exclusions.first(&observation("E12", *b"1C"));
        assert_eq!(first.map(|exclusion| exclusion.to_string()).as_deref(), Some("E"));
        assert_eq!(exclusions.first(&observation("G05", *b"1C")), None);
        assert_eq!(exclusions.idle().map(|exclusion| exclusion.to_string()).collect::<Vec<_>>(), ["R"]);
    }
}
