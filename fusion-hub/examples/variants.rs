//! What each part is worth: runs sessions through variants of the estimator, without Zenoh, and prints the horizontal
//! 50th and 95th percentiles, mean over the phones.
//!
//!     cargo run --release --example variants -- DATA docs/reproduce/*.toml
//!
//! DATA is the folder to which the session files' paths are relative.
//!
//! A second table has the phones with two bands one by one: what each band and the ionosphere-free pair are worth to them.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use cofix_agent::source::products::Loaded;
use cofix_agent::{Source, Stop, source};
use cofix_common::accuracy::Accuracy;
use cofix_common::constraint::{ConstraintOptions, DistanceModel, Enlargement, Method};
use cofix_common::filter::{FilterOptions, RobustWeights};
use cofix_common::formats::decode::Record;
use cofix_common::fusion::align::{AlignOptions, Aligner};
use cofix_common::fusion::engine::{Engine, EngineOptions};
use cofix_common::gnss::ObservationEpoch;
use cofix_common::measurement::{CorrectionOptions, Ionosphere};
use cofix_common::orbit::Products;
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
use cofix_common::wire::EpochMessage;
use cofix_hub::replay::Plan;
use cofix_hub::report::scores::{ByPhone, Methods, Scores};
use cofix_hub::session::Session;
use cofix_hub::session::truths::read_truths;

/// A way to run a session.
struct Variant {
    name: &'static str,
    pipeline: PipelineOptions,
    engine: EngineOptions,
    constrained: bool,
    bands: Bands,
}

/// Which signals are offered.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Bands {
    All,
    /// L1, E1, B1I.
    First,
    /// L5 and E5a of the satellites that have it, the first band of the others.
    FifthElseFirst,
}

impl Bands {
    fn keep(self, epoch: &ObservationEpoch) -> ObservationEpoch {
        let has_fifth = |satellite| {
            epoch
                .observations
                .iter()
                .any(|o| o.satellite == satellite && o.signal.band == b'5' && o.pseudorange_m.is_some())
        };
        let mut kept = epoch.clone();
        kept.observations.retain(|o| match self {
            Self::All => true,
            Self::First => o.signal.band != b'5',
            Self::FifthElseFirst => o.signal.band == b'5' || !has_fifth(o.satellite),
        });
        kept
    }
}

fn variants() -> Vec<Variant> {
    let ours = |name, constraints| Variant {
        name,
        pipeline: PipelineOptions::default(),
        engine: EngineOptions { constraints, ..EngineOptions::default() },
        constrained: true,
        bands: Bands::All,
    };
    let default = ConstraintOptions::default();
    let sequential = Method::Sequential { max_sweeps: 5 };
    let peng = Enlargement::Peng { confidence: 0.1, factor: 1.5, max_iterations: 50 };
    vec![
        ours("default", default),
        Variant { constrained: false, ..ours("no constraints", default) },
        ours("one by one instead of EP", ConstraintOptions { method: sequential, ..default }),
        ours("only when violated", ConstraintOptions { act_when_inside: false, ..default }),
        ours("distance as a box", ConstraintOptions { distance_model: DistanceModel::Box, ..default }),
        ours(
            "distance on its line only",
            ConstraintOptions { distance_model: DistanceModel::Radial, ..default },
        ),
        ours("intervals enlarged (Alg. 1)", ConstraintOptions { enlargement: peng, ..default }),
        Variant {
            engine: EngineOptions { feedback: true, ..EngineOptions::default() },
            ..ours("constraints fed back", default)
        },
        filtered("RAIM's selection", |filter| filter.only_used = true),
        filtered("every clock group white", |filter| filter.bias_walk_m2ps = f64::INFINITY),
        filtered("robust weights 2 to 8 sigma", |filter| {
            filter.robust = RobustWeights { keep: 2.0, reject: 8.0 };
        }),
        filtered("lasting errors weigh once", |filter| {
            (filter.lasting_weight, filter.tied_lasting_weight) = (1.0, 1.0);
        }),
        filtered("no carrier phase", |filter| filter.use_changes = false),
        filtered("phases, code noise and lasting errors weigh as without", |filter| {
            filter.code_noise.tied_share = filter.code_noise.correlated_share;
            filter.tied_lasting_weight = filter.lasting_weight;
        }),
        ours("constraints of Peng 2023", ConstraintOptions::peng2023()),
        as_printed("all of Peng 2023", |_| ()),
        as_printed("the same with Doppler", |filter| filter.use_rates = true),
        Variant { bands: Bands::First, ..ours("L1, E1 and B1I only", default) },
        Variant { bands: Bands::FifthElseFirst, ..ours("L5 and E5a where present, else L1", default) },
        Variant {
            pipeline: pairs(Ionosphere::Pair),
            ..ours("ionosphere-free pairs where possible", default)
        },
    ]
}

/// The default with other options of the filters.
fn filtered(name: &'static str, change: impl Fn(&mut FilterOptions)) -> Variant {
    let (mut pipeline, mut engine) = (PipelineOptions::default(), EngineOptions::default());
    change(&mut pipeline.filter);
    change(&mut engine.filter);
    Variant { name, pipeline, engine, constrained: true, bands: Bands::All }
}

