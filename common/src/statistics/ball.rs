//! Moments of a standard normal variable times the parabola that vanishes at the ends of an interval.
//!
//! A point that is equally likely anywhere in a ball of radius u has components with the density ∝ u² − y². With y = μ + σx the parabola is
//! (x − a)(b − x) on (a, b) = ((−u − μ)/σ, (u − μ)/σ). Its moments with the normal density follow from the moments of the truncated normal
//! up to the fourth. In the tails and in narrow intervals these cancel, and the moments are integrated about the maximum of the density,
//! as in [`super::truncated`].

use super::quadrature::{GAUSS_LEGENDRE, GAUSS_LEGENDRE_16};
use super::truncated::truncated_moments;

/// Intervals that begin further from zero are integrated numerically.
const TAIL: f64 = 2.0;
/// Intervals narrower than this are integrated numerically.
const NARROW: f64 = 3.0;
/// Product of centre and half width of a narrow interval up to which 16 nodes are exact to 14 digits.
const FLAT: f64 = 6.0;
/// Density, relative to its maximum, at which the integration stops.
const NEGLIGIBLE: f64 = 1e-16;
/// Number of iterations for the maximum of the density; each at least halves its interval.
const BISECTIONS: usize = 60;

/// Mean and variance of the density ∝ φ(x)(x − lower)(upper − x) on (lower, upper), both bounds finite.
///
/// `None` for an interval of zero width, with reversed or infinite bounds, or NaN.
pub fn ball_moments(lower: f64, upper: f64) -> Option<(f64, f64)> {
    if !(lower.is_finite() && upper.is_finite() && lower < upper) {
        return None;
    }
    let (centre, half) = (0.5 * (lower + upper), 0.5 * (upper - lower));
    if lower < TAIL && upper > -TAIL && upper - lower > NARROW {
        closed_form(lower, upper)
    } else if 2.0 * half <= NARROW && centre.abs() * half <= FLAT {
        Some(integrated_whole(centre, half))
    } else {
        Some(integrated(lower, upper))
    }
}

/// From the moments m₁ to m₄ of the truncated normal: m₃ = 2m₁ + a²p − b²q, m₄ = 3m₂ + a³p − b³q with p = φ(a)/Z, q = φ(b)/Z, and p and q
/// from m₁ = p − q and m₂ = 1 + ap − bq.
fn closed_form(a: f64, b: f64) -> Option<(f64, f64)> {
    let truncated = truncated_moments(a, b)?;
    let m1 = truncated.mean;
    let m2 = truncated.variance + m1 * m1;
    let p = (m2 - 1.0 - b * m1) / (a - b);
    let q = p - m1;
    let m3 = 2.0 * m1 + a * a * p - b * b * q;
    let m4 = 3.0 * m2 + a * a * a * p - b * b * b * q;
    let weight = |low: f64, middle: f64, high: f64| (a + b) * middle - high - a * b * low;
    let z = weight(1.0, m1, m2);
    let mean = weight(m1, m2, m3) / z;
    let variance = weight(m2, m3, m4) / z - mean * mean;
    (variance > 0.0).then_some((mean, variance))
}

/// The integrals over the whole of an interval in which the density changes little.
fn integrated_whole(centre: f64, half: f64) -> (f64, f64) {
    let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
    for (node, weight) in GAUSS_LEGENDRE_16.iter() {
        let off = half * node;
        let part = weight * (1.0 - node * node) * (-off * (0.5 * off + centre)).exp();
        sum += part;
        first += part * off;
        second += part * off * off;
    }
    let shift = first / sum;
    (centre + shift, second / sum - shift * shift)
}

fn integrated(lower: f64, upper: f64) -> (f64, f64) {
    let mode = mode(lower, upper);
    // Density relative to its maximum.
    let density = |off: f64| {
        let parabola = ((mode + off - lower) / (mode - lower)) * ((upper - mode - off) / (upper - mode));
        (-off * (0.5 * off + mode)).exp() * parabola
    };
    let width = (1.0 + (mode - lower).powi(-2) + (upper - mode).powi(-2)).sqrt().recip();
    let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
    for (side, most) in [(-1.0, mode - lower), (1.0, upper - mode)] {
        let mut reach = width.min(most);
        while reach < most && density(side * reach) > NEGLIGIBLE {
            reach = (1.5 * reach).min(most);
        }
        for (node, weight) in GAUSS_LEGENDRE.iter() {
            let off = side * 0.5 * reach * (1.0 + node);
            let part = 0.5 * reach * weight * density(off);
            sum += part;
            first += part * off;
            second += part * off * off;
        }
    }
    let shift = first / sum;
    (mode + shift, second / sum - shift * shift)
}

