//! What each band and the ionosphere-free pair are worth to phones: a table over the recorded drives.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

#[path = "../../common/tests/beside/mod.rs"]
mod beside;
mod tracks;

use std::path::PathBuf;
use std::sync::Arc;

use cofix_agent::source::products::Loaded;
use cofix_agent::source::{Reading, open_file};
use cofix_agent::{ProductFiles, ProductSource, Stop};
use cofix_common::accuracy::{Accuracy, Truth};
use cofix_common::formats::decode::Record;
use cofix_common::gnss::ObservationEpoch;
use cofix_common::measurement::{CorrectionOptions, Ionosphere};
use cofix_common::orbit::Products;
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};

use tracks::Tracks;

fn data(path: &str) -> PathBuf {
    beside::file(&format!("data/{path}"))
}

/// Which signals are offered.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Bands {
    /// L1, E1, B1I.
    First,
    /// L5 and E5a of the satellites that have it, the first band of the others.
    FifthElseFirst,
    Both,
}

impl Bands {
    fn keep(self, epoch: &ObservationEpoch) -> ObservationEpoch {
        let is_fifth = |band: u8| band == b'5';
        let has_fifth = |satellite| {
            epoch
                .observations
                .iter()
                .any(|o| o.satellite == satellite && is_fifth(o.signal.band) && o.pseudorange_m.is_some())
        };
        let mut kept = epoch.clone();
        kept.observations.retain(|o| match self {
            Self::Both => true,
            Self::First => !is_fifth(o.signal.band),
            Self::FifthElseFirst => is_fifth(o.signal.band) || !has_fifth(o.satellite),
        });
        kept
    }
}

struct Drive {
    observations: PathBuf,
    truth: Truth,
    products: Arc<Products>,
}

/// Accuracy of the epoch-wise solution and of the local filter; signals in use per epoch.
fn run(drive: &Drive, bands: Bands, ionosphere: Ionosphere) -> (Option<Accuracy>, Option<Accuracy>, f64) {
    let correction = CorrectionOptions { ionosphere, ..CorrectionOptions::default() };
    let options = PipelineOptions { correction, ..PipelineOptions::default() };
    let mut pipeline = PhonePipeline::new("phone", Arc::clone(&drive.products), options);
    let mut records = open_file(&drive.observations, &Reading::default()).unwrap();
    let (mut tracks, mut signals) = (Tracks::default(), 0);
    while let Some(record) = records.next(&Stop::default()).unwrap() {
        let Record::Epoch(epoch) = record else { continue };
        let message = pipeline.process(&bands.keep(&epoch));
        signals += message.observations.len();
        tracks.push(message);
    }
    let [wls, local] = tracks.scores(&drive.truth);
    (wls, local, signals as f64 / tracks.times.len() as f64)
}

fn cell(accuracy: Option<&Accuracy>) -> String {
    accuracy.map_or_else(
        || "none".to_owned(),
        |a| {
            format!(
                "{:.2} / {:.2}, up {:.1} ({})",
                a.horizontal_p50_m, a.horizontal_p95_m, a.rmse_up_m, a.epochs
            )
        },
    )
}

#[test]
#[ignore = "needs the reference data"]
fn a_table_of_bands() {
    let folder = "whu-wuhan-2020-08-13";
    let (sp3, navigation) =
        (data(&format!("{folder}/orbits.sp3")), data("ESBC00DNK_R_20201770000_01D_MN.rnx.gz"));
    let source = ProductSource::Files(ProductFiles {
        sp3: vec![sp3],
        navigation: vec![navigation],
        ..ProductFiles::default()
    });
    let products = Loaded::read(&source).unwrap().products;
    println!("| drive | phone | signals | per epoch | wls p50 / p95, up (epochs) | local |");
    for session in ["WH-3-08", "WH-3-09", "WH-4-06"] {
        for phone in ["HP30", "XIM8"] {
            let observations = data(&format!("{folder}/{session}/{phone}.rnx"));
            let truth = std::fs::read(data(&format!("{folder}/{session}/{phone}.truth.csv"))).unwrap();
            let (truth, _) = Truth::parse_csv(&truth).unwrap();
            let drive = Drive { observations, truth, products: Arc::clone(&products) };
            let mut local_p50_m = Vec::new();
            for (name, bands, ionosphere) in [
                ("L1, E1, B1I", Bands::First, Ionosphere::Model),
                ("L5, E5a where present, else the first", Bands::FifthElseFirst, Ionosphere::Model),
                ("both", Bands::Both, Ionosphere::Model),
                ("pairs, others with the model", Bands::Both, Ionosphere::Pair),
                ("pairs only", Bands::Both, Ionosphere::PairOnly),
            ] {
                let (wls, local, signals) = run(&drive, bands, ionosphere);
                let (wls_cell, local_cell) = (cell(wls.as_ref()), cell(local.as_ref()));
                println!("| {session} | {phone} | {name} | {signals:.1} | {wls_cell} | {local_cell} |");
                local_p50_m.push(local.map_or(f64::INFINITY, |a| a.horizontal_p50_m));
            }
            // Both bands are not worse than one of them, and pairs with the rest not far from it.
            assert!(local_p50_m[2] < 1.1 * local_p50_m[0].max(local_p50_m[1]), "{local_p50_m:?}");
            assert!(local_p50_m[3] < 3.0, "{local_p50_m:?}");
        }
    }
}
