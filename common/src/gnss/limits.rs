//! What a measurement can be at all. The limits stop damage and mixed-up units, not bad measurements.

/// Pseudoranges outside these bounds, m, are impossible: no satellite in use is nearer or farther.
pub(crate) const PSEUDORANGE_BOUNDS_M: (f64, f64) = (1e6, 1e9);
/// Largest Doppler that is believed, Hz. An oscillator that is off by 10⁻⁴ makes 158 kHz on L1, the same for all satellites (a
/// station with 3.5·10⁻⁵ is on record); satellite and receiver add some 10 kHz.
pub(crate) const MAX_DOPPLER_HZ: f64 = 2e5;
/// Reason to count a larger one under.
pub(crate) const DOPPLER_TOO_LARGE: &str = "Doppler beyond 200 kHz";
/// Carrier-to-noise densities that are believed, dB-Hz.
pub(crate) const CN0_BOUNDS_DBHZ: (f64, f64) = (0.0, 70.0);
