//! The tropospheric delay at the zenith of Saastamoinen (1972) in a standard atmosphere.

use crate::frames::Geodetic;

/// Relative humidity assumed without a measurement.
pub const STANDARD_RELATIVE_HUMIDITY: f64 = 0.7;

/// Valid heights of the formula, m; heights outside are limited to them.
const HEIGHT_RANGE_M: (f64, f64) = (0.0, 10_000.0);
/// Temperature at sea level, K.
const SEA_LEVEL_K: f64 = 15.0 + 273.16;

/// Tropospheric delay of a signal from the zenith, m, positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZenithDelay {
    /// Hydrostatic part, in proportion to the pressure, m.
    pub hydrostatic_m: f64,
    /// Wet part, by the water vapour, m.
    pub wet_m: f64,
}

/// The tropospheric delay at the zenith.
///
/// Pressure and temperature are those of the standard atmosphere at the receiver's height (1013.25 hPa and 15 °C at sea level),
/// `relative_humidity` is in 0-1. Heights outside 0-10 km are limited, so that the result is finite for any finite input.
pub fn saastamoinen_zenith_delay(receiver: Geodetic, relative_humidity: f64) -> ZenithDelay {
    let height_m = receiver.height_m.clamp(HEIGHT_RANGE_M.0, HEIGHT_RANGE_M.1);
    let pressure_hpa = 1013.25 * (1.0 - 2.2557e-5 * height_m).powf(5.2568);
    let temperature_k = SEA_LEVEL_K - 6.5e-3 * height_m;
    let vapour_hpa =
        6.108 * relative_humidity * ((17.15 * temperature_k - 4684.0) / (temperature_k - 38.45)).exp();

    let gravity = 1.0 - 0.00266 * (2.0 * receiver.latitude_rad).cos() - 0.00028 * height_m / 1e3;
    ZenithDelay {
        hydrostatic_m: 0.0022768 * pressure_hpa / gravity,
        wet_m: 0.002277 * (1255.0 / temperature_k + 0.05) * vapour_hpa,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn delay(height_m: f64, humidity: f64) -> ZenithDelay {
        saastamoinen_zenith_delay(Geodetic::from_degrees(45.0, 0.0, height_m), humidity)
    }

    #[test]
    fn zenith_at_sea_level_is_2_3_m_dry() {
        // 0.0022768 m/hPa times 1013.25 hPa, where the latitude term vanishes.
        assert!((delay(0.0, 0.0).hydrostatic_m - 0.0022768 * 1013.25).abs() < 1e-12);
        assert!(delay(0.0, 0.0).wet_m.abs() < 1e-12);
    }

    #[test]
    fn absurd_heights_stay_finite() {
        for height_m in [-6_378_137.0, 20_200_000.0] {
            let ZenithDelay { hydrostatic_m, wet_m } = delay(height_m, 0.7);
            assert!(hydrostatic_m.is_finite() && wet_m.is_finite());
        }
    }

    #[test]
    fn higher_is_shorter_and_wetter_is_longer() {
        assert!(delay(3_000.0, 0.5).hydrostatic_m < 0.75 * delay(0.0, 0.5).hydrostatic_m);
        assert!(delay(0.0, 1.0).wet_m > 0.1);
    }
}
