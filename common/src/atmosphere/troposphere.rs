//! The tropospheric delay of signals at one place and time: zenith delay times mapping function.

use serde::{Deserialize, Serialize};

use super::niell::NiellMapping;
use super::saastamoinen::{ZenithDelay, saastamoinen_zenith_delay};
use crate::frames::{Direction, Geodetic};
use crate::time::GpsTime;

/// Minimum elevation (1°), rad; lower elevations are limited to it.
const LOWEST_ELEVATION_RAD: f64 = 0.017_453_292_519_943_295;
/// Days from 1980-01-01 to the beginning of GPS time.
const FIRST_GPS_DAY: f64 = 5.0;
const DAYS_PER_YEAR: f64 = 365.25;
const SECONDS_PER_DAY: f64 = 86_400.0;

/// Ratio of the tropospheric delay at an elevation to that at the zenith.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TroposphereMapping {
    /// The functions of Niell (1996).
    #[default]
    Niell,
    /// 1/sin(elevation), as of a flat Earth; too large by 0.1 m at 15° and by 1 m at 7.5°.
    Cosecant,
}

/// Tropospheric delays at one place and time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Troposphere {
    zenith: ZenithDelay,
    /// `None` for the cosecant.
    niell: Option<NiellMapping>,
}

impl Troposphere {
    /// The delays at a receiver. `relative_humidity` is in 0-1.
    pub fn at(
        receiver: Geodetic,
        time: GpsTime,
        mapping: TroposphereMapping,
        relative_humidity: f64,
    ) -> Self {
        let niell = match mapping {
            TroposphereMapping::Niell => {
                Some(NiellMapping::at(receiver.latitude_rad, receiver.height_m, day_of_year(time)))
            }
            TroposphereMapping::Cosecant => None,
        };
        Self { zenith: saastamoinen_zenith_delay(receiver, relative_humidity), niell }
    }

    /// Delay (hydrostatic and wet) of a signal, m, positive. Elevations below 1° count as 1°, so that the result is finite.
    pub fn delay_m(&self, direction: Direction) -> f64 {
        let elevation_rad = direction.elevation_rad.max(LOWEST_ELEVATION_RAD);
        let ZenithDelay { hydrostatic_m, wet_m } = self.zenith;
        match &self.niell {
            Some(niell) => {
                hydrostatic_m * niell.hydrostatic(elevation_rad) + wet_m * niell.wet(elevation_rad)
            }
            None => (hydrostatic_m + wet_m) / elevation_rad.sin(),
        }
    }
}

/// Day of the year, 1 to 366.25, within a day: years of 365.25 days are counted from 1980 on. A day changes a delay at 5° by less than 1 mm.
fn day_of_year(time: GpsTime) -> f64 {
    let days = (time - GpsTime::default()) / SECONDS_PER_DAY + FIRST_GPS_DAY;
    1.0 + days.rem_euclid(DAYS_PER_YEAR)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::atmosphere::STANDARD_RELATIVE_HUMIDITY;
    use crate::time::Calendar;

    fn delay_m(mapping: TroposphereMapping, elevation_deg: f64) -> f64 {
        let receiver = Geodetic::from_degrees(48.0, 11.0, 500.0);
        let time = GpsTime::from_week_tow(2_118, 400_000.0);
        let direction = Direction { azimuth_rad: 0.0, elevation_rad: elevation_deg.to_radians() };
        Troposphere::at(receiver, time, mapping, STANDARD_RELATIVE_HUMIDITY).delay_m(direction)
    }

    #[test]
    fn the_cosecant_exceeds_niell_near_the_horizon_only() {
        let excess_m = |elevation_deg| {
            delay_m(TroposphereMapping::Cosecant, elevation_deg)
                - delay_m(TroposphereMapping::Niell, elevation_deg)
        };
        assert!(excess_m(90.0).abs() < 1e-9);
        assert!((0.0..0.02).contains(&excess_m(30.0)), "{} m", excess_m(30.0));
        assert!((0.1..0.2).contains(&excess_m(15.0)), "{} m", excess_m(15.0));
        assert!((0.9..1.2).contains(&excess_m(7.5)), "{} m", excess_m(7.5));
        assert!((8.0..13.0).contains(&excess_m(3.0)), "{} m", excess_m(3.0));
    }

    #[test]
    fn below_the_horizon_delays_are_finite() {
        for mapping in [TroposphereMapping::Niell, TroposphereMapping::Cosecant] {
            assert!((10.0..150.0).contains(&delay_m(mapping, -90.0)));
        }
    }

    #[test]
    fn days_of_the_year_are_right_within_a_day() {
        for (year, month, day, expected) in [
            (1980, 1, 6, 6.0),
            (2020, 2, 29, 60.0),
            (2023, 12, 31, 365.0),
            (2026, 7, 1, 182.0),
            (2099, 3, 1, 60.0),
        ] {
            let calendar = Calendar { year, month, day, hour: 0, minute: 0, second: 0.0 };
            let ours = day_of_year(GpsTime::from_calendar(calendar).unwrap());
            assert!((ours - expected).abs() <= 1.0, "{year}-{month}-{day}: {ours}");
        }
    }
}