/// The preset of Peng 2023 with other options of the filters.
fn as_printed(name: &'static str, change: impl Fn(&mut FilterOptions)) -> Variant {
    let (mut pipeline, mut engine) = (PipelineOptions::peng2023(), EngineOptions::peng2023());
    change(&mut pipeline.filter);
    change(&mut engine.filter);
    Variant { name, pipeline, engine, constrained: true, bands: Bands::All }
}

fn pairs(ionosphere: Ionosphere) -> PipelineOptions {
    let correction = CorrectionOptions { ionosphere, ..CorrectionOptions::default() };
    PipelineOptions { correction, ..PipelineOptions::default() }
}

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let data =
        PathBuf::from(arguments.next().context("name the folder of the data and at least one SESSION.toml")?);
    let paths: Vec<String> = arguments.collect();
    anyhow::ensure!(!paths.is_empty(), "name at least one SESSION.toml after the folder of the data");
    println!("| session | variant | wls p50/p95 m | local | joint |");
    println!("|:--------|:--------|:--------------|:------|:------|");
    for path in &paths {
        let session = Session::read(Path::new(path), Some(&data))?;
        let plan = Plan::from_session(&session)?;
        let products = Loaded::read(&plan.products)?.products;
        anyhow::ensure!(products.has_orbits(), "{path}: no orbits in its [products]");
        for variant in variants() {
            let methods = run(&session, &plan, &products, &variant)?;
            let cells = [&methods.wls, &methods.local, &methods.joint].map(mean);
            println!("| {} | {} | {} |", session.group, variant.name, cells.join(" | "));
        }
    }
    bands(&data, &paths)
}

/// Phones whose recordings have both bands, each by itself.
fn bands(data: &Path, paths: &[String]) -> anyhow::Result<()> {
    println!("\n| session | phone | signals | epochs of wls | wls p50/p95 m | local |");
    println!("|:--------|:------|:--------|--------------:|:--------------|:------|");
    for path in paths {
        let session = Session::read(Path::new(path), Some(data))?;
        let plan = Plan::from_session(&session)?;
        let products = Loaded::read(&plan.products)?.products;
        for variant in band_variants() {
            let methods = run(&session, &plan, &products, &variant)?;
            for (phone, wls) in &methods.wls {
                let local = methods.local.get(phone).copied().flatten();
                if let (true, Some(wls), Some(local)) = (TWO_BANDS.contains(&phone.as_str()), wls, local) {
                    println!(
                        "| {} | {phone} | {} | {} | {} | {} |",
                        session.group,
                        variant.name,
                        wls.epochs,
                        percentiles(wls),
                        percentiles(&local)
                    );
                }
            }
        }
    }
    Ok(())
}

/// Phones of the home track that record L5.
const TWO_BANDS: [&str; 2] = ["HP30", "XIM8"];

fn band_variants() -> Vec<Variant> {
    let variant = |name, bands, ionosphere| Variant {
        name,
        pipeline: pairs(ionosphere),
        engine: EngineOptions::default(),
        constrained: false,
        bands,
    };
    vec![
        variant("L1, E1, B1I only", Bands::First, Ionosphere::Model),
        variant("L5, E5a where present, else L1", Bands::FifthElseFirst, Ionosphere::Model),
        variant("both, model", Bands::All, Ionosphere::Model),
        variant("pairs, others with the model", Bands::All, Ionosphere::Pair),
        variant("pairs only", Bands::All, Ionosphere::PairOnly),
    ]
}

fn run(
    session: &Session,
    plan: &Plan,
    products: &Arc<Products>,
    variant: &Variant,
) -> anyhow::Result<Methods> {
    let mut aligner = Aligner::new(plan.phones.len(), AlignOptions::default());
    for (index, phone) in plan.phones.iter().enumerate() {
        let Source::File { path, .. } = &phone.source else { anyhow::bail!("{} is not a file", phone.name) };
        let mut records = source::open_file(path, &source::Reading::default())?;
        let mut pipeline = PhonePipeline::new(&phone.name, Arc::clone(products), variant.pipeline.clone());
        while let Some(record) = records.next(&Stop::default()).context("observations")? {
            let Record::Epoch(epoch) = record else { continue };
            let message: EpochMessage = pipeline.process(&variant.bands.keep(&epoch));
            aligner.push(index, message, Duration::ZERO);
        }
        aligner.finish(index);
    }
    let constraints = if variant.constrained { plan.constraints.clone() } else { Vec::new() };
    let mut engine = Engine::new(&session.phone_names(), constraints, variant.engine.clone());
    let mut scores = Scores::new(read_truths(&session.phones)?.0, plan.truth_quality.clone());
    while let Some(bucket) = aligner.pop_ready() {
        scores.push(&engine.step(bucket));
    }
    Ok(scores.methods())
}

/// Mean p50/p95 over the phones that are scored.
fn mean(phones: &ByPhone) -> String {
    let scored: Vec<&Accuracy> = phones.values().flatten().collect();
    let mean = |value: fn(&Accuracy) -> f64| {
        scored.iter().map(|accuracy| value(accuracy)).sum::<f64>() / scored.len() as f64
    };
    format!("{:.2} / {:.2}", mean(|a| a.horizontal_p50_m), mean(|a| a.horizontal_p95_m))
}

fn percentiles(accuracy: &Accuracy) -> String {
    format!("{:.2} / {:.2}", accuracy.horizontal_p50_m, accuracy.horizontal_p95_m)
}
