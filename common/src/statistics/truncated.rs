//! Moments of a standard normal variable within an interval (a, b).
//!
//! With Z = Φ(b) − Φ(a) the textbook moments are m = (φ(a) − φ(b))/Z and s² = 1 + (aφ(a) − bφ(b))/Z − m². In the far
//! tail Z underflows, and in the tail as in a narrow interval s² is a small difference of large numbers. So:
//!
//! - intervals are mirrored such that a + b ≥ 0: the lower bound is then the one nearer to zero;
//! - a wide interval that begins left of 1σ uses the textbook forms (φ(a) − φ(b) through `expm1`);
//! - any other is integrated by Gauss-Legendre quadrature about its centre over the part where the density is
//!   within e^(−40) of its maximum: all terms of Z and of s² are positive there, so there is no cancellation.
//!
//! Measured against 50-digit values, bounds from −40σ to 60σ and widths from 1e-12σ to infinity, the relative
//! error of log probability, mean and variance is below 1e-13 (see the integration test of the oracle vectors).

use super::normal::{LN_SQRT_2PI, pdf, upper_tail};
use super::quadrature::GAUSS_LEGENDRE;

/// Moments of a standard normal variable within an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruncatedMoments {
    /// Natural logarithm of the probability of the interval.
    pub log_probability: f64,
    /// Mean, in the interval.
    pub mean: f64,
    /// Variance, in [0, 1].
    pub variance: f64,
}

/// Begin of the tail: intervals that start beyond it are integrated numerically.
const TAIL: f64 = 1.0;
/// Intervals narrower than this are integrated numerically.
const NARROW: f64 = 2.0;
/// Density drop at which the integration stops, as an exponent.
const DROP: f64 = 40.0;

/// Moments of N(0, 1) on (lower, upper); either bound may be infinite.
///
/// `None` for an interval without probability: of zero width, with reversed bounds, or NaN.
pub fn truncated_moments(lower: f64, upper: f64) -> Option<TruncatedMoments> {
    if lower.is_nan() || upper.is_nan() || lower >= upper {
        return None;
    }
    if lower + upper < 0.0 {
        let mirrored = truncated_moments(-upper, -lower)?;
        return Some(TruncatedMoments { mean: -mirrored.mean, ..mirrored });
    }
    if lower == f64::INFINITY {
        return None;
    }
    let moments = if lower < TAIL && upper - lower > NARROW {
        closed_form(lower, upper)
    } else {
        integrated(lower, upper)
    };
    moments.mean.is_finite().then_some(moments)
}

/// ln(Φ(upper) − Φ(lower)), −∞ for an empty interval.
pub fn log_interval_probability(lower: f64, upper: f64) -> f64 {
    truncated_moments(lower, upper).map_or(f64::NEG_INFINITY, |moments| moments.log_probability)
}

fn closed_form(lower: f64, upper: f64) -> TruncatedMoments {
    let (density_lower, density_upper) = (pdf(lower), pdf(upper));
    // Probability outside; 1 − outside then has the digits that a logarithm near 0 needs.
    let outside = upper_tail(-lower) + upper_tail(upper);
    let inside = 1.0 - outside;
    let mean = if upper.is_infinite() {
        density_lower / inside
    } else {
        -density_lower * (0.5 * (lower - upper) * (lower + upper)).exp_m1() / inside
    };
    let edge = |bound: f64, density: f64| if bound.is_infinite() { 0.0 } else { bound * density };
    let edges = (edge(lower, density_lower) - edge(upper, density_upper)) / inside;
    TruncatedMoments {
        log_probability: (-outside).ln_1p(),
        mean: if mean.is_finite() { mean } else { 0.0 },
        variance: 1.0 + edges - mean * mean,
    }
}

fn integrated(lower: f64, upper: f64) -> TruncatedMoments {
    // e^(−lower·t − t²/2) has fallen by e^(−DROP) at this distance t behind the lower bound.
    let start = lower.max(0.0);
    let reach = 2.0 * DROP / (start + (start * start + 2.0 * DROP).sqrt());
    let half = 0.5 * (upper - lower).min(reach);
    let centre = lower + half;
    // Density relative to that at the lower bound (or at 0 when that is inside), so that no exponent is large.
    let mut weighted = [(0.0, 0.0); 32];
    let (mut sum, mut first) = (0.0, 0.0);
    for ((node, weight), slot) in GAUSS_LEGENDRE.iter().zip(&mut weighted) {
        let offset = half * node;
        let behind = half + offset;
        let mass = weight * (-behind * (lower + 0.5 * behind)).exp();
        *slot = (offset, mass);
        sum += mass;
        first += offset * mass;
    }
    let mean_offset = first / sum;
    let second: f64 = weighted.iter().map(|(offset, mass)| mass * (offset - mean_offset).powi(2)).sum();
    TruncatedMoments {
        log_probability: (half * sum).ln() - 0.5 * lower * lower - LN_SQRT_2PI,
        mean: (centre + mean_offset).clamp(lower, upper),
        variance: second / sum,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_intervals_have_no_moments() {
        for (a, b) in [(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (f64::INFINITY, f64::INFINITY)] {
            assert_eq!(truncated_moments(a, b), None, "{a} {b}");
            assert_eq!(log_interval_probability(a, b), f64::NEG_INFINITY);
        }
    }

    #[test]
    fn whole_line_is_untouched() {
        let whole = truncated_moments(f64::NEG_INFINITY, f64::INFINITY).unwrap();
        assert_eq!((whole.log_probability, whole.mean, whole.variance), (0.0, 0.0, 1.0));
    }

    #[test]
    fn far_tail_is_exponential() {
        // 1/a − 2/a³ + … and 1/a² − 6/a⁴ + …
        let a = 1e4;
        let tail = truncated_moments(a, f64::INFINITY).unwrap();
        assert!(((tail.mean - a) * a - 1.0).abs() < 1e-7);
        assert!((tail.variance * a * a - 1.0).abs() < 1e-7);
    }

    #[test]
    fn branches_agree_where_they_meet() {
        for (a, b) in [(0.9, 3.5), (-1.0, 1.5), (0.5, 4.0), (-0.2, 2.5), (0.99, 9.0)] {
            let (closed, numeric) = (closed_form(a, b), integrated(a, b));
            assert!((closed.mean / numeric.mean - 1.0).abs() < 1e-13, "{closed:?} {numeric:?}");
            assert!((closed.variance / numeric.variance - 1.0).abs() < 1e-12, "{closed:?} {numeric:?}");
            assert!((closed.log_probability - numeric.log_probability).abs() < 1e-14);
        }
    }

    #[test]
    fn mirrored_intervals_mirror() {
        let (left, right) = (truncated_moments(-3.0, 0.4).unwrap(), truncated_moments(-0.4, 3.0).unwrap());
        assert_eq!((left.mean, left.variance), (-right.mean, right.variance));
    }
}
