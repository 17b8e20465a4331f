//! Quantiles of any number of values.

use std::collections::BTreeMap;

use serde::Serialize;

/// Values below the first and NaN count as zero; those above the last as the last.
const LIMITS: (f64, f64) = (1e-6, 1e9);

/// Counts values to three significant digits, which are 13,500 different ones at most.
#[derive(Clone, Debug, Default)]
pub struct Quantiles {
    /// By power of ten and digits, 100 to 1000.
    counts: BTreeMap<(i32, i32), u64>,
    total: u64,
}

/// A median and the 90th percentile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Typical {
    /// Median.
    pub median: f64,
    /// 90th percentile.
    pub p90: f64,
}

impl Quantiles {
    /// Counts the magnitude of a value.
    pub fn add(&mut self, value: f64) {
        self.total += 1;
        *self.counts.entry(digits(value)).or_default() += 1;
    }

    /// Number of values.
    pub const fn count(&self) -> u64 {
        self.total
    }

    /// Median and 90th percentile; `None` without values.
    pub fn typical(&self) -> Option<Typical> {
        Some(Typical { median: self.at(0.5)?, p90: self.at(0.9)? })
    }

    /// The smallest value that this share of all does not exceed.
    fn at(&self, share: f64) -> Option<f64> {
        let enough = share * self.total as f64;
        let mut below = 0;
        self.counts.iter().find_map(|((power, digits), count)| {
            below += count;
            (below as f64 >= enough).then(|| value(*power, *digits))
        })
    }
}

/// Power of ten, and three digits.
fn digits(value: f64) -> (i32, i32) {
    let size = value.abs();
    if size.is_nan() || size < LIMITS.0 {
        return (i32::MIN, 0);
    }
    let size = size.min(LIMITS.1);
    #[allow(clippy::cast_possible_truncation)] // within the limits
    let power = size.log10().floor() as i32;
    #[allow(clippy::cast_possible_truncation)]
    let digits = (size * 10_f64.powi(2 - power)).round() as i32;
    (power, digits)
}

fn value(power: i32, digits: i32) -> f64 {
    let digits = f64::from(digits);
    if digits == 0.0 {
        0.0
    } else if power < 2 {
        digits / 10_f64.powi(2 - power)
    } else {
        digits * 10_f64.powi(power - 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_tenths() {
        let mut quantiles = Quantiles::default();
        assert_eq!(quantiles.typical(), None);
        // 0.05 to 4.95 m.
        (0..50).for_each(|i| quantiles.add(0.05 + 0.1 * f64::from(i)));
        assert_eq!(quantiles.typical(), Some(Typical { median: 2.45, p90: 4.45 }));
        assert_eq!(quantiles.count(), 50);
    }

    #[test]
    fn any_value_has_a_place_and_three_digits_of_it_stay() {
        for (given, kept) in [
            (0.0, 0.0),
            (f64::NAN, 0.0),
            (-4.2366, 4.24),
            (0.001_234_6, 0.001_23),
            (0.9996, 1.0),
            (1000.0, 1000.0),
            (123_456.0, 123_000.0),
            (f64::INFINITY, 1e9),
        ] {
            let mut quantiles = Quantiles::default();
            quantiles.add(given);
            assert_eq!(quantiles.typical().unwrap().median, kept, "{given}");
        }
    }
}
