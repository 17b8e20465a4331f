//! Errors that all phones have alike because they arise on the way or in the satellites: biases of satellites and what a model leaves of the ionosphere.
//!
//! Each is a first-order Gauss-Markov process with one time constant of hours, computed every [`NODE_S`] seconds and linear in between, so
//! that phones with epochs at any times have the same value at the same time. The rate (at most a few millimetres per second) is
//! not in the Doppler.
//!
//! The ionosphere residual on L1 is slant · (f·I + g_n·n + g_e·e): the modelled vertical delay I at the receiver, the fraction f, the
//! gradients g to north and east, and the distances n and e of the pierce point from the receiver, with pierce point and slant factor
//! of a thin shell ([`SHELL`]).

use std::f64::consts::FRAC_PI_2;

use rand::Rng;

use crate::atmosphere::Shell;
use crate::frames::{Direction, Geodetic};
use crate::gnss::Constellation;

use super::environment::GaussMarkov;

/// Time between computed values of a process, s.
const NODE_S: f64 = 60.0;
/// Radius of the sphere below the shell, m.
const SPHERE_M: f64 = 6_371_000.0;
/// The shell of the ionosphere residual, 400 km above the sphere.
const SHELL: Shell = Shell::new(SPHERE_M, 400_000.0);
/// Length to which gradients refer, m.
const GRADIENT_LENGTH_M: f64 = 1e6;

/// Direction of the vertical delay.
pub(super) const ZENITH: Direction = Direction { azimuth_rad: 0.0, elevation_rad: FRAC_PI_2 };

/// Sizes of the errors that all phones have alike; by default none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedErrors {
    /// Standard deviation of the range bias of a GPS or Galileo satellite, m.
    pub gps_galileo_bias_sigma_m: f64,
    /// Standard deviation of the range bias of a BeiDou satellite, m.
    pub beidou_bias_sigma_m: f64,
    /// Mean of the ionosphere residual.
    pub ionosphere_mean: IonosphereResidual,
    /// Standard deviations of the ionosphere residual about its mean.
    pub ionosphere_sigma: IonosphereResidual,
    /// Time constant of all these processes, s; at least 600 s.
    pub time_constant_s: f64,
}

/// What a model leaves of the ionosphere around a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IonosphereResidual {
    /// Residual of the vertical delay as a fraction of the modelled one.
    pub vertical_fraction: f64,
    /// Change of the vertical L1 residual to north, m per 1,000 km.
    pub north_m_per_1000km: f64,
    /// Change of the vertical L1 residual to east, m per 1,000 km.
    pub east_m_per_1000km: f64,
}

impl Default for SharedErrors {
    fn default() -> Self {
        Self::NONE
    }
}

impl SharedErrors {
    /// No errors.
    pub const NONE: Self = Self {
        gps_galileo_bias_sigma_m: 0.0,
        beidou_bias_sigma_m: 0.0,
        ionosphere_mean: IonosphereResidual::NONE,
        ionosphere_sigma: IonosphereResidual::NONE,
        time_constant_s: 7_200.0,
    };

    /// Satellite biases of 1 m (GPS, Galileo) and 2 m (BeiDou), and an ionosphere residual of 0.3 of the model's vertical delay with
    /// gradients of 1 m per 1,000 km, all 1 σ with a time constant of two hours.
    pub const fn typical() -> Self {
        Self {
            gps_galileo_bias_sigma_m: 1.0,
            beidou_bias_sigma_m: 2.0,
            ionosphere_sigma: IonosphereResidual {
                vertical_fraction: 0.3,
                north_m_per_1000km: 1.0,
                east_m_per_1000km: 1.0,
            },
            ..Self::NONE
        }
    }

    /// Standard deviation of a satellite's range bias, m.
    pub(super) fn satellite_bias_sigma_m(&self, constellation: Constellation) -> f64 {
        if constellation == Constellation::Beidou {
            self.beidou_bias_sigma_m
        } else {
            self.gps_galileo_bias_sigma_m
        }
    }
}

impl IonosphereResidual {
    /// No residual.
    pub const NONE: Self = Self { vertical_fraction: 0.0, north_m_per_1000km: 0.0, east_m_per_1000km: 0.0 };

    /// Residual delay of a signal on L1, m; `modelled_vertical_m` is the model's vertical delay at the receiver.
    pub fn delay_l1_m(&self, modelled_vertical_m: f64, receiver: Geodetic, direction: Direction) -> f64 {
        let Geodetic { latitude_rad, longitude_rad, .. } = receiver;
        let pierce = SHELL.pierce(latitude_rad, longitude_rad, direction);
        let north_m = SPHERE_M * (pierce.latitude_rad - latitude_rad);
        let east_m = SPHERE_M * latitude_rad.cos() * (pierce.longitude_rad - longitude_rad);
        let by_gradients_m =
            (self.north_m_per_1000km * north_m + self.east_m_per_1000km * east_m) / GRADIENT_LENGTH_M;
        pierce.slant * (self.vertical_fraction * modelled_vertical_m + by_gradients_m)
    }

    /// The three values, in the order of the fields.
    pub(super) const fn values(&self) -> [f64; 3] {
        [self.vertical_fraction, self.north_m_per_1000km, self.east_m_per_1000km]
    }
}

/// A Gauss-Markov process of unit variance over a whole scenario.
#[derive(Clone, Debug)]
pub(super) struct SlowProcess {
    nodes: Vec<f64>,
}

