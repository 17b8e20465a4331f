//! Special cases of truncation, and the rows against finite differences.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::kinds::BoundedLength;
use super::rows::{BoundedRow, Rows, part, position};
use super::truncation::{Gaussian, Interval, truncate};
use super::*;
use crate::filter::STATES_PER_PHONE;
use crate::frames::{Ecef, Enu, Geodetic, LocalFrame};

const PENG: Enlargement = Enlargement::Peng { confidence: 0.1, factor: 1.5, max_iterations: 50 };

fn origin() -> LocalFrame {
    LocalFrame::at(Geodetic::from_degrees(31.8935, 118.818, 30.0).geodetic_to_ecef())
}

/// State of phones at displacements from the origin with velocities, both east, north, up.
fn state(phones: &[([f64; 3], [f64; 3])]) -> DVector<f64> {
    let frame = origin();
    let enu = |v: [f64; 3]| Enu { east: v[0], north: v[1], up: v[2] };
    let mut state = DVector::zeros(STATES_PER_PHONE * phones.len());
    for (index, (place, velocity)) in phones.iter().enumerate() {
        let start = STATES_PER_PHONE * index;
        state.fixed_rows_mut::<3>(start).copy_from(&frame.enu_to_ecef(enu(*place)).0);
        state.fixed_rows_mut::<3>(start + 3).copy_from(&frame.vector_enu_to_ecef(enu(*velocity)).0);
    }
    state
}

/// Covariance with independent components: standard deviations of position, velocity and acceleration per phone.
fn covariance(sigmas: &[[f64; 3]]) -> DMatrix<f64> {
    let diagonal = sigmas.iter().flat_map(|s| s.iter().flat_map(|sigma| [sigma * sigma; 3]));
    DMatrix::from_diagonal(&DVector::from_iterator(STATES_PER_PHONE * sigmas.len(), diagonal))
}

fn distance(minimum_m: f64, maximum_m: f64) -> Constraint {
    Constraint::Distance(Distance { phones: [0, 1], minimum_m, maximum_m })
}

/// The vector of a constraint in a state.
fn vector_at(constraint: Constraint, state: &DVector<f64>, horizon_s: f64) -> Vector3<f64> {
    constraint.kind().terms(horizon_s).sum(|phone, which| part(state, phone, which)).unwrap()
}

/// Rows of a constraint at a state without uncertainty.
fn rows_at(constraint: Constraint, state: &DVector<f64>, options: &ConstraintOptions) -> Rows {
    let mean = vector_at(constraint, state, options.horizon_s);
    let frame = LocalFrame::at(position(state, constraint.phones()[0]).unwrap());
    constraint.kind().rows(&Quantity { mean, covariance: Matrix3::zeros(), frame: &frame, options }).unwrap()
}

fn fixed_sequential() -> ConstraintOptions {
    ConstraintOptions { enlargement: Enlargement::Fixed, horizon_s: 0.0, ..ConstraintOptions::peng2023() }
}

fn all_options() -> [ConstraintOptions; 3] {
    [ConstraintOptions::default(), ConstraintOptions::peng2023(), fixed_sequential()]
}

#[test]
fn far_tail_40_sigma_truncates_to_the_bound() {
    let gaussian = Gaussian { mean: 40.0, variance: 1.0 };
    let interval = Interval { lower: f64::NEG_INFINITY, upper: 0.0 };
    let moments = truncate(gaussian, interval, Enlargement::Fixed).unwrap().moments;
    // Reference values from mpmath: 40 − 40.0249688472…, 6.2266837859e-4.
    assert!((moments.mean + 0.024_968_847_2).abs() < 1e-9, "{moments:?}");
    assert!((moments.variance - 6.226_683_785_9e-4).abs() < 1e-12, "{moments:?}");
}

#[test]
fn absurdly_far_is_still_finite() {
    for mean in [1e3, 1e6, 1e12] {
        let interval = Interval { lower: -0.3, upper: 0.3 };
        for policy in [Enlargement::Fixed, PENG] {
            let moments = truncate(Gaussian { mean, variance: 1e-2 }, interval, policy).unwrap().moments;
            assert!(moments.mean.is_finite() && moments.variance > 0.0, "{mean} {policy:?} {moments:?}");
        }
    }
}

#[test]
fn enlarging_a_zero_bound_ends() {
    for interval in [
        Interval { lower: f64::NEG_INFINITY, upper: 0.0 },
        Interval { lower: 0.0, upper: f64::INFINITY },
        Interval { lower: 0.0, upper: 0.0 },
    ] {
        let gaussian = Gaussian { mean: if interval.upper == 0.0 { 7.0 } else { -7.0 }, variance: 1.0 };
        let truncation = truncate(gaussian, interval, PENG).unwrap();
        assert!((1..50).contains(&truncation.enlargements), "{interval:?} {truncation:?}");
    }
}

#[test]
fn enlargements_are_bounded() {
    let policy = Enlargement::Peng { confidence: 0.1, factor: 1.5, max_iterations: 3 };
    let interval = Interval { lower: -0.3, upper: 0.3 };
    let truncation = truncate(Gaussian { mean: 1e6, variance: 1.0 }, interval, policy).unwrap();
    assert_eq!(truncation.enlargements, 3);
}

#[test]
fn a_confident_violation_nearly_switches_the_paper_off_but_not_fixed_bounds() {
    let gaussian = Gaussian { mean: 20.0, variance: 1.0 };
    let interval = Interval { lower: -5.0, upper: 5.0 };
    let fixed = truncate(gaussian, interval, Enlargement::Fixed).unwrap();
    let peng = truncate(gaussian, interval, PENG).unwrap();
    assert!(fixed.moments.mean < 5.0 && fixed.moments.mean > 4.9, "{fixed:?}");
    assert!(peng.moments.mean > 18.0, "{peng:?}");
    assert_eq!(fixed.enlargements, 0);
}

