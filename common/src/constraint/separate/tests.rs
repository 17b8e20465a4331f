//! Constraints on independent phones against the same constraints on one joint state.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::engine::jointly;
use super::super::kinds::{Distance, Heading, Height, Speed, VerticalVelocity};
use super::super::options::DistanceModel;
use super::super::prior::Joint;
use super::super::second::{Between, carry};
use super::*;
use crate::frames::{Enu, Geodetic, LocalFrame};

/// Number of errors that all phones share.
const SHARED: usize = 5;
/// Largest difference of the two ways in standard deviations, and relative to them.
const ROUNDING: f64 = 1e-7;

/// Independent phones with the sensitivities of their errors to shared ones.
struct Group {
    phones: Vec<FreePhone>,
    shared: Vec<SMatrix<f64, STATES_PER_PHONE, SHARED>>,
}

impl Between for Group {
    fn between<const N: usize>(&self, a: usize, b: usize) -> SMatrix<f64, N, N> {
        let of = |phone: usize| self.shared[phone].fixed_rows::<N>(0).into_owned();
        of(a) * of(b).transpose()
    }
}

impl Group {
    /// Phones somewhere in a square, with dependent states.
    fn random(phones: usize, size_m: f64, random: &mut ChaCha8Rng) -> Self {
        let frame = LocalFrame::at(Geodetic::from_degrees(30.5, 114.3, 30.0).geodetic_to_ecef());
        let mut unit = |scale: f64| scale * (2.0 * random.random::<f64>() - 1.0);
        let mut group = Self { phones: Vec::new(), shared: Vec::new() };
        for _ in 0..phones {
            let place = Enu { east: unit(size_m), north: unit(size_m), up: unit(3.0) };
            let velocity = Enu { east: unit(8.0), north: unit(8.0), up: unit(1.0) };
            let mut mean = SVector::<f64, STATES_PER_PHONE>::zeros();
            mean.fixed_rows_mut::<3>(0).copy_from(&frame.enu_to_ecef(place).0);
            mean.fixed_rows_mut::<3>(3).copy_from(&frame.vector_enu_to_ecef(velocity).0);
            mean.fixed_rows_mut::<3>(6).copy_from(&Vector3::from_fn(|_, _| unit(0.5)));
            let scales = [2.0, 2.0, 2.0, 0.7, 0.7, 0.7, 0.4, 0.4, 0.4];
            let root = PhoneMatrix::from_fn(|row, column| {
                unit(0.6 * scales[row]) + if row == column { scales[row] } else { 0.0 }
            });
            group.phones.push(FreePhone::new(mean, root * root.transpose()));
            group.shared.push(SMatrix::from_fn(|row, _| unit(scales[row])));
        }
        group
    }

    fn stated(&self) -> Vec<PhoneMatrix> {
        let own = |(phone, shared): (&FreePhone, &SMatrix<f64, STATES_PER_PHONE, SHARED>)| {
            phone.covariance * 0.8 + shared * shared.transpose()
        };
        self.phones.iter().zip(&self.shared).map(own).collect()
    }

    /// Mean, covariance and second covariance as one joint state.
    fn joint(&self) -> (DVector<f64>, DMatrix<f64>, DMatrix<f64>) {
        let n = STATES_PER_PHONE * self.phones.len();
        let mean = DVector::from_iterator(n, self.phones.iter().flat_map(|phone| phone.mean.iter().copied()));
        let (mut covariance, mut second) = (DMatrix::zeros(n, n), DMatrix::zeros(n, n));
        for (a, (phone, stated)) in self.phones.iter().zip(self.stated()).enumerate() {
            block_mut(&mut covariance, a, a).copy_from(&phone.covariance);
            block_mut(&mut second, a, a).copy_from(&stated);
            for b in (0..self.phones.len()).filter(|b| *b != a) {
                block_mut(&mut second, a, b).copy_from(&self.between::<STATES_PER_PHONE>(a, b));
            }
        }
        (mean, covariance, second)
    }
}

