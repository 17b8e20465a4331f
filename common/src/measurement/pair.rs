//! Ionosphere-free pairs: P_IF = (f₁²P₁ − f₂²P₂)/(f₁² − f₂²).
//!
//! The ionospheric delay of a signal is inversely proportional to the square of its frequency, except for higher-order terms of millimetres
//! to centimetres, so this combination of two signals of one satellite is free of it (IS-GPS-200, 20.3.3.3.3.3). The group delay of each
//! signal is corrected before. The receiver's delay between the two signals remains; it is the same for all satellites of a system, so each
//! pair of bands has its own receiver clock ([`SignalCode::pair`]). The combination amplifies the noise: by 2.6 for L1 and L5 of equal
//! noise, by 3.0 for L1 and L2.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::given::GivenCorrections;
use super::prepared::{PreparedObservation, SecondSignal};
use crate::gnss::{Constellation, SignalCode};
use crate::skips::{Reason, Skips};

/// Maximum noise amplification of a pair (L2 and L5 would have 16.6).
const MOST_NOISE: f64 = 5.0;

/// Treatment of the ionospheric delay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ionosphere {
    /// Single signals, with the delay of a model or of the recording.
    #[default]
    Model,
    /// Ionosphere-free pairs for satellites with two usable bands in an epoch; other satellites as by
    /// [`Ionosphere::Model`], with separate receiver clocks.
    Pair,
    /// Ionosphere-free pairs only.
    PairOnly,
}

/// Error for an unknown word.
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

impl Ionosphere {
    /// Replaces signals by pairs. The two signals of a satellite with the largest frequency difference make the pair with the least noise:
    /// L1 and L5 before L1 and L2, E1 and E5a before E1 and E5b. Other signals of the satellite are left out. The pair has the range rate
    /// of its first signal, or else of its second.
    pub(super) fn form_pairs(
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

/// The pair with the least noise, if there is a pair.
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

/// Variance amplification of an ionosphere-free pair, a² + (a−1)²; 1 for a single signal.
pub(super) fn variance_factor(signal: SignalCode, constellation: Constellation) -> f64 {
    pair_factor(signal, constellation).map_or(1.0, |factor| factor.powi(2) + (factor - 1.0).powi(2))
}

/// Factor a = f₁²/(f₁² − f₂²) of a pair by its signal code; `None` for a single signal.
pub(super) fn pair_factor(signal: SignalCode, constellation: Constellation) -> Option<f64> {
    let (first, second) = signal.bands_of_pair()?;
    // The frequency ratio of GLONASS' two bands is the same on every channel.
    let frequency_hz = |band| SignalCode::new(band, signal.attribute).frequency_hz(constellation, Some(0));
    factor(frequency_hz(first)?, frequency_hz(second)?)
}

/// Factor f₁²/(f₁² − f₂²); `None` unless f₁ > f₂ with a sufficient difference.
fn factor(first_hz: f64, second_hz: f64) -> Option<f64> {
    let ratio = (first_hz / second_hz).powi(2);
    let factor = ratio / (ratio - 1.0);
    // Unknown frequencies are NaN, for which comparisons are false.
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
        phase_m: None,
        stated: first.stated.map(|stated| GivenCorrections { ionosphere_m: Some(0.0), ..stated }),
        second: Some(SecondSignal {
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
