//! Broadcast ionosphere coefficients.

/// Klobuchar coefficients as broadcast (IS-GPS-200, 20.3.3.5.1.7).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KlobucharCoefficients {
    /// Amplitude polynomial: s, s/semicircle, s/semicircle², s/semicircle³.
    pub alpha: [f64; 4],
    /// Period polynomial: s, s/semicircle, s/semicircle², s/semicircle³.
    pub beta: [f64; 4],
}
