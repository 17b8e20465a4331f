//! Ionospheric delay by the best available product.

use std::sync::Arc;

use super::Products;
use crate::atmosphere::{
    B1I_HZ, Ionex, NoTec, beidou_klobuchar_delay_b1i_m, klobuchar_delay_l1_m, mean_solar_flux_sfu,
    ntcm_delay_l1_m, scale_delay, scale_from_l1,
};
use crate::frames::{Direction, Geodetic};
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;

/// Line of sight from a user to a satellite, with time and frequency.
#[derive(Clone, Copy, Debug)]
pub struct LineOfSight {
    /// Position of the user.
    pub receiver: Geodetic,
    /// Direction of the satellite.
    pub direction: Direction,
    /// Time of reception.
    pub time: GpsTime,
    /// Carrier frequency, Hz.
    pub frequency_hz: f64,
}

/// Share of the delay by maps that is as uncertain as the delay by broadcast coefficients.
const MAP_SHARE: f64 = 0.3;
/// Ionospheric delay of a code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IonosphereDelay {
    /// The delay, m.
    pub delay_m: f64,
    /// Measure of what is left after its correction, m: a delay by broadcast coefficients that would be as uncertain.
    pub uncertain_m: f64,
}

/// Delay of the mean ionosphere of date, hour and place, m: no correction would be wrong by metres, in one direction.
fn climatological_delay_m(sight: &LineOfSight) -> f64 {
    ntcm_delay_m(mean_solar_flux_sfu(sight.time), sight)
}

fn ntcm_delay_m(flux_sfu: f64, sight: &LineOfSight) -> f64 {
    let LineOfSight { receiver, direction, time, frequency_hz } = *sight;
    scale_from_l1(ntcm_delay_l1_m(flux_sfu, receiver, direction, time), frequency_hz)
}

impl Products {
    /// Adds ionosphere maps. Of several maps at one instant the first added is used.
    pub fn add_ionosphere_maps(&mut self, file: Ionex) {
        Arc::make_mut(&mut self.maps).add(file.maps);
    }

    /// First and last ionosphere map, `None` without any.
    pub fn ionosphere_map_coverage(&self) -> Option<(GpsTime, GpsTime)> {
        self.maps.span()
    }

    /// Ionospheric delay of a code, m; [`Products::ionosphere_delay`] tells what it is worth.
    pub fn ionosphere_delay_m(&self, sight: &LineOfSight, skips: &mut Skips) -> f64 {
        self.ionosphere_delay(sight, skips).delay_m
    }

    /// Ionospheric delay of a code, and a measure of what is left of it: by maps where they cover it, else by the Klobuchar coefficients of GPS, else by those of
    /// BeiDou, else by Galileo's in NTCM-G, else by a climatology. Gaps in existing maps are counted, and delays without any model.
    pub fn ionosphere_delay(&self, sight: &LineOfSight, skips: &mut Skips) -> IonosphereDelay {
        let LineOfSight { receiver, direction, time, frequency_hz } = *sight;
        let place = || {
            format!(
                "{time}, from {:.2}° {:.2}° at azimuth {:.0}°, elevation {:.0}°",
                receiver.latitude_deg(),
                receiver.longitude_deg(),
                direction.azimuth_rad.to_degrees(),
                direction.elevation_rad.to_degrees()
            )
        };
        let by_maps = match self.maps.delay_m(receiver, direction, time, frequency_hz) {
            Ok(delay_m) => return IonosphereDelay { delay_m, uncertain_m: MAP_SHARE * delay_m },
            Err(why) => (!self.maps.is_empty()).then_some(why),
        };
        let modelled_m = self.modelled_delay_m(sight);
        if let Some(reason) = fallback_reason(by_maps, modelled_m.is_some()) {
            skips.add(reason, place);
        }
        let delay_m = modelled_m.unwrap_or_else(|| climatological_delay_m(sight));
        IonosphereDelay { delay_m, uncertain_m: delay_m }
    }

    /// Delay by broadcast coefficients, if there are any.
    fn modelled_delay_m(&self, sight: &LineOfSight) -> Option<f64> {
        let LineOfSight { receiver, direction, time, frequency_hz } = *sight;
        let by_gps = || {
            let coefficients = self.ionosphere()?;
            Some(scale_from_l1(klobuchar_delay_l1_m(&coefficients, receiver, direction, time), frequency_hz))
        };
        let by_beidou = || {
            let coefficients = self.beidou_ionosphere()?;
            let delay_m = beidou_klobuchar_delay_b1i_m(&coefficients, receiver, direction, time);
            Some(scale_delay(delay_m, B1I_HZ, frequency_hz))
        };
        let by_galileo = || Some(ntcm_delay_m(self.galileo_ionisation_sfu()?, sight));
        by_gps().or_else(by_beidou).or_else(by_galileo)
    }
}

