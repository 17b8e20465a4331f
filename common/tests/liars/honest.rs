//! Bad is not lying: honest phones name nobody.

use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::simulation::{Canyon, Scenario};

use crate::group::Group;
use crate::lies::{Told, events};

/// Beyond a lap.
const LONGEST_ROAD_M: f64 = 20_000.0;

/// A convoy whose last car sees narrow streets all the way, the others those of the scenario.
fn one_in_a_canyon(scenario: Scenario) -> Group {
    let mut group = Group::simulated(scenario.clone());
    let canyons = Canyon::old_town(0.0, LONGEST_ROAD_M);
    let mut blocked = Group::simulated(Scenario { canyons, ..scenario });
    let last = group.messages.len() - 1;
    group.messages[last] = blocked.messages.swap_remove(last);
    group
}

fn fused(group: &Group) -> Vec<(f64, FusedEpoch)> {
    group.fused(&group.simulation.distance_constraints())
}

#[test]
fn honest_phones_are_never_named() {
    for seed in 1..=5 {
        for scenario in [Scenario::car(4), Scenario::canyon(6), Scenario::default()] {
            let group = Group::simulated(Scenario { seed, duration_s: 360.0, ..scenario });
            let told = events(&fused(&group));
            assert!(told.is_empty(), "seed {seed}: {told:?}");
        }
        let told =
            events(&fused(&one_in_a_canyon(Scenario { seed, duration_s: 360.0, ..Scenario::default() })));
        assert!(told.is_empty(), "seed {seed}, one in a canyon: {told:?}");
    }
}

/// Levels of the excess over a bound, in standard deviations.
const LEVELS: [f64; 6] = [1.0, 2.0, 3.0, 3.6, 4.5, 6.0];

/// How often the excess over a bound rises beyond each level.
fn crossings(epochs: &[(f64, FusedEpoch)], constraints: usize) -> [usize; LEVELS.len()] {
    let mut counts = [0; LEVELS.len()];
    let mut before = vec![0.0; constraints];
    for (_, epoch) in epochs {
        let mut now = vec![0.0; constraints];
        for action in &epoch.actions {
            now[action.index] = action.free_sigmas;
        }
        for (count, level) in counts.iter_mut().zip(LEVELS) {
            *count += before.iter().zip(&now).filter(|(a, b)| **a <= level && **b > level).count();
        }
        before = now;
    }
    counts
}

/// Events in hours of honest groups, and how often bounds are exceeded.
fn hours(name: &str, group: impl Fn(u64) -> Group) -> Vec<Told> {
    let (mut told, mut phone_hours, mut pair_hours, mut counts) = (Vec::new(), 0.0, 0.0, [0; LEVELS.len()]);
    for seed in 1..=10 {
        let group = group(seed);
        let (phones, pairs) = (group.messages.len(), group.simulation.distance_constraints().len());
        let epochs = fused(&group);
        let hours = group.simulation.scenario().duration_s / 3_600.0;
        phone_hours += phones as f64 * hours;
        pair_hours += pairs as f64 * hours;
        for (sum, count) in counts.iter_mut().zip(crossings(&epochs, pairs)) {
            *sum += count;
        }
        told.extend(events(&epochs));
    }
    let rates: Vec<String> = LEVELS
        .iter()
        .zip(counts)
        .map(|(level, n)| format!("{level}: {:.2}", n as f64 / pair_hours))
        .collect();
    println!(
        "{name}: {} events in {phone_hours} hours of phones; excesses an hour and pair {rates:?}",
        told.len()
    );
    told
}

#[test]
fn honest_phones_are_never_named_in_an_hour() {
    if !crate::takes_minutes() {
        return;
    }
    let hour = |seed, scenario| Scenario { seed, duration_s: 3_600.0, ..scenario };
    let mut told = hours("convoy", |seed| Group::simulated(hour(seed, Scenario::default())));
    told.extend(hours("convoy, one in a canyon", |seed| one_in_a_canyon(hour(seed, Scenario::default()))));
    told.extend(hours("car", |seed| Group::simulated(hour(seed, Scenario::car(4)))));
    told.extend(hours("canyon", |seed| Group::simulated(hour(seed, Scenario::canyon(6)))));
    assert!(told.is_empty(), "{told:?}");
}
