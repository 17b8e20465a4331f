//! What surrounds a phone: open sky, or a street canyon that blocks and reflects.
//!
//! A canyon is a stretch of road between rows of houses of height h at the distance w. A satellite at the angle Δ from
//! the street's direction is blocked below the elevation atan(h·|sin Δ| / w): across the street much, along it little.
//!
//! Multipath is a first-order Gauss-Markov process of unit variance, x ← x·e^(−Δt/τ) + √(1 − e^(−2Δt/τ))·n, scaled by
//! elevation and surroundings. Now and then a satellite is received by reflection only: a constant positive error for
//! some seconds.

use rand::Rng;
use rand_distr::StandardNormal;

use crate::frames::Direction;

/// Elevation below which nothing is received, rad (5°).
const HORIZON_RAD: f64 = 0.087_266;

/// A stretch of road between houses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Canyon {
    /// Where it begins, as distance along the road from the start of a lap, m.
    pub from_m: f64,
    /// Where it ends, m.
    pub to_m: f64,
    /// Height of the houses above the phones, m.
    pub height_m: f64,
    /// Distance of the houses from the lane, m.
    pub half_width_m: f64,
}

/// Time-correlated and gross errors. The demonstration's values are those of [`ErrorModel::default`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorModel {
    /// Code noise: σ² = a + b·10^(−C/N0/10); a in m².
    pub code_a_m2: f64,
    /// b in m²·Hz.
    pub code_b_m2hz: f64,
    /// Range-rate noise, likewise: a in m²/s².
    pub rate_a_m2ps2: f64,
    /// b in m²/s²·Hz.
    pub rate_b_m2ps2hz: f64,
    /// Standard deviation of the multipath at the horizon in open surroundings, m.
    pub multipath_open_m: f64,
    /// The same in a canyon, m.
    pub multipath_canyon_m: f64,
    /// Correlation time τ of the multipath, s.
    pub multipath_correlation_s: f64,
    /// Reflected-only receptions per satellite and second in open surroundings.
    pub outliers_open_hz: f64,
    /// The same in a canyon.
    pub outliers_canyon_hz: f64,
    /// Standard deviation of the shadowing, dB; four times that in a canyon.
    pub shadowing_db: f64,
    /// Ionosphere: true delay over the broadcast model's.
    pub ionosphere_scale: f64,
    /// Troposphere: true delay over the model's.
    pub troposphere_scale: f64,
    /// Standard deviation of the satellites' L5 delays, which no simulated message carries, m.
    pub l5_delay_m: f64,
}

impl Default for ErrorModel {
    /// Phones in cars: metres of noise, metres of multipath, tens of metres now and then.
    fn default() -> Self {
        Self {
            code_a_m2: 0.25,
            code_b_m2hz: 5e4,
            rate_a_m2ps2: 4e-4,
            rate_b_m2ps2hz: 100.0,
            multipath_open_m: 5.0,
            multipath_canyon_m: 9.0,
            multipath_correlation_s: 20.0,
            outliers_open_hz: 1.0 / 3_000.0,
            outliers_canyon_hz: 1.0 / 150.0,
            shadowing_db: 1.0,
            ionosphere_scale: 1.15,
            troposphere_scale: 1.02,
            l5_delay_m: 0.8,
        }
    }
}

impl ErrorModel {
    /// No errors at all: only geometry, clocks, inter-system biases, and delays that the models remove exactly.
    pub const fn none() -> Self {
        Self {
            code_a_m2: 0.0,
            code_b_m2hz: 0.0,
            rate_a_m2ps2: 0.0,
            rate_b_m2ps2hz: 0.0,
            multipath_open_m: 0.0,
            multipath_canyon_m: 0.0,
            multipath_correlation_s: 20.0,
            outliers_open_hz: 0.0,
            outliers_canyon_hz: 0.0,
            shadowing_db: 0.0,
            ionosphere_scale: 1.0,
            troposphere_scale: 1.0,
            l5_delay_m: 0.0,
        }
    }

    /// Standard deviation of the multipath at an elevation, m.
    pub fn multipath_sigma_m(&self, elevation_rad: f64, in_canyon: bool) -> f64 {
        let at_horizon = if in_canyon { self.multipath_canyon_m } else { self.multipath_open_m };
        at_horizon * (-elevation_rad / 0.6).exp()
    }

    /// Standard deviation of the code noise at a C/N0, m.
    pub fn code_sigma_m(&self, cn0_dbhz: f64) -> f64 {
        (self.code_a_m2 + self.code_b_m2hz * 10_f64.powf(-cn0_dbhz / 10.0)).sqrt()
    }

    /// Standard deviation of the range rate at a C/N0, m/s.
    pub fn rate_sigma_mps(&self, cn0_dbhz: f64) -> f64 {
        (self.rate_a_m2ps2 + self.rate_b_m2ps2hz * 10_f64.powf(-cn0_dbhz / 10.0)).sqrt()
    }
}

/// The surroundings of one phone at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Surroundings {
    canyon: Option<Canyon>,
    heading_rad: f64,
}