/// Reason to count if the maps give no delay.
const fn fallback_reason(maps: Option<NoTec>, has_model: bool) -> Option<Reason> {
    Some(match (maps, has_model) {
        (None, true) => return None,
        (None, false) => Reason::NoIonosphereModel,
        (Some(NoTec::NotCovered), true) => Reason::OutsideIonosphereMapsKlobucharUsed,
        (Some(NoTec::NotCovered), false) => Reason::OutsideIonosphereMaps,
        (Some(NoTec::Missing), true) => Reason::IonosphereMapEmptyKlobucharUsed,
        (Some(NoTec::Missing), false) => Reason::IonosphereMapEmpty,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::atmosphere::KlobucharCoefficients;
    use crate::orbit::{IonosphereTerms, NavigationFile};

    const L1_HZ: f64 = 1_575.42e6;

    /// A file of two maps with ten TEC units everywhere from 60° south to 60° north.
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
        // The nominal delay depends on the time of the day; there is no model, which is counted.
        for (navigation, is_modelled, word) in
            [(vec![klobuchar()], true, "Klobuchar used"), (vec![], false, "climatology used")]
        {
            let fallback_m = |sight| if is_modelled { night_m } else { climatological_delay_m(sight) };
            let mut products = Products::new(Vec::new(), navigation);
            let mut skips = Skips::default();
            let inside = sight(30.0, "2020-08-13T01:00:00");
            assert!((products.ionosphere_delay_m(&inside, &mut skips) - fallback_m(&inside)).abs() < 1e-9);
            let nothing = skips.count(Reason::NoIonosphereModel);
            assert_eq!((skips.total(), nothing), (u64::from(!is_modelled), u64::from(!is_modelled)));
            skips = Skips::default();
            products.add_ionosphere_maps(ionex());
            assert!((products.ionosphere_delay_m(&inside, &mut skips) - map_m).abs() < 1e-9);
            assert!(skips.is_empty(), "{skips}");
            let late = sight(30.0, "2020-08-13T02:01:00");
            assert!((products.ionosphere_delay_m(&late, &mut skips) - fallback_m(&late)).abs() < 1e-9);
            let north = sight(70.0, "2020-08-13T01:00:00");
            assert!((products.ionosphere_delay_m(&north, &mut skips) - fallback_m(&north)).abs() < 1e-9);
            assert_eq!(skips.total(), 2);
            assert_eq!(skips.count(format!("instant outside the ionosphere maps, {word}")), 1, "{skips}");
            let missing = format!("ionosphere map without a value at the pierce point, {word}");
            assert_eq!(skips.count(&missing), 1, "{skips}");
        }
    }
    #[test]
    fn coefficients_of_beidou_stand_in_for_those_of_gps() {
        let beidou = KlobucharCoefficients { alpha: [3e-8, 0.0, 0.0, 0.0], beta: [1e5, 0.0, 0.0, 0.0] };
        let with = |gps| NavigationFile {
            ionosphere: IonosphereTerms { gps, beidou: Some(beidou), galileo: None },
            ..Default::default()
        };
        let sight = sight(30.0, "2020-08-13T06:00:00");
        let delay_m = |file| {
            let mut skips = Skips::default();
            let delay_m = Products::new(Vec::new(), vec![file]).ionosphere_delay_m(&sight, &mut skips);
            assert!(skips.is_empty(), "{skips}");
            delay_m
        };
        let LineOfSight { receiver, direction, time, .. } = sight;
        let b1i_m = beidou_klobuchar_delay_b1i_m(&beidou, receiver, direction, time);
        assert!(b1i_m > 10.0, "it is day: {b1i_m} m");
        let expected_m = b1i_m * (1_561.098e6 / L1_HZ).powi(2);
        assert!((delay_m(with(None)) - expected_m).abs() < 1e-9);
        let gps = klobuchar().ionosphere.gps;
        assert!((delay_m(with(gps)) - delay_m(klobuchar())).abs() < 1e-12, "GPS' own come first");
    }

    #[test]
    fn coefficients_of_galileo_stand_in_for_all_others_and_a_climatology_for_them() {
        // An effective ionisation of 70 sfu, that of a quiet sun as in 2020, and one of 200 sfu.
        let galileo = |a0| NavigationFile {
            ionosphere: IonosphereTerms { galileo: Some([a0, 0.0, 0.0]), ..IonosphereTerms::default() },
            ..Default::default()
        };
        let sight = sight(30.0, "2020-08-13T06:00:00");
        let delay_m = |files| {
            let mut skips = Skips::default();
            (Products::new(Vec::new(), files).ionosphere_delay_m(&sight, &mut skips), skips.total())
        };
        let (quiet_m, counted) = delay_m(vec![galileo(75.0)]);
        assert_eq!((delay_m(Vec::new()), counted), ((quiet_m, 1), 0), "the sun of that year");
        assert!(delay_m(vec![galileo(200.0)]).0 > 2.0 * quiet_m && quiet_m > 1.0, "{quiet_m} m");
        assert_eq!(delay_m(vec![galileo(0.0)]).1, 1, "zeros say that there are none");
        assert_eq!(delay_m(vec![galileo(200.0), klobuchar()]), delay_m(vec![klobuchar()]));
    }
}
