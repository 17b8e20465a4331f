//! Assembly of messages whose pieces carry a number.

use std::collections::BTreeMap;

use crate::gnss::SatelliteId;
use crate::orbit::KeplerEphemeris;

/// The latest pieces 1 to `N` of the message of each satellite.
#[derive(Clone, Debug, Default)]
pub(super) struct Pieces<P, const N: usize> {
    satellites: BTreeMap<SatelliteId, OfSatellite<P, N>>,
}

#[derive(Clone, Debug)]
struct OfSatellite<P, const N: usize> {
    pieces: [Option<P>; N],
    given: Option<KeplerEphemeris>,
}

impl<P: Copy, const N: usize> Pieces<P, N> {
    /// Takes a piece by its number. When no piece is missing, gives all pieces and the place of the ephemeris that was given last.
    pub(super) fn put(
        &mut self,
        satellite: SatelliteId,
        number: u64,
        piece: P,
    ) -> Option<([P; N], &mut Option<KeplerEphemeris>)> {
        let nothing = OfSatellite { pieces: [None; N], given: None };
        let OfSatellite { pieces, given } = self.satellites.entry(satellite).or_insert(nothing);
        *pieces.get_mut(usize::try_from(number.checked_sub(1)?).ok()?)? = Some(piece);
        let mut whole = [piece; N];
        for (place, piece) in whole.iter_mut().zip(pieces) {
            *place = (*piece)?;
        }
        Some((whole, given))
    }
}
