//! Information of one epoch about the states of one phone, with the receiver clock eliminated and the rows compressed.
//!
//! Rows y = hᵀx + c + ε have h in three position (or velocity) states and, for code, one state of the clock group's bias; c is one white clock
//! of the whole receiver. With weights w and the mean h̄ = Σwh/Σw the information without the clock is (A, b), A = Σw h̃h̃ᵀ, h̃ = h − h̄. With
//! A = LLᵀ the rows z = L⁻¹b, H = Lᵀ have unit noise, and are at most as many as the states.

use nalgebra::{DMatrix, DVector, Dyn, StorageMut, Vector, Vector3};

/// Information below this fraction of the rows' total is rounding error.
const NEGLIGIBLE: f64 = 1e-12;

/// One measurement of a phone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    /// Partial derivatives with respect to position or velocity.
    pub h: Vector3<f64>,
    /// Partial derivatives with respect to the unknowns after the first three.
    pub other: Other,
    /// Observed minus computed, the predicted bias included.
    pub y: f64,
    /// 1/σ².
    pub weight: f64,
}

/// Partial derivatives with respect to the unknowns after the first three.
#[derive(Clone, Copy, Debug)]
pub(super) enum Other {
    /// None, as for a satellite of the reference group.
    None,
    /// One for the bias at this place.
    Bias(usize),
    /// These with respect to the position at the epoch before.
    Before(Vector3<f64>),
}

/// Compressed rows: z = Hx + noise of unit variance.
#[derive(Clone, Debug)]
pub(super) struct Information {
    /// L, H = Lᵀ; a direction without information has a zero column.
    pub root: DMatrix<f64>,
    /// z.
    pub z: DVector<f64>,
    mean: DVector<f64>,
}

impl Information {
    /// Information about `unknowns` states: three and the others.
    pub fn new(rows: &[Measured], unknowns: usize) -> Self {
        let total: f64 = rows.iter().map(|row| row.weight).sum();
        let (mut mean, mut y_mean) = (DVector::zeros(unknowns), 0.0);
        let mut size = 0.0;
        for row in rows {
            row.add_to(&mut mean, row.weight);
            y_mean += row.weight * row.y;
            size += row.weight * (row.h.norm_squared() + 1.0);
        }
        if total > 0.0 {
            mean /= total;
            y_mean /= total;
        }
        let (mut normal, mut rhs) = (DMatrix::zeros(unknowns, unknowns), DVector::zeros(unknowns));
        let mut centred = DVector::zeros(unknowns);
        for row in rows {
            row.centred(&mean, &mut centred);
            normal.ger(row.weight, &centred, &centred, 1.0);
            rhs.axpy(row.weight * (row.y - y_mean), &centred, 1.0);
        }
        let (root, z) = compress(&normal, &rhs, NEGLIGIBLE * size);
        Self { root, z, mean }
    }

    /// Rows that measure three states themselves.
    pub fn of_values(values: &Vector3<f64>, sigma: f64) -> Self {
        let root = DMatrix::from_diagonal_element(3, 3, sigma.recip());
        Self {
            z: DVector::from_iterator(3, values.iter().map(|value| value / sigma)),
            root,
            mean: DVector::zeros(3),
        }
    }

    /// The states that fit the rows alone; `None` if a direction has no information.
    pub fn solution(&self) -> Option<DVector<f64>> {
        let is_whole = self.root.diagonal().iter().all(|pivot| *pivot > 0.0);
        if is_whole { self.root.transpose().solve_upper_triangular(&self.z) } else { None }
    }

    /// L⁻¹h̃ of a row into `solved`, which has the size of the unknowns; 0 for directions without information.
    pub fn compress(&self, row: &Measured, solved: &mut DVector<f64>) {
        row.centred(&self.mean, solved);
        for j in 0..solved.len() {
            let pivot = self.root[(j, j)];
            let known: f64 = (0..j).map(|k| self.root[(j, k)] * solved[k]).sum();
            solved[j] = if pivot > 0.0 { (solved[j] - known) / pivot } else { 0.0 };
        }
    }
}

impl Measured {
    /// Adds the partial derivatives with respect to all unknowns, times a factor.
    pub fn add_to<S: StorageMut<f64, Dyn>>(&self, sum: &mut Vector<f64, Dyn, S>, factor: f64) {
        for (element, h) in sum.iter_mut().zip(self.h.iter()) {
            *element += factor * h;
        }
        match self.other {
            Other::None => {}
            Other::Bias(place) => sum[3 + place] += factor,
            Other::Before(h) => {
                for (element, h) in sum.iter_mut().skip(3).zip(h.iter()) {
                    *element += factor * h;
                }
            }
        }
    }

    /// The partial derivatives less the mean of all rows.
    pub fn centred(&self, mean: &DVector<f64>, into: &mut DVector<f64>) {
        into.copy_from(mean);
        into.neg_mut();
        self.add_to(into, 1.0);
    }
}

/// L and z = L⁻¹b for A = LLᵀ; a pivot below the floor leaves its direction out.
fn compress(normal: &DMatrix<f64>, rhs: &DVector<f64>, floor: f64) -> (DMatrix<f64>, DVector<f64>) {
    let n = rhs.len();
    let (mut root, mut z) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for j in 0..n {
        let pivot = normal[(j, j)] - (0..j).map(|k: usize| root[(j, k)] * root[(j, k)]).sum::<f64>();
        if pivot.is_nan() || pivot <= floor {
            continue;
        }
        let diagonal = pivot.sqrt();
        root[(j, j)] = diagonal;
        for i in j + 1..n {
            let known: f64 = (0..j).map(|k| root[(i, k)] * root[(j, k)]).sum();
            root[(i, j)] = (normal[(i, j)] - known) / diagonal;
        }
        z[j] = (rhs[j] - (0..j).map(|k| root[(j, k)] * z[k]).sum::<f64>()) / diagonal;
    }
    (root, z)
}
