//! From the bytes of four phones' RINEX files to fused, constrained states, on one core, without transport and recording.
//!
//! Uses the session WH-3-08 of the reference data; without it, it says so and measures nothing.
//! The figure to read is the throughput of `all`, in phone-epochs per second; `parse`, `agents` and `hub` are its parts.
#![allow(clippy::unwrap_used, missing_docs)]

#[path = "../../common/tests/beside/mod.rs"]
mod beside;

use std::sync::Arc;
use std::time::Duration;

use cofix_common::constraint::{Constraint, Distance, VerticalVelocity};
use cofix_common::formats::rinex::ObservationFile;
use cofix_common::fusion::align::{AlignOptions, Aligner};
use cofix_common::fusion::engine::{Engine, EngineOptions, ScheduledConstraint};
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::{Products, Sp3};
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
use cofix_common::wire::EpochMessage;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

const PHONES: [&str; 4] = ["HP30", "HP20", "VX30", "XIM8"];

struct Session {
    observations: Vec<Vec<u8>>,
    products: Arc<Products>,
}

impl Session {
    fn load() -> Option<Self> {
        let whu = "data/whu-wuhan-2020-08-13";
        let read = |below: String| std::fs::read(beside::path(&below)).ok();
        let observations =
            PHONES.iter().map(|p| read(format!("{whu}/WH-3-08/{p}.rnx"))).collect::<Option<_>>()?;
        let sp3 = Sp3::parse(&read(format!("{whu}/orbits.sp3"))?).ok()?;
        let navigation =
            NavigationFile::parse(&read("data/ESBC00DNK_R_20201770000_01D_MN.rnx.gz".to_owned())?).ok()?;
        Some(Self { observations, products: Arc::new(Products::new(vec![sp3], vec![navigation])) })
    }

    fn parse(&self) -> Vec<ObservationFile> {
        self.observations.iter().map(|bytes| ObservationFile::parse(bytes).unwrap()).collect()
    }

    fn agents(&self, files: &[ObservationFile]) -> Vec<Vec<EpochMessage>> {
        let run = |(file, name): (&ObservationFile, &&str)| {
            let mut pipeline =
                PhonePipeline::new(name, Arc::clone(&self.products), PipelineOptions::default());
            file.epochs.iter().map(|epoch| pipeline.process(epoch)).collect()
        };
        files.iter().zip(&PHONES).map(run).collect()
    }
}

/// Two metres between all pairs, one metre a second upwards: as in the session file.
fn constraints() -> Vec<ScheduledConstraint> {
    let always = |constraint| ScheduledConstraint { constraint, from_gps: None, to_gps: None };
    let pairs = (0..PHONES.len()).flat_map(|a| (a + 1..PHONES.len()).map(move |b| [a, b]));
    let distances =
        pairs.map(|phones| Constraint::Distance(Distance { phones, minimum_m: 0.0, maximum_m: 2.0 }));
    let speeds = (0..PHONES.len())
        .map(|phone| Constraint::VerticalVelocity(VerticalVelocity { phone, maximum_mps: 1.0 }));
    distances.chain(speeds).map(always).collect()
}

fn hub(messages: Vec<Vec<EpochMessage>>) -> usize {
    let names = PHONES.map(str::to_owned);
    let mut aligner = Aligner::new(PHONES.len(), AlignOptions::default());
    for (phone, messages) in messages.into_iter().enumerate() {
        for message in messages {
            aligner.push(phone, message, Duration::ZERO);
        }
        aligner.finish(phone);
    }
    let mut engine = Engine::new(&names, constraints(), EngineOptions::default());
    let mut fused = 0;
    while let Some(bucket) = aligner.pop_ready() {
        let epoch = engine.step(bucket);
        fused += epoch.phones.iter().filter(|p| p.message.is_some() && p.state.is_some()).count();
    }
    fused
}

fn parse_to_fused(criterion: &mut Criterion) {
    let Some(session) = Session::load() else {
        println!("nothing is measured: {} is missing or incomplete", beside::path("data").display());
        return;
    };
    let files = session.parse();
    let messages = session.agents(&files);
    let phone_epochs = files.iter().map(|file| file.epochs.len() as u64).sum();
    let mut group = criterion.benchmark_group("WH-3-08");
    group.throughput(Throughput::Elements(phone_epochs)).sample_size(20);
    group.bench_function("parse", |b| b.iter(|| session.parse()));
    group.bench_function("agents", |b| b.iter(|| session.agents(&files)));
    group.bench_function("hub", |b| {
        b.iter_batched(|| messages.clone(), hub, criterion::BatchSize::LargeInput);
    });
    group.bench_function("all", |b| b.iter(|| hub(session.agents(&session.parse()))));
    group.finish();
}

criterion_group!(benches, parse_to_fused);
criterion_main!(benches);
