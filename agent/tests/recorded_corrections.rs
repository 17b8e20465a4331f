//! A challenge's table with its own satellite states and delays, and nothing else, through the agent's pipeline.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

#[path = "../../common/tests/beside/mod.rs"]
mod beside;
mod tracks;

use std::path::PathBuf;
use std::sync::Arc;

use beside::pixel4_table as table;
use cofix_agent::source::{Reading, open_file, survey};
use cofix_agent::{Source, Stop};
use cofix_common::accuracy::{Accuracy, Truth};
use cofix_common::formats::decode::Record;
use cofix_common::formats::gsdc::ground_truth;
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::Products;
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
use cofix_common::skips::Skips;

use tracks::Tracks;

const HEADER: &str = "millisSinceGpsEpoch,constellationType,svid,signalType,receivedSvTimeInGpsNanos,xSatPosM,ySatPosM,\
    zSatPosM,xSatVelMps,ySatVelMps,zSatVelMps,satClkBiasM,satClkDriftMps,rawPrM,rawPrUncM,isrbM,ionoDelayM,tropoDelayM\n";

/// A file that goes when the value does.
fn file(bytes: &[u8]) -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    file
}

#[test]
fn a_table_needs_no_products_and_a_bare_one_does() {
    let row = |orbit: &str| {
        format!(
            "1273529463442,1,5,GPS_L1,1273529463365539137,{orbit},-3793.067,-0.001,23052313.867,4.197,0,7,5\n"
        )
    };
    let whole =
        file(format!("{HEADER}{}", row("-2179862.557,-26154875.769,-3437694.371,325,-419,3129")).as_bytes());
    let bare = file(format!("{HEADER}{}", row(",,,,,")).as_bytes());
    let has = |path: PathBuf| {
        survey(&Source::File { path, near: None }, &Reading::default(), &Stop::default())
            .unwrap()
            .has_corrections
    };
    assert!(has(whole.path().to_owned()));
    assert!(!has(bare.path().to_owned()));
}

fn required(path: &str) -> Vec<u8> {
    beside::required(&format!("data/gsdc-2020-05-14-mtv1/{path}"))
}

/// Runs the pipeline over a table, with its own corrections or with products; what it brought, and what was skipped.
fn drive(table: &tempfile::NamedTempFile, products: Products, recorded: bool) -> (Tracks, Skips) {
    let options = PipelineOptions { recorded_corrections: recorded, ..PipelineOptions::default() };
    let mut pipeline = PhonePipeline::new("pixel4", Arc::new(products), options);
    let mut records = open_file(table.path(), &Reading::default()).unwrap();
    let mut tracks = Tracks::default();
    while let Some(record) = records.next(&Stop::default()).unwrap() {
        let Record::Epoch(epoch) = record else { continue };
        let message = pipeline.process_recorded(records.decoder().recorded_corrections().unwrap());
        // The phone's clock, by which its epochs are tagged, is within 20 µs of GPS time.
        assert!((message.time_gps - epoch.time_gps).abs() < 2e-5, "{}", message.time_gps);
        tracks.push(message);
    }
    (tracks, pipeline.skips())
}

/// p50 and p95 of the horizontal error, m, of the epoch-wise solution and of the local filter.
fn percentiles(truth: &Truth, tracks: &Tracks) -> [(f64, f64); 2] {
    tracks.scores(truth).map(|accuracy| {
        let Accuracy { epochs, horizontal_p50_m, horizontal_p95_m, .. } = accuracy.unwrap();
        assert!(epochs >= 1_735, "{epochs} epochs");
        (horizontal_p50_m, horizontal_p95_m)
    })
}

/// The table has neither C/N0 nor Doppler, so the filter has to go by code alone, and by the phone's own uncertainties.
#[test]
#[ignore = "needs the reference data"]
fn a_drive_on_nothing_but_its_table() {
    let (table, truth, navigation) = (table(), required("Pixel4_ground_truth.csv"), required("hour1350.20n"));
    let (truth, _) = ground_truth(&truth).unwrap();
    let table = file(&table);
    let (own, skips) = drive(&table, Products::default(), true);
    let [wls, local] = percentiles(&truth, &own);
    println!("its own corrections: wls {wls:.3?}, local {local:.3?}; {skips}");
    assert!(wls.0 <= 2.5 && wls.1 <= 7.5, "{wls:?}");
    assert!(local.0 <= 2.5 && local.1 <= 7.5, "{local:?}");
    let products = Products::new(Vec::new(), vec![NavigationFile::parse(&navigation).unwrap()]);
    let (other, skips) = drive(&table, products, false);
    let [wls, local] = percentiles(&truth, &other);
    println!("our corrections: wls {wls:.3?}, local {local:.3?}; {skips}");
    assert!(wls.0 <= 2.7 && wls.1 <= 7.7, "{wls:?}");
    assert!(local.0 <= 2.5 && local.1 <= 7.5, "{local:?}");
}