#[test]
fn an_interval_without_width_becomes_an_equality() {
    let gaussian = Gaussian { mean: 3.0, variance: 4.0 };
    let moments =
        truncate(gaussian, Interval { lower: 1.0, upper: 1.0 }, Enlargement::Fixed).unwrap().moments;
    assert!((moments.mean - 1.0).abs() < 1e-3 && moments.variance > 0.0 && moments.variance < 1e-8);
}

#[test]
fn both_phones_move_in_proportion_to_their_variance() {
    for options in all_options() {
        let mut mean = state(&[([0.0; 3], [0.0; 3]), ([12.0, 0.0, 0.0], [0.0; 3])]);
        let mut spread = covariance(&[[1.0, 1.0, 1.0], [3.0, 1.0, 1.0]]);
        let prior = mean.clone();
        let actions = constrain(&mut mean, &mut spread, &[distance(0.0, 5.0)], &options);
        let shift =
            |phone: usize| (mean.fixed_rows::<3>(9 * phone) - prior.fixed_rows::<3>(9 * phone)).norm();
        assert!((shift(1) / shift(0) - 9.0).abs() < 1e-6, "{} {}", shift(0), shift(1));
        assert_eq!(actions.len(), 1);
        assert!((actions[0].before - 12.0).abs() < 1e-6 && actions[0].after < 12.0);
        assert!((actions[0].shift_m - shift(1)).abs() < 1e-9);
    }
}

#[test]
fn common_errors_do_not_count_in_a_distance() {
    // Both phones share a 10 m error; their relative position is known to 0.1 m each.
    let mut spread = covariance(&[[0.1, 1.0, 1.0], [0.1, 1.0, 1.0]]);
    for axis in 0..3 {
        for (row, column) in [(0, 0), (0, 9), (9, 0), (9, 9)] {
            spread[(row + axis, column + axis)] += 100.0;
        }
    }
    let prior_spread = spread.clone();
    let mut mean = state(&[([0.0; 3], [0.0; 3]), ([2.1, 0.0, 0.0], [0.0; 3])]);
    constrain(&mut mean, &mut spread, &[distance(0.0, 2.0)], &fixed_sequential());
    let after = distance(0.0, 2.0).value(&mean, 0.0).unwrap();
    // The standard deviation of the difference is 0.14 m, so the correction is of that order.
    assert!(after > 1.7 && after <= 2.0, "{after}");
    // The uncertainty of the common part is unchanged.
    let sum = |p: &DMatrix<f64>| p[(0, 0)] + p[(9, 9)] + 2.0 * p[(0, 9)];
    assert!((sum(&spread) / sum(&prior_spread) - 1.0).abs() < 1e-9);
}

#[test]
fn a_constraint_is_not_applied_twice() {
    // For any number of sweeps the result is the truncation of the state without the bound, not a repeated truncation.
    let constraints = [Constraint::VerticalVelocity(VerticalVelocity { phone: 0, maximum_mps: 0.3 })];
    let run = |max_sweeps| {
        let mut mean = state(&[([0.0; 3], [0.0, 0.0, 0.5])]);
        let mut spread = covariance(&[[5.0, 0.5, 0.1]]);
        let method = Method::ExpectationPropagation { max_sweeps, damping: 0.0 };
        let options = ConstraintOptions { method, ..ConstraintOptions::default() };
        constrain(&mut mean, &mut spread, &constraints, &options);
        (mean, spread)
    };
    let (once, many) = (run(1), run(20));
    assert!((&once.0 - &many.0).amax() < 1e-8 && (&once.1 - &many.1).amax() < 1e-8);

    // The single truncation agrees with the textbook.
    let row = rows_at(constraints[0], &once.0, &ConstraintOptions::default())[0].unwrap();
    let row = dense(constraints[0], &row, 9, 0.0);
    let expected = truncate(
        Gaussian { mean: 0.5, variance: 0.25 },
        Interval { lower: -0.3, upper: 0.3 },
        Enlargement::Fixed,
    );
    let expected = expected.unwrap().moments;
    assert!((row.dot(&once.0) - expected.mean).abs() < 1e-9);
    assert!((row.dot(&(&once.1 * &row)) - expected.variance).abs() < 1e-9);
}

#[test]
fn sequential_sweeps_do_not_shrink_what_they_did_before() {
    // Three phones in a line; both pairs are violated and move the middle phone, so sweeps repeat.
    let constraints = [
        distance(0.0, 5.0),
        Constraint::Distance(Distance { phones: [1, 2], minimum_m: 0.0, maximum_m: 5.0 }),
    ];
    let run = |max_sweeps| {
        let mut mean =
            state(&[([0.0; 3], [0.0; 3]), ([20.0, 0.0, 0.0], [0.0; 3]), ([40.0, 0.0, 0.0], [0.0; 3])]);
        let mut spread = covariance(&[[4.0, 1.0, 1.0]; 3]);
        let options = ConstraintOptions { method: Method::Sequential { max_sweeps }, ..fixed_sequential() };
        let actions = constrain(&mut mean, &mut spread, &constraints, &options);
        (actions, spread)
    };
    let (actions, spread) = run(20);
    assert!(actions.iter().all(|action| action.outcome == ConstraintOutcome::Holds), "{actions:?}");
    let (later_actions, later) = run(200);
    assert_eq!(actions, later_actions);
    assert_eq!(spread, later);
}

