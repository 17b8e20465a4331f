//! The ionospheric model of BeiDou's D1 and D2 messages for B1I (BDS-SIS-ICD-B1I, 5.2.4.7): Klobuchar's daily cosine with the geographic
//! latitude of the pierce point of a shell.

use std::f64::consts::{PI, TAU};

use super::KlobucharCoefficients;
use super::klobuchar::{NIGHT_S, PEAK_S, SHORTEST_PERIOD_S, cubic};
use super::shell::Shell;
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::frames::{Direction, Geodetic};
use crate::time::{BEIDOU_BEHIND_GPS_S, GpsTime, SECONDS_PER_DAY};

/// Frequency of the model's delay, Hz: B1I.
pub const B1I_HZ: f64 = 1561.098e6;
/// The ICD's sphere and shell.
const SHELL: Shell = Shell::new(6_378e3, 375e3);
/// Maximum period of the daily cosine, s.
const LONGEST_PERIOD_S: f64 = 172_800.0;

/// Ionospheric delay of a code on B1I, m, positive, by the coefficients of BeiDou's own messages.
///
/// An elevation below the horizon counts as the horizon.
pub fn beidou_klobuchar_delay_b1i_m(
    coefficients: &KlobucharCoefficients,
    receiver: Geodetic,
    direction: Direction,
    time: GpsTime,
) -> f64 {
    let pierce = SHELL.pierce(receiver.latitude_rad, receiver.longitude_rad, direction);
    let latitude_semicircles = (pierce.latitude_rad / PI).abs();
    let longitude_s = pierce.longitude_rad * 43_200.0 / PI;
    let local_time_s = (time.tow_s() - BEIDOU_BEHIND_GPS_S + longitude_s).rem_euclid(SECONDS_PER_DAY);

    let amplitude_s = cubic(&coefficients.alpha, latitude_semicircles).max(0.0);
    let period_s = cubic(&coefficients.beta, latitude_semicircles).clamp(SHORTEST_PERIOD_S, LONGEST_PERIOD_S);
    let after_peak_s = local_time_s - PEAK_S;
    let day_s = if after_peak_s.abs() < period_s / 4.0 {
        amplitude_s * (TAU * after_peak_s / period_s).cos()
    } else {
        0.0
    };
    SPEED_OF_LIGHT_MPS * pierce.slant * (NIGHT_S + day_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    const COEFFICIENTS: KlobucharCoefficients = KlobucharCoefficients {
        alpha: [2.0e-8, 1.5e-7, -1.0e-6, 1.4e-6],
        beta: [1.2e5, -5.0e5, 4.0e6, -5.0e6],
    };

    fn delay_m(latitude_deg: f64, longitude_deg: f64, elevation_deg: f64, tow_s: f64) -> f64 {
        let receiver = Geodetic::from_degrees(latitude_deg, longitude_deg, 0.0);
        let direction = Direction { azimuth_rad: 0.0, elevation_rad: elevation_deg.to_radians() };
        let time = GpsTime::from_week_tow(2_118, tow_s);
        beidou_klobuchar_delay_b1i_m(&COEFFICIENTS, receiver, direction, time)
    }

    #[test]
    fn at_the_zenith_it_is_the_daily_cosine() {
        // In the zenith the pierce point is the place itself; longitude 0°, at the peak at 14 h BeiDou time.
        let peak_tow_s = PEAK_S + BEIDOU_BEHIND_GPS_S;
        let expected = SPEED_OF_LIGHT_MPS * (NIGHT_S + 2.0e-8);
        assert!((delay_m(0.0, 0.0, 90.0, peak_tow_s) - expected).abs() < 1e-9);
        // At 90° east, six hours (21,600 s) of the period of 120,000 s after the peak.
        let day_s = 2.0e-8 * (TAU * 21_600.0 / 1.2e5).cos();
        let expected = SPEED_OF_LIGHT_MPS * (NIGHT_S + day_s);
        assert!((delay_m(0.0, 90.0, 90.0, peak_tow_s) - expected).abs() < 1e-9);
        let night = SPEED_OF_LIGHT_MPS * NIGHT_S;
        assert!((delay_m(0.0, 180.0, 90.0, peak_tow_s) - night).abs() < 1e-9);
    }

    #[test]
    fn hemispheres_are_alike_and_low_paths_are_longer() {
        let noon = 43_200.0;
        assert!((delay_m(30.0, 0.0, 90.0, noon) - delay_m(-30.0, 0.0, 90.0, noon)).abs() < 1e-9);
        let night = 0.0;
        // At the horizon 1/sqrt(1 - (6378/6753)²).
        let slant = 1.0 / (1.0 - (6_378.0_f64 / 6_753.0).powi(2)).sqrt();
        assert!((delay_m(0.0, 0.0, 0.0, night) / delay_m(0.0, 0.0, 90.0, night) - slant).abs() < 1e-9);
        assert_eq!(delay_m(0.0, 0.0, -5.0, night), delay_m(0.0, 0.0, 0.0, night));
    }
}
