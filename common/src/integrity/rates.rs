//! Rates of the tests over many simulated epochs: false alarms, detections, right exclusions, errors beyond the protection levels.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::checks::global_test;
use super::*;
use crate::frames::LocalFrame;
use crate::gnss::Constellation;
use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};
use crate::measurement::{CorrectedObservation, Usage};
use crate::solve::{Fit, solve_position};
use crate::statistics::{ChiSquareThresholds, detectable_noncentrality};

/// 24 signals of three constellations with standard deviations of 1 to 6 m.
fn unequal_sky() -> (Receiver, Vec<CorrectedObservation>) {
    let receiver = Receiver::in_wuhan();
    let mut observations = receiver.observe(&OPEN_SKY_DEG);
    let turned = OPEN_SKY_DEG.map(|(azimuth, elevation)| (azimuth + 25.0, elevation + 3.0));
    observations.extend(receiver.observe(&turned));
    for (index, observation) in observations.iter_mut().enumerate() {
        observation.satellite.number = u8::try_from(index + 1).unwrap();
        observation.pseudorange_sigma_m = 1.0 + ((index * 7) % 6) as f64;
    }
    (receiver, observations)
}

/// The observations with Gaussian errors of the stated standard deviations.
fn noisy(observations: &[CorrectedObservation], random: &mut ChaCha8Rng) -> Vec<CorrectedObservation> {
    let disturbed = |o: &CorrectedObservation| {
        let normal: f64 = random.sample(rand_distr::StandardNormal);
        CorrectedObservation { pseudorange_m: o.pseudorange_m + o.pseudorange_sigma_m * normal, ..o.clone() }
    };
    observations.iter().map(disturbed).collect()
}

fn fit(observations: &[CorrectedObservation], receiver: &Receiver) -> Fit {
    solve_position(observations, receiver.position).unwrap()
}

#[test]
fn false_alarms_are_as_frequent_as_set() {
    let options = RaimOptions { global: ChiSquareThresholds::new(0.01), ..RaimOptions::default() };
    let (receiver, sky) = unequal_sky();
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for dof in [1_usize, 2, 3, 5, 8, 12, 15, 18] {
        // The first signals of the three constellations have three clocks.
        let sky = &sky[..6 + dof];
        let clocks: std::collections::BTreeSet<Constellation> =
            sky.iter().map(|o| o.satellite.constellation).collect();
        assert_eq!(clocks.len(), 3);
        let alarms = (0..10_000).filter(|_| {
            let test = global_test(&fit(&noisy(sky, &mut random), &receiver), &options).unwrap();
            assert_eq!(usize::from(test.degrees_of_freedom), dof);
            !test.passes()
        });
        let rate = alarms.count() as f64 / 10_000.0;
        assert!((0.01 / 1.5..0.01 * 1.5).contains(&rate), "{dof} degrees of freedom: {rate}");
    }
}

/// Error of the `i`-th measurement, m, whose noncentrality is λ: λ = b²w²(C_v)_ii.
fn bias_m(fit: &Fit, i: usize, noncentrality: f64) -> f64 {
    noncentrality.sqrt() / (fit.weight(i) * fit.residual_covariance(i, i).sqrt())
}

#[test]
fn minimal_detectable_errors_are_detected_as_often_as_set_and_larger_ones_excluded() {
    let options = RaimOptions::default();
    let (receiver, sky) = unequal_sky();
    let clean = fit(&sky, &receiver);
    let dof = clean.degrees_of_freedom();
    let noncentrality = detectable_noncentrality(1e-3, 0.2, dof);
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let (mut detected, mut right, mut wrong, mut epochs) = (0_u32, 0_u32, 0_u32, 0_u32);
    for _ in 0..250 {
        for faulty in 0..sky.len() {
            epochs += 1;
            let mut observations = noisy(&sky, &mut random);
            let error_m = bias_m(&clean, faulty, noncentrality);
            observations[faulty].pseudorange_m += error_m;
            detected += u32::from(!global_test(&fit(&observations, &receiver), &options).unwrap().passes());
            observations[faulty].pseudorange_m += error_m;
            let report = solve_with_raim(&mut observations, receiver.position, &options).report;
            let excluded: Vec<usize> =
                (0..observations.len()).filter(|i| observations[*i].usage == Usage::Excluded).collect();
            right += u32::from(report.verdict == Verdict::Reliable && excluded == [faulty]);
            wrong += u32::from(!excluded.is_empty() && !excluded.contains(&faulty));
        }
    }
    let share = |count: u32| f64::from(count) / f64::from(epochs);
    println!("detected {:.3}, excluded {:.3}, wrongly {:.4}", share(detected), share(right), share(wrong));
    assert!((share(detected) - 0.8).abs() < 0.03, "{}", share(detected));
    assert!(share(right) > 0.9, "{}", share(right));
    assert!(share(wrong) < 0.02, "{}", share(wrong));
}

/// A fault of any size on any satellite, and often none: errors beyond the levels without a warning are rarer than promised.
#[test]
fn protection_levels_hold_what_they_promise() {
    let (receiver, sky) = unequal_sky();
    let mut options = RaimOptions::default();
    options.protection.misleading = 0.02;
    options.protection.satellite_fault = 0.004;
    (options.protection.nominal_bias_m, options.protection.ionosphere_share) = (0.0, 0.0);
    let frame = LocalFrame::at(receiver.position);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let (epochs, mut beyond, mut reliable, mut ratio) = (6_000, 0, 0, 0.0);
    for _ in 0..epochs {
        let mut observations = noisy(&sky, &mut random);
        for observation in &mut observations {
            if random.random_bool(options.protection.satellite_fault) {
                observation.pseudorange_m += random.random_range(0.0..80.0);
            }
        }
        let monitored = solve_with_raim(&mut observations, receiver.position, &options);
        if monitored.report.verdict != Verdict::Reliable {
            continue;
        }
        reliable += 1;
        let levels = monitored.report.protection.unwrap();
        let error = frame.ecef_to_enu(monitored.fit.unwrap().position());
        beyond += i32::from(error.horizontal() > levels.horizontal_m || error.up.abs() > levels.vertical_m);
        ratio += error.horizontal() / levels.horizontal_m;
    }
    println!("{beyond} of {reliable} beyond, mean ratio {:.2}", ratio / f64::from(reliable));
    assert!(
        reliable > epochs * 9 / 10 && f64::from(beyond) < 0.02 * f64::from(reliable),
        "{beyond} of {reliable}"
    );
    // Neither are they huge: the error is a seventh of them or more on the average.
    assert!(ratio / f64::from(reliable) > 0.14, "{}", ratio / f64::from(reliable));
}
