//! The standard normal distribution.
//!
//! Tails use the scaled complementary error function erfcx(x) = exp(x²) erfc(x), which neither
//! underflows nor loses digits: 1 − Φ(x) = ½ erfcx(x/√2) exp(−x²/2).

use std::f64::consts::{FRAC_1_SQRT_2, LN_2, PI};

use puruspe::erfcx;

/// ln √(2π).
pub(super) const LN_SQRT_2PI: f64 = 0.918_938_533_204_672_8;

/// Density φ(x).
pub fn pdf(x: f64) -> f64 {
    (-0.5 * x * x - LN_SQRT_2PI).exp()
}

/// Probability Φ(x) of a value below x; small values keep their relative precision.
pub fn cdf(x: f64) -> f64 {
    upper_tail(-x)
}

/// Probability 1 − Φ(x) of a value above x; small values keep their relative precision.
pub fn upper_tail(x: f64) -> f64 {
    if x < 0.0 { 1.0 - upper_tail(-x) } else { 0.5 * erfcx(x * FRAC_1_SQRT_2) * (-0.5 * x * x).exp() }
}

/// ln Φ(x), finite for all x with finite x².
pub fn log_cdf(x: f64) -> f64 {
    if x > 0.0 { (-upper_tail(x)).ln_1p() } else { erfcx(-x * FRAC_1_SQRT_2).ln() - 0.5 * x * x - LN_2 }
}

/// Threshold of a two-sided test: the x > 0 that the absolute value of a standard normal variable exceeds with probability
/// `probability`. Infinite for 0, zero for 1, NaN outside of [0, 1].
pub fn two_sided_threshold(probability: f64) -> f64 {
    if probability == 0.0 {
        return f64::INFINITY;
    }
    if !(0.0..=1.0).contains(&probability) {
        return f64::NAN;
    }
    let target = probability.ln();
    // ln P = ln erfcx(x/√2) − x²/2 is concave and falling, and below −x²/2: from there Newton comes from the right and never steps over the root.
    let mut x = (-2.0 * target).sqrt();
    for _ in 0..100 {
        let scaled = erfcx(x * FRAC_1_SQRT_2);
        let excess = scaled.ln() - 0.5 * x * x - target;
        let slope = (2.0 / PI).sqrt() / scaled;
        let step = excess / slope;
        x += step;
        if step.abs() <= 1e-15 * (1.0 + x) {
            break;
        }
    }
    x.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        assert!((pdf(0.0) - 0.398_942_280_401_432_7).abs() < 1e-16);
        assert!((cdf(1.0) - 0.841_344_746_068_542_9).abs() < 2e-16);
        assert!((cdf(-10.0) / 7.619_853_024_160_526e-24 - 1.0).abs() < 1e-14);
        assert!((log_cdf(-40.0) + 804.608_442_013_753_8).abs() < 1e-12);
        assert!((log_cdf(8.0) / -6.220_960_574_271_786e-16 - 1.0).abs() < 1e-13);
        assert_eq!(cdf(0.0), 0.5);
        assert_eq!(cdf(f64::NEG_INFINITY), 0.0);
        assert_eq!(log_cdf(f64::INFINITY), 0.0);
    }

    #[test]
    fn two_sided_thresholds() {
        for (probability, x) in [
            (0.05, 1.959_963_984_540_054),
            (1e-3, 3.290_526_731_491_895),
            (1e-7, 5.326_723_886_384_496),
            (0.5, 0.674_489_750_196_081_7),
        ] {
            assert!((two_sided_threshold(probability) / x - 1.0).abs() < 1e-14, "{probability}");
        }
        assert_eq!(two_sided_threshold(1.0), 0.0);
        assert_eq!(two_sided_threshold(0.0), f64::INFINITY);
        assert!(two_sided_threshold(1.5).is_nan() && two_sided_threshold(f64::NAN).is_nan());
        assert!((two_sided_threshold(1e-300) - 37.0).abs() < 0.2);
    }
}
