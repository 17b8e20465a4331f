//! The tropospheric delay of Saastamoinen (1972) in a standard atmosphere.

use crate::frames::{Direction, Geodetic};

/// Relative humidity assumed without a measurement.
pub const STANDARD_RELATIVE_HUMIDITY: f64 = 0.7;

/// Valid heights of the formula, m; heights outside are limited to them.
const HEIGHT_RANGE_M: (f64, f64) = (0.0, 10_000.0);
/// Minimum elevation of the flat-layer mapping (1°), rad; lower elevations are limited to it.
const LOWEST_ELEVATION_RAD: f64 = 0.017_453_292_519_943_295;
/// Temperature at sea level, K.
const SEA_LEVEL_K: f64 = 15.0 + 273.16;

/// Tropospheric delay (hydrostatic and wet) of a signal, m, positive.
///
/// Pressure and temperature are those of the standard atmosphere at the receiver's height (1013.25 hPa and
/// 15 °C at sea level), `relative_humidity` is in 0-1, and the mapping is 1/sin(elevation). Elevations below 1°
/// and heights outside 0-10 km are limited, so that the result is finite for any finite input.
pub fn saastamoinen_delay_m(receiver: Geodetic, direction: Direction, relative_humidity: f64) -> f64 {
    let height_m = receiver.height_m.clamp(HEIGHT_RANGE_M.0, HEIGHT_RANGE_M.1);
    let pressure_hpa = 1013.25 * (1.0 - 2.2557e-5 * height_m).powf(5.2568);
    let temperature_k = SEA_LEVEL_K - 6.5e-3 * height_m;
    let vapour_hpa =
        6.108 * relative_humidity * ((17.15 * temperature_k - 4684.0) / (temperature_k - 38.45)).exp();

    let gravity = 1.0 - 0.00266 * (2.0 * receiver.latitude_rad).cos() - 0.00028 * height_m / 1e3;
    let hydrostatic_m = 0.0022768 * pressure_hpa / gravity;
    let wet_m = 0.002277 * (1255.0 / temperature_k + 0.05) * vapour_hpa;
    (hydrostatic_m + wet_m) / direction.elevation_rad.max(LOWEST_ELEVATION_RAD).sin()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn delay(height_m: f64, elevation_deg: f64, humidity: f64) -> f64 {
        let direction = Direction { azimuth_rad: 0.0, elevation_rad: elevation_deg.to_radians() };
        saastamoinen_delay_m(Geodetic::from_degrees(45.0, 0.0, height_m), direction, humidity)
    }

    #[test]
    fn zenith_at_sea_level_is_2_3_m_dry() {
        // 0.0022768 m/hPa times 1013.25 hPa, where the latitude term vanishes.
        assert!((delay(0.0, 90.0, 0.0) - 0.0022768 * 1013.25).abs() < 1e-12);
    }

    #[test]
    fn absurd_inputs_stay_finite() {
        assert!(delay(-6_378_137.0, -90.0, 0.7).is_finite());
        assert!(delay(20_200_000.0, 0.0, 0.7).is_finite());
    }

    #[test]
    fn higher_is_shorter_and_wetter_is_longer() {
        assert!(delay(3_000.0, 30.0, 0.5) < 0.75 * delay(0.0, 30.0, 0.5));
        assert!(delay(0.0, 30.0, 1.0) > delay(0.0, 30.0, 0.0) + 0.1);
    }
}
