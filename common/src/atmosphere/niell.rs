//! The mapping functions of Niell (1996), "Global mapping functions for the atmosphere delay at radio wavelengths", J. Geophys. Res. 101.
//!
//! A mapping function is the ratio of the delay at an elevation to the delay at the zenith. It is smaller than 1/sin(elevation), which is
//! that of a flat Earth: by 2 % at 15°, 6 % at 7.5° and 23 % at 3°. Niell's need no weather: the hydrostatic one depends on latitude, day
//! of the year and height, the wet one on latitude.

use std::f64::consts::TAU;

/// Latitudes of the tables, ° from the equator; in between the coefficients are linear, beyond them constant.
const STEP_DEG: f64 = 15.0;
/// Coefficients a, b, c at 15°, 30°, 45°, 60° and 75°: mean of the hydrostatic function (Table 3).
const HYDROSTATIC_MEAN: [[f64; 3]; 5] = [
    [1.276_993_4e-3, 2.915_369_5e-3, 62.610_505e-3],
    [1.268_323_0e-3, 2.915_229_9e-3, 62.837_393e-3],
    [1.246_539_7e-3, 2.928_844_5e-3, 63.721_774e-3],
    [1.219_604_9e-3, 2.902_256_5e-3, 63.824_265e-3],
    [1.204_599_6e-3, 2.902_491_2e-3, 64.258_455e-3],
];
/// Amplitude of the yearly variation of the hydrostatic function (Table 3).
const HYDROSTATIC_AMPLITUDE: [[f64; 3]; 5] = [
    [0.0, 0.0, 0.0],
    [1.270_962_6e-5, 2.141_497_9e-5, 9.012_840_0e-5],
    [2.652_366_2e-5, 3.016_077_9e-5, 4.349_703_7e-5],
    [3.400_045_2e-5, 7.256_272_2e-5, 84.795_348e-5],
    [4.120_219_1e-5, 11.723_375e-5, 170.372_06e-5],
];
/// The wet function (Table 4).
const WET: [[f64; 3]; 5] = [
    [5.802_189_7e-4, 1.427_526_8e-3, 4.347_296_1e-2],
    [5.679_484_7e-4, 1.513_862_5e-3, 4.672_951_0e-2],
    [5.811_801_9e-4, 1.457_275_2e-3, 4.390_893_1e-2],
    [5.972_754_2e-4, 1.500_742_8e-3, 4.462_698_2e-2],
    [6.164_169_3e-4, 1.759_908_2e-3, 5.473_603_8e-2],
];
/// Correction of the hydrostatic function per kilometre of height.
const HEIGHT: [f64; 3] = [2.53e-5, 5.49e-3, 1.14e-3];
/// Day of the year of the extremes of the yearly variation: winter of the northern hemisphere.
const WINTER_DAY: f64 = 28.0;
const DAYS_PER_YEAR: f64 = 365.25;
/// Heights of the correction, m; heights outside are limited to them.
const HEIGHT_RANGE_M: (f64, f64) = (-1_000.0, 10_000.0);

/// Niell's mapping functions at one place on one day.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NiellMapping {
    hydrostatic: [f64; 3],
    wet: [f64; 3],
    height_km: f64,
}

impl NiellMapping {
    /// The functions at a latitude (rad) and height (m) on a day of the year (1 to 366, with fraction).
    pub fn at(latitude_rad: f64, height_m: f64, day_of_year: f64) -> Self {
        let latitude_deg = latitude_rad.to_degrees();
        let half_year = if latitude_deg < 0.0 { 0.5 } else { 0.0 };
        let season = (TAU * ((day_of_year - WINTER_DAY) / DAYS_PER_YEAR + half_year)).cos();
        let mean = interpolated(&HYDROSTATIC_MEAN, latitude_deg.abs());
        let amplitude = interpolated(&HYDROSTATIC_AMPLITUDE, latitude_deg.abs());
        let term = |i: usize| mean[i] - amplitude[i] * season;
        Self {
            hydrostatic: [term(0), term(1), term(2)],
            wet: interpolated(&WET, latitude_deg.abs()),
            height_km: height_m.clamp(HEIGHT_RANGE_M.0, HEIGHT_RANGE_M.1) / 1e3,
        }
    }

