//! Messages 1005 and 1006: where the reference station's antenna is (RTCM 10403.3, tables 3.5-6 and 3.5-7).

use std::ops::RangeInclusive;

use super::ephemeris::Fault;
use crate::formats::bits::Bits;
use crate::frames::Ecef;
use crate::orbit::within;

/// Coordinates and heights are sent in tenths of a millimetre.
const UNIT_M: f64 = 1e-4;
/// Distance of a station from the Earth's centre, m: from the bottom of the sea at a pole to an aeroplane at the equator.
const RADIUS_BOUNDS_M: RangeInclusive<f64> = 6.33e6..=6.41e6;

/// A reference station.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Station {
    /// Its number, 0-4095.
    pub id: u16,
    /// The antenna reference point, m. The phase centre is some centimetres above it.
    pub position: Ecef,
    /// Height of the antenna reference point above the marker, m, where the message says it (1006). The position has it in it.
    pub antenna_height_m: Option<f64>,
}

/// Decodes message 1005 or 1006.
pub(super) fn decode(bytes: &[u8], number: u32) -> Result<Station, Fault> {
    let mut bits = Bits::new(bytes);
    bits.skip(12);
    let id = u16::try_from(bits.unsigned(12)?).unwrap_or_default();
    bits.skip(6 + 4); // year of the frame, systems, kind of station
    let x = bits.signed_long(38)?;
    bits.skip(2); // oscillator, reserved
    let y = bits.signed_long(38)?;
    bits.skip(2); // quarter cycle
    let z = bits.signed_long(38)?;
    let [x_m, y_m, z_m] = [x, y, z].map(|coordinate| coordinate as f64 * UNIT_M);
    let position = Ecef::new(x_m, y_m, z_m);
    within("distance from the Earth's centre (m)", position.0.norm(), RADIUS_BOUNDS_M)?;
    let antenna_height_m = if number == 1006 { Some(bits.scaled_unsigned(16, UNIT_M)?) } else { None };
    Ok(Station { id, position, antenna_height_m })
}
