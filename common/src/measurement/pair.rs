//! Ionosphere-free pairs: P_IF = (f₁²P₁ − f₂²P₂)/(f₁² − f₂²).
//!
//! The delay of a signal in the ionosphere is, but for millimetres to centimetres of higher order, inversely proportional to
//! the square of its frequency, so this combination of two signals of one satellite is free of it (IS-GPS-200, 20.3.3.3.3.3).
//! Each signal gets its own group delay first. What the receiver delays one signal against the other stays, the same for
//! all satellites of a system: each pair of bands has a receiver clock of its own ([`SignalCode::pair`]). The price is noise:
//! L1 and L5 of equal noise make a pair of 2.6 times that, L1 and L2 of 3.0 times.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::{GivenCorrections, PreparedObservation};
use crate::gnss::{Constellation, SignalCode};
use crate::skips::{Reason, Skips};

/// Pairs that multiply the noise by more than this are not formed (L2 and L5: 16.6).
const MOST_NOISE: f64 = 5.0;

/// What is done about the ionosphere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ionosphere {
    /// Every signal by itself, with the delay of a model (or of the recording, where it states one).
    #[default]
    Model,
    /// The ionosphere-free pair of satellites with two usable bands in an epoch; the others as by
    /// [`Ionosphere::Model`], with receiver clocks of their own.
    Pair,
    /// Pairs, and nothing else.
    PairOnly,
}

/// A word that names none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{text}' is not a way to treat the ionosphere: write 'model', 'pair' or 'pair-only'")]
pub struct IonosphereError {
    text: String,
}

impl FromStr for Ionosphere {
    type Err = IonosphereError;

    fn from_str(text: &str) -> Result<Self, IonosphereError> {
        match text {
            "model" => Ok(Self::Model),
            "pair" => Ok(Self::Pair),
            "pair-only" => Ok(Self::PairOnly),
            _ => Err(IonosphereError { text: text.to_owned() }),
        }
    }
}

/// The second signal of a pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct Second {
    /// The pair's name.
    pub(super) pair: SignalCode,
    /// f₁²/(f₁² − f₂²), by which the first is multiplied; the second by one less.
    factor: f64,
    /// Its strength, dB-Hz.
    pub(super) cn0_dbhz: Option<f64>,
    /// Its standard deviation by the receiver, m.
    pub(super) code_sigma_m: Option<f64>,
    /// Variance of what it has alone, beside its noise, m².
    signal_variance_m2: f64,
}

impl Second {
    /// Variance of the pair, from that of the first signal and of this one's noise, m².
    pub(super) fn variance_m2(&self, first_m2: f64, own_noise_m2: f64) -> f64 {
        let second_m2 = own_noise_m2 + self.signal_variance_m2;
        self.factor.powi(2) * first_m2 + (self.factor - 1.0).powi(2) * second_m2
    }
}

impl Ionosphere {
    /// Replaces signals by pairs. Of a satellite's signals the two whose frequencies are farthest apart make the pair, since
    /// it has the least noise: L1 and L5 before L1 and L2, E1 and E5a before E1 and E5b. The satellite's other
    /// signals are left out. The pair has the range rate of its first signal; where that has none, of its second.
    pub(super) fn combine(
        self,
        prepared: Vec<PreparedObservation>,
        skips: &mut Skips,
    ) -> Vec<PreparedObservation> {
        if self == Self::Model {
            return prepared;
        }
        let mut combined = Vec::with_capacity(prepared.len());
        for (index, one) in prepared.iter().enumerate() {
            let satellite = one.observation.satellite;
            let is_first = !prepared.iter().take(index).any(|p| p.observation.satellite == satellite);
            let signals = || prepared.iter().filter(|p| p.observation.satellite == satellite);
            match (best_pair(signals), self) {
                (Some(pair), _) => combined.extend(is_first.then_some(pair)),
                (None, Self::PairOnly) => {
                    skips.add(Reason::NoSecondBandForPair, || {
                        format!("{satellite} {}", one.observation.signal)
                    });
                }
                (None, _) => combined.push(one.clone()),
            }
        }
        combined
    }
}

/// The pair with the least noise, if there is one.
fn best_pair<'a, I>(signals: impl Fn() -> I) -> Option<PreparedObservation>
where
    I: Iterator<Item = &'a PreparedObservation>,
{
    let mut best: Option<(f64, &PreparedObservation, &PreparedObservation)> = None;
    for first in signals() {
        for second in signals() {
            let Some(factor) = factor(first.frequency_hz, second.frequency_hz) else { continue };
            if best.is_none_or(|(known, ..)| factor < known) {
                best = Some((factor, first, second));
            }
        }
    }
    let (factor, first, second) = best?;
    pair(factor, first, second)
}

/// By what the variance of a signal's code is multiplied in an observation, if both signals of a pair have the same: 1 for a
/// single signal.
pub(super) fn variance_factor(signal: SignalCode, constellation: Constellation) -> f64 {
    pair_factor(signal, constellation).map_or(1.0, |factor| factor.powi(2) + (factor - 1.0).powi(2))
}

/// f₁²/(f₁² − f₂²) of a pair by its name; `None` of a single signal.
pub(super) fn pair_factor(signal: SignalCode, constellation: Constellation) -> Option<f64> {
    let (first, second) = signal.bands_of_pair()?;
    // The two bands of GLONASS have the same ratio on every channel.
    let frequency_hz = |band| SignalCode::new(band, signal.attribute).frequency_hz(constellation, Some(0));
    factor(frequency_hz(first)?, frequency_hz(second)?)
}

/// f₁²/(f₁² − f₂²) for f₁ > f₂ not too near each other.
fn factor(first_hz: f64, second_hz: f64) -> Option<f64> {
    let ratio = (first_hz / second_hz).powi(2);
    let factor = ratio / (ratio - 1.0);
    // Frequencies that are not known are not a number, and no comparison holds.
    (ratio > 1.0 && factor.hypot(factor - 1.0) <= MOST_NOISE).then_some(factor)
}

fn pair(
    factor: f64,
    first: &PreparedObservation,
    second: &PreparedObservation,
) -> Option<PreparedObservation> {
    let name = SignalCode::pair(first.observation.signal, second.observation.signal)?;
    Some(PreparedObservation {
        pseudorange_m: factor * first.pseudorange_m - (factor - 1.0) * second.pseudorange_m,
        range_rate_mps: first.range_rate_mps.or(second.range_rate_mps),
        stated: first.stated.map(|stated| GivenCorrections { ionosphere_m: Some(0.0), ..stated }),
        second: Some(Second {
            pair: name,
            factor,
            cn0_dbhz: second.observation.cn0_dbhz,
            code_sigma_m: second.code_sigma_m,
            signal_variance_m2: second.signal_variance_m2,
        }),
        ..first.clone()
    })
}

#[cfg(test)]
mod tests;
