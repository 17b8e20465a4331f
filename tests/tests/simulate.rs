//! Simulated scenarios: what is written and replayed is what was simulated, and what cooperation is worth.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

use std::sync::Arc;

use cofix_agent::source::products::Loaded;
use cofix_agent::{ProductSource, Source, Stop, source};
use cofix_common::accuracy::Accuracy;
use cofix_common::formats::decode::Record;
use cofix_common::pipeline::PhonePipeline;
use cofix_common::simulation::Scenario;
use cofix_common::wire::EpochMessage;
use cofix_hub::demo;
use cofix_hub::replay::{Outcome, Plan, ReplayOptions, replay};
use cofix_hub::report::scores::ByPhone;
use cofix_hub::session::Session;
use cofix_hub::simulate::{Arguments, Kind, simulate};

fn run(plan: &Plan) -> Outcome {
    replay(plan, &ReplayOptions::default(), &Stop::default()).unwrap()
}

/// A minute of a scenario, written and read as a session, and in memory.
fn both(kind: Kind, folder: &std::path::Path) -> (Plan, Plan) {
    let arguments = Arguments {
        scenario: kind,
        out: folder.to_owned(),
        seed: 5,
        duration: 60.0,
        phones: None,
        overwrite: false,
    };
    let session = Session::read(&simulate(&arguments, &Stop::default()).unwrap(), None).unwrap();
    (Plan::from_session(&session).unwrap(), demo::plan(arguments.scenario()).unwrap())
}

/// What an agent makes of a phone.
fn messages(plan: &Plan, phone: usize) -> Vec<EpochMessage> {
    let products = Loaded::read(&plan.products).unwrap().products;
    let planned = &plan.phones[phone];
    let mut pipeline =
        PhonePipeline::new(&planned.name, Arc::clone(&products), plan.pipeline(planned).unwrap());
    match &planned.source {
        Source::Epochs(epochs) => epochs.iter().map(|epoch| pipeline.process(epoch)).collect(),
        Source::File { path, .. } => {
            let mut records = source::open_file(path, &source::Reading::default()).unwrap();
            let mut messages = Vec::new();
            while let Some(record) = records.next(&Stop::default()).unwrap() {
                if let Record::Epoch(epoch) = record {
                    messages.push(pipeline.process(&epoch));
                }
            }
            messages
        }
        other @ Source::Live { .. } => panic!("neither simulated nor a file: {other:?}"),
    }
}

#[test]
fn what_is_written_and_replayed_is_what_was_simulated() {
    for kind in Kind::ALL {
        let folder = tempfile::tempdir().unwrap();
        let (written, simulated) = both(kind, folder.path());
        assert!(matches!(written.products, ProductSource::Files(_)));
        let (mut wls_m, mut local_m) = (0.0_f64, 0.0_f64);
        for phone in 0..written.phones.len() {
            let (read, direct) = (messages(&written, phone), messages(&simulated, phone));
            assert_eq!(read.len(), direct.len(), "{kind:?}");
            for (a, b) in read.iter().zip(&direct) {
                assert_eq!((a.time_gps, a.observations.len()), (b.time_gps, b.observations.len()));
                let pair = a.wls.as_ref().zip(b.wls.as_ref());
                wls_m = wls_m.max(pair.map_or(0.0, |(a, b)| a.position.distance_m(b.position)));
                let pair = a.local.as_ref().zip(b.local.as_ref());
                local_m = local_m.max(pair.map_or(0.0, |(a, b)| a.position().distance_m(b.position())));
            }
        }
        let (read, direct) = (run(&written).report, run(&simulated).report);
        let mut report_m = 0.0_f64;
        for (a, b) in [
            (&read.methods.wls, &direct.methods.wls),
            (&read.methods.local, &direct.methods.local),
            (&read.methods.joint, &direct.methods.joint),
        ] {
            for (name, accuracy) in a {
                let (a, b) = (accuracy.unwrap(), b[name].unwrap());
                assert_eq!((a.epochs, a.availability), (b.epochs, b.availability), "{kind:?} {name}");
                let values: [fn(&Accuracy) -> f64; 3] =
                    [|a| a.horizontal_p50_m, |a| a.horizontal_p95_m, |a| a.rmse_up_m];
                let differences = values.into_iter().map(|value| (value(&a) - value(&b)).abs());
                report_m = differences.fold(report_m, f64::max);
            }
        }
        println!("{kind:?}: wls {wls_m:.5} m, local {local_m:.5} m, report {report_m:.5} m");
        // Half a millimetre on a pseudorange, by a dilution of precision below 20.
        assert!(wls_m < 0.01 && local_m < 0.01 && report_m < 0.005, "{kind:?}: {wls_m} {local_m} {report_m}");
        assert_eq!(read.skips.to_string(), direct.skips.to_string(), "{kind:?}");
    }
}

fn mean(phones: &ByPhone, value: fn(&Accuracy) -> f64) -> f64 {
    let scored: Vec<&Accuracy> = phones.values().flatten().collect();
    scored.iter().map(|accuracy| value(accuracy)).sum::<f64>() / scored.len() as f64
}

/// The bounds are those of the table in docs/results.md with some room; they fail when cooperation is lost.
#[test]
fn cooperation_wins_in_the_demonstration() {
    let (mut local, mut joint) = ([0.0; 2], [0.0; 2]);
    let mut better = 0;
    for seed in 1..=4 {
        let methods = run(&demo::plan(Scenario { seed, ..demo::scenario() }).unwrap()).report.methods;
        for (sums, phones) in [(&mut local, &methods.local), (&mut joint, &methods.joint)] {
            sums[0] += 0.25 * mean(phones, |a| a.horizontal_p50_m);
            sums[1] += 0.25 * mean(phones, |a| a.horizontal_p95_m);
        }
        for (name, accuracy) in &methods.joint {
            let (joint, local) = (accuracy.unwrap(), methods.local[name].unwrap());
            assert_eq!(methods.joint.len(), 6);
            better += i32::from(joint.horizontal_p50_m < local.horizontal_p50_m);
        }
        if seed == demo::scenario().seed {
            assert!(joint[0] < 0.85 * local[0] && joint[1] < 0.9 * local[1], "{joint:?} {local:?}");
        }
    }
    println!("local {local:.2?}, joint {joint:.2?}, better for {better} of 24");
    assert!(joint[0] < 0.85 * local[0], "p50: joint {joint:?}, local {local:?}");
    assert!(joint[1] < 0.90 * local[1], "p95: joint {joint:?}, local {local:?}");
    assert!(better >= 20, "{better} of 24 phones gain");
}
