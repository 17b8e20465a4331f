//! The ionospheric model of the GPS navigation message (IS-GPS-200, 20.3.3.5.2.5).

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::frames::{Direction, Geodetic};
use crate::time::{GpsTime, SECONDS_PER_DAY};

/// Frequency of the model's delay, Hz: GPS L1, Galileo E1, BeiDou B1C.
pub(crate) const L1_HZ: f64 = 1575.42e6;
/// Night delay, s.
pub(super) const NIGHT_S: f64 = 5e-9;
/// Local time of the maximum, s.
pub(super) const PEAK_S: f64 = 50_400.0;
/// Minimum period of the daily cosine, s.
pub(super) const SHORTEST_PERIOD_S: f64 = 72_000.0;

/// The eight broadcast coefficients of one day, of GPS' model or of BeiDou's
/// ([`beidou_klobuchar_delay_b1i_m`](super::beidou_klobuchar_delay_b1i_m)); the two are not interchangeable.
///
/// There is no default: all coefficients zero would mean a night delay of 5 ns at any time, and not an unknown ionosphere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct KlobucharCoefficients {
    /// Amplitude polynomial in the geomagnetic (BeiDou: absolute geographic) latitude: s, s/semicircle, s/semicircle², s/semicircle³.
    pub alpha: [f64; 4],
    /// Period polynomial in the same latitude: s, s/semicircle, s/semicircle², s/semicircle³.
    pub beta: [f64; 4],
}

/// Ionospheric delay of a code on L1, m, positive.
///
/// An elevation below the horizon counts as the horizon. Angles of the document are in semicircles, hence the factors π.
pub fn klobuchar_delay_l1_m(
    coefficients: &KlobucharCoefficients,
    receiver: Geodetic,
    direction: Direction,
    time: GpsTime,
) -> f64 {
    let elevation = direction.elevation_rad.max(0.0) / PI;
    let (sin_azimuth, cos_azimuth) = direction.azimuth_rad.sin_cos();
    let earth_angle = 0.0137 / (elevation + 0.11) - 0.022;
    let latitude = (receiver.latitude_rad / PI + earth_angle * cos_azimuth).clamp(-0.416, 0.416);
    let longitude = receiver.longitude_rad / PI + earth_angle * sin_azimuth / (latitude * PI).cos();
    let geomagnetic_latitude = latitude + 0.064 * ((longitude - 1.617) * PI).cos();
    let local_time_s = (43_200.0 * longitude + time.tow_s()).rem_euclid(SECONDS_PER_DAY);

    let slant = 1.0 + 16.0 * (0.53 - elevation).powi(3);
    let amplitude_s = cubic(&coefficients.alpha, geomagnetic_latitude).max(0.0);
    let period_s = cubic(&coefficients.beta, geomagnetic_latitude).max(SHORTEST_PERIOD_S);
    let phase = 2.0 * PI * (local_time_s - PEAK_S) / period_s;
    let day_s = if phase.abs() < 1.57 {
        let square = phase * phase;
        amplitude_s * (1.0 + square * (-0.5 + square / 24.0))
    } else {
        0.0
    };
    SPEED_OF_LIGHT_MPS * slant * (NIGHT_S + day_s)
}

/// Converts a delay on L1 to another frequency: (f_L1/f)² times as long.
pub fn scale_from_l1(delay_l1_m: f64, frequency_hz: f64) -> f64 {
    scale_delay(delay_l1_m, L1_HZ, frequency_hz)
}

/// Converts a delay on one frequency to another.
pub(crate) fn scale_delay(delay_m: f64, from_hz: f64, to_hz: f64) -> f64 {
    let ratio = from_hz / to_hz;
    delay_m * ratio * ratio
}

pub(super) fn cubic(c: &[f64; 4], x: f64) -> f64 {
    c[0] + x * (c[1] + x * (c[2] + x * c[3]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const DAY: KlobucharCoefficients = KlobucharCoefficients {
        alpha: [1.118e-8, -7.451e-9, -5.961e-8, 1.192e-7],
        beta: [1.167e5, -2.294e5, -1.311e5, 1.049e6],
    };

    fn delay(coefficients: &KlobucharCoefficients, elevation_deg: f64, tow_s: f64) -> f64 {
        let direction =
            Direction { azimuth_rad: 210f64.to_radians(), elevation_rad: elevation_deg.to_radians() };
        let receiver = Geodetic::from_degrees(40.0, -100.0, 0.0);
        klobuchar_delay_l1_m(coefficients, receiver, direction, GpsTime::from_week_tow(1_000, tow_s))
    }

    #[test]
    fn all_zero_coefficients_mean_night_not_a_substitute() {
        let zero = KlobucharCoefficients { alpha: [0.0; 4], beta: [0.0; 4] };
        let slant = 1.0 + 16.0 * (0.53f64 - 0.5).powi(3);
        let expected = SPEED_OF_LIGHT_MPS * 5e-9 * slant;
        assert!((delay(&zero, 90.0, 72_000.0) - expected).abs() < 1e-12);
    }

    #[test]
    fn afternoon_is_more_than_night_and_low_more_than_high() {
        let afternoon = 14.0 * 3_600.0 + 100.0 / 15.0 * 3_600.0;
        assert!(delay(&DAY, 45.0, afternoon) > 1.5 * delay(&DAY, 45.0, afternoon - 43_200.0));
        assert!(delay(&DAY, 10.0, afternoon) > 1.5 * delay(&DAY, 80.0, afternoon));
    }

    #[test]
    fn below_the_horizon_is_finite() {
        assert_eq!(delay(&DAY, -19.8, 0.0), delay(&DAY, 0.0, 0.0));
    }

    #[test]
    fn l5_is_delayed_by_1_793_times_l1() {
        assert!((scale_from_l1(1.0, 1176.45e6) - (154.0f64 / 115.0).powi(2)).abs() < 1e-14);
    }
}
