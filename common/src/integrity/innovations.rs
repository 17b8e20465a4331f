//! Tests of innovations: whether the measurements of an epoch agree with a predicted state, and with each other.
//!
//! Innovations are ν = Hx + 1c + ε with the error x ~ N(0, P) of the prediction, one white clock c and noise ε ~ N(0, W⁻¹). The least squares of
//! (x, c) with the prediction as further measurements have the residuals r = W⁻¹Mν with M = S⁻¹ − S⁻¹1(1ᵀS⁻¹1)⁻¹1ᵀS⁻¹, S = HPHᵀ + W⁻¹. So the
//! global test νᵀMν of m innovations, of m − 1 degrees of freedom, and the local tests (Mν)ᵢ/√Mᵢᵢ are those of these residuals, and cost
//! what a least squares of the states costs. The prediction is redundancy too: four satellites can be checked.
//!
//! Errors that last are in the prediction and in the measurements. Their correlation is neglected, so a test alarms less often than is set.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::checks::{Residuals, forward, test_of};
use super::options::RaimOptions;
use super::{Cause, GlobalTest, TestReport, Verdict};

/// Innovations of one epoch.
#[derive(Clone, Debug)]
pub(crate) struct Innovations {
    /// One column per innovation: partial derivatives with respect to the states in units of their prior standard deviations, and 1 for the clock.
    design: DMatrix<f64>,
    values_m: Vec<f64>,
    /// 1/σ² of the noise, 1/m².
    weights: Vec<f64>,
}

impl Innovations {
    /// Innovations with their partial derivatives with respect to the states, a column each, about a prediction of this covariance. `None` if
    /// that is not positive.
    pub fn new(
        partials: &DMatrix<f64>,
        prior: DMatrix<f64>,
        values_m: Vec<f64>,
        weights: Vec<f64>,
    ) -> Option<Self> {
        let root = Cholesky::new(prior)?;
        let whitened = root.l().tr_mul(partials);
        let states = whitened.nrows();
        Some(Self { design: whitened.insert_row(states, 1.0), values_m, weights })
    }

    /// The verdict on the prediction and these measurements, with exclusions of single ones. It is not reliable if more had to go than redundant
    /// ones are left.
    pub fn test(&self, options: &RaimOptions) -> Option<TestReport> {
        let fit = Adjusted::new(self, (0..self.values_m.len()).collect())?;
        let (fit, verdict) = forward(fit, options, Adjusted::without);
        let excluded = self.values_m.len() - fit.count();
        let is_mostly_excluded = verdict == Verdict::Reliable && excluded >= fit.count();
        Some(TestReport {
            verdict: if is_mostly_excluded { Verdict::Unreliable(Cause::TestsFailed) } else { verdict },
            global_test: fit.global_test(options),
            excluded: u16::try_from(excluded).unwrap_or(u16::MAX),
        })
    }
}

/// Adjustment of some of the innovations.
struct Adjusted<'a> {
    of: &'a Innovations,
    /// Places of the innovations.
    places: Vec<usize>,
    residuals_m: Vec<f64>,
    /// Sum of the squares of the residuals and of the states in their prior standard deviations.
    square_sum: f64,
    /// L⁻¹ times the design, with the normal matrix LLᵀ.
    solved: DMatrix<f64>,
}

impl<'a> Adjusted<'a> {
    fn new(of: &'a Innovations, places: Vec<usize>) -> Option<Self> {
        let first_m = *of.values_m.get(*places.first()?)?;
        let unknowns = of.design.nrows();
        let mut normal = DMatrix::identity(unknowns, unknowns);
        normal[(unknowns - 1, unknowns - 1)] = 0.0;
        let mut rhs = DVector::zeros(unknowns);
        for &place in &places {
            let (row, weight) = (of.design.column(place), of.weights[place]);
            normal.ger(weight, &row, &row, 1.0);
            rhs.axpy(weight * (of.values_m[place] - first_m), &row, 1.0);
        }
        let root: Cholesky<f64, Dyn> = Cholesky::new(normal)?;
        let states = root.solve(&rhs);
        let residual = |place: &usize| of.values_m[*place] - first_m - of.design.column(*place).dot(&states);
        let residuals_m: Vec<f64> = places.iter().map(residual).collect();
        let squares = places.iter().zip(&residuals_m).map(|(place, r)| of.weights[*place] * r * r);
        let square_sum = squares.sum::<f64>() + states.rows(0, unknowns - 1).norm_squared();
        let mut solved = of.design.select_columns(&places);
        root.l_dirty().solve_lower_triangular_mut(&mut solved);
        Some(Self { of, places, residuals_m, square_sum, solved })
    }

