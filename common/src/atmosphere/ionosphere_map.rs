//! Maps of the ionosphere's electron content, and delays from them.
//!
//! All free electrons are modelled in one thin shell. A signal crosses it at its pierce point under the zenith angle z', so the
//! content along its path is the vertical content divided by cos z'. Interpolation is bilinear between the nodes of a map and
//! linear between two maps, each rotated with the sun to the instant (Schaer, Gurtner, Feltens 1998, section 3).

use std::f64::consts::TAU;

use super::map_axis::Axis;
use super::shell::Shell;
use crate::constants::WGS84_FLATTENING;
use crate::frames::{Direction, Geodetic};
use crate::skips::Skips;
use crate::time::GpsTime;

/// Group delay of a signal: 40.3 m³/s² times the electrons per m² over the frequency squared; a TEC unit is 10¹⁶ electrons per m².
const DELAY_M3PS2: f64 = 40.3e16;
/// Angular rate of the sun about the Earth, rad/s: a revolution in a mean solar day.
const SUN_RADPS: f64 = TAU / 86_400.0;
/// Maximum time between two maps of an interpolation, s. Maps come every two hours or more often.
const MAX_GAP_S: f64 = 4.0 * 3_600.0;

/// Geocentric latitude of a point on the ellipsoid.
fn geocentric_rad(geodetic_rad: f64) -> f64 {
    let (sin, cos) = geodetic_rad.sin_cos();
    ((1.0 - WGS84_FLATTENING).powi(2) * sin).atan2(cos)
}

/// The vertical electron content at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct IonosphereMap {
    time: GpsTime,
    shell: Shell,
    latitudes: Axis,
    longitudes: Axis,
    /// By latitude, then longitude; NaN where missing.
    tec_tecu: Vec<f64>,
}

/// A whole IONEX file.
#[derive(Clone, Debug, PartialEq)]
pub struct Ionex {
    /// Maps in order of time.
    pub maps: Vec<IonosphereMap>,
    /// Counts of skipped lines by reason.
    pub skips: Skips,
}

impl IonosphereMap {
    /// A map on a grid of latitudes and longitudes; contents by latitude, then longitude, NaN where missing.
    pub(crate) const fn new(
        time: GpsTime,
        shell: Shell,
        (latitudes, longitudes): (Axis, Axis),
        tec_tecu: Vec<f64>,
    ) -> Self {
        Self { time, shell, latitudes, longitudes, tec_tecu }
    }

    /// Time of the map, GPS time.
    pub const fn time(&self) -> GpsTime {
        self.time
    }

    /// Content along a signal's path at an instant, TECU; the map rotates with the sun.
    fn slant_tecu(&self, receiver: Geodetic, direction: Direction, time: GpsTime) -> Option<f64> {
        let latitude_rad = geocentric_rad(receiver.latitude_rad);
        let pierce = self.shell.pierce(latitude_rad, receiver.longitude_rad, direction);
        let turned_rad = pierce.longitude_rad + SUN_RADPS * (time - self.time);
        // Smoothed maps contain small negative values, which are set to zero.
        Some(self.vertical_tecu(pierce.latitude_rad, turned_rad)?.max(0.0) * pierce.slant)
    }

    /// Vertical content at a place, bilinear between four nodes; `None` outside the map and next to a missing node.
    fn vertical_tecu(&self, latitude_rad: f64, longitude_rad: f64) -> Option<f64> {
        let rows = self.latitudes.latitude_cell(latitude_rad.to_degrees())?;
        let columns = self.longitudes.longitude_cell(longitude_rad.rem_euclid(TAU).to_degrees())?;
        let mut sum = 0.0;
        for (row, row_weight) in rows {
            for (column, column_weight) in columns {
                let weight = row_weight * column_weight;
                if weight > 0.0 {
                    sum += weight * self.tec_tecu.get(row * self.longitudes.count() + column)?;
                }
            }
        }
        sum.is_finite().then_some(sum)
    }
}

/// Reason for a missing delay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoTec {
    /// The instant is before the first or after the last map, or in a gap of more than four hours.
    NotCovered,
    /// The pierce point is outside the maps or next to a missing node.
    Missing,
}

/// Maps in order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IonosphereMaps(Vec<IonosphereMap>);

impl IonosphereMaps {
    /// Adds maps. Of several maps at one instant the first added is used.
    pub fn add(&mut self, maps: Vec<IonosphereMap>) {
        self.0.extend(maps);
        // The sort is stable.
        self.0.sort_by_key(IonosphereMap::time);
        self.0.dedup_by_key(|map| map.time);
    }