fn block_mut(
    matrix: &mut DMatrix<f64>,
    a: usize,
    b: usize,
) -> nalgebra::MatrixViewMut<'_, f64, nalgebra::U9, nalgebra::U9, nalgebra::U1, nalgebra::Dyn> {
    matrix.fixed_view_mut::<9, 9>(STATES_PER_PHONE * a, STATES_PER_PHONE * b)
}

/// Constraints of all kinds on some of the phones.
fn random_constraints(phones: usize, random: &mut ChaCha8Rng) -> Vec<Constraint> {
    let mut constraints = Vec::new();
    for a in 0..phones {
        for b in a + 1..phones {
            let (minimum_m, maximum_m) =
                [(0.0, 2.0), (5.0, 50.0), (0.0, 12.0), (4.0, 9.0), (0.0, 5000.0)][random.random_range(0..5)];
            if random.random_bool(0.6) {
                constraints.push(Distance { phones: [a, b], minimum_m, maximum_m }.into());
            }
        }
        if random.random_bool(0.5) {
            constraints.push(VerticalVelocity { phone: a, maximum_mps: 0.3 }.into());
        }
        if random.random_bool(0.3) {
            constraints.push(Speed { phone: a, minimum_mps: 2.0, maximum_mps: 4.0 }.into());
        }
        if random.random_bool(0.3) {
            constraints.push(Height { phone: a, minimum_m: 29.0, maximum_m: 32.0 }.into());
        }
        if random.random_bool(0.3) {
            constraints.push(Heading { phone: a, course_rad: 1.0, tolerance_rad: 0.4 }.into());
        }
    }
    constraints
}

/// The dense form: P₂ − WDᵀ − DWᵀ + WYWᵀ with W = PCᵀ(CPCᵀ + T⁻¹)⁻¹, D = P₂Cᵀ and Y = CP₂Cᵀ + T⁻¹.
fn carried_jointly(covariance: &DMatrix<f64>, tasks: &[Task<'_>], second: &DMatrix<f64>) -> DMatrix<f64> {
    let sites = |task: &Task<'_>| {
        let Seat::In { placed, .. } = task.seat else { return Vec::new() };
        let row = |axis: Vector3<f64>| {
            let mut row = DVector::zeros(covariance.nrows());
            for (offset, factor) in placed.iter() {
                let mut part = row.fixed_rows_mut::<3>(offset);
                part += axis * factor;
            }
            row
        };
        let acting = task.sites.iter().flatten().filter(|site| site.precision > 0.0);
        acting.map(|site| (row(site.axis), 1.0 / site.precision)).collect::<Vec<_>>()
    };
    let (rows, noise): (Vec<_>, Vec<_>) = tasks.iter().flat_map(sites).unzip();
    if rows.is_empty() {
        return second.clone();
    }
    let c = DMatrix::from_columns(&rows).transpose();
    let noise = DMatrix::from_diagonal(&DVector::from_vec(noise));
    let factor = (&c * covariance * c.transpose() + &noise).cholesky().unwrap();
    let w = factor.solve(&(&c * covariance)).transpose();
    let d = second * c.transpose();
    let y = &c * &d + noise;
    second - &w * d.transpose() - &d * w.transpose() + &w * y * w.transpose()
}

