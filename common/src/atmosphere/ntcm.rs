//! NTCM-G: the ionosphere by its mean behaviour and one number for the sun's activity.
//!
//! The Neustrelitz total electron content model (Jakowski, Hoque and Mayer 2011) describes the vertical electron content by local time,
//! season, latitude and the crests beside the magnetic equator. Its last factor is linear in the solar radio flux at 10.7 cm; the form of
//! the "NTCM-G Ionospheric Model Description" (European Commission, issue 1.0, 2022) takes an effective ionisation from the three
//! coefficients of Galileo's navigation messages for it. Without these a mean flux of the date makes it a climatology.

use std::f64::consts::{PI, TAU};

use super::klobuchar::L1_HZ;
use super::shell::Shell;
use crate::frames::{Direction, Geodetic};
use crate::time::GpsTime;

/// k₁ to k₁₂ of the description; the last two in TEC units and TEC units per solar flux unit.
const K: [f64; 12] = [
    0.92519, 0.16951, 0.00443, 0.06626, 0.00899, 0.21289, -0.15414, -0.38439, 1.14023, 1.20556, 1.41808,
    0.13985,
];
/// The shell: the Earth's radius and the height of the ionosphere, m.
const SHELL: Shell = Shell::new(6_371e3, 450e3);
const RATIO: f64 = 6_371.0 / (6_371.0 + 450.0);
/// Factor on the zenith distance in the mapping function.
const MAPPING: f64 = 0.9782;
/// Geomagnetic north pole.
const POLE_LATITUDE_DEG: f64 = 79.74;
const POLE_LONGITUDE_DEG: f64 = -71.78;
/// Addition to the solar zenith angle's cosine.
const NIGHT_SHARE: f64 = 0.4;
/// Latitudes of the crests and their widths, deg.
const CRESTS_DEG: [(f64, f64); 2] = [(16.0, 12.0), (-10.0, 13.0)];
/// Vertical delay of a TEC unit on L1, m: 40.3·10¹⁶/f².
const L1_M_PER_TECU: f64 = 40.3e16 / (L1_HZ * L1_HZ);
/// Solar fluxes that are plausible, sfu.
const FLUX_SFU: std::ops::RangeInclusive<f64> = 0.0..=500.0;

/// Approximate yearly means of the solar radio flux at 10.7 cm, sfu, in steps of five.
const FIRST_YEAR: i32 = 2008;
const YEARLY_FLUX_SFU: [f64; 18] = [
    70.0, 70.0, 80.0, 115.0, 120.0, 125.0, 145.0, 120.0, 90.0, 75.0, 70.0, 70.0, 75.0, 80.0, 130.0, 160.0,
    190.0, 165.0,
];
/// Mean over a cycle, for other years.
const MEAN_FLUX_SFU: f64 = 105.0;

/// Effective ionisation of Galileo's coefficients a₀ (sfu), a₁ (sfu/deg), a₂ (sfu/deg²), sfu; `None` if it is not plausible, or all are 0,
/// which says that there are none.
pub fn effective_ionisation_sfu([a0, a1, a2]: [f64; 3]) -> Option<f64> {
    let square = a0 * a0 + 1_633.33 * a1 * a1 + 4_802_000.0 * a2 * a2 + 3_266.67 * a0 * a2;
    let flux_sfu = square.max(0.0).sqrt();
    (flux_sfu > 0.0 && FLUX_SFU.contains(&flux_sfu)).then_some(flux_sfu)
}

/// Mean solar flux of a date, sfu.
pub fn mean_solar_flux_sfu(time: GpsTime) -> f64 {
    let place = usize::try_from(time.calendar().year - FIRST_YEAR).ok();
    place.and_then(|place| YEARLY_FLUX_SFU.get(place)).copied().unwrap_or(MEAN_FLUX_SFU)
}

/// Ionospheric delay of a code on L1, m, positive, for a solar flux or an effective ionisation, sfu. An elevation below the horizon counts as
/// the horizon.
pub fn ntcm_delay_l1_m(flux_sfu: f64, receiver: Geodetic, direction: Direction, time: GpsTime) -> f64 {
    let point = SHELL.pierce(receiver.latitude_rad, receiver.longitude_rad, direction);
    let zenith_rad = 0.5 * PI - direction.elevation_rad.max(0.0);
    let sin = RATIO * (MAPPING * zenith_rad).sin();
    let slant = 1.0 / (1.0 - sin * sin).sqrt();
    let vertical = vertical_tecu(flux_sfu, point.latitude_rad, point.longitude_rad, time);
    L1_M_PER_TECU * slant * vertical.max(0.0)
}

