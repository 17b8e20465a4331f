//! A Gaussian state that constraints change.

use nalgebra::{DMatrix, DVector, Vector3};

use super::SkipReason;
use super::local::{Local, Site};
use super::rows::Placed;

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
        }
    }

    /// The present distribution of a constraint's vector.
    pub(super) fn local(&self, placed: &Placed) -> Local {
        Local::new(placed.mean(&self.state), placed.covariance(&self.covariance))
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
        self.add_products();
        Ok(())
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
        if self.has_changed {
            self.covariance.fill_upper_triangle_with_lower_triangle();
        }
    }
}
