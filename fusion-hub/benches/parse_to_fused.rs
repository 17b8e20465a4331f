//! From the bytes of four phones' RINEX files to fused, constrained states, without transport and recording.
//!
//! Uses the session WH-3-08 of the reference data; without it, it says so and measures nothing.
//! The figure to read is the throughput of `all`, in phone-epochs per second on one core; `parse`, `agents` and `hub` are its parts.
//! `threads` is the same with a thread for each agent and one for the hub, as `replay` has them.
#![allow(clippy::unwrap_used, missing_docs)]

#[path = "../../common/tests/beside/mod.rs"]
mod beside;

use std::sync::Arc;
use std::sync::mpsc::sync_channel;
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

/// Messages that wait for the hub at most.
const WAITING: usize = 1_000;

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
        let run = |(phone, file): (usize, &ObservationFile)| {
            let mut pipeline = self.pipeline(phone);
            file.epochs.iter().map(|epoch| pipeline.process(epoch)).collect()
        };
        files.iter().enumerate().map(run).collect()
    }

    fn pipeline(&self, phone: usize) -> PhonePipeline {
        PhonePipeline::new(PHONES[phone], Arc::clone(&self.products), PipelineOptions::default())
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

/// Aligner and engine of the group.
struct Hub {
    aligner: Aligner,
    engine: Engine,
    fused: usize,
}

impl Hub {
    fn new() -> Self {
        Self {
            aligner: Aligner::new(PHONES.len(), AlignOptions::default()),
            engine: Engine::new(&PHONES.map(str::to_owned), constraints(), EngineOptions::default()),
            fused: 0,
        }
    }

    /// Takes a message of a phone; `None`: it has no more.
    fn take(&mut self, phone: usize, message: Option<EpochMessage>) {
        match message {
            Some(message) => self.aligner.push(phone, message, Duration::ZERO),
            None => self.aligner.finish(phone),
        }
    }

    fn fuse(&mut self) {
        while let Some(bucket) = self.aligner.pop_ready() {
            let epoch = self.engine.step(bucket);
            self.fused += epoch.phones.iter().filter(|p| p.message.is_some() && p.state.is_some()).count();
        }
    }
}

fn hub(messages: Vec<Vec<EpochMessage>>) -> usize {
    let mut hub = Hub::new();
    for (phone, messages) in messages.into_iter().enumerate() {
        for message in messages.into_iter().map(Some).chain([None]) {
            hub.take(phone, message);
        }
    }
    hub.fuse();
    hub.fused
}

/// A thread for each agent, which parses and solves, and this one for the hub.
fn threads(session: &Session) -> usize {
    let mut hub = Hub::new();
    let (sender, receiver) = sync_channel(WAITING);
    std::thread::scope(|scope| {
        for (phone, bytes) in session.observations.iter().enumerate() {
            let sender = sender.clone();
            scope.spawn(move || {
                let file = ObservationFile::parse(bytes).unwrap();
                let mut pipeline = session.pipeline(phone);
                for epoch in &file.epochs {
                    sender.send((phone, Some(pipeline.process(epoch)))).unwrap();
                }
                sender.send((phone, None)).unwrap();
            });
        }
        drop(sender);
        for (phone, message) in receiver {
            hub.take(phone, message);
            hub.fuse();
        }
    });
    hub.fused
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
    group.bench_function("threads", |b| b.iter(|| threads(&session)));
    group.bench_function("all", |b| b.iter(|| hub(session.agents(&session.parse()))));
    group.finish();
}

criterion_group!(benches, parse_to_fused);
criterion_main!(benches);
