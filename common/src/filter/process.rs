//! Prediction of one phone: position, velocity and a decaying acceleration driven by white jerk.
//!
//! With the time constant τ of the acceleration, a unit jerk impulse at time s before the end changes the acceleration by g_a = e^(−s/τ),
//! the velocity by g_v = τ(1 − e^(−s/τ)) and the position by g_r = τ²(s/τ − 1 + e^(−s/τ)). So F = [1 Δt g_r(Δt); 0 1 g_v(Δt); 0 0 g_a(Δt)]
//! ⊗ I₃, Peng Eq. 22 as τ → ∞, and the noise of a white jerk of spectral density q is Q_ij = q∫₀^Δt g_i g_j ds. As τ → ∞ that is q·[Δt⁵/20
//! Δt⁴/8 Δt³/6; Δt⁴/8 Δt³/3 Δt²/2; Δt³/6 Δt²/2 Δt]: Eq. 21 with σ_a² = q·Δt. Two half steps add the same noise as one step.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::ProcessNoise;
use crate::statistics::quadrature;

/// Response of position, velocity and acceleration to a unit jerk impulse after a time.
fn response(after_s: f64, time_constant_s: f64) -> [f64; 3] {
    let x = after_s / time_constant_s;
    let lost = -(-x).exp_m1();
    // x − (1 − e^(−x)) loses digits by cancellation for small x.
    let curvature = if x < 1e-3 { 0.5 - x / 6.0 + x * x / 24.0 } else { (x - lost) / (x * x) };
    let slope = if x < 1e-9 { 1.0 } else { lost / x };
    [curvature * after_s * after_s, slope * after_s, 1.0 - lost]
}

/// Scalar coefficients of a prediction step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Step {
    dt_s: f64,
    position_from_acceleration: f64,
    velocity_from_acceleration: f64,
    decay: f64,
    /// ∫ g_i g_j for position, velocity and acceleration.
    noise: [[f64; 3]; 3],
}

impl Step {
    pub fn new(dt_s: f64, process: &ProcessNoise) -> Self {
        let tau = process.acceleration_time_s;
        let [position_from_acceleration, velocity_from_acceleration, decay] = response(dt_s, tau);
        let mut noise = [[0.0; 3]; 3];
        for (node, weight) in quadrature::ON_UNIT_INTERVAL {
            let g = response(node * dt_s, tau);
            for (row, gi) in noise.iter_mut().zip(g) {
                for (element, gj) in row.iter_mut().zip(g) {
                    *element += weight * dt_s * (gi * gj);
                }
            }
        }
        Self { dt_s, position_from_acceleration, velocity_from_acceleration, decay, noise }
    }

    /// Length of the step, s.
    pub const fn seconds(&self) -> f64 {
        self.dt_s
    }

    /// x ← Fx for the phones whose states begin at `phones`.
    pub fn advance_mean(&self, mean: &mut DVector<f64>, phones: &[usize]) {
        self.advance(mean.as_mut_slice(), phones);
    }

    /// P ← FPFᵀ: first the columns, then the rows.
    pub fn advance_covariance(&self, covariance: &mut DMatrix<f64>, phones: &[usize]) {
        let n = covariance.nrows();
        self.advance_columns(covariance, phones);
        let data = covariance.as_mut_slice();
        for at in phones {
            for axis in 0..3 {
                let (r, v, a) = (at + axis, at + axis + 3, at + axis + 6);
                for row in 0..n {
                    let (pr, pv, pa) = (data[r * n + row], data[v * n + row], data[a * n + row]);
                    let [r1, v1, a1] = self.apply(pr, pv, pa);
                    data[r * n + row] = r1;
                    data[v * n + row] = v1;
                    data[a * n + row] = a1;
                }
            }
        }
    }

    /// C ← FC.
    pub fn advance_columns(&self, matrix: &mut DMatrix<f64>, phones: &[usize]) {
        let n = matrix.nrows();
        if n > 0 {
            for column in matrix.as_mut_slice().chunks_exact_mut(n) {
                self.advance(column, phones);
            }
        }
    }

