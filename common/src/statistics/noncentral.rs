//! Noncentral chi-square with an integer number of degrees of freedom: what a test sees of a fault.

use std::sync::OnceLock;

use super::chi_square::{chi_square_threshold, chi_square_upper_tail};

/// Weight of the Poisson mixture from which on its terms are left out.
const NEGLIGIBLE: f64 = 1e-18;
/// Its terms begin so many standard deviations below its mean.
const SPREAD: f64 = 10.0;
/// Relative precision of a detectable noncentrality.
const PRECISION: f64 = 1e-12;
/// Number of degrees of freedom with a stored noncentrality in [`DetectableNoncentrality`].
const TABULATED: usize = 64;

/// Probability that a chi-square variable with `dof` ≥ 1 degrees of freedom and this noncentrality λ exceeds `value`:
/// Σ_j e^(−λ/2) (λ/2)^j/j! · Q(value; dof + 2j) (Johnson, Kotz and Balakrishnan 1995, 29.3).
///
/// NaN for `dof` = 0, a negative or infinite noncentrality, and a NaN argument.
pub fn noncentral_upper_tail(value: f64, dof: usize, noncentrality: f64) -> f64 {
    if dof == 0 || value.is_nan() || !(0.0..f64::INFINITY).contains(&noncentrality) {
        return f64::NAN;
    }
    if value <= 0.0 {
        return 1.0;
    }
    let (half, y) = (noncentrality / 2.0, value / 2.0);
    // The weights are largest about λ/2; what is further below it than this does not count.
    let first = (half - SPREAD * half.sqrt() - SPREAD).max(0.0).floor();
    let mut weight = if half > 0.0 { (first * half.ln() - half - log_factorial(first)).exp() } else { 1.0 };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not negative, and finite
    let mut tail = chi_square_upper_tail(value, dof + 2 * first as usize);
    // Q(x; k + 2) = Q(x; k) + y^a e^(−y)/Γ(a + 1) with y = x/2 and a = k/2.
    let mut a = dof as f64 / 2.0 + first;
    let mut more = (a * y.ln() - y - log_factorial(a)).exp();
    let (mut sum, mut j) = (0.0, first);
    loop {
        sum += weight * tail;
        tail += more;
        a += 1.0;
        j += 1.0;
        more *= y / a;
        weight *= half / j;
        if j > half && weight < NEGLIGIBLE {
            return sum.min(1.0);
        }
    }
}

/// ln Γ(j + 1), by Stirling's series from 16 on.
fn log_factorial(j: f64) -> f64 {
    let x = j + 1.0;
    let shift = (16.0 - x).max(0.0).ceil();
    let far = x + shift;
    let series = (1.0 / 12.0 - (1.0 / 360.0 - 1.0 / (1_260.0 * far * far)) / (far * far)) / far;
    let log_gamma = (far - 0.5) * far.ln() - far + 0.5 * (2.0 * std::f64::consts::PI).ln() + series;
    let mut product = 1.0;
    let mut factor = x;
    while factor < far {
        product *= factor;
        factor += 1.0;
    }
    log_gamma - product.ln()
}

/// Noncentrality that a test with these probabilities of false alarm and of missed detection detects.
///
/// NaN without a degree of freedom or for probabilities outside of (0, 1). Zero if the test misses that rarely without any fault.
pub fn detectable_noncentrality(false_alarm: f64, missed_detection: f64, dof: usize) -> f64 {
    let threshold = chi_square_threshold(false_alarm, dof);
    if threshold.is_nan() || !(f64::MIN_POSITIVE..1.0).contains(&missed_detection) {
        return f64::NAN;
    }
    let is_detected =
        |noncentrality: f64| noncentral_upper_tail(threshold, dof, noncentrality) >= 1.0 - missed_detection;
    let (mut low, mut high) = (0.0, threshold.max(1.0));
    if is_detected(low) {
        return 0.0;
    }
    while !is_detected(high) {
        high *= 2.0;
    }
    while high - low > PRECISION * high {
        let middle = 0.5 * (low + high);
        if is_detected(middle) { high = middle } else { low = middle }
    }
    high
}