    /// Whether there are no maps.
    pub const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// First and last map.
    pub fn span(&self) -> Option<(GpsTime, GpsTime)> {
        Some((self.0.first()?.time, self.0.last()?.time))
    }

    /// Group delay of a signal, m, positive. An elevation below the horizon counts as the horizon.
    ///
    /// # Errors
    /// If the maps do not cover the signal.
    pub fn delay_m(
        &self,
        receiver: Geodetic,
        direction: Direction,
        time: GpsTime,
        frequency_hz: f64,
    ) -> Result<f64, NoTec> {
        let right = self.0.partition_point(|map| map.time < time).max(1);
        let (Some(a), Some(b)) = (self.0.get(right - 1), self.0.get(right)) else {
            return Err(NoTec::NotCovered);
        };
        let gap_s = b.time - a.time;
        if time < a.time || gap_s > MAX_GAP_S {
            return Err(NoTec::NotCovered);
        }
        let tecu = |map: &IonosphereMap| map.slant_tecu(receiver, direction, time).ok_or(NoTec::Missing);
        let late = (time - a.time) / gap_s;
        let slant_tecu = (1.0 - late) * tecu(a)? + late * tecu(b)?;
        Ok(DELAY_M3PS2 / (frequency_hz * frequency_hz) * slant_tecu)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    const L1_HZ: f64 = 1_575.42e6;

    fn axis(first: f64, last: f64, step: f64) -> Axis {
        Axis::from_degrees([first, last, step]).unwrap()
    }

    fn start() -> GpsTime {
        GpsTime::from_week_tow(2_118, 0.0)
    }

    /// A map of the whole Earth whose content is a function of latitude and longitude, degrees.
    fn map(after_s: f64, tecu: impl Fn(f64, f64) -> f64) -> IonosphereMap {
        let (latitudes, longitudes) = (axis(87.5, -87.5, -2.5), axis(-180.0, 180.0, 5.0));
        let values = (0..latitudes.count())
            .flat_map(|i| (0..longitudes.count()).map(move |j| (i, j)))
            .map(|(i, j)| tecu(87.5 - 2.5 * i as f64, -180.0 + 5.0 * j as f64))
            .collect();
        let shell = Shell::from_kilometres(6_371.0, 450.0).unwrap();
        IonosphereMap::new(start() + after_s, shell, (latitudes, longitudes), values)
    }

    fn maps(list: Vec<IonosphereMap>) -> IonosphereMaps {
        let mut maps = IonosphereMaps::default();
        maps.add(list);
        maps
    }

    fn up() -> Direction {
        Direction { azimuth_rad: 0.0, elevation_rad: FRAC_PI_2 }
    }

    #[test]
    fn ten_units_overhead_delay_l1_by_1_62_m() {
        let maps = maps(vec![map(0.0, |_, _| 10.0), map(7_200.0, |_, _| 10.0)]);
        let place = Geodetic::from_degrees(30.0, 114.0, 0.0);
        let delay_m = maps.delay_m(place, up(), start() + 3_600.0, L1_HZ).unwrap();
        assert!((delay_m - 40.3e17 / (L1_HZ * L1_HZ)).abs() < 1e-9 && (delay_m - 1.6237).abs() < 1e-4);
        // At the horizon the shell at 450 km is crossed with z' = asin(6371 / 6821).
        let low = Direction { elevation_rad: 0.0, ..up() };
        let slant = 1.0 / (6_371.0_f64 / 6_821.0).asin().cos();
        let low_m = maps.delay_m(place, low, start(), L1_HZ).unwrap();
        assert!((low_m / delay_m - slant).abs() < 1e-9);
    }

    #[test]
    fn the_pierce_point_lies_towards_the_satellite() {
        // From the equator at 30° to the east: centre angle 60° − asin(6371/6821 cos 30°) = 6.0°.
        let maps = maps(vec![map(0.0, |_, longitude| 50.0 + longitude.abs()), map(7_200.0, |_, _| 0.0)]);
        let east = Direction { azimuth_rad: FRAC_PI_2, elevation_rad: PI / 6.0 };
        let zenith = (6_371.0 / 6_821.0 * east.elevation_rad.cos()).asin();
        let centre_deg = (PI / 3.0 - zenith).to_degrees();
        let expected_tecu = (50.0 + 20.0 + centre_deg) / zenith.cos();
        let place = Geodetic::from_degrees(0.0, 20.0, 0.0);
        let delay_m = maps.delay_m(place, east, start(), L1_HZ).unwrap();
        assert!((delay_m / DELAY_M3PS2 * L1_HZ * L1_HZ - expected_tecu).abs() < 1e-9);
        assert!((5.5..6.5).contains(&centre_deg));
    }

    #[test]
    fn a_crest_under_the_sun_moves_with_it() {
        // The maximum is at local noon in both maps: at 0 h at 180°, at 2 h at 150°.
        let crest = |at: f64| move |_: f64, longitude: f64| 20.0 + 10.0 * (longitude - at).to_radians().cos();
        let maps = maps(vec![map(0.0, crest(180.0)), map(7_200.0, crest(150.0))]);
        let place = Geodetic::from_degrees(0.0, 165.0, 0.0);
        let delay_m = maps.delay_m(place, up(), start() + 3_600.0, L1_HZ).unwrap();
        let tecu = delay_m / DELAY_M3PS2 * L1_HZ * L1_HZ;
        assert!((tecu - 30.0).abs() < 1e-6, "{tecu}: without turning it would be 29.66");
    }

    #[test]
    fn the_date_line_and_the_poles_are_no_edges() {
        let maps = maps(vec![map(0.0, |latitude, _| 90.0 - latitude), map(7_200.0, |_, _| 0.0)]);
        let at = |latitude: f64, longitude: f64| {
            let place = Geodetic::from_degrees(latitude, longitude, 0.0);
            maps.delay_m(place, up(), start(), L1_HZ).map(|m| m / DELAY_M3PS2 * L1_HZ * L1_HZ)
        };
        for longitude in [179.0, -179.0, 180.0, -180.0, 541.0] {
            assert!((at(0.0, longitude).unwrap() - 90.0).abs() < 1e-9, "{longitude}");
        }
        assert!((at(90.0, 0.0).unwrap() - 2.5).abs() < 1e-9);
        assert!((at(-90.0, 0.0).unwrap() - 177.5).abs() < 1e-9);
    }

    #[test]
    fn what_is_not_covered_is_said() {
        let hole =
            |latitude: f64, longitude: f64| if (latitude, longitude) == (0.0, 10.0) { f64::NAN } else { 5.0 };
        let maps = maps(vec![map(0.0, hole), map(7_200.0, hole), map(7_200.0 + 14_401.0, hole)]);
        let delay = |longitude: f64, after_s: f64| {
            let place = Geodetic::from_degrees(0.0, longitude, 0.0);
            maps.delay_m(place, up(), start() + after_s, L1_HZ)
        };
        assert_eq!(delay(0.0, -1.0), Err(NoTec::NotCovered));
        assert_eq!(delay(0.0, 7_201.0), Err(NoTec::NotCovered), "a gap of more than four hours");
        assert_eq!(delay(0.0, 30_000.0), Err(NoTec::NotCovered));
        assert_eq!(delay(7.0, 0.0), Err(NoTec::Missing));
        assert!(delay(4.0, 0.0).is_ok() && delay(0.0, 7_200.0).is_ok());
        assert_eq!(
            IonosphereMaps::default().delay_m(Geodetic::from_degrees(0.0, 0.0, 0.0), up(), start(), L1_HZ),
            Err(NoTec::NotCovered)
        );
    }

    #[test]
    fn a_regional_map_ends_at_its_edges() {
        let (latitudes, longitudes) = (axis(30.0, 60.0, 10.0), axis(170.0, 190.0, 10.0));
        let shell = Shell::from_kilometres(6_371.0, 350.0).unwrap();
        let at =
            |after_s| IonosphereMap::new(start() + after_s, shell, (latitudes, longitudes), vec![7.0; 12]);
        let maps = maps(vec![at(0.0), at(900.0)]);
        let delay = |latitude: f64, longitude: f64| {
            maps.delay_m(Geodetic::from_degrees(latitude, longitude, 0.0), up(), start(), L1_HZ)
        };
        assert!(delay(45.0, 179.0).is_ok() && delay(45.0, -171.0).is_ok());
        for (latitude, longitude) in
            [(45.0, 169.0), (45.0, -169.0), (29.0, 180.0), (61.0, 180.0), (45.0, 0.0)]
        {
            assert_eq!(delay(latitude, longitude), Err(NoTec::Missing), "{latitude} {longitude}");
        }
    }
}