    /// The hydrostatic function at an elevation, which must be above the horizon.
    pub fn hydrostatic(&self, elevation_rad: f64) -> f64 {
        let sine = elevation_rad.sin();
        fraction(self.hydrostatic, sine) + (1.0 / sine - fraction(HEIGHT, sine)) * self.height_km
    }

    /// The wet function at an elevation, which must be above the horizon.
    pub fn wet(&self, elevation_rad: f64) -> f64 {
        fraction(self.wet, elevation_rad.sin())
    }
}

/// Coefficients at a latitude, ° from the equator.
fn interpolated(table: &[[f64; 3]; 5], latitude_deg: f64) -> [f64; 3] {
    let place = (latitude_deg / STEP_DEG - 1.0).clamp(0.0, 4.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to 3
    let row = place.floor().min(3.0) as usize;
    let part = place - row as f64;
    let (low, high) = (table[row], table[row + 1]);
    [0, 1, 2].map(|i| low[i] + part * (high[i] - low[i]))
}

/// The continued fraction of Marini, 1 at the zenith.
fn fraction([a, b, c]: [f64; 3], sine: f64) -> f64 {
    (1.0 + a / (1.0 + b / (1.0 + c))) / (sine + a / (sine + b / (sine + c)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Elevation (°), hydrostatic and wet mapping.
    const HAND: [(f64, f64, f64); 6] = [
        (3.0, 14.699_039_278_4, 16.416_700_643_7),
        (5.0, 10.151_761_745_0, 10.750_884_210_4),
        (7.5, 7.207_460_153_9, 7.427_610_113_7),
        (15.0, 3.801_492_725_3, 3.833_295_371_7),
        (30.0, 1.992_807_375_4, 1.996_544_071_1),
        (60.0, 1.154_234_618_7, 1.154_477_730_5),
    ];

    /// At 45° on day 28 the coefficients are mean less amplitude of the tables' third column: a = 1.2200160e-3, b = 2.8986837e-3,
    /// c = 6.3678277e-2; the values are the continued fraction with them, computed apart from this code with 50 digits.
    #[test]
    fn values_computed_by_hand() {
        let mapping = NiellMapping::at(45_f64.to_radians(), 0.0, 28.0);
        for (elevation_deg, hydrostatic, wet) in HAND {
            let elevation_rad = f64::to_radians(elevation_deg);
            assert!((mapping.hydrostatic(elevation_rad) - hydrostatic).abs() < 1e-9, "{elevation_deg}°");
            assert!((mapping.wet(elevation_rad) - wet).abs() < 1e-9, "{elevation_deg}°");
        }
    }

    #[test]
    fn the_zenith_is_one_everywhere() {
        let zenith = std::f64::consts::FRAC_PI_2;
        for latitude_deg in [-90.0, -37.0, 0.0, 14.9, 52.5, 75.0, 90.0] {
            let mapping = NiellMapping::at(f64::to_radians(latitude_deg), 800.0, 200.0);
            assert!((mapping.hydrostatic(zenith) - 1.0).abs() < 1e-12);
            assert!((mapping.wet(zenith) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn southern_seasons_are_half_a_year_apart() {
        let at = |latitude_deg: f64, day| {
            NiellMapping::at(latitude_deg.to_radians(), 0.0, day).hydrostatic(5_f64.to_radians())
        };
        assert!((at(-60.0, 28.0) - at(60.0, 28.0 + DAYS_PER_YEAR / 2.0)).abs() < 1e-9);
        assert!((at(-60.0, 28.0) - at(60.0, 28.0)).abs() > 0.02);
    }

    #[test]
    fn heights_and_tables_have_no_jumps_and_no_absurd_values() {
        let at = |latitude_deg: f64, height_m| {
            NiellMapping::at(latitude_deg.to_radians(), height_m, 100.0).hydrostatic(5_f64.to_radians())
        };
        for latitude_deg in [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0] {
            assert!((at(latitude_deg - 1e-7, 0.0) - at(latitude_deg + 1e-7, 0.0)).abs() < 1e-6);
        }
        assert!(at(45.0, 1_000.0) > at(45.0, 0.0));
        assert!(at(45.0, 2e7) < 11.0 && at(45.0, -6.4e6) > 9.0);
    }
}
