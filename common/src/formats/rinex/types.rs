//! Observation types: kind and signal of the columns of an observation file.

use crate::gnss::SignalCode;

/// Quantity in a column of an observation file.
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

/// One column: its quantity and signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservationType {
    /// The quantity.
    pub kind: ObservationKind,
    /// The signal.
    pub signal: SignalCode,
    /// Factor that the file's values are multiplied with (SYS / SCALE FACTOR), usually 1.
    pub scale: f64,
}

/// An observation code of RINEX 3 and 4 as it is written; `None` when no system can have it.
pub(super) fn observation_type(code: &[u8]) -> Option<ObservationType> {
    let (letter, band, attribute) = match *code {
        [letter, band, attribute] => (letter, band, attribute),
        [letter, band] => (letter, band, b' '),
        _ => return None,
    };
    let kind = match letter.to_ascii_uppercase() {
        b'C' => ObservationKind::Pseudorange,
        b'L' => ObservationKind::CarrierPhase,
        b'D' => ObservationKind::Doppler,
        b'S' => ObservationKind::SignalStrength,
        b'A'..=b'Z' => ObservationKind::Other,
        _ => return None,
    };
    if !band.is_ascii_digit() || !(attribute == b' ' || attribute.is_ascii_alphabetic()) {
        return None;
    }
    let signal = SignalCode::new(band, attribute.to_ascii_uppercase());
    Some(ObservationType { kind, signal, scale: 1.0 })
}