/// With damping 0.5 half of each former site is kept: the second sweep moves less far, and many sweeps end in the same place.
#[test]
fn damping_slows_the_sweeps_and_does_not_change_their_end() {
    let bound = |phone| Constraint::VerticalVelocity(VerticalVelocity { phone, maximum_mps: 0.3 });
    let run = |max_sweeps, damping| {
        let mut mean = state(&[([0.0; 3], [0.0, 0.0, 0.9]), ([0.0; 3], [0.0, 0.0, -0.8])]);
        let mut spread = covariance(&[[5.0, 0.5, 0.1]; 2]);
        // The velocities of both phones have a correlation of 0.8.
        for axis in 3..6 {
            (spread[(axis, axis + 9)], spread[(axis + 9, axis)]) = (0.2, 0.2);
        }
        let method = Method::ExpectationPropagation { max_sweeps, damping };
        let options = ConstraintOptions { method, ..ConstraintOptions::default() };
        constrain(&mut mean, &mut spread, &[bound(0), bound(1)], &options);
        mean
    };
    let (once, end) = (run(1, 0.0), run(200, 0.0));
    let moved = |max_sweeps, damping| (run(max_sweeps, damping) - &once).norm();
    assert!(moved(2, 0.0) > 1e-3, "{}", moved(2, 0.0));
    assert!(moved(2, 0.5) < 0.9 * moved(2, 0.0), "{} {}", moved(2, 0.5), moved(2, 0.0));
    let ends = (run(200, 0.5) - &end).norm();
    assert!(ends < 2e-3, "{ends}");
}

/// Three phones far out of the bounds of all their distances turn about each other, so that rows which were linearised only once point
/// elsewhere at the end.
#[test]
fn distances_of_three_phones_hold_after_they_have_turned() {
    let pair = |first, second, minimum_m, maximum_m| {
        Constraint::Distance(Distance { phones: [first, second], minimum_m, maximum_m })
    };
    let constraints = [pair(0, 1, 4.0, 5.0), pair(1, 2, 4.0, 5.0), pair(0, 2, 7.0, 8.0)];
    for (east, north) in [(15.0, 3.0), (3.0, 15.0), (10.0, 10.0), (6.0, 18.0)] {
        let phone = |east, north| ([east, north, 0.0], [0.0; 3]);
        let mut mean = state(&[phone(0.0, 0.0), phone(east, 2.0), phone(1.0, north)]);
        let mut spread = covariance(&[[2.0, 1.0, 1.0], [5.0, 1.0, 1.0], [3.0, 1.0, 1.0]]);
        let options = ConstraintOptions {
            distance_model: DistanceModel::Radial,
            contradiction_sigmas: f64::INFINITY,
            ..ConstraintOptions::default()
        };
        let actions = constrain(&mut mean, &mut spread, &constraints, &options);
        let holds = |action: &ConstraintAction| action.outcome == ConstraintOutcome::Holds;
        assert!(actions.iter().all(holds), "{east} m, {north} m: {actions:?}");
    }
}

#[test]
fn golden_courses_of_the_paper() {
    // Peng 2023, table 1.
    let a = Geodetic::from_degrees(31.893451, 118.8175719, 0.0);
    let b = Geodetic::from_degrees(31.8936597, 118.8184759, 0.0);
    let c = Geodetic::from_degrees(31.8933643, 118.817593, 0.0);
    let d = Geodetic::from_degrees(31.8935834, 118.818498, 0.0);
    for (from, to, golden_deg) in [(d, a, 260.48f64), (b, c, 248.59)] {
        let frame = LocalFrame::at(from.geodetic_to_ecef());
        let way = frame.ecef_to_enu(to.geodetic_to_ecef());
        let mut mean = DVector::zeros(STATES_PER_PHONE);
        mean.fixed_rows_mut::<3>(0).copy_from(&frame.origin().0);
        mean.fixed_rows_mut::<3>(3).copy_from(&frame.vector_enu_to_ecef(way).0);
        let heading = Constraint::Heading(Heading {
            phone: 0,
            course_rad: golden_deg.to_radians(),
            tolerance_rad: 0.1,
        });
        let off_deg = heading.value(&mean, 0.0).unwrap().to_degrees();
        assert!(off_deg.abs() < 0.01, "{golden_deg}: {off_deg}");
    }
}

#[test]
fn headings_wrap() {
    let heading = |course_deg: f64, tolerance_deg: f64| {
        Constraint::Heading(Heading {
            phone: 0,
            course_rad: course_deg.to_radians(),
            tolerance_rad: tolerance_deg.to_radians(),
        })
    };
    // A phone moving at 179° deviates from the course −179° by 2°.
    let course = 179f64.to_radians();
    let mean = state(&[([0.0; 3], [10.0 * course.sin(), 10.0 * course.cos(), 0.0])]);
    for given in [-179.0, 181.0, 541.0] {
        let off = heading(given, 3.0).value(&mean, 0.0).unwrap();
        assert!((off.to_degrees() + 2.0).abs() < 1e-4, "{given} {off}");
        assert!(heading(given, 3.0).holds(off) && !heading(given, 1.0).holds(off));
    }
    assert!((wrap_rad(3.0 * PI) - PI).abs() < 1e-15 && (wrap_rad(-PI) - PI).abs() < 1e-15);
    for options in all_options() {
        let (mut constrained, mut spread) = (mean.clone(), covariance(&[[1.0, 1.0, 0.1]]));
        let options = ConstraintOptions { act_when_inside: false, ..options };
        assert!(constrain(&mut constrained, &mut spread, &[heading(-179.0, 3.0)], &options).is_empty());
        assert_eq!(constrained, mean);
    }
}

