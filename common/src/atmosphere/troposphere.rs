//! The tropospheric delay of signals at one place and time: zenith delay times mapping function.

use serde::{Deserialize, Serialize};

use super::niell::NiellMapping;
use super::saastamoinen::{ZenithDelay, saastamoinen_zenith_delay};
use crate::frames::{Direction, Geodetic};
use crate::time::GpsTime;

/// Minimum elevation (1°), rad; lower elevations are limited to it.
const LOWEST_ELEVATION_RAD: f64 = 0.017_453_292_519_943_295;

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
            TroposphereMapping::Niell => Some(NiellMapping::at(
                receiver.latitude_rad,
                receiver.height_m,
                f64::from(time.calendar().day_of_year()),
            )),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::atmosphere::STANDARD_RELATIVE_HUMIDITY;

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
}
