//! Distributions against values of 50 digits (mpmath) and scipy.

mod oracle;

use cofix_common::statistics::normal::two_sided_threshold;
use cofix_common::statistics::{chi_square_threshold, chi_square_upper_tail, truncated_moments};

/// |value/reference − 1|, or the absolute difference for references below what a double resolves here.
fn error(value: f64, reference: f64) -> f64 {
    if reference.abs() < 1e-300 { (value - reference).abs() } else { (value / reference - 1.0).abs() }
}

#[test]
#[ignore = "needs the reference data"]
fn truncated_normal() {
    let rows = oracle::rows("truncated_normal.csv");
    assert!(rows.len() > 480, "{}", rows.len());
    let mut worst = [0.0f64; 3];
    for row in rows {
        let moments = truncated_moments(row[0], row[1]).unwrap();
        let errors = [
            error(moments.log_probability, row[2]),
            error(moments.mean, row[3]),
            error(moments.variance, row[4]),
        ];
        assert!(errors.iter().all(|error| *error < 1e-13), "{row:?}: {moments:?} {errors:?}");
        for (worst, error) in worst.iter_mut().zip(errors) {
            *worst = worst.max(error);
        }
    }
    println!(
        "worst relative error: log probability {:e}, mean {:e}, variance {:e}",
        worst[0], worst[1], worst[2]
    );
}

#[test]
#[ignore = "needs the reference data"]
fn chi_square() {
    let rows = oracle::rows("chi2.csv");
    assert!(rows.len() >= 400, "{}", rows.len());
    let mut worst = 0f64;
    for row in rows {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 1-40
        let dof = row[0] as usize;
        let threshold = chi_square_threshold(row[1], dof);
        worst = worst.max(error(threshold, row[2]));
        assert!(error(threshold, row[2]) < 1e-14, "{row:?}: {threshold}");
        assert!(error(chi_square_upper_tail(row[2], dof), row[1]) < 1e-11, "{row:?}");
        if dof == 1 {
            assert!(error(two_sided_threshold(row[1]), row[3]) < 1e-13, "{row:?}");
        }
    }
    println!("worst relative error of a threshold: {worst:e}");
}