impl SlowProcess {
    /// A process from the scenario's start to `duration_s` later.
    pub(super) fn new(duration_s: f64, time_constant_s: f64, mut random: impl Rng) -> Self {
        let mut process = GaussMarkov::start(&mut random);
        let mut nodes = Vec::new();
        let mut node_s = 0.0;
        while node_s < duration_s + NODE_S {
            nodes.push(process.advance(NODE_S, time_constant_s, &mut random));
            node_s += NODE_S;
        }
        Self { nodes }
    }

    /// Value at `time_s` since the scenario's start; before the start and after the end the nearest one.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 0 and the number of nodes
    pub(super) fn at(&self, time_s: f64) -> f64 {
        let place = (time_s / NODE_S).clamp(0.0, self.nodes.len().saturating_sub(1) as f64);
        let node = |index: usize| self.nodes.get(index).or(self.nodes.last()).copied().unwrap_or(0.0);
        let index = place as usize;
        node(index) + place.fract() * (node(index + 1) - node(index))
    }
}

/// The processes of the ionosphere residual.
#[derive(Clone, Debug)]
pub(super) struct IonosphereProcess {
    processes: [SlowProcess; 3],
}

impl IonosphereProcess {
    pub(super) fn new(duration_s: f64, time_constant_s: f64, mut random: impl Rng) -> Self {
        Self { processes: [(); 3].map(|()| SlowProcess::new(duration_s, time_constant_s, &mut random)) }
    }

    /// The residual at `time_s` since the scenario's start.
    pub(super) fn at(&self, errors: &SharedErrors, time_s: f64) -> IonosphereResidual {
        let (mean, sigma) = (errors.ionosphere_mean.values(), errors.ionosphere_sigma.values());
        let [fraction, north, east] = &self.processes;
        let value = |mean: f64, sigma: f64, process: &SlowProcess| mean + sigma * process.at(time_s);
        IonosphereResidual {
            vertical_fraction: value(mean[0], sigma[0], fraction),
            north_m_per_1000km: value(mean[1], sigma[1], north),
            east_m_per_1000km: value(mean[2], sigma[2], east),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn slow_processes_have_unit_variance_and_their_time_constant() {
        let runs = 4_000;
        let lags_s = [0.0, 30.0, 7_200.0, 14_400.0];
        let mut products = [0.0; 4];
        for run in 0..runs {
            let process = SlowProcess::new(14_400.0, 7_200.0, ChaCha8Rng::seed_from_u64(run));
            for (sum, lag_s) in products.iter_mut().zip(lags_s) {
                *sum += process.at(0.0) * process.at(lag_s) / runs as f64;
            }
        }
        for (product, lag_s) in products.into_iter().zip(lags_s) {
            let expected = (-lag_s / 7_200.0).exp();
            assert!((product - expected).abs() < 0.06, "{lag_s} s: {product} {expected}");
        }
    }

    #[test]
    fn slow_processes_are_continuous_and_defined_everywhere() {
        let process = SlowProcess::new(600.0, 7_200.0, ChaCha8Rng::seed_from_u64(1));
        assert_eq!(process.at(-1.0), process.at(0.0));
        for node_s in [60.0, 300.0, 600.0] {
            assert!((process.at(node_s - 1e-6) - process.at(node_s + 1e-6)).abs() < 1e-6);
            assert_ne!(process.at(node_s), process.at(node_s - 30.0));
        }
        assert_eq!(process.at(1e6), process.at(1e9));
        assert!(process.at(600.3).is_finite());
    }

    #[test]
    fn the_ionosphere_residual_grows_to_the_horizon_and_with_the_gradient() {
        let receiver = Geodetic::from_degrees(48.0, 11.5, 500.0);
        let residual = IonosphereResidual { vertical_fraction: 0.5, ..IonosphereResidual::NONE };
        let low = |azimuth_deg: f64| Direction {
            azimuth_rad: azimuth_deg.to_radians(),
            elevation_rad: 10.0_f64.to_radians(),
        };
        assert!((residual.delay_l1_m(4.0, receiver, ZENITH) - 2.0).abs() < 1e-12);
        // The slant factor of a shell 400 km high at 10° is 2.7 by its formula.
        let slant = 1.0 / (1.0 - (6_371.0 / 6_771.0 * 10.0_f64.to_radians().cos()).powi(2)).sqrt();
        assert!((residual.delay_l1_m(4.0, receiver, low(77.0)) - 2.0 * slant).abs() < 1e-9, "{slant}");
        // At 10° the pierce point lies 12.1° of the Earth's centre away, 1,345 km.
        let north = IonosphereResidual { north_m_per_1000km: 1.0, ..IonosphereResidual::NONE };
        let away = |azimuth_deg| north.delay_l1_m(4.0, receiver, low(azimuth_deg)) / slant;
        assert!((away(0.0) - 1.345).abs() < 0.02 && (away(180.0) + 1.345).abs() < 0.02, "{}", away(0.0));
        let east = IonosphereResidual { east_m_per_1000km: 1.0, ..IonosphereResidual::NONE };
        let away = |azimuth_deg| east.delay_l1_m(4.0, receiver, low(azimuth_deg)) / slant;
        assert!((away(90.0) - 1.345).abs() < 0.1 && away(180.0).abs() < 1e-9, "{}", away(90.0));
        assert_eq!(north.delay_l1_m(4.0, receiver, ZENITH).abs().max(1e-9), 1e-9);
    }
}