#[test]
fn a_violated_heading_is_turned_towards_its_course() {
    for options in all_options() {
        // 20° right of the course, tolerance 5°, with 1.5 m/s uncertainty at 10 m/s.
        let angle = 110f64.to_radians();
        let mut mean = state(&[([0.0; 3], [10.0 * angle.sin(), 10.0 * angle.cos(), 0.0])]);
        let mut spread = covariance(&[[5.0, 1.5, 0.1]]);
        let heading = Constraint::Heading(Heading {
            phone: 0,
            course_rad: 90f64.to_radians(),
            tolerance_rad: 5f64.to_radians(),
        });
        let actions = constrain(&mut mean, &mut spread, &[heading], &options);
        assert!((actions[0].before.to_degrees() - 20.0).abs() < 1e-3, "{actions:?}");
        let limit_deg = if options.enlargement == Enlargement::Fixed { 5.0 } else { 19.9 };
        assert!(actions[0].after.to_degrees().abs() <= limit_deg, "{actions:?}");
        assert_eq!(actions[0].enlargements > 0, options.enlargement != Enlargement::Fixed, "{actions:?}");
    }
}

#[test]
fn a_phone_at_rest_has_no_heading() {
    let heading = Constraint::Heading(Heading { phone: 0, course_rad: 0.0, tolerance_rad: 0.1 });
    for options in all_options() {
        // Standing still; slow; fast, but with an uncertain speed.
        for (speed, sigma) in [(0.0, 0.1), (0.5, 0.01), (5.0, 4.0)] {
            let mut mean = state(&[([0.0; 3], [speed, 0.0, 0.0])]);
            let mut spread = covariance(&[[5.0, sigma, 0.1]]);
            let before = (mean.clone(), spread.clone());
            assert!(constrain(&mut mean, &mut spread, &[heading], &options).is_empty());
            assert_eq!((mean, spread), before);
        }
    }
}

