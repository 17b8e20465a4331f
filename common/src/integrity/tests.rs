//! The schemes of exclusion and the protection levels on single epochs.

use super::protection::{separation_levels, slope_levels};
use super::*;
use crate::frames::Ecef;
use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};
use crate::measurement::{CorrectedObservation, Usage};
use crate::solve::{SolveError, solve_position};

fn excluded(observations: &[CorrectedObservation]) -> Vec<usize> {
    (0..observations.len()).filter(|i| observations[*i].usage == Usage::Excluded).collect()
}

/// 24 signals; the second twelve are other satellites of the same constellations.
fn two_skies() -> (Receiver, Vec<CorrectedObservation>) {
    let receiver = Receiver::in_wuhan();
    let mut observations = receiver.observe(&OPEN_SKY_DEG);
    let turned = OPEN_SKY_DEG.map(|(azimuth, elevation)| (azimuth + 25.0, elevation + 3.0));
    let mut others = receiver.observe(&turned);
    for other in &mut others {
        other.satellite.number += 20;
    }
    observations.extend(others);
    (receiver, observations)
}

fn with(method: Method) -> RaimOptions {
    RaimOptions { method, ..RaimOptions::default() }
}

#[test]
fn absurd_residuals_start_no_filter() {
    let report = |verdict, scale: f64| {
        let degrees_of_freedom = 9;
        let statistic = scale * scale * f64::from(degrees_of_freedom);
        let test = GlobalTest { statistic, threshold: 27.9, degrees_of_freedom };
        assert!((test.posterior_scale() - scale).abs() < 1e-12);
        RaimReport { global_test: Some(test), ..RaimReport::of(verdict) }
    };
    let failed = Verdict::Unreliable(Cause::TestsFailed);
    assert!(report(Verdict::Reliable, 1.0).may_start_filter());
    assert!(report(failed, 9.9).may_start_filter());
    assert!(!report(failed, 10.1).may_start_filter());
    let untested = RaimReport { global_test: None, ..report(Verdict::CannotBeChecked, 1.0) };
    assert!(untested.may_start_filter());
}

/// Two large faults pull the solution so that a good measurement goes too; the way back brings it in again.
#[test]
fn what_need_not_have_gone_comes_back() {
    let options = with(Method::ForwardBackward);
    let mut came_back = 0;
    for (first, second) in (0..12).flat_map(|i| (0..12).filter(move |j| *j != i).map(move |j| (i, j))) {
        let (receiver, mut observations) = two_skies();
        observations.truncate(16);
        observations[first].pseudorange_m += 75.0;
        observations[second].pseudorange_m += 60.0;
        let fit = solve_position(&observations, receiver.position).unwrap();
        let monitored = solve_with_raim(&mut observations, fit.position(), &options);
        if monitored.report.verdict != Verdict::Reliable {
            continue;
        }
        assert_eq!(usize::from(monitored.report.excluded), excluded(&observations).len());
        // Everything excluded makes the test fail if it is put back.
        for index in excluded(&observations) {
            let mut without_one = observations.clone();
            without_one[index].usage = Usage::Used;
            let test = checks::global_test(&solve_position(&without_one, fit.position()).unwrap(), &options);
            assert!(!test.unwrap().passes(), "faults {first} and {second}: {index} need not have gone");
        }
        came_back += 1;
    }
    assert!(came_back > 100, "{came_back}");
}

#[test]
fn the_largest_subset_that_passes_is_taken() {
    for method in [Method::Subset, Method::ForwardBackward] {
        let (receiver, mut observations) = two_skies();
        for (index, error_m) in [(2, 90.0), (9, -70.0), (17, 120.0)] {
            observations[index].pseudorange_m += error_m;
        }
        let monitored = solve_with_raim(&mut observations, receiver.position, &with(method));
        assert_eq!(monitored.report.verdict, Verdict::Reliable, "{method:?}");
        assert_eq!(excluded(&observations), [2, 9, 17], "{method:?}");
        assert!(monitored.fit.unwrap().position().distance_m(receiver.position) < 1e-3);
    }
}

