//! Chi-square tests with an integer number of degrees of freedom.
//!
//! For integers the tail is a finite sum of positive terms, so even very small tails have full relative precision. With y = x/2
//! and k degrees of freedom, Q = e^(−y) (r + Σ y^(a−1)/Γ(a)) over a = k/2, k/2 − 1, … down to 1 or 3/2, where r is
//! 0 for even k and erfcx(√y) for odd k (Abramowitz and Stegun, 26.4.4-5).

use std::f64::consts::PI;

use puruspe::erfcx;

use super::normal::two_sided_threshold;

/// ln Q(x; k) and the hazard, −d ln Q/dy with y = x/2.
fn log_upper_tail(y: f64, dof: usize) -> (f64, f64) {
    // All values are relative to the top term y^(k/2−1)/Γ(k/2), which is the density of y without e^(−y).
    let half = dof as f64 / 2.0;
    let (mut sum, mut term, mut a) = (0.0, 1.0, half);
    let mut log_gamma = 0.0;
    while a >= 1.0 {
        sum += term;
        a -= 1.0;
        term *= a / y;
        if a > 0.0 {
            log_gamma += a.ln();
        }
    }
    if dof % 2 == 1 {
        log_gamma += 0.5 * PI.ln();
        sum += (erfcx(y.sqrt()).ln() - (half - 1.0) * y.ln() + log_gamma).exp();
    }
    (sum.ln() + (half - 1.0) * y.ln() - log_gamma - y, 1.0 / sum)
}

/// Probability that a chi-square variable with `dof` ≥ 1 degrees of freedom exceeds `value`.
///
/// 1 for a value ≤ 0. NaN for `dof` = 0 and for a NaN value.
pub fn chi_square_upper_tail(value: f64, dof: usize) -> f64 {
    if dof == 0 || value.is_nan() {
        f64::NAN
    } else if value <= 0.0 {
        1.0
    } else if value.is_infinite() {
        0.0
    } else {
        log_upper_tail(value / 2.0, dof).0.exp().min(1.0)
    }
}

/// The threshold χ²(1 − P_fa, dof) that a chi-square variable exceeds with probability
/// `false_alarm_probability`, relative error below 1e-14 for dof ≤ 40.
///
/// NaN without a degree of freedom or for a probability outside of (0, 1).
pub fn chi_square_threshold(false_alarm_probability: f64, dof: usize) -> f64 {
    if dof == 0 || !(f64::MIN_POSITIVE..1.0).contains(&false_alarm_probability) {
        return f64::NAN;
    }
    if dof == 1 {
        return two_sided_threshold(false_alarm_probability).powi(2);
    }
    let target = false_alarm_probability.ln();
    // ln Q is concave and falling (dof ≥ 2). From the left of the root a Newton step leads to the root or to its right, and from
    // there it converges without overshooting; a step that would leave y > 0 is halved instead.
    let mut y = dof as f64 / 2.0;
    for _ in 0..200 {
        let (log_tail, hazard) = log_upper_tail(y, dof);
        let next = (y + (log_tail - target) / hazard).max(y / 2.0);
        let converged = (next - y).abs() <= 4.0 * f64::EPSILON * y;
        y = next;
        if converged {
            break;
        }
    }
    2.0 * y
}

/// Number of degrees of freedom with a stored threshold in [`ChiSquareThresholds`].
const TABULATED: usize = 64;

/// Thresholds of one false-alarm probability, computed once for up to 64 degrees of freedom.
#[derive(Clone, Debug, PartialEq)]
pub struct ChiSquareThresholds {
    false_alarm_probability: f64,
    thresholds: [f64; TABULATED],
}

impl ChiSquareThresholds {
    /// The table for a false-alarm probability in (0, 1).
    pub fn new(false_alarm_probability: f64) -> Self {
        let thresholds =
            std::array::from_fn(|index| chi_square_threshold(false_alarm_probability, index + 1));
        Self { false_alarm_probability, thresholds }
    }

    /// The false-alarm probability.
    pub const fn false_alarm_probability(&self) -> f64 {
        self.false_alarm_probability
    }

    /// Threshold for `dof` degrees of freedom, computed if beyond the table. NaN for `dof` = 0.
    pub fn threshold(&self, dof: usize) -> f64 {
        dof.checked_sub(1)
            .and_then(|index| self.thresholds.get(index).copied())
            .unwrap_or_else(|| chi_square_threshold(self.false_alarm_probability, dof))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_degrees_of_freedom_are_exponential() {
        for probability in [0.999, 0.5, 1e-3, 1e-7, 1e-30, 1e-300] {
            let expected = -2.0 * f64::ln(probability);
            assert!((chi_square_threshold(probability, 2) / expected - 1.0).abs() < 1e-13, "{probability}");
        }
    }

    #[test]
    fn threshold_and_tail_are_inverse() {
        for dof in (1..=300).chain([2_000]) {
            for probability in [0.9, 0.5, 1e-2, 1e-7, 1e-12] {
                let threshold = chi_square_threshold(probability, dof);
                let back = chi_square_upper_tail(threshold, dof);
                assert!((back / probability - 1.0).abs() < 1e-9, "{dof} {probability} {threshold} {back}");
            }
        }
    }

    #[test]
    fn table_agrees_and_falls_back() {
        let table = ChiSquareThresholds::new(1e-5);
        for dof in 1..=80 {
            assert_eq!(table.threshold(dof), chi_square_threshold(1e-5, dof));
        }
        assert!(table.threshold(0).is_nan());
    }

    #[test]
    fn limits() {
        assert_eq!(chi_square_upper_tail(0.0, 3), 1.0);
        assert_eq!(chi_square_upper_tail(f64::INFINITY, 3), 0.0);
        assert!(chi_square_upper_tail(1.0, 0).is_nan());
        assert!(chi_square_threshold(0.0, 3).is_nan() && chi_square_threshold(1.0, 3).is_nan());
    }
}
