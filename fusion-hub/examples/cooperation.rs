//! What cooperation is worth in a simulated scenario: horizontal 50th and 95th percentiles of each phone, each epoch by
//! itself (wls), by the phone's own filter (local) and by the joint filter, over many seeds, without Zenoh.
//!
//!     cargo run --release -p cofix-hub --example cooperation -- canyon 20
//!
//! The last column counts the seeds in which the joint filter is better than the phone's own one.

use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, bail};
use clap::ValueEnum;
use cofix_agent::{ProductSource, Source};
use cofix_common::accuracy::Accuracy;
use cofix_common::fusion::align::{AlignOptions, Aligner};
use cofix_common::fusion::engine::Engine;
use cofix_common::pipeline::PhonePipeline;
use cofix_common::simulation::Scenario;
use cofix_hub::demo;
use cofix_hub::replay::Plan;
use cofix_hub::report::scores::{Methods, Scores};
use cofix_hub::simulate::Kind;

/// Percentiles of one phone by one method, over the seeds.
#[derive(Clone, Debug, Default)]
struct Percentiles {
    p50_m: Vec<f64>,
    p95_m: Vec<f64>,
}

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().context("name a scenario: convoy, car, canyon or static")?;
    let kind = Kind::from_str(&name, false).map_err(anyhow::Error::msg)?;
    let seeds: u64 = arguments.next().as_deref().unwrap_or("20").parse()?;
    let phones: Option<u8> = arguments.next().map(|phones| phones.parse()).transpose()?;
    let unbounded = arguments.next().is_some();
    let scenario = kind.scenario(phones);
    let names: Vec<String> = scenario.phones.iter().map(|phone| phone.name.clone()).collect();
    // By phone and method; the last phone is the mean of all.
    let mut table =
        vec![[const { Percentiles { p50_m: Vec::new(), p95_m: Vec::new() } }; 3]; names.len() + 1];
    for seed in 1..=seeds {
        let mut plan = demo::plan(Scenario { seed, ..scenario.clone() })?;
        if unbounded {
            plan.constraints.clear();
        }
        let methods = run(&plan)?;
        for (method, by_phone) in [&methods.wls, &methods.local, &methods.joint].into_iter().enumerate() {
            let scored: Vec<Accuracy> =
                names.iter().filter_map(|name| by_phone.get(name).copied().flatten()).collect();
            if scored.len() != names.len() {
                bail!("seed {seed}: {} of {} phones are scored", scored.len(), names.len());
            }
            let mean =
                |value: fn(&Accuracy) -> f64| scored.iter().map(value).sum::<f64>() / scored.len() as f64;
            for (row, accuracy) in table.iter_mut().zip(&scored) {
                row[method].p50_m.push(accuracy.horizontal_p50_m);
                row[method].p95_m.push(accuracy.horizontal_p95_m);
            }
            if let Some(row) = table.last_mut() {
                row[method].p50_m.push(mean(|a| a.horizontal_p50_m));
                row[method].p95_m.push(mean(|a| a.horizontal_p95_m));
            }
        }
    }
    println!("{name}, seeds 1 to {seeds}: p50 / p95 in m, median over the seeds (worst seed)\n");
    println!("| phone | wls | local | joint | joint better, p50; p95 |");
    println!("|:------|:----|:------|:------|-----------------------:|");
    for (name, row) in names.iter().map(String::as_str).chain(["mean"]).zip(&table) {
        let [wls, local, joint] = row;
        let better = |local: &[f64], joint: &[f64]| local.iter().zip(joint).filter(|(l, j)| j < l).count();
        let (p50, p95) = (better(&local.p50_m, &joint.p50_m), better(&local.p95_m, &joint.p95_m));
        let cells = [wls, local, joint].map(cell);
        println!("| {name:5} | {} | {p50}; {p95} of {seeds} |", cells.join(" | "));
    }
    Ok(())
}

fn cell(percentiles: &Percentiles) -> String {
    let [p50, p95] = [&percentiles.p50_m, &percentiles.p95_m].map(|values| {
        let mut sorted = values.clone();
        sorted.sort_by(f64::total_cmp);
        let median = 0.5 * (sorted[(sorted.len() - 1) / 2] + sorted[sorted.len() / 2]);
        (median, sorted.last().copied().unwrap_or(f64::NAN))
    });
    format!("{:.2} / {:.2} ({:.2} / {:.2})", p50.0, p95.0, p50.1, p95.1)
}

fn run(plan: &Plan) -> anyhow::Result<Methods> {
    let ProductSource::Loaded(products) = &plan.products else { bail!("the products are not loaded") };
    let mut aligner = Aligner::new(plan.phones.len(), AlignOptions::default());
    for (index, phone) in plan.phones.iter().enumerate() {
        let Source::Epochs(epochs) = &phone.source else { bail!("{} is not simulated", phone.name) };
        let mut pipeline = PhonePipeline::new(&phone.name, Arc::clone(products), plan.pipeline(phone)?);
        for epoch in epochs.iter() {
            aligner.push(index, pipeline.process(epoch), Duration::ZERO);
        }
        aligner.finish(index);
    }
    let names: Vec<String> = plan.phones.iter().map(|phone| phone.name.clone()).collect();
    let mut engine = Engine::new(&names, plan.constraints.clone(), plan.settings.options()?.1);
    let truths = plan.phones.iter().map(|phone| (phone.name.clone(), phone.truth.clone())).collect();
    let mut scores = Scores::new(truths, plan.truth_quality.clone());
    while let Some(bucket) = aligner.pop_ready() {
        scores.push(&engine.step(bucket));
    }
    Ok(scores.methods())
}