/// A fault that hardly exceeds the threshold is explained by more than one measurement.
#[test]
fn several_subsets_that_pass_are_a_tie() {
    let (receiver, clean) = two_skies();
    let mut ties = 0;
    for step in 1..60 {
        let mut observations = clean.clone();
        observations.truncate(9);
        observations[4].pseudorange_m += f64::from(step);
        let monitored = solve_with_raim(&mut observations, receiver.position, &with(Method::Subset));
        let tie = monitored.report.verdict == Verdict::Unreliable(Cause::Tie);
        ties += i32::from(tie);
        if tie {
            // The solution is that with the smallest statistic.
            assert_eq!(excluded(&observations).len(), 1);
            let test = monitored.report.global_test.unwrap();
            assert!(test.passes());
        }
    }
    assert!(ties > 3, "{ties}");
}

#[test]
fn a_search_that_becomes_too_long_ends() {
    let (receiver, mut observations) = two_skies();
    for index in [1, 5, 9, 14, 19] {
        observations[index].pseudorange_m += 100.0 * index as f64;
    }
    let options = RaimOptions { maximum_subsets: 500, ..with(Method::Subset) };
    let report = solve_with_raim(&mut observations, receiver.position, &options).report;
    assert_eq!(report.verdict, Verdict::Unreliable(Cause::SearchLimit));
    assert_eq!(report.excluded, 0);
    let patient = RaimOptions { maximum_subsets: 60_000, ..options };
    let report = solve_with_raim(&mut observations, receiver.position, &patient).report;
    assert_eq!(report.verdict, Verdict::Reliable);
    assert_eq!(excluded(&observations), [1, 5, 9, 14, 19]);
}

/// The judgement about the solution of all equals the exact one.
#[test]
fn subsets_are_judged_as_if_solved() {
    let (receiver, mut observations) = two_skies();
    for (index, error_m) in [(3, 25.0), (11, -18.0)] {
        observations[index].pseudorange_m += error_m;
    }
    let fit = solve_position(&observations, receiver.position).unwrap();
    for set in [vec![3], vec![3, 11], vec![0, 7, 20]] {
        let statistic = subset::statistic_without(&fit, &set);
        let mut rest = observations.clone();
        for index in &set {
            rest[*index].usage = Usage::Excluded;
        }
        let exact = solve_position(&rest, receiver.position).unwrap();
        let expected = exact.weighted_square_sum();
        assert!((statistic - expected).abs() < 1e-3 * (1.0 + expected), "{set:?}: {statistic} {expected}");
    }
}

#[test]
fn in_bad_geometry_nothing_is_excluded() {
    let mut low: Vec<(f64, f64)> = (0..8).map(|i| (f64::from(i), 30.0 + f64::from(i % 3))).collect();
    low.push((40.0, 33.0));
    for method in [Method::ForwardBackward, Method::Subset] {
        let mut observations = Receiver::in_wuhan().observe(&low);
        observations[5].pseudorange_m += 60.0;
        let monitored = solve_with_raim(&mut observations, Receiver::in_wuhan().position, &with(method));
        assert!(!monitored.report.global_test.unwrap().passes());
        assert_eq!(monitored.report.verdict, Verdict::Unreliable(Cause::Geometry), "{method:?}");
        assert!(excluded(&observations).is_empty(), "{method:?}");
    }
}

#[test]
fn without_a_method_nothing_is_excluded() {
    let (receiver, mut observations) = two_skies();
    observations[3].pseudorange_m += 90.0;
    let report = solve_with_raim(&mut observations, receiver.position, &with(Method::None)).report;
    assert_eq!(report.verdict, Verdict::Unreliable(Cause::TestsFailed));
    assert!(excluded(&observations).is_empty());
}

