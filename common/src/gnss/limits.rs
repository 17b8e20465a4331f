//! What a measurement can be at all, in any format. The limits stop damage and mixed-up units, not bad measurements.

use std::ops::RangeInclusive;

/// Pseudoranges outside these bounds, m, are impossible: no satellite in use is nearer or farther.
pub const PSEUDORANGE_BOUNDS_M: RangeInclusive<f64> = 1e6..=1e9;
/// Largest carrier phase that is believed, cycles: RINEX has no room for more. The Kirin 980 writes some of 4·10¹⁰.
pub(crate) const MAX_PHASE_CYCLES: f64 = 9e9;
/// Largest Doppler that is believed, Hz. An oscillator that is off by 10⁻⁴ makes 158 kHz on L1, the same for all satellites (a
/// station with 3.5·10⁻⁵ is on record); satellite and receiver add some 10 kHz.
pub const MAX_DOPPLER_HZ: f64 = 2e5;
/// Carrier-to-noise densities that are believed, dB-Hz.
pub const CN0_BOUNDS_DBHZ: RangeInclusive<f64> = 0.0..=70.0;