    fn advance(&self, states: &mut [f64], phones: &[usize]) {
        for at in phones {
            for axis in 0..3 {
                let (r, v, a) = (at + axis, at + axis + 3, at + axis + 6);
                [states[r], states[v], states[a]] = self.apply(states[r], states[v], states[a]);
            }
        }
    }

    fn apply(&self, r: f64, v: f64, a: f64) -> [f64; 3] {
        [
            r + self.dt_s * v + self.position_from_acceleration * a,
            v + self.velocity_from_acceleration * a,
            self.decay * a,
        ]
    }

    /// Adds the process noise of this step to the phone with states from `offset`; `up` is its vertical.
    pub fn add_noise(
        &self,
        covariance: &mut DMatrix<f64>,
        offset: usize,
        up: &Vector3<f64>,
        noise: &ProcessNoise,
    ) {
        let density = Matrix3::identity() * noise.horizontal_m2ps5
            + up * up.transpose() * (noise.vertical_m2ps5 - noise.horizontal_m2ps5);
        for (i, row) in self.noise.iter().enumerate() {
            for (j, factor) in row.iter().enumerate() {
                let mut block = covariance.fixed_view_mut::<3, 3>(offset + 3 * i, offset + 3 * j);
                block += density * *factor;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAR: ProcessNoise =
        ProcessNoise { horizontal_m2ps5: 0.5, vertical_m2ps5: 0.1, acceleration_time_s: 4.0 };

    fn transition(step: &Step) -> DMatrix<f64> {
        let mut f = DMatrix::identity(9, 9);
        for axis in 0..3 {
            f[(axis, axis + 3)] = step.dt_s;
            f[(axis, axis + 6)] = step.position_from_acceleration;
            f[(axis + 3, axis + 6)] = step.velocity_from_acceleration;
            f[(axis + 6, axis + 6)] = step.decay;
        }
        f
    }

    #[test]
    fn block_products_equal_the_dense_ones() {
        let step = Step::new(0.7, &CAR);
        let one = transition(&step);
        let mut f = DMatrix::zeros(18, 18);
        f.view_mut((0, 0), (9, 9)).copy_from(&one);
        f.view_mut((9, 9), (9, 9)).copy_from(&one);
        let root = DMatrix::from_fn(18, 18, |i, j| ((i * 7 + j * 13) % 11) as f64 - 5.0);
        let mut covariance = &root * root.transpose();
        let expected = &f * &covariance * f.transpose();
        step.advance_covariance(&mut covariance, &[0, 9]);
        assert!((covariance - expected).norm() < 1e-9);
    }

    #[test]
    fn two_steps_equal_one() {
        let (half, whole) = (Step::new(0.5, &CAR), Step::new(1.0, &CAR));
        assert!((transition(&half) * transition(&half) - transition(&whole)).norm() < 1e-12);
        let up = Vector3::new(0.0, 0.6, 0.8);
        let noise = |process: &ProcessNoise, steps: i32| {
            let step = Step::new(1.0 / f64::from(steps), process);
            let mut covariance = DMatrix::zeros(9, 9);
            for _ in 0..steps {
                step.advance_covariance(&mut covariance, &[0]);
                step.add_noise(&mut covariance, 0, &up, process);
            }
            covariance
        };
        for acceleration_time_s in [0.5, 4.0, 100.0, f64::INFINITY] {
            let process = ProcessNoise { acceleration_time_s, ..CAR };
            let difference = (noise(&process, 1) - noise(&process, 4)).amax();
            assert!(difference < 1e-7, "{acceleration_time_s}: {difference}");
        }
        let constant = ProcessNoise { acceleration_time_s: f64::INFINITY, ..CAR };
        assert!((noise(&constant, 1)[(0, 0)] - 0.5 / 20.0).abs() < 1e-12, "horizontal axis, Eq. 21");
    }
}