/// Maximum of the density: root of −x + 1/(x − lower) − 1/(upper − x), which falls from ∞ to −∞.
fn mode(lower: f64, upper: f64) -> f64 {
    let (mut low, mut high) = (lower, upper);
    let mut x = 0.5 * (lower + upper);
    for _ in 0..BISECTIONS {
        let slope = -x + 1.0 / (x - lower) - 1.0 / (upper - x);
        if slope > 0.0 {
            low = x;
        } else {
            high = x;
        }
        let curvature = 1.0 + (x - lower).powi(-2) + (upper - x).powi(-2);
        let newton = x + slope / curvature;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - x).abs() <= 1e-9 * (upper - lower) {
            break;
        }
        x = next;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Simpson's rule on many points, relative to the largest density.
    fn summed(lower: f64, upper: f64) -> (f64, f64) {
        let points = 200_001;
        let at = |i: usize| lower + (upper - lower) * i as f64 / (points - 1) as f64;
        let log = |x: f64| -0.5 * x * x + ((x - lower) * (upper - x)).ln();
        let top = (1..points - 1).map(|i| log(at(i))).fold(f64::NEG_INFINITY, f64::max);
        let (mut z, mut first, mut second) = (0.0, 0.0, 0.0);
        for i in 1..points - 1 {
            let weight = if i % 2 == 1 { 4.0 } else { 2.0 } * (log(at(i)) - top).exp();
            z += weight;
            first += weight * at(i);
            second += weight * at(i) * at(i);
        }
        (first / z, second / z - (first / z).powi(2))
    }

    #[test]
    fn both_forms_equal_a_fine_sum() {
        let intervals = [
            (-1.0, 3.0),
            (-9.0, 4.0),
            (-2.0, 2.0),
            (-0.2, 0.3),
            (1.0, 6.0),
            (4.0, 9.0),
            (8.0, 13.0),
            (-30.0, -25.0),
        ];
        for (lower, upper) in intervals {
            let ((mean, variance), (m, v)) = (ball_moments(lower, upper).unwrap(), summed(lower, upper));
            assert!((mean - m).abs() < 2e-6 * (1.0 + m.abs()), "({lower}, {upper}): mean {mean} against {m}");
            assert!((variance / v - 1.0).abs() < 1e-4, "({lower}, {upper}): variance {variance} against {v}");
        }
    }

    #[test]
    fn the_forms_agree_where_both_hold() {
        for step in 0..40 {
            let lower = -6.0 + 0.2 * f64::from(step);
            let upper = lower + 4.0;
            if lower < TAIL && upper > -TAIL {
                let (closed, integral) = (closed_form(lower, upper).unwrap(), integrated(lower, upper));
                assert!((closed.0 - integral.0).abs() < 1e-8, "{lower}: {closed:?} {integral:?}");
                assert!((closed.1 - integral.1).abs() < 1e-8, "{lower}: {closed:?} {integral:?}");
            }
        }
    }

    #[test]
    fn few_nodes_are_enough_for_narrow_intervals() {
        for half in [1e-3, 0.1, 0.6, 1.5] {
            for steepness in [-6.0, -2.0, 0.0, 0.5, 4.0] {
                let centre: f64 = steepness / half;
                let (few, many) = (integrated_whole(centre, half), integrated(centre - half, centre + half));
                assert!((few.0 - many.0).abs() < 1e-10 * half, "{centre} {half}: {few:?} {many:?}");
                assert!((few.1 / many.1 - 1.0).abs() < 1e-9, "{centre} {half}: {few:?} {many:?}");
            }
        }
    }

    #[test]
    fn without_other_knowledge_it_is_the_ball() {
        // σ much larger than the ball: variance u²/5.
        let (mean, variance) = ball_moments(-1e-3, 1e-3).unwrap();
        assert!(mean.abs() < 1e-9 && (variance / (1e-6 / 5.0) - 1.0).abs() < 1e-6, "{mean} {variance}");
    }

    #[test]
    fn empty_and_open_intervals_have_none() {
        for (lower, upper) in [(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
            assert!(ball_moments(lower, upper).is_none());
        }
    }
}
