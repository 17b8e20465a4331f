//! Prediction of one phone: position, velocity and a decaying acceleration driven by white jerk.
//!
//! For Δt, with τ the acceleration's time constant and d = e^(−Δt/τ),
//! F = [1 Δt τ²(Δt/τ − 1 + d); 0 1 τ(1 − d); 0 0 d] ⊗ I₃, which is Peng Eq. 22 as τ → ∞. The noise of a white jerk of
//! spectral density q is q·[Δt⁵/20 Δt⁴/8 Δt³/6; Δt⁴/8 Δt³/3 Δt²/2; Δt³/6 Δt²/2 Δt]: Eq. 21 with σ_a² = q·Δt, so that a
//! second in two steps gains the same noise as in one. With a finite τ it is exact to first order in Δt/τ; the filter
//! takes steps of at most a second.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::ProcessNoise;

/// The scalar coefficients of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Step {
    dt_s: f64,
    position_from_acceleration: f64,
    velocity_from_acceleration: f64,
    decay: f64,
}

impl Step {
    pub fn new(dt_s: f64, noise: &ProcessNoise) -> Self {
        let tau = noise.acceleration_time_s;
        let x = dt_s / tau;
        if x < 1e-6 {
            return Self {
                dt_s,
                position_from_acceleration: 0.5 * dt_s * dt_s,
                velocity_from_acceleration: dt_s,
                decay: 1.0 - x,
            };
        }
        let decay = (-x).exp();
        Self {
            dt_s,
            position_from_acceleration: tau * tau * (x - 1.0 + decay),
            velocity_from_acceleration: tau * (1.0 - decay),
            decay,
        }
    }

    /// x ← Fx for every phone.
    pub fn advance_mean(&self, mean: &mut DVector<f64>) {
        self.advance(mean.as_mut_slice());
    }

    /// P ← FPFᵀ: the columns, then the rows.
    pub fn advance_covariance(&self, covariance: &mut DMatrix<f64>) {
        let n = covariance.nrows();
        let data = covariance.as_mut_slice();
        for column in data.chunks_exact_mut(n) {
            self.advance(column);
        }
        for phone in 0..n / 9 {
            for axis in 0..3 {
                let (r, v, a) = (phone * 9 + axis, phone * 9 + axis + 3, phone * 9 + axis + 6);
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

    fn advance(&self, states: &mut [f64]) {
        for phone in states.chunks_exact_mut(9) {
            for axis in 0..3 {
                let [r, v, a] = self.apply(phone[axis], phone[axis + 3], phone[axis + 6]);
                phone[axis] = r;
                phone[axis + 3] = v;
                phone[axis + 6] = a;
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

    /// Adds the noise of this step to the phone whose states start at `offset`; `up` is its vertical.
    pub fn add_noise(
        &self,
        covariance: &mut DMatrix<f64>,
        offset: usize,
        up: &Vector3<f64>,
        noise: &ProcessNoise,
    ) {
        let density = Matrix3::identity() * noise.horizontal_m2ps5
            + up * up.transpose() * (noise.vertical_m2ps5 - noise.horizontal_m2ps5);
        let t = self.dt_s;
        let (t2, t3) = (t * t, t * t * t);
        let blocks = [
            [t3 * t2 / 20.0, t2 * t2 / 8.0, t3 / 6.0],
            [t2 * t2 / 8.0, t3 / 3.0, t2 / 2.0],
            [t3 / 6.0, t2 / 2.0, t],
        ];
        for (i, row) in blocks.iter().enumerate() {
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
        step.advance_covariance(&mut covariance);
        assert!((covariance - expected).norm() < 1e-9);
    }

    #[test]
    fn two_steps_equal_one() {
        let (half, whole) = (Step::new(0.5, &CAR), Step::new(1.0, &CAR));
        assert!((transition(&half) * transition(&half) - transition(&whole)).norm() < 1e-12);
        let constant = ProcessNoise { acceleration_time_s: f64::INFINITY, ..CAR };
        let up = Vector3::new(0.0, 0.6, 0.8);
        let noise = |steps: i32| {
            let step = Step::new(1.0 / f64::from(steps), &constant);
            let mut covariance = DMatrix::zeros(9, 9);
            for _ in 0..steps {
                step.advance_covariance(&mut covariance);
                step.add_noise(&mut covariance, 0, &up, &constant);
            }
            covariance
        };
        assert!((noise(1) - noise(4)).norm() < 1e-12, "white jerk does not care about the step");
        assert!((noise(1)[(0, 0)] - 0.5 / 20.0).abs() < 1e-12, "horizontal axis, Eq. 21");
    }
}
