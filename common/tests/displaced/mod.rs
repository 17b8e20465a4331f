//! Messages of a phone that says it is elsewhere, and bounds that contradict it.

#![allow(dead_code)] // not every test uses everything

use cofix_common::constraint::{Constraint, Distance};
use cofix_common::frames::{Ecef, EcefVector, Enu, LocalFrame};
use cofix_common::wire::EpochMessage;

/// Changes measurements and solution of a phone at a place to those of the place displaced by a vector.
pub fn displace(message: &mut EpochMessage, place: Ecef, by: EcefVector) {
    for observation in &mut message.observations {
        let range_m = |from| observation.satellite_position.distance_m(from);
        observation.pseudorange_m += range_m(place + by) - range_m(place);
        observation.range_change = None;
    }
    if let Some(solution) = &mut message.wls {
        solution.position = solution.position + by;
    }
}

/// Metres to the east of a place.
pub fn east_of(place: Ecef, metres: f64) -> EcefVector {
    LocalFrame::at(place).vector_enu_to_ecef(Enu { east: metres, north: 0.0, up: 0.0 })
}

/// Two metres between all phones.
pub fn bounds(phones: usize) -> Vec<Constraint> {
    let pair = |a, b| Constraint::Distance(Distance { phones: [a, b], minimum_m: 0.0, maximum_m: 2.0 });
    (0..phones).flat_map(|a| (a + 1..phones).map(move |b| pair(a, b))).collect()
}