#[test]
fn phones_in_one_place_move_apart_where_least_is_known() {
    let mut spread = covariance(&[[1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]);
    spread[(1, 1)] = 100.0;
    for options in [ConstraintOptions::default(), fixed_sequential()] {
        let (mut mean, mut spread) = (state(&[([0.0; 3], [0.0; 3]), ([0.0; 3], [0.0; 3])]), spread.clone());
        let prior = mean.clone();
        let actions = constrain(&mut mean, &mut spread, &[distance(3.0, 30.0)], &options);
        assert_eq!(actions[0].outcome, ConstraintOutcome::Holds, "{actions:?}");
        assert!((mean[1] - prior[1]).abs() > 2.9 && (mean[0] - prior[0]).abs() < 1e-6, "{}", &mean - &prior);
    }
}

#[test]
fn phones_in_one_place_satisfy_an_upper_bound() {
    let mut mean = state(&[([0.0; 3], [0.0; 3]), ([0.0; 3], [0.0; 3])]);
    let prior = mean.clone();
    let mut spread = covariance(&[[3.0, 1.0, 1.0]; 2]);
    let before = spread.clone();
    for options in [ConstraintOptions::peng2023(), fixed_sequential()] {
        assert!(constrain(&mut mean, &mut spread, &[distance(0.0, 2.0)], &options).is_empty());
        assert_eq!((&mean, &spread), (&prior, &before));
    }
    // Truncation reduces the variance in all directions and moves nothing.
    constrain(&mut mean, &mut spread, &[distance(0.0, 2.0)], &ConstraintOptions::default());
    assert!((&mean - &prior).amax() < 1e-6);
    for axis in 0..3 {
        let relative = spread[(axis, axis)] + spread[(9 + axis, 9 + axis)] - 2.0 * spread[(axis, 9 + axis)];
        assert!(relative < 4.0 / 3.0 * 1.1, "axis {axis}: {relative}");
    }
}

#[test]
fn what_cannot_be_applied_is_named_and_changes_nothing() {
    let nan = f64::NAN;
    let heading = |tolerance_rad| Constraint::Heading(Heading { phone: 0, course_rad: 0.0, tolerance_rad });
    let cases = [
        (
            Constraint::VerticalVelocity(VerticalVelocity { phone: 2, maximum_mps: 0.3 }),
            SkipReason::UnknownPhone,
        ),
        (
            Constraint::VerticalVelocity(VerticalVelocity { phone: usize::MAX, maximum_mps: 0.3 }),
            SkipReason::UnknownPhone,
        ),
        (
            Constraint::Distance(Distance { phones: [1, 1], minimum_m: 0.0, maximum_m: 1.0 }),
            SkipReason::UnknownPhone,
        ),
        (distance(2.0, 1.0), SkipReason::InvalidBounds),
        (distance(-1.0, 1.0), SkipReason::InvalidBounds),
        (distance(0.0, nan), SkipReason::InvalidBounds),
        (
            Constraint::VerticalVelocity(VerticalVelocity { phone: 0, maximum_mps: nan }),
            SkipReason::InvalidBounds,
        ),
        (heading(PI / 2.0), SkipReason::InvalidBounds),
        (heading(nan), SkipReason::InvalidBounds),
    ];
    for options in all_options() {
        for (constraint, reason) in cases {
            let mut mean = state(&[([0.0; 3], [9.0, 0.0, 9.0]), ([9.0, 0.0, 0.0], [0.0; 3])]);
            let mut spread = covariance(&[[1.0, 0.1, 1.0]; 2]);
            let before = (mean.clone(), spread.clone());
            let actions = constrain(&mut mean, &mut spread, &[constraint], &options);
            assert_eq!(actions[0].outcome, ConstraintOutcome::Skipped(reason), "{constraint:?}");
            assert_eq!((mean, spread), before);
        }
    }
}

#[test]
fn states_without_variance_or_not_finite_are_left_alone() {
    let vertical = Constraint::VerticalVelocity(VerticalVelocity { phone: 0, maximum_mps: 0.3 });
    for options in all_options() {
        for (sigma, up, reason) in [
            (0.0, 2.0, SkipReason::NoVariance),
            (f64::NAN, 2.0, SkipReason::NotFinite),
            (f64::INFINITY, 2.0, SkipReason::NotFinite),
            (1.0, f64::NAN, SkipReason::NotFinite),
        ] {
            let mut mean = state(&[([0.0; 3], [0.0, 0.0, up])]);
            let mut spread = covariance(&[[1.0, sigma, sigma]]);
            let before = (format!("{mean}"), format!("{spread}"));
            let actions = constrain(&mut mean, &mut spread, &[vertical], &options);
            assert_eq!(actions[0].outcome, ConstraintOutcome::Skipped(reason), "{sigma} {up}");
            assert_eq!((format!("{mean}"), format!("{spread}")), before);
        }
    }
}

#[test]
fn a_constraint_that_the_state_contradicts_is_reported_and_not_applied() {
    // A phone driving north at 15 m/s, known to 0.3 m/s, 100 m from the other phone; each position is known to a metre.
    let prior_state = state(&[([0.0; 3], [0.0, 15.0, 0.0]), ([100.0, 0.0, 0.0], [0.0, 15.0, 0.0])]);
    let prior = covariance(&[[1.0, 0.3, 1.0]; 2]);
    let west = Constraint::Heading(Heading { phone: 0, course_rad: 1.5 * PI, tolerance_rad: 0.2 });
    for wrong in [west, distance(0.0, 2.0)] {
        let (mut x, mut p) = (prior_state.clone(), prior.clone());
        let actions = constrain(&mut x, &mut p, &[wrong], &ConstraintOptions::default());
        assert_eq!(actions[0].outcome, ConstraintOutcome::Skipped(SkipReason::Contradicted), "{wrong:?}");
        assert_eq!((&x, &p), (&prior_state, &prior), "{wrong:?}");
        let obedient =
            ConstraintOptions { contradiction_sigmas: f64::INFINITY, ..ConstraintOptions::default() };
        constrain(&mut x, &mut p, &[wrong], &obedient);
        assert_ne!(x, prior_state, "{wrong:?}");
    }
}

#[test]
fn the_horizon_looks_ahead_with_the_acceleration() {
    let constraint = Constraint::VerticalVelocity(VerticalVelocity { phone: 0, maximum_mps: 0.3 });
    let mut mean = state(&[([0.0; 3], [0.0; 3])]);
    let up = origin().up();
    mean.fixed_rows_mut::<3>(6).copy_from(&(2.0 * up));
    assert!(constraint.value(&mean, 0.0).unwrap().abs() < 1e-9);
    assert!((constraint.value(&mean, 1.0).unwrap() - 1.0).abs() < 1e-9);
}

/// Central differences of a constrained quantity at a state.
fn differences(constraint: &Constraint, at: &DVector<f64>, horizon_s: f64, step: f64) -> DVector<f64> {
    DVector::from_fn(at.len(), |element, _| {
        let value = |sign: f64| {
            let mut moved = at.clone();
            moved[element] += sign * step;
            constraint.value(&moved, horizon_s).unwrap()
        };
        (value(1.0) - value(-1.0)) / (2.0 * step)
    })
}

/// A row as a direction in the space of the state.
fn dense(constraint: Constraint, bounded: &BoundedRow, elements: usize, horizon_s: f64) -> DVector<f64> {
    let mut row = DVector::zeros(elements);
    for term in constraint.kind().terms(horizon_s).iter() {
        let mut part = row.fixed_rows_mut::<3>(STATES_PER_PHONE * term.phone + term.part.offset());
        part += bounded.axis * term.factor;
    }
    row
}

#[test]
fn distance_rows_are_the_jacobian() {
    let at = state(&[([1.0, -2.0, 0.5], [1.0, 2.0, 3.0]), ([30.0, 44.0, -7.0], [0.0; 3])]);
    let bounded = Distance { phones: [0, 1], minimum_m: 1.0, maximum_m: 5.0 };
    let vector = vector_at(bounded.into(), &at, 0.0);
    let direction = vector.normalize();
    for distance_model in [DistanceModel::Radial, DistanceModel::Box] {
        let options = ConstraintOptions { distance_model, ..ConstraintOptions::default() };
        let row = rows_at(bounded.into(), &at, &options)[0].unwrap();
        let numeric = differences(&distance(1.0, 5.0), &at, 0.0, 1e-2);
        assert!((dense(bounded.into(), &row, 18, 0.0) - numeric).amax() < 1e-6);
        assert!((row.at(&vector) - distance(1.0, 5.0).value(&at, 0.0).unwrap()).abs() < 1e-8);
    }
    let (frame, covariance) = (LocalFrame::at(position(&at, 0).unwrap()), Matrix3::zeros());
    let options = ConstraintOptions { distance_model: DistanceModel::Box, ..ConstraintOptions::default() };
    let boxed = Quantity { mean: vector, covariance, frame: &frame, options: &options };
    // The axes across are orthogonal to the direction and to each other, also near the pole.
    for direction in [direction, Vector3::z(), Vector3::new(1e-9, 0.0, -1.0).normalize()] {
        let rows = BoundedLength::rows_along(&bounded, &boxed, &direction);
        let rows = rows.map(|row| row.unwrap().axis);
        for i in 0..3 {
            for j in 0..3 {
                let product = rows[i].dot(&rows[j]);
                assert!((product - if i == j { 1.0 } else { 0.0 }).abs() < 1e-6);
            }
        }
    }
}

/// Phone 0 knows its velocity to 0.1 m/s, phone 1, on the same body, to 2 m/s.
#[test]
fn phones_of_one_vehicle_share_their_motion() {
    let together = Constraint::SameVehicle(SameVehicle { phones: [0, 1], maximum_mps: 0.8 });
    let after = |first: [f64; 3], second: [f64; 3], options: &ConstraintOptions| {
        let mut mean = state(&[([0.0; 3], first), ([1.0, 1.0, 0.0], second)]);
        let mut spread = covariance(&[[5.0; 3]; 2]);
        for axis in 0..3 {
            spread[(3 + axis, 3 + axis)] = 0.01;
            spread[(12 + axis, 12 + axis)] = 4.0;
        }
        let positions = (mean.fixed_rows::<3>(0).into_owned(), mean.fixed_rows::<3>(9).into_owned());
        let constraints = [together];
        constrain(&mut mean, &mut spread, &constraints, options);
        assert_eq!(mean.fixed_rows::<3>(0), positions.0);
        assert_eq!(mean.fixed_rows::<3>(9), positions.1);
        (together.value(&mean, 0.0).unwrap(), mean, spread)
    };
    for options in all_options() {
        let (apart_mps, mean, spread) = after([10.0, 0.0, 0.0], [12.0, 1.0, 0.5], &options);
        assert!(apart_mps < 0.85, "{apart_mps} m/s");
        let known = state(&[([0.0; 3], [10.0, 0.0, 0.0]), ([1.0, 1.0, 0.0], [0.0; 3])]);
        assert!((mean.fixed_rows::<3>(3) - known.fixed_rows::<3>(3)).norm() < 0.05);
        assert!(spread[(12, 12)] < 2.0, "{}", spread[(12, 12)]);
        // Turning at 0.5 rad/s with 1.4 m between them is allowed: the difference stays.
        let still = ConstraintOptions { act_when_inside: false, ..options };
        let (apart_mps, ..) = after([10.0, 0.0, 0.0], [10.0, 0.7, 0.0], &still);
        assert!((apart_mps - 0.7).abs() < 1e-9, "{apart_mps} m/s");
    }
    let at = state(&[([0.0; 3], [1.0, 2.0, 3.0]), ([1.0; 3], [4.0, -2.0, 1.0])]);
    let row = rows_at(together, &at, &ConstraintOptions::default())[0].unwrap();
    let numeric = differences(&together, &at, 0.0, 1e-4);
    assert!((dense(together, &row, 18, 0.0) - numeric).amax() < 1e-6);
}

#[test]
fn vertical_velocity_rows_are_the_jacobian() {
    for horizon_s in [0.0, 1.0] {
        let mut at = state(&[([0.0; 3], [3.0, -4.0, 0.7]), ([0.0; 3], [5.0, 9.0, -0.2])]);
        at.fixed_rows_mut::<3>(15).copy_from(&Vector3::new(0.3, -0.2, 0.9));
        let constraint = Constraint::VerticalVelocity(VerticalVelocity { phone: 1, maximum_mps: 0.3 });
        let options = ConstraintOptions { horizon_s, ..ConstraintOptions::default() };
        let row = rows_at(constraint, &at, &options)[0].unwrap();
        let numeric = differences(&constraint, &at, horizon_s, 1e-2);
        // The rows neglect horizontal speed over the Earth's radius: 10 m/s / 6.4e6 m.
        assert!((dense(constraint, &row, 18, horizon_s) - numeric).amax() < 2e-6);
    }
}

fn height(minimum_m: f64, maximum_m: f64) -> Constraint {
    Constraint::Height(Height { phone: 0, minimum_m, maximum_m })
}

#[test]
fn height_rows_are_the_jacobian() {
    let at = state(&[([300.0, -200.0, 12.0], [0.0; 3])]);
    let row = rows_at(height(20.0, 30.0), &at, &ConstraintOptions::default())[0].unwrap();
    let numeric = differences(&height(20.0, 30.0), &at, 0.0, 1.0);
    assert!((dense(height(20.0, 30.0), &row, 9, 0.0) - numeric).amax() < 1e-8);
    let value_m = height(20.0, 30.0).value(&at, 0.0).unwrap();
    let row_m = row.at(&vector_at(height(20.0, 30.0), &at, 0.0));
    assert!((row_m - row.interval.lower - (value_m - 20.0)).abs() < 1e-6);
    assert!((row.interval.upper - row.interval.lower - 10.0).abs() < 1e-6);
}

/// A height of 5 ± 10 m under a bound of ±1 m about 0: the height is within, and a position that is correlated with it moves too.
#[test]
fn a_height_is_brought_within_its_bounds_by_every_method() {
    let zero_m = origin().geodetic().height_m;
    let at = state(&[([0.0, 0.0, 5.0], [0.0; 3])]);
    let mut spread = covariance(&[[0.1, 0.1, 0.1]]);
    let direction = origin().vector_enu_to_ecef(Enu { east: 0.5, north: 0.0, up: 1.0 }).0 * 10.0;
    let mut block = spread.fixed_view_mut::<3, 3>(0, 0);
    block += direction * direction.transpose();
    for options in all_options() {
        for bounded in [height(zero_m - 1.0, zero_m + 1.0), height(f64::NEG_INFINITY, zero_m + 1.0)] {
            let (mut mean, mut covariance) = (at.clone(), spread.clone());
            let actions = constrain(&mut mean, &mut covariance, &[bounded], &options);
            assert_eq!(actions[0].outcome, ConstraintOutcome::Holds, "{options:?} {actions:?}");
            let moved = origin().ecef_to_enu(position(&mean, 0).unwrap());
            assert!(moved.up < 1.01 && (moved.east - 0.5 * (moved.up - 5.0)).abs() < 0.01, "{moved:?}");
            assert!(covariance.trace() < 0.9 * spread.trace());
        }
    }
}

fn speed(minimum_mps: f64, maximum_mps: f64) -> Constraint {
    Constraint::Speed(Speed { phone: 0, minimum_mps, maximum_mps })
}

#[test]
fn speed_rows_are_the_jacobian() {
    for horizon_s in [0.0, 1.0] {
        let mut at = state(&[([3.0, 1.0, 2.0], [3.0, -4.0, 0.7])]);
        at.fixed_rows_mut::<3>(6).copy_from(&Vector3::new(0.3, -0.2, 0.9));
        let options = ConstraintOptions { horizon_s, ..ConstraintOptions::default() };
        let rows = rows_at(speed(1.0, 9.0), &at, &options);
        let row = rows[0].unwrap();
        let numeric = differences(&speed(1.0, 9.0), &at, horizon_s, 1e-2);
        // The rows neglect vertical speed over the Earth's radius.
        assert!((dense(speed(1.0, 9.0), &row, 9, horizon_s) - numeric).amax() < 2e-6);
        let value = speed(1.0, 9.0).value(&at, horizon_s).unwrap();
        let vector = vector_at(speed(1.0, 9.0), &at, horizon_s);
        assert!((row.at(&vector) - value).abs() < 1e-8 && rows[1].is_none(), "{value}");
        assert!((horizon_s > 0.0 || (value - 5.0).abs() < 1e-5) && row.interval.lower == 1.0);
    }
}

#[test]
fn a_speed_stays_below_its_maximum_whatever_is_known_of_its_direction() {
    for (velocity, sigma) in [([9.0, 3.0, 0.1], 1.0), ([2.0, -1.0, 0.1], 1.5), ([0.0; 3], 2.0)] {
        for horizon_s in [0.0, 1.0] {
            let mut mean = state(&[([0.0; 3], velocity)]);
            let mut spread = covariance(&[[5.0, sigma, 0.1]]);
            let options = ConstraintOptions { horizon_s, ..ConstraintOptions::default() };
            let bound = speed(0.0, 0.6 * velocity[0] + 0.5);
            let actions = constrain(&mut mean, &mut spread, &[bound], &options);
            assert_eq!(actions[0].outcome, ConstraintOutcome::Holds, "{actions:?}");
            let up = mean.fixed_rows::<3>(3).dot(&origin().up());
            assert!((up - velocity[2]).abs() < 1e-3, "the vertical velocity is none of its business: {up}");
            // Every component is known better than its bound (a uniform distribution has maximum/√3), except that across
            // a certain direction.
            let east = origin().vector_enu_to_ecef(Enu { east: 1.0, north: 0.0, up: 0.0 }).0;
            let variance = east.dot(&(spread.fixed_view::<3, 3>(3, 3) * east));
            assert!(variance < 0.95 * sigma * sigma, "{velocity:?}: {variance}");
        }
    }
}

#[test]
fn a_least_speed_needs_a_direction_that_is_certain() {
    let run = |speed_mps: f64, sigma: f64| {
        let mut mean = state(&[([0.0; 3], [0.6 * speed_mps, 0.8 * speed_mps, 0.0])]);
        let mut spread = covariance(&[[5.0, sigma, 0.1]]);
        let prior = (mean.clone(), spread.clone());
        let bound = speed(4.0, f64::INFINITY);
        let actions = constrain(&mut mean, &mut spread, &[bound], &ConstraintOptions::default());
        (actions, (mean.clone(), spread) == prior, bound.value(&mean, 0.0).unwrap())
    };
    let (actions, is_untouched, after) = run(3.0, 0.5);
    assert!(actions.len() == 1 && !is_untouched && after > 3.9, "{actions:?}");
    for (speed_mps, sigma) in [(3.0, 1.5), (0.0, 0.1)] {
        let (actions, is_untouched, _) = run(speed_mps, sigma);
        assert!(actions.is_empty() && is_untouched, "{speed_mps} {sigma}: {actions:?}");
    }
    // Twenty standard deviations: state and constraint contradict each other.
    let (actions, is_untouched, _) = run(3.0, 0.05);
    assert_eq!(actions[0].outcome, ConstraintOutcome::Skipped(SkipReason::Contradicted));
    assert!(is_untouched);
}

#[test]
fn heading_rows_have_the_derivative_of_the_course_at_their_edge() {
    // At the edge of the tolerance the row of the half-plane is speed times the gradient of the angle off course.
    let (course, tolerance, speed) = (4.0f64, 0.2f64, 12.0);
    for (side, index) in [(1.0, 1), (-1.0, 2)] {
        let angle = course + side * tolerance;
        let at = state(&[([0.0; 3], [speed * angle.sin(), speed * angle.cos(), 0.3])]);
        let constraint =
            Constraint::Heading(Heading { phone: 0, course_rad: course, tolerance_rad: tolerance });
        let rows = rows_at(constraint, &at, &ConstraintOptions::default());
        let row = rows[index].unwrap();
        let vector = vector_at(constraint, &at, 0.0);
        assert!(row.at(&vector).abs() < 1e-5, "{}", row.at(&vector));
        let numeric = differences(&constraint, &at, 0.0, 1e-3) * (side * speed);
        assert!((dense(constraint, &row, 9, 0.0) - numeric).rows(3, 3).amax() < 1e-6);
        // A velocity in the phone's direction is within the first half-plane.
        assert!(rows[0].unwrap().at(&vector) < 0.0);
    }
}

#[test]
fn values_are_none_without_a_state_for_them() {
    let empty = DVector::zeros(0);
    assert_eq!(distance(0.0, 1.0).value(&empty, 0.0), None);
    let heading = Constraint::Heading(Heading { phone: 0, course_rad: 0.0, tolerance_rad: 0.1 });
    assert_eq!(heading.value(&state(&[([0.0; 3], [0.0; 3])]), 0.0), None);
    let mut lost = state(&[([0.0; 3], [1.0; 3])]);
    lost.fixed_rows_mut::<3>(0).copy_from(&Ecef::new(f64::NAN, 0.0, 0.0).0);
    assert_eq!(heading.value(&lost, 0.0), None);
    assert!(heading.excess(f64::NAN).is_nan() && !heading.holds(f64::NAN));
}

#[test]
fn actions_tell_the_place_of_their_constraint_also_among_equal_ones() {
    let slow = Constraint::VerticalVelocity(VerticalVelocity { phone: 0, maximum_mps: 9.0 });
    let near = distance(0.0, 5.0);
    for options in [ConstraintOptions::peng2023(), fixed_sequential()] {
        let mut mean = state(&[([0.0; 3], [0.0; 3]), ([12.0, 0.0, 0.0], [0.0; 3])]);
        let mut spread = covariance(&[[1.0; 3], [3.0, 1.0, 1.0]]);
        let unknown = Constraint::VerticalVelocity(VerticalVelocity { phone: 7, maximum_mps: 9.0 });
        let actions = constrain(&mut mean, &mut spread, &[slow, near, unknown, unknown], &options);
        let places: Vec<_> = actions.iter().map(|action| (action.index, action.constraint)).collect();
        assert_eq!(places, [(1, near), (2, unknown), (3, unknown)]);
    }
}

#[test]
fn constraints_are_written_with_the_keys_of_their_kind_and_read_back() {
    use serde_json::{from_value, json, to_value};
    let written = [
        (distance(1.0, 2.5), json!({"kind": "distance", "minimum_m": 1.0, "maximum_m": 2.5})),
        (
            Constraint::VerticalVelocity(VerticalVelocity { phone: 0, maximum_mps: 0.5 }),
            json!({"kind": "vertical-velocity", "maximum_mps": 0.5}),
        ),
        (speed(1.0, 14.0), json!({"kind": "speed", "minimum_mps": 1.0, "maximum_mps": 14.0})),
        (
            Constraint::SameVehicle(SameVehicle { phones: [0, 1], maximum_mps: 0.8 }),
            json!({"kind": "same-vehicle", "maximum_mps": 0.8}),
        ),
        (height(-20.0, 14.0), json!({"kind": "height", "minimum_m": -20.0, "maximum_m": 14.0})),
        (
            Constraint::Heading(Heading {
                phone: 0,
                course_rad: 260f64.to_radians(),
                tolerance_rad: 10f64.to_radians(),
            }),
            json!({"kind": "heading", "course_deg": 260.0, "tolerance_deg": 10.0}),
        ),
    ];
    for (constraint, form) in written {
        assert_eq!(to_value(constraint).unwrap(), form);
        assert_eq!(form["kind"], constraint.name());
        let keys: Vec<&str> = form.as_object().unwrap().keys().map(String::as_str).collect();
        let mut of_kind = Constraint::keys(constraint.name()).to_vec();
        of_kind.push("kind");
        of_kind.sort_unstable();
        assert_eq!(keys, of_kind);
        let read: Constraint = from_value(form).unwrap();
        assert_eq!(read.among(&[0, 1]).first(), Some(&constraint));
    }
    assert!(Constraint::keys("speed of light").is_empty());
    let error = |form| from_value::<Constraint>(form).unwrap_err().to_string();
    let foreign = error(json!({"kind": "distance", "maximum_m": 2.0, "course_deg": 1.0}));
    assert!(foreign.contains("unknown field `course_deg`, expected `minimum_m` or `maximum_m`"), "{foreign}");
    assert!(error(json!({"kind": "heading", "course_deg": 1.0})).contains("missing field `tolerance_deg`"));
    for (bounds, due) in [
        (json!({}), "at least one of both"),
        (json!({"minimum_m": 3.0, "maximum_m": 3.0}), "not below"),
        (json!({"maximum_m": 6_371_000.0}), "ellipsoidal height"),
    ] {
        let mut form = bounds;
        form["kind"] = json!("height");
        assert!(error(form).contains(due), "{due}");
    }
}

#[test]
fn changes_of_values_are_written_in_units_for_people() {
    let heading = Constraint::Heading(Heading { phone: 0, course_rad: 0.0, tolerance_rad: 0.1 });
    for (constraint, before, written) in [
        (distance(0.0, 2.0), 2.5, "2.50 → 1.00 m"),
        (speed(0.0, 2.0), 2.5, "2.50 → 1.00 m/s"),
        (heading, 2.0, "114.6 → 57.3° off course"),
    ] {
        assert_eq!(constraint.unit().change(before, 1.0), written);
    }
}

#[test]
fn a_constraint_is_multiplied_by_phones_and_pairs_and_its_phones_are_mapped() {
    let pairs: Vec<_> =
        distance(0.0, 2.0).among(&[4, 2, 7]).iter().map(|pair| pair.phones().to_vec()).collect();
    assert_eq!(pairs, [[4, 2], [4, 7], [2, 7]]);
    let vertical = Constraint::VerticalVelocity(VerticalVelocity { phone: 0, maximum_mps: 1.0 });
    let singles: Vec<_> = vertical.among(&[4, 2]).iter().map(|one| one.phones().to_vec()).collect();
    assert_eq!(singles, [[4], [2]]);
    let slot = |phone| (phone < 5).then_some(10 + phone);
    assert_eq!(distance(0.0, 2.0).mapped(slot).unwrap().phones(), [10, 11]);
    assert_eq!(distance(0.0, 2.0).among(&[4, 7])[0].mapped(slot), None);
}
