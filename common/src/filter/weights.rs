//! Robust weights of the rows of one epoch, by their innovations.
//!
//! The weight of an innovation depends on the variances of the measurement and of the prediction. The variances of the clock and of the
//! groups' biases, which are estimated from the same few innovations, are neglected.

use nalgebra::Matrix3;

use super::information::Measured;
use super::options::RobustWeights;

/// Number of reweighting iterations.
const ROUNDS: usize = 3;

/// Multiplies the rows' weights by their robust factors and returns the factors. `prior` is the covariance of the three states. The clock starts from
/// a weighted median, so that one outlier does not shift all rows.
pub(super) fn reweight(rows: &mut [Measured], prior: &Matrix3<f64>, robust: RobustWeights) -> Vec<f64> {
    reweight_delayed(rows, prior, robust, |_| 1.0)
}

/// The same for rows whose errors may be delays: the innovation of row i counts `late(i)` times as large where it is positive.
pub(super) fn reweight_delayed(
    rows: &mut [Measured],
    prior: &Matrix3<f64>,
    robust: RobustWeights,
    late: impl Fn(usize) -> f64,
) -> Vec<f64> {
    let nominal: Vec<f64> = rows.iter().map(|row| row.weight).collect();
    let predicted: Vec<f64> = rows.iter().map(|row| row.h.dot(&(prior * row.h))).collect();
    let mut factors = vec![1.0; rows.len()];
    let mut clock = median(rows.iter().map(|row| (row.y, row.weight)).collect());
    for round in 0..ROUNDS {
        for (i, (row, factor)) in rows.iter_mut().zip(&mut factors).enumerate() {
            let weight = nominal[i];
            let standardised = (row.y - clock) / (1.0 / weight + predicted[i]).sqrt();
            *factor = robust.factor(if standardised > 0.0 { late(i) * standardised } else { standardised });
            row.weight = weight * *factor;
        }
        if round + 1 < ROUNDS {
            clock = mean(rows).unwrap_or(clock);
        }
    }
    factors
}

/// Weighted mean of the innovations; `None` without weight.
pub(super) fn mean(rows: &[Measured]) -> Option<f64> {
    let total: f64 = rows.iter().map(|row| row.weight).sum();
    let sum: f64 = rows.iter().map(|row| row.weight * row.y).sum();
    (total > 0.0).then(|| sum / total)
}

/// Weighted median of values with weights; 0 without values.
pub(super) fn median(mut values: Vec<(f64, f64)>) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = values.iter().map(|v| v.1).sum::<f64>() / 2.0;
    let mut passed = 0.0;
    for (value, weight) in &values {
        passed += weight;
        if passed >= half {
            return *value;
        }
    }
    0.0
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::super::information::Other;
    use super::*;

    /// Reflections only lengthen a path.
    #[test]
    fn a_late_pseudorange_of_a_weak_signal_is_doubted_sooner_than_an_early_one() {
        let row = |y| Measured { h: Vector3::zeros(), other: Other::None, y, weight: 1.0 };
        let factor = |y, late| {
            let mut rows = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, y].map(row);
            reweight_delayed(&mut rows, &Matrix3::zeros(), RobustWeights { keep: 1.0, reject: 5.0 }, |_| late)
                [7]
        };
        assert_eq!(factor(-2.0, 3.0), factor(2.0, 1.0));
        assert!(factor(2.0, 3.0) == 0.0 && factor(1.0, 3.0) < 0.3 && factor(0.9, 1.0) == 1.0);
    }

    /// Four innovations of 0 and three of 1.5 standard deviations have the median 0 and the mean 0.6. About the median the three exceed
    /// one standard deviation; about the mean of the third round they do not.
    #[test]
    fn innovations_are_weighed_about_their_common_mean() {
        let row = |y| Measured { h: Vector3::zeros(), other: Other::None, y, weight: 1.0 };
        let mut rows = [0.0, 0.0, 0.0, 0.0, 1.5, 1.5, 1.5].map(row);
        let factors = reweight(&mut rows, &Matrix3::zeros(), RobustWeights { keep: 1.0, reject: 5.0 });
        assert_eq!(factors, [1.0; 7]);
        assert!(rows.iter().all(|row| row.weight == 1.0));
    }
}