/// Compares both ways. Returns the number of components and the number of constraints that acted.
fn compare(group: &Group, constraints: &[Constraint], options: &ConstraintOptions) -> (usize, usize) {
    let pairs: Vec<(usize, usize)> = constraints
        .iter()
        .filter_map(|constraint| match constraint {
            Constraint::Distance(Distance { phones: [a, b], .. }) => Some((*a, *b)),
            _ => None,
        })
        .collect();
    let separated = constrain_separately(&group.phones, constraints, &pairs, options);
    let stated = carry(&separated, &group.stated(), group, &pairs);

    let (mean, covariance, second) = group.joint();
    let frames = Joint::frames(&mean);
    let prior = Joint::new(&mean, &covariance, &frames);
    let mut tasks = Task::all(constraints, &prior, options);
    let after = jointly(&mean, &covariance, &mut tasks, options);
    let mut second = carried_jointly(&covariance, &tasks, &second);
    let after = after.map_or_else(|| mean.clone(), |after| after.state);

    let reported: Vec<usize> = separated.actions.iter().map(|action| action.index).collect();
    let expected = tasks.iter().filter(|task| task.acted || task.skipped.is_some());
    assert_eq!(reported, expected.map(|task| task.index).collect::<Vec<_>>());
    for (phone, (mean, own)) in separated.means.iter().zip(&stated.own).enumerate() {
        let covariance = block_mut(&mut second, phone, phone).into_owned();
        let sigmas = covariance.diagonal().map(f64::sqrt);
        let moved = (mean - after.fixed_rows::<9>(STATES_PER_PHONE * phone)).component_div(&sigmas);
        assert!(moved.amax() < ROUNDING, "phone {phone}: {moved}");
        let scaled = (own - covariance).component_div(&(sigmas * sigmas.transpose()));
        assert!(scaled.amax() < ROUNDING, "phone {phone}: {scaled}");
    }
    for ((a, b), pair) in pairs.iter().zip(&stated.pairs) {
        let expected: Matrix3<f64> = block_mut(&mut second, *a, *b).fixed_view::<3, 3>(0, 0).into_owned();
        assert!((pair - expected).amax() < ROUNDING, "phones {a} and {b}: {pair}{expected}");
    }
    (separated.components.len(), reported.len())
}

#[test]
fn independent_phones_have_the_result_of_one_joint_state() {
    let plain = ConstraintOptions { contradiction_sigmas: f64::INFINITY, ..ConstraintOptions::default() };
    let all = [
        plain,
        ConstraintOptions { distance_model: DistanceModel::Box, horizon_s: 1.0, ..plain },
        ConstraintOptions { act_when_inside: false, ..plain },
        ConstraintOptions::peng2023(),
    ];
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let (mut several, mut acted) = (0, 0);
    for round in 0..120 {
        let phones = random.random_range(2..=6);
        let group = Group::random(phones, [4.0, 25.0][round % 2], &mut random);
        let constraints = random_constraints(phones, &mut random);
        let (components, actions) = compare(&group, &constraints, &all[round % all.len()]);
        several += usize::from(components > 1);
        acted += actions;
    }
    assert!(several > 30 && acted > 400, "{several} {acted}");
}

/// Twenty phones in one component: changes of the covariance are collected.
#[test]
fn a_large_component_has_the_result_of_one_joint_state() {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let options = ConstraintOptions { contradiction_sigmas: f64::INFINITY, ..ConstraintOptions::default() };
    let group = Group::random(20, 15.0, &mut random);
    let next = |minimum_m, maximum_m| {
        move |a: usize| Constraint::from(Distance { phones: [a, (a + 1) % 20], minimum_m, maximum_m })
    };
    let constraints: Vec<_> = (0..10).map(next(4.0, 9.0)).chain((10..20).map(next(0.0, 12.0))).collect();
    let (components, acted) = compare(&group, &constraints, &options);
    assert!(components == 1 && acted > 15, "{components} {acted}");
}

/// The third phone pulls the second one away from the first, so that the distance of those two, idle at first, is violated.
#[test]
fn a_constraint_that_others_violate_connects_its_phones() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut group = Group::random(4, 1.0, &mut random);
    let base = group.phones[0].mean;
    for (phone, (east_m, sigma)) in
        [(0.0, 1.0), (10.0, 1.0), (60.0, 0.1), (10.0, 1.0)].into_iter().enumerate()
    {
        let mut mean = base;
        mean[0] += east_m;
        group.phones[phone] = FreePhone::new(mean, PhoneMatrix::identity() * sigma * sigma);
    }
    let distance = |phones, maximum_m| Distance { phones, minimum_m: 0.0, maximum_m }.into();
    let options = ConstraintOptions { contradiction_sigmas: f64::INFINITY, ..ConstraintOptions::default() };
    let idle = distance([0, 1], 30.0);
    assert_eq!(compare(&group, &[idle], &options), (0, 0));
    assert_eq!(compare(&group, &[idle, distance([1, 3], 2.0)], &options).0, 1);
    let constraints = [idle, distance([1, 2], 2.0), distance([0, 3], 40.0)];
    assert_eq!(compare(&group, &constraints, &options), (1, 2));
}
