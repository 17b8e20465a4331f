//! Phones that lie: named by the others, isolated, and without harm to them.

#![allow(clippy::unwrap_used)] // helpers of tests

mod group;

use cofix_common::constraint::{Constraint, Distance};
use cofix_common::frames::{EcefVector, Enu};
use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::fusion::peers::EventKind;
use cofix_common::integrity::{Cause, Verdict};
use cofix_common::simulation::Scenario;
use cofix_common::wire::EpochMessage;
use group::Group;

/// Begin of the lie, s.
const LIES_AT_S: f64 = 60.0;

/// A car with phones, of which some lie from 60 s on: their pseudoranges and positions are those of a place displaced by `by` (seconds since then).
fn group(phones: usize, liars: &[usize], by: impl Fn(&Group, usize, f64) -> EcefVector) -> Group {
    let mut group = Group::simulated(Scenario { duration_s: 160.0, ..Scenario::car(phones) });
    let start = group.simulation.scenario().start_gps;
    for phone in liars {
        let mut messages = std::mem::take(&mut group.messages[*phone]);
        for message in &mut messages {
            let lying_s = message.time_gps - start - LIES_AT_S;
            if lying_s >= 0.0 {
                let displacement = by(&group, *phone, lying_s);
                displace(&group, *phone, message, displacement);
            }
        }
        group.messages[*phone] = messages;
    }
    group
}

fn displace(group: &Group, phone: usize, message: &mut EpochMessage, by: EcefVector) {
    let truth = group.simulation.truth_at(phone, message.time_gps).position;
    for observation in &mut message.observations {
        let range_m = |from| observation.satellite_position.distance_m(from);
        observation.pseudorange_m += range_m(truth + by) - range_m(truth);
        observation.range_change = None;
    }
    if let Some(solution) = &mut message.wls {
        solution.position = solution.position + by;
    }
}

/// Two metres between all phones.
fn bounds(phones: usize) -> Vec<Constraint> {
    let pair = |a, b| Constraint::Distance(Distance { phones: [a, b], minimum_m: 0.0, maximum_m: 2.0 });
    (0..phones).flat_map(|a| (a + 1..phones).map(move |b| pair(a, b))).collect()
}

fn events(epochs: &[(f64, FusedEpoch)]) -> Vec<(f64, Vec<usize>, EventKind)> {
    let told = |(second, epoch): &(f64, FusedEpoch)| {
        epoch.events.iter().map(|event| (*second, event.phones.clone(), event.kind)).collect::<Vec<_>>()
    };
    epochs.iter().flat_map(told).collect()
}

/// 95th percentile of a phone's horizontal error from 70 s on, m.
fn p95_m(group: &Group, phone: usize, epochs: &[(f64, FusedEpoch)]) -> f64 {
    let settled = epochs.iter().filter(|(second, _)| *second > LIES_AT_S + 10.0);
    let states: Vec<_> =
        settled.filter_map(|(_, epoch)| Some((epoch.time_gps, epoch.phones[phone].state.clone()?))).collect();
    group.accuracy(phone, &states).horizontal_p95_m
}

fn east(group: &Group, phone: usize, metres: f64) -> EcefVector {
    let start = group.simulation.scenario().start_gps;
    let position = group.simulation.truth_at(phone, start).position;
    let frame = cofix_common::frames::LocalFrame::at(position);
    frame.vector_enu_to_ecef(Enu { east: metres, north: 0.0, up: 0.0 })
}

