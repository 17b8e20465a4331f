//! A Gaussian state that constraints change.

use nalgebra::{DMatrix, DMatrixView, DVector, Matrix3, Matrix3xX, Vector3};

use super::SkipReason;
use super::local::{Local, Site};
use super::rows::Placed;

/// Number of states from which changes of the covariance are collected, and applied together as one product.
const LARGE: usize = 48;
/// Number of changes that are collected.
const COLLECTED: usize = 8;
/// Number of columns in a block of the covariance, whose rows begin at the diagonal.
const BLOCK: usize = 48;

/// A Gaussian state with sites. While constraints are applied only the lower triangle of its covariance is kept.
pub(super) struct Posterior {
    pub(super) state: DVector<f64>,
    pub(super) covariance: DMatrix<f64>,
    /// State and covariance without sites.
    prior: (DVector<f64>, DMatrix<f64>),
    /// Whether a site was removed from the covariance, which loses digits.
    has_removed: bool,
    has_changed: bool,
    /// PJᵀ of the constraint's vector.
    columns: [Vec<f64>; 3],
    /// PJᵀM.
    scaled: [Vec<f64>; 3],
    pending: Pending,
}

/// Changes of the covariance that are not in it yet: the columns PJᵀM and PJᵀ of several constraints.
#[derive(Default)]
struct Pending {
    scaled: Vec<f64>,
    columns: Vec<f64>,
}

impl Pending {
    /// The columns as matrices of n rows.
    fn matrices(&self, n: usize) -> (DMatrixView<'_, f64>, DMatrixView<'_, f64>) {
        let of = |values| DMatrixView::from_slice(values, n, self.columns.len() / n.max(1));
        (of(&self.scaled), of(&self.columns))
    }

    /// The rows of a constraint's vector in both matrices.
    fn rows(&self, placed: &Placed, n: usize) -> (Matrix3xX<f64>, Matrix3xX<f64>) {
        let (scaled, columns) = self.matrices(n);
        let rows = |matrix: DMatrixView<'_, f64>| {
            let mut rows = Matrix3xX::zeros(matrix.ncols());
            for (offset, factor) in placed.iter() {
                rows += matrix.fixed_rows::<3>(offset) * factor;
            }
            rows
        };
        (rows(scaled), rows(columns))
    }
}

impl Posterior {
    /// A posterior without sites.
    pub(super) fn new(state: DVector<f64>, covariance: DMatrix<f64>) -> Self {
        Self {
            prior: (state.clone(), covariance.clone()),
            state,
            covariance,
            has_removed: false,
            has_changed: false,
            columns: Default::default(),
            scaled: Default::default(),
            pending: Pending::default(),
        }
    }

    /// The present distribution of a constraint's vector.
    pub(super) fn local(&self, placed: &Placed) -> Local {
        let mut covariance = placed.covariance(&self.covariance);
        if !self.pending.columns.is_empty() {
            let (scaled, columns) = self.pending.rows(placed, self.state.len());
            let change: Matrix3<f64> = scaled * columns.transpose();
            covariance += (change + change.transpose()) * 0.5;
        }
        Local::new(placed.mean(&self.state), covariance)
    }

    /// Changes the state as a constraint changed its vector.
    ///
    /// # Errors
    /// [`SkipReason::NotFinite`] if the covariance with the vector is not finite; the state stays as it is.
    pub(super) fn follow(&mut self, local: &Local, placed: &Placed) -> Result<(), SkipReason> {
        if !local.has_changed {
            return Ok(());
        }
        placed.columns(&self.covariance, &mut self.columns);
        self.add_pending(placed);
        if !self.columns.iter().flatten().all(|element| element.is_finite()) {
            return Err(SkipReason::NotFinite);
        }
        self.has_removed |= local.has_removed;
        self.has_changed = true;
        let [a, b, c] = &self.columns;
        for ((value, a), (b, c)) in self.state.iter_mut().zip(a).zip(b.iter().zip(c)) {
            *value += local.step.x * a + local.step.y * b + local.step.z * c;
        }
        for (axis, scaled) in self.scaled.iter_mut().enumerate() {
            let m = local.change.column(axis);
            scaled.clear();
            scaled.extend(a.iter().zip(b.iter().zip(c)).map(|(a, (b, c))| m.x * a + m.y * b + m.z * c));
        }
        if self.state.len() < LARGE {
            self.add_products();
            return Ok(());
        }
        self.pending.columns.extend(self.columns.iter().flatten());
        self.pending.scaled.extend(self.scaled.iter().flatten());
        if self.pending.columns.len() >= 3 * COLLECTED * self.state.len() {
            self.add_collected();
        }
        Ok(())
    }

    /// Adds the collected changes to the columns of a constraint's vector.
    fn add_pending(&mut self, placed: &Placed) {
        if self.pending.columns.is_empty() {
            return;
        }
        let n = self.state.len();
        let (_, rows) = self.pending.rows(placed, n);
        for (change, factors) in self.pending.scaled.chunks_exact(n).zip(rows.column_iter()) {
            for (column, factor) in self.columns.iter_mut().zip(factors.iter()) {
                for (value, change) in column.iter_mut().zip(change) {
                    *value += factor * change;
                }
            }
        }
    }

    /// Applies the collected changes to the lower triangle. Above the diagonal, which is not read, blocks are changed in part.
    fn add_collected(&mut self) {
        if self.pending.columns.is_empty() {
            return;
        }
        let n = self.state.len();
        let (scaled, columns) = self.pending.matrices(n);
        for start in (0..n).step_by(BLOCK) {
            let (rows, width) = (n - start, BLOCK.min(n - start));
            let factors = columns.rows(start, width).transpose();
            let mut block = self.covariance.view_mut((start, start), (rows, width));
            block.gemm(1.0, &scaled.rows(start, rows), &factors, 1.0);
        }
        self.pending = Pending::default();
    }

    /// P ← P + (PJᵀM)(PJᵀ)ᵀ in the lower triangle.
    fn add_products(&mut self) {
        let n = self.state.len();
        let ([a, b, c], [u, v, w]) = (&self.columns, &self.scaled);
        for (place, column) in self.covariance.as_mut_slice().chunks_exact_mut(n.max(1)).enumerate() {
            let factors = Vector3::new(a[place], b[place], c[place]);
            let below = column[place..].iter_mut().zip(&u[place..]).zip(v[place..].iter().zip(&w[place..]));
            for ((value, u), (v, w)) in below {
                *value += u * factors.x + v * factors.y + w * factors.z;
            }
        }
    }

    /// Recomputes the state from the prior and all present sites, each applied once, without the rounding errors of removed sites. Every
    /// step reduces the covariance, so it stays positive definite.
    pub(super) fn rebuild<'s>(
        &mut self,
        constraints: impl Iterator<Item = (&'s Placed, &'s [Option<Site>; 3])>,
    ) {
        if !self.has_removed {
            return;
        }
        self.pending = Pending::default();
        self.state.copy_from(&self.prior.0);
        self.covariance.copy_from(&self.prior.1);
        for (placed, sites) in constraints {
            let mut local = self.local(placed);
            sites.iter().flatten().for_each(|site| local.add(site));
            // A step that is not finite is left out; the state is then that without this constraint.
            let _ = self.follow(&local, placed);
        }
    }

    /// Makes the covariance whole again.
    pub(super) fn finish(&mut self) {
        self.add_collected();
        if self.has_changed {
            self.covariance.fill_upper_triangle_with_lower_triangle();
        }
    }
}
