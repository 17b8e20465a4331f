//! An epoch of a group of 4 to 100 simulated phones in the engine, on one core, without transport and recording.
//!
//! Four groups: a convoy with bounds on the distances of neighbours that hardly ever act (5 to 50 m), the same with narrow bounds that act at
//! every epoch (14 to 28 m), the same convoy with a bound on the distance of every pair (0 to 5 km), and phones in one car with a bound on
//! the distance of every pair (0 to 2 m). In all of them the vertical velocity of every phone is bounded to 1 m/s. The figure to read is the throughput: epochs of all phones per second.
#![allow(clippy::unwrap_used, missing_docs)]

use std::sync::Arc;

use cofix_common::constraint::{Constraint, Distance, VerticalVelocity};
use cofix_common::fusion::engine::{Engine, EngineOptions, ScheduledConstraint};
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
use cofix_common::simulation::{PhoneOptions, Scenario, Simulation};
use cofix_common::wire::EpochMessage;
use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};

/// Seconds of a scenario. The filters start in the first ones, which are not measured.
const DURATION_S: f64 = 40.0;
/// Epochs before the measured ones.
const WARM: usize = 20;
/// Measured epochs.
const EPOCHS: usize = 10;

/// Epochs of a group: a message of each phone.
type Buckets = Vec<Vec<Option<EpochMessage>>>;

/// The first epochs of a scenario whose phones record from begin to end.
fn buckets(mut scenario: Scenario) -> (Vec<String>, Buckets) {
    scenario.duration_s = DURATION_S;
    for phone in &mut scenario.phones {
        *phone = PhoneOptions { starts_after_s: 0.0, stops_before_s: 0.0, ..phone.clone() };
    }
    let simulation = Simulation::new(scenario).unwrap();
    let products = Arc::new(simulation.products());
    let names: Vec<String> = simulation.phone_names().into_iter().map(str::to_owned).collect();
    let mut buckets = vec![Vec::new(); WARM + EPOCHS];
    for (phone, name) in names.iter().enumerate() {
        let mut pipeline = PhonePipeline::new(name, Arc::clone(&products), PipelineOptions::default());
        for (bucket, simulated) in buckets.iter_mut().zip(simulation.epochs(phone)) {
            bucket.push(Some(pipeline.process(&simulated.epoch)));
        }
    }
    (names, buckets)
}

/// A bound on the distances of these pairs, and one metre a second upwards.
fn constraints(
    phones: usize,
    (minimum_m, maximum_m): (f64, f64),
    is_bounded: impl Fn(usize, usize) -> bool,
) -> Vec<ScheduledConstraint> {
    let always = |constraint| ScheduledConstraint { constraint, from_gps: None, to_gps: None };
    let pairs = (0..phones).flat_map(|a| (a + 1..phones).map(move |b| [a, b]));
    let distances = pairs
        .filter(|[a, b]| is_bounded(*a, *b))
        .map(|phones| Constraint::Distance(Distance { phones, minimum_m, maximum_m }));
    let vertical =
        (0..phones).map(|phone| Constraint::VerticalVelocity(VerticalVelocity { phone, maximum_mps: 1.0 }));
    distances.chain(vertical).map(always).collect()
}

fn measure(
    criterion: &mut Criterion,
    title: &str,
    scenario: fn(usize) -> Scenario,
    sizes: &[usize],
    bound: (f64, f64),
    is_bounded: fn(usize, usize) -> bool,
) {
    let mut group = criterion.benchmark_group(title);
    group.throughput(Throughput::Elements(EPOCHS as u64)).sample_size(10);
    for &phones in sizes {
        let (names, mut buckets) = buckets(scenario(phones));
        let measured = buckets.split_off(WARM);
        let ready = || {
            let constraints = constraints(phones, bound, is_bounded);
            let mut engine = Engine::new(&names, constraints, EngineOptions::default());
            for bucket in buckets.clone() {
                engine.step(bucket);
            }
            (engine, measured.clone())
        };
        group.bench_function(BenchmarkId::from_parameter(phones), |bencher| {
            bencher.iter_batched(
                ready,
                |(mut engine, buckets)| {
                    let fused: Vec<_> = buckets.into_iter().map(|bucket| engine.step(bucket)).collect();
                    (engine, fused)
                },
                BatchSize::PerIteration,
            );
        });
    }
    group.finish();
}

fn group_size(criterion: &mut Criterion) {
    let convoys = [4, 10, 20, 50, 100];
    measure(criterion, "neighbours", Scenario::convoy, &convoys, (5.0, 50.0), |a, b| a + 1 == b);
    measure(criterion, "narrow", Scenario::convoy, &convoys, (14.0, 28.0), |a, b| a + 1 == b);
    measure(criterion, "all pairs", Scenario::convoy, &convoys, (0.0, 5_000.0), |_, _| true);
    measure(criterion, "car", Scenario::car, &convoys[..3], (0.0, 2.0), |_, _| true);
}

criterion_group!(benches, group_size);
criterion_main!(benches);
