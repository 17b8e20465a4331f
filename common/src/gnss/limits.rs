//! Limits of measurements in all formats. They reject damage and wrong units, not bad measurements.

use std::ops::RangeInclusive;

/// Possible pseudoranges, m; no satellite in use is nearer or farther.
pub const PSEUDORANGE_BOUNDS_M: RangeInclusive<f64> = 1e6..=1e9;
/// Maximum carrier phase, cycles: RINEX has no room for more. The Kirin 980 writes some of 4·10¹⁰.
pub(crate) const MAX_PHASE_CYCLES: f64 = 9e9;
/// Maximum Doppler, Hz. An oscillator error of 10⁻⁴ gives 158 kHz on L1, the same for all satellites (a
/// station with 3.5·10⁻⁵ is on record); satellite and receiver motion add about 10 kHz.
pub const MAX_DOPPLER_HZ: f64 = 2e5;
/// Valid carrier-to-noise densities, dB-Hz.
pub const CN0_BOUNDS_DBHZ: RangeInclusive<f64> = 0.0..=70.0;
