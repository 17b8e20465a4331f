//! The ionospheric delay by the best product that there is.

use std::sync::Arc;

use super::Products;
use crate::atmosphere::{Ionex, NoTec, klobuchar_delay_l1_m, scale_from_l1};
use crate::frames::{Direction, Geodetic};
use crate::skips::Skips;
use crate::time::GpsTime;

/// A user's view of a satellite on one frequency.
#[derive(Clone, Copy, Debug)]
pub struct LineOfSight {
    /// Where the user is.
    pub receiver: Geodetic,
    /// Where the satellite is.
    pub direction: Direction,
    /// When.
    pub time: GpsTime,
    /// Carrier frequency, Hz.
    pub frequency_hz: f64,
}

impl Products {
    /// Adds ionosphere maps. Of several at one instant the one added first holds.
    pub fn add_ionosphere_maps(&mut self, file: Ionex) {
        Arc::make_mut(&mut self.maps).add(file.maps);
    }

    /// First and last ionosphere map, `None` without any.
    pub fn ionosphere_map_coverage(&self) -> Option<(GpsTime, GpsTime)> {
        self.maps.span()
    }

    /// Ionospheric delay of a code, m: by maps where they cover it, else by the Klobuchar coefficients, else 0. Where maps are
    /// there and do not cover it, that is counted.
    pub fn ionosphere_delay_m(&self, sight: &LineOfSight, skips: &mut Skips) -> f64 {
        let LineOfSight { receiver, direction, time, frequency_hz } = *sight;
        if !self.maps.is_empty() {
            match self.maps.delay_m(receiver, direction, time, frequency_hz) {
                Ok(delay_m) => return delay_m,
                Err(why) => skips.add(self.fallback_reason(why), || {
                    format!(
                        "{time}, from {:.2}° {:.2}° at azimuth {:.0}°, elevation {:.0}°",
                        receiver.latitude_deg(),
                        receiver.longitude_deg(),
                        direction.azimuth_rad.to_degrees(),
                        direction.elevation_rad.to_degrees()
                    )
                }),
            }
        }
        self.ionosphere().map_or(0.0, |coefficients| {
            scale_from_l1(klobuchar_delay_l1_m(&coefficients, receiver, direction, time), frequency_hz)
        })
    }

    const fn fallback_reason(&self, why: NoTec) -> &'static str {
        match (why, self.ionosphere().is_some()) {
            (NoTec::NotCovered, true) => "instant outside the ionosphere maps, Klobuchar used",
            (NoTec::NotCovered, false) => "instant outside the ionosphere maps, ionosphere not corrected",
            (NoTec::Missing, true) => "ionosphere map without a value at the pierce point, Klobuchar used",
            (NoTec::Missing, false) => {
                "ionosphere map without a value at the pierce point, ionosphere not corrected"
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::atmosphere::KlobucharCoefficients;
    use crate::rinex::{IonosphereTerms, NavigationFile};

    const L1_HZ: f64 = 1_575.42e6;

    /// A file of two maps with ten TEC units everywhere between 60° south and north.
    fn ionex() -> Ionex {
        let line = |content: &str, label: &str| format!("{content:<60}{label}\n");
        let mut text = line("     1.0            IONOSPHERE MAPS     GPS", "IONEX VERSION / TYPE")
            + &line("  6371.0", "BASE RADIUS")
            + &line("   450.0 450.0   0.0", "HGT1 / HGT2 / DHGT")
            + &line("    60.0 -60.0-120.0", "LAT1 / LAT2 / DLAT")
            + &line("  -180.0 180.0 180.0", "LON1 / LON2 / DLON")
            + &line("", "END OF HEADER");
        for hour in [0, 2] {
            text += &line("     1", "START OF TEC MAP");
            text += &line(&format!("  2020     8    13    {hour:2}     0     0"), "EPOCH OF CURRENT MAP");
            for latitude in ["60.0", "-60.0"] {
                text += &line(&format!("  {latitude:>6}-180.0 180.0 180.0 450.0"), "LAT/LON1/LON2/DLON/H");
                text += "  100  100  100\n";
            }
            text += &line("     1", "END OF TEC MAP");
        }
        Ionex::parse(text.as_bytes()).unwrap()
    }

    fn sight(latitude_deg: f64, time: &str) -> LineOfSight {
        LineOfSight {
            receiver: Geodetic::from_degrees(latitude_deg, 114.0, 0.0),
            direction: Direction { azimuth_rad: 0.0, elevation_rad: std::f64::consts::FRAC_PI_2 },
            time: time.parse().unwrap(),
            frequency_hz: L1_HZ,
        }
    }

    fn klobuchar() -> NavigationFile {
        let gps = Some(KlobucharCoefficients { alpha: [0.0; 4], beta: [0.0; 4] });
        NavigationFile {
            ionosphere: IonosphereTerms { gps, ..IonosphereTerms::default() },
            ..Default::default()
        }
    }

    #[test]
    fn maps_come_first_and_every_fallback_is_counted() {
        let map_m = 40.3e17 / (L1_HZ * L1_HZ);
        let night_m = 5e-9 * crate::constants::SPEED_OF_LIGHT_MPS * (1.0 + 16.0 * 0.03_f64.powi(3));
        for (navigation, fallback_m, word) in
            [(vec![klobuchar()], night_m, "Klobuchar used"), (vec![], 0.0, "ionosphere not corrected")]
        {
            let mut products = Products::new(Vec::new(), navigation);
            let mut skips = Skips::default();
            let inside = sight(30.0, "2020-08-13T01:00:00");
            assert!((products.ionosphere_delay_m(&inside, &mut skips) - fallback_m).abs() < 1e-9);
            assert!(skips.is_empty(), "without maps nothing is missed: {skips}");
            products.add_ionosphere_maps(ionex());
            assert!((products.ionosphere_delay_m(&inside, &mut skips) - map_m).abs() < 1e-9);
            assert!(skips.is_empty(), "{skips}");
            let late = sight(30.0, "2020-08-13T02:01:00");
            assert!((products.ionosphere_delay_m(&late, &mut skips) - fallback_m).abs() < 1e-9);
            let north = sight(70.0, "2020-08-13T01:00:00");
            assert!((products.ionosphere_delay_m(&north, &mut skips) - fallback_m).abs() < 1e-9);
            assert_eq!(skips.total(), 2);
            assert_eq!(skips.count(&format!("instant outside the ionosphere maps, {word}")), 1, "{skips}");
            let missing = format!("ionosphere map without a value at the pierce point, {word}");
            assert_eq!(skips.count(&missing), 1, "{skips}");
        }
    }
}