    fn without(&self, residual: usize) -> Option<Self> {
        let mut places = self.places.clone();
        places.remove(residual);
        Self::new(self.of, places)
    }
}

impl Residuals for Adjusted<'_> {
    fn count(&self) -> usize {
        self.places.len()
    }

    fn residual_m(&self, i: usize) -> f64 {
        self.residuals_m[i]
    }

    fn covariance(&self, i: usize, j: usize) -> f64 {
        let own = if i == j { self.weight(i).recip() } else { 0.0 };
        own - self.solved.column(i).dot(&self.solved.column(j))
    }

    fn weight(&self, i: usize) -> f64 {
        self.of.weights[self.places[i]]
    }

    fn global_test(&self, options: &RaimOptions) -> Option<GlobalTest> {
        test_of(self.square_sum, self.places.len() - 1, options)
    }
}

#[cfg(test)]
mod tests {
    use rand::Rng;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use super::*;
    use crate::statistics::{ChiSquareThresholds, detectable_noncentrality};

    /// Innovations of signals all around, without errors: three coordinates, and a clock of a second group of every third signal.
    fn sky(signals: usize) -> (DMatrix<f64>, DMatrix<f64>, Vec<f64>) {
        let partials = DMatrix::from_fn(4, signals, |state, signal| {
            let (azimuth, up) = (2.4 * signal as f64, 0.2 + 0.7 * ((signal * 5) % 7) as f64 / 7.0);
            let across = (1.0 - up * up).sqrt();
            let second = if signal % 3 == 2 { 1.0 } else { 0.0 };
            [across * azimuth.sin(), across * azimuth.cos(), up, second][state]
        });
        let mut prior = DMatrix::from_diagonal(&DVector::from_vec(vec![4.0, 9.0, 25.0, 1.0]));
        (prior[(0, 1)], prior[(1, 0)]) = (3.0, 3.0);
        let sigmas_m: Vec<f64> = (0..signals).map(|signal| 1.0 + ((signal * 7) % 6) as f64).collect();
        (partials, prior, sigmas_m)
    }

    fn innovations(signals: usize, errors_m: Vec<f64>) -> Innovations {
        let (partials, prior, sigmas_m) = sky(signals);
        let weights = sigmas_m.iter().map(|sigma_m| sigma_m.powi(-2)).collect();
        Innovations::new(&partials, prior, errors_m, weights).unwrap()
    }

    /// Innovations with errors of the prediction and of the measurements of the stated covariances, and a clock.
    fn noisy(signals: usize, random: &mut ChaCha8Rng) -> Vec<f64> {
        let (partials, prior, sigmas_m) = sky(signals);
        let mut normal = || -> f64 { random.sample(rand_distr::StandardNormal) };
        let root = Cholesky::new(prior).unwrap().l();
        let states = root * DVector::from_fn(4, |_, _| normal());
        let of_states = partials.tr_mul(&states);
        of_states.iter().zip(sigmas_m).map(|(y, sigma_m)| y + 3e5 + sigma_m * normal()).collect()
    }

