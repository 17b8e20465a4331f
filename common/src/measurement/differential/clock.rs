//! Common part of the signals of one constellation and band at a base, and detection of outliers.

/// Minimum number of values for the detection of outliers.
const FEWEST_TO_JUDGE: usize = 4;
/// Ratio of standard deviation to median absolute deviation for a normal distribution.
const MAD_TO_SIGMA: f64 = 1.482_602_218_505_602;

/// A value and its expected standard deviation.
pub(super) type Value = (f64, f64);

/// Weighted mean of the values without outliers, and a flag per value for outliers. An outlier differs from the median by more than `limit`
/// times its standard deviation, which is scaled up if the values scatter more than expected. `None` without values.
pub(super) fn mean_and_outliers(values: &[Value], limit: f64) -> Option<(f64, Vec<bool>)> {
    let centre = median(values.iter().map(|(value, _)| *value).collect())?;
    let standardised: Vec<f64> =
        values.iter().map(|(value, sigma)| ((value - centre) / sigma).abs()).collect();
    let scatter = (MAD_TO_SIGMA * median(standardised.clone())?).max(1.0);
    let judged = values.len() >= FEWEST_TO_JUDGE;
    let outliers: Vec<bool> = standardised.iter().map(|z| judged && *z > limit * scatter).collect();
    let (mut sum, mut weights) = (0.0, 0.0);
    for ((value, sigma), _) in values.iter().zip(&outliers).filter(|(_, is_outlier)| !**is_outlier) {
        let weight = sigma.powi(-2);
        sum += weight * (value - centre);
        weights += weight;
    }
    let mean = centre + sum / weights;
    mean.is_finite().then_some((mean, outliers))
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let upper = *values.get(values.len() / 2)?;
    let lower = *values.get((values.len() - 1) / 2)?;
    Some(f64::midpoint(lower, upper))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_is_of_those_that_agree() {
        let values = [(10.0, 1.0), (11.0, 1.0), (9.0, 1.0), (10.5, 2.0), (60.0, 1.0)];
        let (mean, outliers) = mean_and_outliers(&values, 5.0).unwrap();
        assert_eq!(outliers, [false, false, false, false, true]);
        assert!((mean - (30.0 + 10.5 / 4.0) / 3.25).abs() < 1e-12);
        let (mean, outliers) = mean_and_outliers(&values[1..3], 5.0).unwrap();
        assert_eq!((mean, outliers), (10.0, vec![false, false]));
        assert_eq!(mean_and_outliers(&[], 5.0), None);
        assert_eq!(mean_and_outliers(&[(f64::NAN, 1.0)], 5.0), None);
    }

    #[test]
    fn values_that_scatter_widely_are_no_outliers() {
        let values = [(-30.0, 1.0), (-10.0, 1.0), (0.0, 1.0), (12.0, 1.0), (33.0, 1.0)];
        assert!(!mean_and_outliers(&values, 5.0).unwrap().1.contains(&true));
    }

    #[test]
    fn three_values_are_not_judged() {
        let values = [(0.0, 1.0), (0.1, 1.0), (100.0, 1.0)];
        assert!(!mean_and_outliers(&values, 5.0).unwrap().1.contains(&true));
    }
}