/// Detectable noncentralities of one pair of probabilities. Each is computed once, for up to 64 degrees of freedom.
#[derive(Clone, Debug)]
pub struct DetectableNoncentrality {
    false_alarm: f64,
    missed_detection: f64,
    values: [OnceLock<f64>; TABULATED],
}

impl DetectableNoncentrality {
    /// For probabilities in (0, 1).
    pub const fn new(false_alarm: f64, missed_detection: f64) -> Self {
        Self { false_alarm, missed_detection, values: [const { OnceLock::new() }; TABULATED] }
    }

    /// Probability of missed detection.
    pub const fn missed_detection(&self) -> f64 {
        self.missed_detection
    }

    /// Noncentrality for `dof` degrees of freedom, computed if beyond the table. NaN for `dof` = 0.
    pub fn value(&self, dof: usize) -> f64 {
        let compute = || detectable_noncentrality(self.false_alarm, self.missed_detection, dof);
        match dof.checked_sub(1).and_then(|index| self.values.get(index)) {
            Some(known) => *known.get_or_init(compute),
            None => compute(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::normal::upper_tail;

    /// A squared normal variable with mean μ exceeds t² with probability Q(t − μ) + Q(t + μ).
    #[test]
    fn one_degree_of_freedom_is_a_squared_normal_variable() {
        for (mean, root) in [(0.0, 1.0), (0.5, 2.0), (3.0, 1.0), (5.0, 8.0), (30.0, 33.0), (60.0, 55.0)] {
            let expected = upper_tail(root - mean) + upper_tail(root + mean);
            let ours = noncentral_upper_tail(root * root, 1, mean * mean);
            assert!((ours / expected - 1.0).abs() < 1e-9, "{mean} {root}: {ours} {expected}");
        }
    }

    /// With three degrees of freedom (Johnson, Kotz and Balakrishnan 1995, 29.5, by parts): one more than with one,
    /// (φ(t − μ) − φ(t + μ))/μ.
    #[test]
    fn three_degrees_of_freedom_have_a_closed_form_too() {
        use crate::statistics::normal::pdf;
        for (mean, root) in [(0.5, 2.0), (3.0, 1.0), (5.0, 8.0), (20.0, 22.0)] {
            let one = upper_tail(root - mean) + upper_tail(root + mean);
            let expected = one + (pdf(root - mean) - pdf(root + mean)) / mean;
            let ours = noncentral_upper_tail(root * root, 3, mean * mean);
            assert!((ours / expected - 1.0).abs() < 1e-9, "{mean} {root}: {ours} {expected}");
        }
    }

    #[test]
    fn the_detectable_noncentrality_is_detected_as_often_as_set() {
        for dof in [1, 2, 7, 30, 100] {
            for (false_alarm, missed) in [(1e-3, 1e-3), (1e-5, 0.2), (0.05, 1e-7)] {
                let noncentrality = detectable_noncentrality(false_alarm, missed, dof);
                let tail = noncentral_upper_tail(chi_square_threshold(false_alarm, dof), dof, noncentrality);
                assert!((1.0 - tail - missed).abs() < 1e-9, "{dof} {false_alarm} {missed}: {noncentrality}");
            }
        }
        // A geodesist's number: significance 0.1 %, power 80 %, one degree of freedom (Baarda 1968).
        assert!((detectable_noncentrality(1e-3, 0.2, 1).sqrt() - 4.13).abs() < 0.01);
        let table = DetectableNoncentrality::new(1e-3, 0.2);
        assert_eq!(table.value(3), detectable_noncentrality(1e-3, 0.2, 3));
        assert_eq!(table.value(80), detectable_noncentrality(1e-3, 0.2, 80));
        assert!(table.value(0).is_nan() && noncentral_upper_tail(1.0, 0, 1.0).is_nan());
    }
}
