//! Observation types: what the columns of an observation file hold.

use crate::gnss::{Constellation, SignalCode};

/// What a column of an observation file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObservationKind {
    /// C: pseudorange, m.
    Pseudorange,
    /// L: carrier phase, cycles.
    CarrierPhase,
    /// D: Doppler, Hz.
    Doppler,
    /// S: carrier-to-noise density, dB-Hz.
    SignalStrength,
    /// Anything else (I: ionosphere delay, X: receiver channel); not decoded.
    Other,
}

/// One column: what it holds, and of which signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservationType {
    /// What it holds.
    pub kind: ObservationKind,
    /// The signal.
    pub signal: SignalCode,
    /// Factor that the file's values are multiplied with (SYS / SCALE FACTOR), usually 1.
    pub scale: f64,
}

/// An observation code of RINEX 3 and 4; `None` when it is none.
pub(super) fn observation_type(
    code: &[u8],
    constellation: Constellation,
    version: u16,
) -> Option<ObservationType> {
    let (letter, band, attribute) = match *code {
        [letter, band, attribute] => (letter, band, attribute),
        [letter, band] => (letter, band, b' '),
        _ => return None,
    };
    let kind = match letter {
        b'C' => ObservationKind::Pseudorange,
        b'L' => ObservationKind::CarrierPhase,
        b'D' => ObservationKind::Doppler,
        b'S' => ObservationKind::SignalStrength,
        b'A'..=b'Z' => ObservationKind::Other,
        _ => return None,
    };
    if !band.is_ascii_digit() || !(attribute == b' ' || attribute.is_ascii_uppercase()) {
        return None;
    }
    let band = beidou_b1i_band(constellation, band, attribute, version);
    Some(ObservationType { kind, signal: SignalCode::new(band, attribute), scale: 1.0 })
}

/// RINEX 3.02 wrote BeiDou B1I as band 1; before and after it is band 2 (RINEX 3.05, notes on
/// BeiDou observation codes).
const fn beidou_b1i_band(constellation: Constellation, band: u8, attribute: u8, version: u16) -> u8 {
    match (constellation, band, attribute) {
        (Constellation::Beidou, b'1', b'I' | b'Q') => b'2',
        (Constellation::Beidou, b'1', b'X') if version == 302 => b'2',
        _ => band,
    }
}
