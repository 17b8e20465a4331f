//! The kind of error that is told of a phone when it is isolated.

use std::collections::BTreeMap;

use cofix_common::frames::Enu;
use cofix_common::fusion::peers::ErrorKind;

use crate::displaced::bounds;
use crate::group::Group;
use crate::lies::{Car, east, events, first_error};

type Lie = (&'static str, ErrorKind, fn(Car) -> Group);

const LIES: [Lie; 12] = [
    ("30 m east", ErrorKind::WrongPlace, |car| car.displaced(|group, _| east(group, 30.0))),
    ("20 m west", ErrorKind::WrongPlace, |car| car.displaced(|group, _| east(group, -20.0))),
    ("1 km east", ErrorKind::WrongPlace, |car| car.displaced(|group, _| east(group, 1_000.0))),
    ("0.5 m/s east", ErrorKind::Drifting, |car| car.displaced(|group, s| east(group, 0.5 * s))),
    ("1 m/s west", ErrorKind::Drifting, |car| car.displaced(|group, s| east(group, -s))),
    ("frozen", ErrorKind::Frozen, |car| car.displaced(move |group, s| car.back(group, s))),
    ("standing 1 km away", ErrorKind::Frozen, |car| car.standing(1_000.0)),
    ("a second late", ErrorKind::WrongClock, |car| car.of_another_second(1.0)),
    ("a second early", ErrorKind::WrongClock, |car| car.of_another_second(-1.0)),
    ("left standing", ErrorKind::LeftBehind, |car| car.standing(0.0)),
    ("another vehicle", ErrorKind::LeftBehind, |car| car.leaving(Enu { east: 5.0, north: 0.0, up: 0.0 })),
    ("carried away", ErrorKind::LeftBehind, |car| car.leaving(Enu { east: 0.0, north: 1.0, up: 0.0 })),
];

/// Counts of the kinds that are told of a lie, of groups with three and four phones, and the times after which it is named, s, sorted.
fn told(lie: fn(Car) -> Group, begin_s: f64, seeds: u64) -> (BTreeMap<String, usize>, Vec<f64>) {
    let (mut counts, mut after_s) = (BTreeMap::new(), Vec::new());
    for phones in [3, 4] {
        for seed in 1..=seeds {
            let car = Car { phones, seed, begin_s };
            let fused = lie(car).fused(&bounds(phones));
            let told = events(&fused);
            let first = told.first().filter(|(_, named, _)| named == &[car.liar()]);
            after_s.push(first.map_or(f64::INFINITY, |(second, _, _)| second - begin_s));
            *counts.entry(format!("{:?}", first_error(&fused))).or_default() += 1;
        }
    }
    after_s.sort_by(f64::total_cmp);
    (counts, after_s)
}

fn right(counts: &BTreeMap<String, usize>, expected: ErrorKind) -> usize {
    counts.get(&format!("{:?}", Some(expected))).copied().unwrap_or(0)
}

/// The car has just changed its speed, or does so within seconds.
#[test]
fn the_kind_of_an_error_is_told_at_isolation() {
    for (name, expected, lie) in LIES {
        let (counts, _) = told(lie, 100.0, 3);
        println!("{name}: {counts:?}");
        let (right, unknown) = (right(&counts, expected), right(&counts, ErrorKind::Unknown));
        assert!(right >= 4, "{name}: {counts:?}");
        assert_eq!(right + unknown, 6, "{name}: {counts:?}");
    }
}

#[test]
fn the_kind_of_an_error_at_many_seeds() {
    if !crate::takes_minutes() {
        return;
    }
    for (name, expected, lie) in LIES {
        for begin_s in [25.0, 60.0, 100.0] {
            let (counts, after_s) = told(lie, begin_s, 10);
            let right = right(&counts, expected);
            println!(
                "{name}, begin {begin_s} s: {right} of 20 right, {counts:?}; named after {after_s:.1?} s"
            );
        }
    }
}

/// Between cars, of which the phones are not companions, no kind is told.
#[test]
fn without_companions_the_kind_is_unknown() {
    let car = Car::of(3);
    let group = car.displaced(|group, _| east(group, 100.0));
    let far: Vec<_> = bounds(3)
        .into_iter()
        .map(|constraint| match constraint {
            cofix_common::constraint::Constraint::Distance(distance) => {
                cofix_common::constraint::Distance { maximum_m: 20.0, ..distance }.into()
            }
            other => other,
        })
        .collect();
    assert_eq!(first_error(&group.fused(&far)), Some(ErrorKind::Unknown));
}
