//! The second covariance of a state under the gains of its constraints.
//!
//! The sites of the constraints, rows C with precisions T, change the error e of a state with covariance P to
//!
//! ```text
//! e ← e − W(Ce + η)        W = PCᵀ(CPCᵀ + T⁻¹)⁻¹        η ~ N(0, T⁻¹)
//! ```
//!
//! If the errors really have the covariance P₂ (see [`crate::filter::SharedErrors`]), the result has P₂ − WDᵀ − DWᵀ + WYWᵀ with D = P₂Cᵀ and
//! Y = CP₂Cᵀ + T⁻¹.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::rows::SparseRow;

/// A row with the precision of its Gaussian factor.
#[derive(Clone, Copy, Debug)]
pub struct AppliedRow {
    /// The row.
    pub row: SparseRow,
    /// Precision of its site, in the inverse square of the row's unit.
    pub precision: f64,
}

/// Carries a second covariance through the rows that were applied to a state with the covariance `first` before them. Without a valid result it
/// stays as it is, which is an upper bound.
pub fn carry(first: &DMatrix<f64>, applied: &[AppliedRow], second: &mut DMatrix<f64>) {
    let acting: Vec<&AppliedRow> = applied.iter().filter(|applied| applied.precision > 0.0).collect();
    let (n, m) = (first.nrows(), acting.len());
    if m == 0 || second.shape() != first.shape() {
        return;
    }
    let (mut cross, mut d) = (DMatrix::zeros(n, m), DMatrix::zeros(n, m));
    let mut product = DVector::zeros(n);
    for (column, applied) in acting.iter().enumerate() {
        applied.row.covariance_times(first, &mut product);
        cross.set_column(column, &product);
        applied.row.covariance_times(second, &mut product);
        d.set_column(column, &product);
    }
    let with_noise = |columns: &DMatrix<f64>| {
        DMatrix::from_fn(m, m, |i, j| {
            let product: f64 = acting[i].row.iter().map(|(offset, value)| value * columns[(offset, j)]).sum();
            if i == j { product + 1.0 / acting[i].precision } else { product }
        })
    };
    let Some(factor) = Cholesky::new(with_noise(&cross)) else { return };
    // W = cross · S⁻¹, P₂ ← P₂ − W(D − ½WY)ᵀ − (D − ½WY)Wᵀ
    let w = factor.solve(&cross.transpose()).transpose();
    let half = d.clone() - (&w * with_noise(&d)) * 0.5;
    second.gemm(-1.0, &w, &half.transpose(), 1.0);
    second.gemm(-1.0, &half, &w.transpose(), 1.0);
    second.fill_upper_triangle_with_lower_triangle();
}
