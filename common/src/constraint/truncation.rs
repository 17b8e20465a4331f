//! Truncation of a scalar to an interval, with the enlargement of Algorithm 1.

use serde::{Deserialize, Serialize};

use crate::statistics::{ball_moments, log_interval_probability, truncated_moments};

/// Minimum width of an interval in standard deviations; narrower intervals are widened about their centre, so that an equality leaves a
/// variance.
const LEAST_WIDTH_SIGMAS: f64 = 1e-4;
/// Half-width of the first enlargement of an interval without width, in standard deviations.
const FIRST_HALF_WIDTH_SIGMAS: f64 = 0.01;

/// An interval; either bound may be infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower bound.
    pub lower: f64,
    /// Upper bound.
    pub upper: f64,
}

/// What is known of a value within its interval before anything else.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Density {
    /// Every value is equally likely.
    #[default]
    Uniform,
    /// The value is a component of a vector that is equally likely anywhere in the ball whose diameter is the interval.
    Ball,
}

/// Normal distribution of one variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Mean.
    pub mean: f64,
    /// Variance.
    pub variance: f64,
}

/// Treatment of an interval that the state contradicts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Enlargement {
    /// The interval is kept: the constraint is true and the state is wrong.
    Fixed,
    /// Algorithm 1: while the truncated moments give the interval a probability below 1 − `confidence`, each bound is moved
    /// outwards by `factor` (courses widen their tolerance).
    ///
    /// For a mean far outside, the truncated distribution is nearly exponential, and its moments give the interval a probability of about
    /// 0.84. With the paper's 0.1 the interval then grows until it reaches the mean, and the correction is almost lost.
    Peng {
        /// The paper's c, 0.1.
        confidence: f64,
        /// The paper's factor, 1.5; above 1.
        factor: f64,
        /// Maximum number of enlargements.
        max_iterations: u32,
    },
}

/// Result of a truncation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truncation {
    /// Moments within the interval.
    pub moments: Gaussian,
    /// Number of enlargements of the interval.
    pub enlargements: u32,
}

impl Interval {
    /// Interval from −`maximum` to `maximum`.
    pub fn within(maximum: f64) -> Self {
        Self { lower: -maximum, upper: maximum }
    }

    /// Distance of a value from the interval; 0 inside, NaN for NaN.
    pub fn excess(&self, value: f64) -> f64 {
        if value < self.lower {
            self.lower - value
        } else if value > self.upper {
            value - self.upper
        } else if value.is_nan() {
            value
        } else {
            0.0
        }
    }

    /// Whether a value is within the interval, bounds included.
    pub fn contains(&self, value: f64) -> bool {
        self.lower <= value && value <= self.upper
    }

    /// The interval after `times` enlargements: each bound moves outwards by `factor` (Peng 2023, section 3.2: "we enlarge the bound 1.5
    /// times"), a bound away from zero as 1.5·d and one towards it as d/1.5. An interval without width first gets one about its value, and a
    /// single bound moves by at least `sigma` times factor^`times` − 1.
    fn enlarged(&self, factor: f64, times: u32, sigma: f64) -> Self {
        if times == 0 {
            return *self;
        }
        let growth = factor.powi(i32::try_from(times).unwrap_or(i32::MAX));
        if self.lower.is_finite() && self.upper.is_finite() {
            if self.upper - self.lower < LEAST_WIDTH_SIGMAS * sigma {
                let (centre, half) =
                    (0.5 * (self.lower + self.upper), FIRST_HALF_WIDTH_SIGMAS * sigma * growth);
                return Self { lower: centre - half, upper: centre + half };
            }
            let outwards = |bound: f64, is_away: bool| if is_away { bound * growth } else { bound / growth };
            return Self {
                lower: outwards(self.lower, self.lower < 0.0),
                upper: outwards(self.upper, self.upper > 0.0),
            };
        }
        let outwards = |bound: f64| (growth - 1.0) * bound.abs().max(sigma);
        let lower = if self.lower.is_finite() { self.lower - outwards(self.lower) } else { self.lower };
        let upper = if self.upper.is_finite() { self.upper + outwards(self.upper) } else { self.upper };
        Self { lower, upper }
    }

    /// The interval in standard deviations from the mean, at least [`LEAST_WIDTH_SIGMAS`] wide.
    fn standardised(&self, gaussian: Gaussian) -> (f64, f64) {
        let sigma = gaussian.variance.sqrt();
        let (lower, upper) = ((self.lower - gaussian.mean) / sigma, (self.upper - gaussian.mean) / sigma);
        // At large distances two doubles with this difference may coincide.
        let least = LEAST_WIDTH_SIGMAS.max(1e-12 * lower.abs().min(upper.abs()));
        if upper - lower < least {
            let centre = 0.5 * (lower + upper);
            (centre - 0.5 * least, centre + 0.5 * least)
        } else {
            (lower, upper)
        }
    }
}

/// Moments of a normal distribution within an interval, enlarged if the policy says so.
///
/// `None` if the distribution has no positive finite variance, or a result is not finite.
pub fn truncate(gaussian: Gaussian, interval: Interval, policy: Enlargement) -> Option<Truncation> {
    truncate_with(gaussian, interval, Density::Uniform, policy)
}

/// The same with a density within the interval.
pub(super) fn truncate_with(
    gaussian: Gaussian,
    interval: Interval,
    density: Density,
    policy: Enlargement,
) -> Option<Truncation> {
    match policy {
        Enlargement::Fixed => {
            Some(Truncation { moments: moments_within(gaussian, interval, density)?, enlargements: 0 })
        }
        Enlargement::Peng { confidence, factor, max_iterations } => {
            let sigma = gaussian.variance.sqrt();
            let mut enlargements = 0;
            loop {
                let current = interval.enlarged(factor, enlargements, sigma);
                let moments = moments_within(gaussian, current, density)?;
                if enlargements >= max_iterations || plausible(moments, current, confidence) {
                    return Some(Truncation { moments, enlargements });
                }
                enlargements += 1;
            }
        }
    }
}

/// Whether an interval has a probability of at least 1 − `confidence` under a distribution (Algorithm 1, steps 9-10).
pub(super) fn plausible(gaussian: Gaussian, interval: Interval, confidence: f64) -> bool {
    let (lower, upper) = interval.standardised(gaussian);
    log_interval_probability(lower, upper) >= (1.0 - confidence).ln()
}

/// Moments of a normal distribution within an interval, without enlargement.
pub(super) fn moments_within(gaussian: Gaussian, interval: Interval, density: Density) -> Option<Gaussian> {
    if !(gaussian.variance > 0.0 && gaussian.variance.is_finite() && gaussian.mean.is_finite()) {
        return None;
    }
    let (lower, upper) = interval.standardised(gaussian);
    let (mean, variance) = match density {
        Density::Uniform => truncated_moments(lower, upper).map(|within| (within.mean, within.variance)),
        Density::Ball => ball_moments(lower, upper),
    }?;
    let mean = gaussian.mean + gaussian.variance.sqrt() * mean;
    let mean =
        if interval.lower < interval.upper { mean.clamp(interval.lower, interval.upper) } else { mean };
    let variance = gaussian.variance * variance.min(1.0);
    (mean.is_finite() && variance > 0.0).then_some(Gaussian { mean, variance })
}