    fn adjusted(innovations: &Innovations) -> Adjusted<'_> {
        Adjusted::new(innovations, (0..innovations.values_m.len()).collect()).unwrap()
    }

    #[test]
    fn tests_are_those_of_the_innovation_covariance_without_the_clock() {
        let signals = 9;
        let (partials, prior, sigmas_m) = sky(signals);
        let errors_m = noisy(signals, &mut ChaCha8Rng::seed_from_u64(1));
        let noise = DMatrix::from_diagonal(&DVector::from_iterator(signals, sigmas_m.iter().map(|s| s * s)));
        let s = (partials.transpose() * prior * &partials + noise).try_inverse().unwrap();
        let clock = DVector::from_element(signals, 1.0);
        let sc = &s * &clock;
        let m = &s - &sc * sc.transpose() / clock.dot(&sc);
        let nu = DVector::from_iterator(signals, errors_m.iter().map(|error_m| error_m - 3e5));
        let innovations = innovations(signals, errors_m);
        let fit = adjusted(&innovations);
        let expected = nu.dot(&(&m * &nu));
        assert!((fit.square_sum / expected - 1.0).abs() < 1e-6, "{} {expected}", fit.square_sum);
        for i in 0..signals {
            let w = (&m * &nu)[i] / m[(i, i)].sqrt();
            assert!((fit.residual_m(i) / fit.covariance(i, i).sqrt() - w).abs() < 1e-6, "{i}");
            let correlation = m[(i, 0)] / (m[(i, i)] * m[(0, 0)]).sqrt();
            let own = fit.covariance(i, 0) / (fit.covariance(i, i) * fit.covariance(0, 0)).sqrt();
            assert!((own - correlation).abs() < 1e-9, "{i}");
        }
    }

    #[test]
    fn false_alarms_are_as_frequent_as_set() {
        let options = RaimOptions { global: ChiSquareThresholds::new(0.01), ..RaimOptions::default() };
        let mut random = ChaCha8Rng::seed_from_u64(2);
        for signals in [2, 3, 4, 6, 10, 15, 21] {
            let alarms = (0..10_000).filter(|_| {
                let test = adjusted(&innovations(signals, noisy(signals, &mut random)))
                    .global_test(&options)
                    .unwrap();
                assert_eq!(usize::from(test.degrees_of_freedom), signals - 1);
                !test.passes()
            });
            let rate = alarms.count() as f64 / 10_000.0;
            assert!((0.01 / 1.5..0.01 * 1.5).contains(&rate), "{signals} signals: {rate}");
        }
    }

    #[test]
    fn minimal_detectable_errors_are_detected_as_often_as_set_and_larger_ones_named() {
        let (signals, options) = (20, RaimOptions::default());
        let noncentrality = detectable_noncentrality(1e-3, 0.2, signals - 1);
        let clean = innovations(signals, vec![0.0; signals]);
        let clean = adjusted(&clean);
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let (mut detected, mut right, mut wrong, mut epochs) = (0_u32, 0_u32, 0_u32, 0_u32);
        for faulty in (0..signals).cycle().take(5_000) {
            epochs += 1;
            let mut errors_m = noisy(signals, &mut random);
            let error_m =
                noncentrality.sqrt() / (clean.weight(faulty) * clean.covariance(faulty, faulty).sqrt());
            errors_m[faulty] += error_m;
            let once = innovations(signals, errors_m.clone());
            detected += u32::from(!adjusted(&once).global_test(&options).unwrap().passes());
            errors_m[faulty] += error_m;
            let twice = innovations(signals, errors_m);
            let (fit, verdict) = forward(adjusted(&twice), &options, Adjusted::without);
            let is_in = fit.places.contains(&faulty);
            right += u32::from(verdict == Verdict::Reliable && !is_in && fit.count() == signals - 1);
            wrong += u32::from(is_in && fit.count() < signals);
        }
        let share = |count: u32| f64::from(count) / f64::from(epochs);
        println!(
            "detected {:.3}, excluded {:.3}, wrongly {:.4}",
            share(detected),
            share(right),
            share(wrong)
        );
        assert!((share(detected) - 0.8).abs() < 0.03, "{}", share(detected));
        assert!(share(right) > 0.9 && share(wrong) < 0.02, "{} {}", share(right), share(wrong));
    }

    #[test]
    fn the_prediction_makes_four_satellites_checkable_and_one_not() {
        let test = |errors_m: Vec<f64>| {
            innovations(errors_m.len(), errors_m).test(&RaimOptions::default()).unwrap().verdict
        };
        assert_eq!(test(vec![7.0; 4]), Verdict::Reliable);
        assert_eq!(test(vec![7.0, 7.0, 7.0, 507.0]), Verdict::Reliable, "one of four is excluded");
        assert_eq!(test(vec![7.0, 507.0]), Verdict::Unreliable(Cause::InsufficientRedundancy));
        assert_eq!(test(vec![7.0]), Verdict::CannotBeChecked);
        let mostly = test(vec![7.0, 7.0, 7.0, 507.0, -800.0, 1_300.0]);
        assert_eq!(mostly, Verdict::Unreliable(Cause::TestsFailed));
    }
}
