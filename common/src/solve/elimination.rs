//! Linear models y = hᵀx + c_g + ε with one white clock c_g per group and exact elimination of the clocks.
//!
//! For weights w and group means h̄_g = Σwh/Σw, ȳ_g = Σwy/Σw, the Schur complement of the clocks in the normal matrix
//! is Σ_g Σ_i w (h − h̄_g)(h − h̄_g)ᵀ: differences against the weighted mean, with the correct covariance.

use nalgebra::{Cholesky, Matrix3, U3, Vector3};

/// Information below this fraction of the rows' total is rounding error.
const NEGLIGIBLE: f64 = 1e-12;

/// One measurement of a three-component unknown and a clock.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    /// Partial derivatives with respect to the unknown.
    pub h: Vector3<f64>,
    /// Index of the clock.
    pub group: usize,
    /// Observed minus computed.
    pub y: f64,
    /// 1/σ².
    pub weight: f64,
}

/// Normal equations with eliminated clocks.
#[derive(Clone, Debug)]
pub(crate) struct Eliminated {
    /// Normal matrix of the unknown.
    pub normal: Matrix3<f64>,
    /// Right-hand side of the unknown.
    pub rhs: Vector3<f64>,
    /// Elements of the normal matrix below this are rounding errors.
    pub floor: f64,
    groups: Vec<GroupMean>,
}

#[derive(Clone, Copy, Debug, Default)]
struct GroupMean {
    weight: f64,
    h: Vector3<f64>,
    y: f64,
}

impl Eliminated {
    /// Eliminates the clocks of `rows`, whose groups are 0..`group_count`.
    pub fn new(rows: &[Row], group_count: usize) -> Self {
        let groups = group_means(rows, group_count);
        let (mut normal, mut rhs) = (Matrix3::zeros(), Vector3::zeros());
        let mut floor = 0.0;
        for row in rows {
            let mean = &groups[row.group];
            let h = row.h - mean.h;
            let wh = h * row.weight;
            normal.ger(1.0, &wh, &h, 1.0);
            rhs.axpy(row.y - mean.y, &wh, 1.0);
            floor += NEGLIGIBLE * row.weight * row.h.norm_squared();
        }
        Self { normal, rhs, floor, groups }
    }

    /// Cholesky factor of the normal matrix; `None` for a singular geometry.
    pub fn factor(&self) -> Option<Cholesky<f64, U3>> {
        let factor = Cholesky::new(self.normal)?;
        let smallest = factor.l_dirty().diagonal().min();
        (smallest * smallest > self.floor).then_some(factor)
    }

    /// Clock of a group for a given solution.
    pub fn clock(&self, group: usize, x: &Vector3<f64>) -> f64 {
        self.groups.get(group).map_or(0.0, |mean| mean.y - mean.h.dot(x))
    }

    /// Partial derivatives of a row less the mean of its group.
    pub fn centred(&self, row: &Row) -> Vector3<f64> {
        row.h - self.groups[row.group].h
    }

    /// Weighted mean of the partial derivatives of a group.
    pub fn mean(&self, group: usize) -> Vector3<f64> {
        self.groups.get(group).map_or_else(Vector3::zeros, |mean| mean.h)
    }

    /// Sum of the weights of a group.
    pub fn group_weight(&self, group: usize) -> f64 {
        self.groups.get(group).map_or(0.0, |mean| mean.weight)
    }
}

fn group_means(rows: &[Row], group_count: usize) -> Vec<GroupMean> {
    let mut groups = vec![GroupMean::default(); group_count];
    for row in rows {
        let mean = &mut groups[row.group];
        mean.weight += row.weight;
        mean.h.axpy(row.weight, &row.h, 1.0);
        mean.y += row.weight * row.y;
    }
    for mean in groups.iter_mut().filter(|mean| mean.weight > 0.0) {
        mean.h /= mean.weight;
        mean.y /= mean.weight;
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn elimination_equals_the_full_least_squares() {
        let rows: Vec<Row> = (0..9_u8)
            .map(|i| {
                let t = f64::from(i);
                Row {
                    h: Vector3::new(t.sin(), (1.7 * t).cos(), (0.3 * t * t).sin()),
                    group: usize::from(i % 3 == 0),
                    y: (t * 2.1).sin() * 5.0,
                    weight: 0.5 + f64::from(i % 4),
                }
            })
            .collect();
        let design = DMatrix::from_fn(9, 5, |i, j| match j {
            0..=2 => rows[i].h[j],
            _ => f64::from(u8::from(rows[i].group == j - 3)),
        });
        let weights = DMatrix::from_diagonal(&DVector::from_iterator(9, rows.iter().map(|r| r.weight)));
        let y = DVector::from_iterator(9, rows.iter().map(|r| r.y));
        let normal = design.transpose() * &weights * &design;
        let full = normal.clone().cholesky().unwrap().solve(&(design.transpose() * &weights * y));
        let eliminated = Eliminated::new(&rows, 2);
        let factor = eliminated.factor().unwrap();
        let x = factor.solve(&eliminated.rhs);
        assert!((x - full.fixed_rows::<3>(0)).norm() < 1e-12);
        assert!((eliminated.clock(0, &x) - full[3]).abs() < 1e-12);
        assert!((eliminated.clock(1, &x) - full[4]).abs() < 1e-12);
        let covariance = normal.cholesky().unwrap().inverse();
        assert!((factor.inverse() - covariance.fixed_view::<3, 3>(0, 0)).norm() < 1e-12);
    }

    #[test]
    fn a_plane_of_directions_is_singular() {
        let rows: Vec<Row> = (0..6_u8)
            .map(|i| Row {
                h: Vector3::new(f64::from(i).sin(), f64::from(i).cos(), 0.0),
                group: 0,
                y: 0.0,
                weight: 1.0,
            })
            .collect();
        assert!(Eliminated::new(&rows, 1).factor().is_none());
    }
}
