//! Constraints that are wrong: named, not applied, and nobody is isolated.

use cofix_common::constraint::{Constraint, Distance, Heading};
use cofix_common::frames::LocalFrame;
use cofix_common::fusion::engine::{FusedEpoch, ScheduledConstraint};
use cofix_common::fusion::peers::EventKind;
use cofix_common::simulation::Scenario;
use cofix_common::time::GpsTime;

use crate::displaced::bounds;
use crate::group::Group;
use crate::lies::{Car, events, p95_m};

const DURATION_S: f64 = 120.0;

fn groups(seed: u64, phones: usize) -> [Group; 2] {
    [Scenario::car(phones), Scenario::convoy(phones)]
        .map(|scenario| Group::simulated(Scenario { seed, duration_s: DURATION_S, ..scenario }))
}

fn always(constraint: Constraint) -> ScheduledConstraint {
    ScheduledConstraint { constraint, from_gps: None, to_gps: None }
}

/// Every phone's 95th percentile with the wrong constraint is within a tenth of that without it.
fn assert_harmless(group: &Group, right: &[ScheduledConstraint], fused: &[(f64, FusedEpoch)], from_s: f64) {
    let without = group.fused_by(right.to_vec());
    assert!(events(&without).is_empty());
    for phone in 0..group.messages.len() {
        let p95_m = |epochs| p95_m(group, phone, epochs, from_s);
        let (with_m, without_m) = (p95_m(fused), p95_m(&without));
        println!("  phone {phone}: {with_m:.2} m, {without_m:.2} m without the constraint");
        assert!(with_m < 1.1 * without_m, "phone {phone}: {with_m} m, {without_m} m");
    }
}

/// A course to the right or left of that which the phone has at a time, for 25 s.
fn wrong_course(group: &Group, from_gps: GpsTime, off_deg: f64) -> ScheduledConstraint {
    let truth = group.simulation.truth_at(0, from_gps);
    let velocity = LocalFrame::at(truth.position).vector_ecef_to_enu(truth.velocity);
    let course_rad = velocity.east.atan2(velocity.north) + off_deg.to_radians();
    let heading = Heading { phone: 0, course_rad, tolerance_rad: 10.0_f64.to_radians() };
    let to_gps = Some(from_gps + 25.0);
    ScheduledConstraint { constraint: heading.into(), from_gps: Some(from_gps), to_gps }
}

#[test]
fn a_course_that_is_off_by_90_degrees_is_named() {
    const FROM_S: f64 = 30.0;
    for (seed, phones, off_deg) in [(1, 1, 90.0), (2, 2, -90.0), (3, 3, 90.0), (4, 4, -90.0), (5, 3, -90.0)] {
        for group in groups(seed, phones) {
            let right: Vec<_> = group.simulation.distance_constraints().into_iter().map(always).collect();
            let mut scheduled = right.clone();
            let from_gps = group.simulation.scenario().start_gps + FROM_S;
            scheduled.push(wrong_course(&group, from_gps, off_deg));
            let fused = group.fused_by(scheduled);
            let told = events(&fused);
            println!("seed {seed}, {phones} phones: {told:?}");
            assert_eq!(told.len(), 1, "{told:?}");
            assert_eq!((told[0].2, &told[0].1[..]), (EventKind::ConstraintContradicted, &[0][..]));
            assert!(told[0].0 < FROM_S + 20.0, "{told:?}");
            assert_harmless(&group, &right, &fused, FROM_S);
        }
    }
}

/// Cars 16 to 26 m behind each other with a bound of 1 m between two of them. Two phones alone cannot tell whether the bound is wrong or one of them.
#[test]
fn a_bound_of_a_metre_between_cars_far_apart_is_named() {
    for (seed, phones) in [(1, 2), (2, 2), (1, 3), (2, 3), (3, 3), (1, 4), (2, 4), (3, 4)] {
        let [_, group] = groups(seed, phones);
        let right: Vec<_> = group.simulation.distance_constraints().into_iter().map(always).collect();
        for (place, scheduled) in right.iter().enumerate() {
            let &[a, b] = scheduled.constraint.phones() else { continue };
            if b != a + 1 {
                continue;
            }
            let mut wrong = right.clone();
            wrong[place] = always(Distance { phones: [a, b], minimum_m: 0.0, maximum_m: 1.0 }.into());
            let fused = group.fused_by(wrong);
            let told: Vec<_> =
                fused.iter().flat_map(|(s, epoch)| epoch.events.iter().map(|e| (*s, e))).collect();
            println!("seed {seed}, {phones} phones, {a} and {b}: {told:?}");
            assert_eq!(told.len(), 1, "{told:?}");
            let kind = if phones == 2 { EventKind::CannotTell } else { EventKind::ConstraintContradicted };
            assert_eq!((told[0].1.kind, told[0].1.constraint), (kind, Some(place)), "{told:?}");
            assert_eq!(told[0].1.phones, [a, b]);
            assert!(told[0].0 < 20.0, "{told:?}");
            let mut without = right.clone();
            without.remove(place);
            assert_harmless(&group, &without, &fused, 0.0);
        }
    }
}

#[test]
fn a_bound_that_is_too_long_is_named() {
    let honest = Car::of(4).honest();
    let mut constraints = bounds(4);
    // The first two phones are within two metres, not 30 to 40 m apart.
    constraints[0] = Constraint::Distance(Distance { phones: [0, 1], minimum_m: 30.0, maximum_m: 40.0 });
    let told = events(&honest.fused(&constraints));
    println!("{told:?}");
    assert_eq!(told.len(), 1, "{told:?}");
    assert_eq!((told[0].2, &told[0].1[..]), (EventKind::ConstraintContradicted, &[0, 1][..]));
    assert!(told[0].0 < 20.0, "{told:?}");
}