/// Vertical electron content, TEC units: the product F₁…F₅ of the description.
fn vertical_tecu(flux_sfu: f64, latitude_rad: f64, longitude_rad: f64, time: GpsTime) -> f64 {
    let [k1, k2, k3, k4, k5, k6, k7, k8, k9, k10, k11, k12] = K;
    let calendar = time.calendar();
    let day = f64::from(calendar.day_of_year());
    let hours = f64::from(calendar.hour) + (f64::from(calendar.minute) * 60.0 + calendar.second) / 3_600.0;
    let local_h = hours + longitude_rad.to_degrees() / 15.0;
    let diurnal = TAU * (local_h - 14.0) / 24.0;
    let (semidiurnal, terdiurnal) = (TAU * local_h / 12.0, TAU * local_h / 8.0);
    let declination_rad = (23.44 * (0.9856 * (day - 80.7)).to_radians().sin()).to_radians();
    let of_noon = (latitude_rad - declination_rad).cos();
    let of_season = of_noon - 2.0 / PI * latitude_rad * declination_rad.sin();
    let waves = k1 * diurnal.cos()
        + k2 * semidiurnal.cos()
        + k3 * semidiurnal.sin()
        + k4 * terdiurnal.cos()
        + k5 * terdiurnal.sin();
    let by_local_time = of_noon + NIGHT_SHARE + of_season * waves;
    let (annual, semiannual) = (TAU * (day - 18.0) / 365.25, 2.0 * TAU * (day - 6.0) / 365.25);
    let by_season = 1.0 + k6 * annual.cos() + k7 * semiannual.cos();
    let magnetic_rad = geomagnetic_latitude_rad(latitude_rad, longitude_rad);
    let by_latitude = 1.0 + k8 * magnetic_rad.cos();
    let crest = |(centre_deg, width_deg): (f64, f64)| {
        (-0.5 * ((magnetic_rad.to_degrees() - centre_deg) / width_deg).powi(2)).exp()
    };
    let by_crests = 1.0 + k9 * crest(CRESTS_DEG[0]) + k10 * crest(CRESTS_DEG[1]);
    let by_sun = k11 + k12 * flux_sfu;
    by_local_time * by_season * by_latitude * by_crests * by_sun
}

fn geomagnetic_latitude_rad(latitude_rad: f64, longitude_rad: f64) -> f64 {
    let (sin_pole, cos_pole) = POLE_LATITUDE_DEG.to_radians().sin_cos();
    let (sin, cos) = latitude_rad.sin_cos();
    (sin * sin_pole + cos * cos_pole * (longitude_rad - POLE_LONGITUDE_DEG.to_radians()).cos()).asin()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::LocalFrame;

    /// Test cases of the description, annex A: coefficients, hour of day 105, longitude and latitude of receiver (deg) and its height (m),
    /// those of the satellite, and the slant electron content (TEC units).
    type Case = (f64, [f64; 3], [f64; 3], f64);

    const HIGH: [f64; 3] = [236.831641, -0.39362878, 0.00402826613];
    const MEDIUM: [f64; 3] = [121.129893, 0.351254133, 0.0134635348];
    const LOW: [f64; 3] = [2.580271, 0.127628236, 0.0252748384];

    fn assert_cases(coefficients: [f64; 3], cases: &[Case]) {
        let flux_sfu = effective_ionisation_sfu(coefficients).unwrap();
        for (hour, [longitude_deg, latitude_deg, height_m], [to_longitude, to_latitude, to_m], tecu) in cases
        {
            let receiver = Geodetic::from_degrees(*latitude_deg, *longitude_deg, *height_m);
            let satellite = Geodetic::from_degrees(*to_latitude, *to_longitude, *to_m).geodetic_to_ecef();
            let frame = LocalFrame::at(receiver.geodetic_to_ecef());
            let direction = frame.direction(&(satellite - frame.origin()).0.normalize());
            let time: GpsTime = format!("2021-04-15T{hour:02.0}:00:00").parse().unwrap();
            let ours = ntcm_delay_l1_m(flux_sfu, receiver, direction, time) / L1_M_PER_TECU;
            assert!((ours - tecu).abs() < 2e-3, "{hour} h: {ours} TEC units, not {tecu}");
        }
    }

    #[test]
    fn the_test_cases_of_the_description_come_out() {
        assert_cases(
            HIGH,
            &[
                (0.0, [-62.34, 82.49, 78.11], [8.23, 54.29, 20_281_546.18], 33.7567),
                (12.0, [-62.34, 82.49, 78.11], [175.57, 51.89, 19_995_445.72], 33.9561),
                (8.0, [-52.81, 5.25, -25.76], [-58.59, 21.93, 20_008_556.82], 31.4675),
                (20.0, [-52.81, 5.25, -25.76], [10.94, 44.72, 20_450_566.19], 252.0204),
            ],
        );
        assert_cases(
            MEDIUM,
            &[
                (4.0, [40.19, -3.0, -23.32], [107.19, -10.65, 19_943_686.06], 108.8940),
                (16.0, [115.89, -31.8, 12.78], [124.09, -14.31, 20_100_697.90], 15.0902),
            ],
        );
        assert_cases(
            LOW,
            &[
                (0.0, [141.13, 39.14, 117.0], [165.14, -13.93, 20_181_976.50], 51.5270),
                (20.0, [-155.46, 19.8, 3_754.69], [-82.52, 20.64, 19_937_791.48], 67.4750),
            ],
        );
    }

    #[test]
    fn a_quiet_and_an_active_sun_differ() {
        let flux = |date: &str| mean_solar_flux_sfu(format!("{date}T00:00:00").parse().unwrap());
        assert_eq!(
            (flux("2019-06-01"), flux("2024-06-01"), flux("2090-06-01")),
            (70.0, 190.0, MEAN_FLUX_SFU)
        );
        assert_eq!(effective_ionisation_sfu([0.0; 3]), None);
        assert_eq!(effective_ionisation_sfu([f64::NAN, 0.0, 0.0]), None);
    }
}
