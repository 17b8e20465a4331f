//! Random processes of one satellite at one phone, and of one satellite at one vehicle.
//!
//! Each has its own random stream and a fixed number of draws per epoch, so that blocking one satellite changes
//! nothing for the others.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::environment::{ErrorModel, GaussMarkov, Outlier};

/// Correlation time of the shadowing, s.
const SHADOWING_CORRELATION_S: f64 = 5.0;

/// Processes of one satellite at one phone.
pub(super) struct Track {
    random: ChaCha8Rng,
    shadowing: GaussMarkov,
    multipath: [GaussMarkov; 2],
    phase: GaussMarkov,
    outlier: Outlier,
}

/// Values of the processes of a satellite at one epoch, of unit variance except for the outlier.
pub(super) struct Draws {
    pub shadowing: f64,
    /// Multipath by band; the other arrays too.
    pub multipath: [f64; 2],
    /// Phase of a reflected signal.
    pub phase: f64,
    pub outlier_m: f64,
    pub code_noise: [f64; 2],
    pub rate_noise: [f64; 2],
}

impl Track {
    pub(super) fn start(mut random: ChaCha8Rng) -> Self {
        let mut start = || GaussMarkov::start(&mut random);
        let (shadowing, multipath, phase) = (start(), [start(), start()], start());
        Self { random, shadowing, multipath, phase, outlier: Outlier::default() }
    }

    pub(super) fn advance(&mut self, step_s: f64, errors: &ErrorModel) -> Draws {
        let random = &mut self.random;
        let correlation_s = errors.multipath_correlation_s;
        let mut normal = |_| random.sample::<f64, _>(StandardNormal);
        let (code_noise, rate_noise) = ([0, 1].map(&mut normal), [0, 1].map(&mut normal));
        Draws {
            shadowing: self.shadowing.advance(step_s, SHADOWING_CORRELATION_S, random),
            multipath: advance(&mut self.multipath, step_s, correlation_s, random),
            phase: self.phase.advance(step_s, correlation_s, random),
            outlier_m: self.outlier.advance(step_s, errors.outliers_hz, random),
            code_noise,
            rate_noise,
        }
    }
}

/// Maximum time between values of the shared multipath, s.
const SHARED_STEP_S: f64 = 1.0;
/// Tolerance of the epochs' times against the shared grid, in steps of it.
const GRID_TOLERANCE: f64 = 1e-6;

/// Multipath of one satellite that the phones of a vehicle share: on a grid of time that begins with the scenario, with the interval of
/// the epochs or one second, whichever is shorter.
pub(super) struct SharedTrack {
    random: ChaCha8Rng,
    multipath: [GaussMarkov; 2],
    /// Number of values computed so far.
    computed: f64,
}

impl SharedTrack {
    pub(super) fn start(mut random: ChaCha8Rng) -> Self {
        let multipath = [GaussMarkov::start(&mut random), GaussMarkov::start(&mut random)];
        Self { random, multipath, computed: 0.0 }
    }

    /// The values at `time_s` since the scenario's start, which must not decrease from call to call.
    pub(super) fn advance_to(&mut self, time_s: f64, interval_s: f64, errors: &ErrorModel) -> [f64; 2] {
        let step_s = interval_s.min(SHARED_STEP_S);
        let node = (time_s / step_s + GRID_TOLERANCE).floor();
        while self.computed <= node {
            advance(&mut self.multipath, step_s, errors.multipath_correlation_s, &mut self.random);
            self.computed += 1.0;
        }
        self.multipath.map(GaussMarkov::value)
    }
}

fn advance(
    processes: &mut [GaussMarkov; 2],
    step_s: f64,
    correlation_s: f64,
    random: &mut ChaCha8Rng,
) -> [f64; 2] {
    processes.each_mut().map(|process| process.advance(step_s, correlation_s, random))
}