/// The liar is named within a time, nobody else is, and the others are as good as without it.
fn assert_named(name: &str, phones: usize, within_s: f64, by: impl Fn(&Group, usize, f64) -> EcefVector) {
    let liar = phones - 1;
    let lying = group(phones, &[liar], by);
    let fused = lying.fused(&bounds(phones));
    let told = events(&fused);
    println!("{name}, {phones} phones: {told:?}");
    let (second, named, kind) = &told[0];
    assert_eq!((kind, &named[..]), (&EventKind::Isolated, &[liar][..]), "{name}: {told:?}");
    assert!((LIES_AT_S..LIES_AT_S + within_s).contains(second), "{name}: {told:?}");
    assert!(told.iter().all(|(_, phones, _)| phones == &[liar]), "{name}: {told:?}");
    let isolated =
        fused.iter().filter(|(at, _)| at > second).filter_map(|(_, epoch)| epoch.phones[liar].verdict);
    let suspect = Verdict::Unreliable(Cause::Peers);
    let others = isolated.filter(|verdict| *verdict == Verdict::Reliable).count();
    assert_eq!(others, 0, "{name}: reliable although isolated, not {suspect}");
    // The same car without the liar.
    let mut alone = group(phones, &[], |_, _, _| EcefVector::new(0.0, 0.0, 0.0));
    alone.messages[liar].clear();
    let without = alone.fused(&bounds(phones));
    let mut sums_m = (0.0, 0.0);
    for phone in 0..liar {
        let (with_m, without_m) = (p95_m(&lying, phone, &fused), p95_m(&alone, phone, &without));
        println!("  phone {phone}: {with_m:.2} m, {without_m:.2} m without the liar");
        assert!(with_m < 1.2 * without_m, "{name}, phone {phone}: {with_m} m, {without_m} m");
        sums_m = (sums_m.0 + with_m, sums_m.1 + without_m);
    }
    assert!(sums_m.0 < 1.1 * sums_m.1, "{name}: {sums_m:?} m");
}

#[test]
fn a_phone_at_the_wrong_place_is_named() {
    for phones in [3, 4] {
        assert_named("30 m away", phones, 20.0, |group, phone, _| east(group, phone, 30.0));
    }
}

#[test]
fn a_phone_that_walks_away_is_named_before_it_is_15_m_off() {
    for phones in [3, 4] {
        assert_named("walking", phones, 30.0, |group, phone, lying_s| east(group, phone, 0.5 * lying_s));
    }
}

#[test]
fn a_frozen_phone_is_named() {
    assert_named("frozen", 4, 40.0, |group, phone, lying_s| {
        let start = group.simulation.scenario().start_gps + LIES_AT_S;
        let at = |second: f64| group.simulation.truth_at(phone, start + second).position;
        at(0.0) - at(lying_s)
    });
}

#[test]
fn a_phone_a_kilometre_away_is_named() {
    assert_named("spoofed", 4, 20.0, |group, phone, _| east(group, phone, 1_000.0));
}

#[test]
fn two_of_four_that_lie_alike_leave_it_open() {
    let lying = group(4, &[2, 3], |group, phone, _| east(group, phone, 30.0));
    let told = events(&lying.fused(&bounds(4)));
    println!("{told:?}");
    assert!(told.iter().any(|(_, _, kind)| *kind == EventKind::CannotTell), "{told:?}");
    assert!(told.iter().all(|(_, _, kind)| *kind != EventKind::Isolated), "{told:?}");
}

#[test]
fn a_wrong_bound_is_named_and_nobody_is_isolated() {
    let honest = group(4, &[], |_, _, _| EcefVector::new(0.0, 0.0, 0.0));
    let mut constraints = bounds(4);
    // The first two phones are within two metres, not 30 to 40 m apart.
    constraints[0] = Constraint::Distance(Distance { phones: [0, 1], minimum_m: 30.0, maximum_m: 40.0 });
    let told = events(&honest.fused(&constraints));
    println!("{told:?}");
    assert_eq!(told.len(), 1, "{told:?}");
    assert_eq!((told[0].2, &told[0].1[..]), (EventKind::ConstraintContradicted, &[0, 1][..]));
    assert!(told[0].0 < 20.0, "{told:?}");
}

/// Bad is not lying: a convoy through streets and cars in old towns name nobody.
#[test]
fn honest_phones_are_never_named() {
    for seed in 1..=5 {
        for scenario in [Scenario::car(4), Scenario::canyon(6), Scenario::default()] {
            let group = Group::simulated(Scenario { seed, duration_s: 360.0, ..scenario });
            let told = events(&group.fused(&group.simulation.distance_constraints()));
            assert!(told.is_empty(), "seed {seed}: {told:?}");
        }
    }
}