impl Surroundings {
    /// At `road_m` along a closed road of `lap_m`, which has the direction `heading_rad` there.
    pub(super) fn at(canyons: &[Canyon], road_m: f64, lap_m: f64, heading_rad: f64) -> Self {
        let place_m = road_m.rem_euclid(lap_m);
        let canyon = canyons.iter().find(|canyon| (canyon.from_m..canyon.to_m).contains(&place_m));
        Self { canyon: canyon.copied(), heading_rad }
    }

    /// Whether the phone is in a canyon.
    pub(super) const fn in_canyon(&self) -> bool {
        self.canyon.is_some()
    }

    /// Whether the direct signal from a direction arrives.
    pub(super) fn is_visible(&self, direction: Direction) -> bool {
        let skyline_rad = self.canyon.map_or(0.0, |canyon| {
            let across = (direction.azimuth_rad - self.heading_rad).sin().abs();
            (canyon.height_m * across).atan2(canyon.half_width_m)
        });
        direction.elevation_rad > skyline_rad.max(HORIZON_RAD)
    }
}

/// A Gauss-Markov process of unit variance.
#[derive(Clone, Copy, Debug)]
pub(super) struct GaussMarkov {
    value: f64,
}

impl GaussMarkov {
    /// Starts in the steady state.
    pub(super) fn start(random: &mut impl Rng) -> Self {
        Self { value: random.sample(StandardNormal) }
    }

    /// Advances by `step_s` with the correlation time `correlation_s` and returns the new value.
    pub(super) fn advance(&mut self, step_s: f64, correlation_s: f64, random: &mut impl Rng) -> f64 {
        let keep = (-step_s / correlation_s).exp();
        let noise: f64 = random.sample(StandardNormal);
        self.value = keep * self.value + (1.0 - keep * keep).max(0.0).sqrt() * noise;
        self.value
    }
}

/// Reflected-only reception of one satellite.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outlier {
    left_s: f64,
    error_m: f64,
}

impl Outlier {
    /// Advances by `step_s` with `rate_hz` beginnings per second; returns the error, m, 0 when there is none.
    ///
    /// The number of draws does not depend on the outcome, so that options change only what they concern.
    pub(super) fn advance(&mut self, step_s: f64, rate_hz: f64, random: &mut impl Rng) -> f64 {
        let (chance, duration, size) =
            (random.random::<f64>(), random.random::<f64>(), random.random::<f64>());
        self.left_s -= step_s;
        if self.left_s <= 0.0 {
            *self = Self::default();
            if chance < 1.0 - (-rate_hz * step_s).exp() {
                *self = Self { left_s: 3.0 + 9.0 * duration, error_m: 15.0 + 45.0 * size };
            }
        }
        self.error_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn multipath_is_correlated_as_asked() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut process = GaussMarkov::start(&mut random);
        let values: Vec<f64> = (0..200_000).map(|_| process.advance(1.0, 20.0, &mut random)).collect();
        for (lag, expected) in [(0, 1.0), (10, (-0.5_f64).exp()), (20, (-1.0_f64).exp()), (100, 0.0)] {
            let products = values.iter().zip(values.iter().skip(lag)).map(|(a, b)| a * b);
            let correlation = products.sum::<f64>() / (values.len() - lag) as f64;
            assert!((correlation - expected).abs() < 0.05, "lag {lag}: {correlation} {expected}");
        }
    }

    #[test]
    fn outliers_begin_at_the_rate_asked() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut outlier = Outlier::default();
        let (mut beginnings, mut free_s, mut before) = (0, 0, 0.0);
        for _ in 0..400_000 {
            let error = outlier.advance(1.0, 1.0 / 150.0, &mut random);
            assert!(error == 0.0 || (15.0..=60.0).contains(&error));
            beginnings += i32::from(error != 0.0 && error != before);
            free_s += i32::from(error == 0.0);
            before = error;
        }
        let rate = f64::from(beginnings) / f64::from(free_s);
        assert!((rate * 150.0 - 1.0).abs() < 0.1, "{rate}");
    }

    #[test]
    fn a_canyon_blocks_across_and_not_along() {
        let canyon = Canyon { from_m: 100.0, to_m: 200.0, height_m: 20.0, half_width_m: 10.0 };
        let seen = |road_m: f64, azimuth_deg: f64, elevation_deg: f64| {
            let azimuth_rad = azimuth_deg.to_radians();
            Surroundings::at(&[canyon], road_m, 1_000.0, 30.0_f64.to_radians())
                .is_visible(Direction { azimuth_rad, elevation_rad: elevation_deg.to_radians() })
        };
        assert!(seen(50.0, 120.0, 10.0) && !seen(50.0, 120.0, 4.0));
        assert!(!seen(1_150.0, 120.0, 60.0) && seen(1_150.0, 120.0, 65.0));
        assert!(!seen(150.0, 300.0, 60.0) && seen(150.0, 210.0, 10.0));
    }
}
