//! Phones that lie, and wrong constraints: named, and without harm to the others.

#![allow(clippy::unwrap_used)] // helpers of tests

#[path = "../displaced/mod.rs"]
mod displaced;
#[path = "../group/mod.rs"]
mod group;
mod honest;
mod kinds;
mod lies;
mod wrong_constraints;

use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::fusion::peers::EventKind;
use cofix_common::integrity::{Cause, Verdict};
use displaced::bounds;
use group::Group;
use lies::{Car, Told, east, events, p95_m};

/// Whether tests of minutes are wanted: those of many hours and seeds.
fn takes_minutes() -> bool {
    let is_wanted = std::env::var_os("COFIX_LONG_TESTS").is_some();
    if !is_wanted {
        println!("skipped: set COFIX_LONG_TESTS to run it for minutes");
    }
    is_wanted
}

/// The liar is named within a time, nobody else is, and the others are as good as without it.
fn assert_named(name: &str, car: Car, within_s: f64, lying: &Group) -> Vec<Told> {
    let (liar, bounds, from_s) = (car.liar(), bounds(car.phones), car.begin_s + 10.0);
    let fused = lying.fused(&bounds);
    let told = events(&fused);
    println!("{name}, {} phones, begin {} s: {told:?}", car.phones, car.begin_s);
    let (second, named, kind) = &told[0];
    assert_eq!((kind, &named[..]), (&EventKind::Isolated, &[liar][..]), "{name}: {told:?}");
    assert!((car.begin_s..car.begin_s + within_s).contains(second), "{name}: {told:?}");
    assert!(told.iter().all(|(_, phones, _)| phones == &[liar]), "{name}: {told:?}");
    assert_not_reliable(name, liar, &fused, &told);
    // The same car without the liar.
    let mut alone = car.honest();
    alone.messages[liar].clear();
    let without = alone.fused(&bounds);
    let mut sums_m = (0.0, 0.0);
    for phone in 0..liar {
        let (with_m, without_m) =
            (p95_m(lying, phone, &fused, from_s), p95_m(&alone, phone, &without, from_s));
        println!("  phone {phone}: {with_m:.2} m, {without_m:.2} m without the liar");
        assert!(with_m < 1.2 * without_m, "{name}, phone {phone}: {with_m} m, {without_m} m");
        sums_m = (sums_m.0 + with_m, sums_m.1 + without_m);
    }
    assert!(sums_m.0 < 1.1 * sums_m.1, "{name}: {sums_m:?} m");
    told
}

/// No verdict of the liar is reliable while it is isolated.
fn assert_not_reliable(name: &str, liar: usize, fused: &[(f64, FusedEpoch)], told: &[Told]) {
    let until_s = told.get(1).map_or(f64::INFINITY, |(second, _, _)| *second);
    let isolated = fused.iter().filter(|(second, _)| *second > told[0].0 && *second < until_s);
    let reliable = isolated
        .filter_map(|(_, epoch)| epoch.phones[liar].verdict)
        .filter(|verdict| *verdict == Verdict::Reliable)
        .count();
    let suspect = Verdict::Unreliable(Cause::Peers);
    assert_eq!(reliable, 0, "{name}: reliable although isolated, not {suspect}");
}

#[test]
fn a_phone_at_the_wrong_place_is_named() {
    for car in [3, 4].map(Car::of) {
        assert_named("30 m away", car, 10.0, &car.displaced(|group, _| east(group, 30.0)));
    }
}

#[test]
fn a_phone_that_walks_away_is_named_before_it_is_16_m_off() {
    for car in [3, 4].map(Car::of) {
        assert_named("walking", car, 32.0, &car.displaced(|group, lying_s| east(group, 0.5 * lying_s)));
    }
}

#[test]
fn a_frozen_phone_is_named() {
    let car = Car::of(4);
    assert_named("frozen", car, 20.0, &car.displaced(|group, lying_s| car.back(group, lying_s)));
}

#[test]
fn a_phone_a_kilometre_away_is_named() {
    for car in [3, 4].map(Car::of) {
        assert_named("spoofed", car, 20.0, &car.displaced(|group, _| east(group, 1_000.0)));
        assert_named("satellites of another place", car, 20.0, &car.standing(1_000.0));
    }
}

/// A second is 14 m. What belongs to another second is right while the car stands: the phone is not taken in again for that.
#[test]
fn a_phone_whose_epochs_are_a_second_off_is_named_while_the_car_drives() {
    for begin_s in [25.0, 100.0] {
        for phones in [3, 4] {
            let car = Car { begin_s, ..Car::of(phones) };
            for by_s in [1.0, -1.0] {
                let told = assert_named(&format!("{by_s} s"), car, 20.0, &car.of_another_second(by_s));
                assert_eq!(told.len(), 1, "{told:?}");
            }
        }
    }
}

#[test]
fn a_phone_that_is_right_again_is_taken_in_again() {
    let car = Car::of(4);
    let away = |group: &Group, lying_s: f64| east(group, if lying_s < 30.0 { 30.0 } else { 0.0 });
    let told = assert_named("away for 30 s", car, 20.0, &car.displaced(away));
    assert_eq!(told.len(), 2, "{told:?}");
    assert_eq!(told[1].2, EventKind::Readmitted);
    assert!((100.0..130.0).contains(&told[1].0), "{told:?}");
}

#[test]
fn two_of_four_that_lie_alike_leave_it_open() {
    let car = Car::of(4);
    let away = |group: &Group, _: f64| east(group, 30.0);
    let mut lying = car.displaced(away);
    lying.messages[2] = Car::of(3).displaced(away).messages.swap_remove(2);
    let told = events(&lying.fused(&bounds(4)));
    println!("{told:?}");
    assert!(told.iter().any(|(_, _, kind)| *kind == EventKind::CannotTell), "{told:?}");
    assert!(told.iter().all(|(_, _, kind)| *kind != EventKind::Isolated), "{told:?}");
}