#[test]
fn levels_beyond_the_alarm_limits_are_not_reliable() {
    let (receiver, observations) = two_skies();
    let report = |limits| {
        let options = RaimOptions { alarm_limits: limits, ..RaimOptions::default() };
        solve_with_raim(&mut observations.clone(), receiver.position, &options).report
    };
    let levels = report(AlarmLimits::NONE).protection.unwrap();
    let wide = AlarmLimits { horizontal_m: levels.horizontal_m + 0.1, vertical_m: levels.vertical_m + 0.1 };
    assert_eq!(report(wide).verdict, Verdict::Reliable);
    let alarm = Verdict::Unreliable(Cause::AlarmLimit);
    assert_eq!(report(AlarmLimits { horizontal_m: levels.horizontal_m - 0.1, ..wide }).verdict, alarm);
    assert_eq!(report(AlarmLimits { vertical_m: levels.vertical_m - 0.1, ..wide }).verdict, alarm);
}

/// The separations and gains of the levels are those of solutions that are made anew.
#[test]
fn levels_grow_with_faults_noise_and_fewer_satellites() {
    let (receiver, observations) = two_skies();
    let options = RaimOptions::default();
    let levels = |observations: &[CorrectedObservation]| {
        let fit = solve_position(observations, receiver.position).unwrap();
        separation_levels(observations, &fit, &options.protection)
    };
    let all = levels(&observations).unwrap();
    assert!((3.0..60.0).contains(&all.horizontal_m) && all.vertical_m > all.horizontal_m, "{all:?}");
    let mut noisy = observations.clone();
    for observation in &mut noisy {
        observation.pseudorange_sigma_m *= 2.0;
    }
    assert!(levels(&noisy).unwrap().horizontal_m > 1.2 * all.horizontal_m);
    assert!(levels(&observations[..12]).unwrap().horizontal_m > 1.2 * all.horizontal_m);
    // A fault that is not excluded moves the solution; the levels reach as far as the solution without it.
    let mut faulty = observations.clone();
    faulty[4].pseudorange_m += 300.0;
    let fit = solve_position(&faulty, receiver.position).unwrap();
    let reached = separation_levels(&faulty, &fit, &options.protection).unwrap();
    let moved_m = fit.position().distance_m(receiver.position);
    assert!(reached.horizontal_m.hypot(reached.vertical_m) > moved_m, "{reached:?} {moved_m}");
    // Six measurements for six unknowns: without any of them there is no solution, and nothing is promised.
    assert!(levels(&observations[..6]).is_none());
}

/// The slope of a fault is the displacement that it causes, per root of the statistic that it causes.
#[test]
fn slopes_are_those_of_real_faults() {
    let (receiver, observations) = two_skies();
    let options = RaimOptions::default();
    let fit = solve_position(&observations, receiver.position).unwrap();
    let frame = crate::frames::LocalFrame::at(receiver.position);
    let slope = |index: usize| {
        let mut faulty = observations.clone();
        faulty[index].pseudorange_m += 10.0;
        let moved = solve_position(&faulty, receiver.position).unwrap();
        let error = frame.ecef_to_enu(moved.position());
        (
            error.horizontal() / moved.weighted_square_sum().sqrt(),
            error.up.abs() / moved.weighted_square_sum().sqrt(),
        )
    };
    let slopes: Vec<(f64, f64)> = (0..observations.len()).map(slope).collect();
    let largest = |of: fn(&(f64, f64)) -> f64| slopes.iter().map(of).fold(0.0, f64::max);
    let levels = slope_levels(&fit, &options).unwrap();
    let dof = fit.degrees_of_freedom();
    let arp_m = largest(|s| s.0) * options.global.threshold(dof).sqrt();
    assert!((levels.arp_m / arp_m - 1.0).abs() < 1e-3, "{levels:?} {arp_m}");
    let detected = options.protection.detectable.value(dof).sqrt();
    assert!((levels.vertical_m / (largest(|s| s.1) * detected) - 1.0).abs() < 1e-3, "{levels:?}");
}

#[test]
fn too_few_satellites_are_no_panic() {
    for method in [Method::ForwardBackward, Method::Subset, Method::None] {
        for count in 0..8 {
            let mut observations = Receiver::in_wuhan().observe(&OPEN_SKY_DEG[..count]);
            let monitored = solve_with_raim(&mut observations, Ecef::new(0.0, 0.0, 0.0), &with(method));
            let is_short = matches!(monitored.fit, Err(SolveError::TooFew { .. }));
            assert_eq!(is_short, count < 6, "{count}");
        }
    }
}
