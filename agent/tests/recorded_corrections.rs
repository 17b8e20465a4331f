//! A challenge's table with its own satellite states and delays, and nothing else, through the agent's pipeline.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

use std::path::PathBuf;
use std::sync::Arc;

use cofix_agent::pipeline::{PhonePipeline, PipelineOptions};
use cofix_agent::source::{open_file, survey};
use cofix_agent::{Source, Stop};
use cofix_common::accuracy::{Accuracy, Solution, Truth, score};
use cofix_common::decode::{Decoder, Record};
use cofix_common::gsdc::ground_truth;
use cofix_common::orbit::Products;
use cofix_common::rinex::NavigationFile;
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;

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
    let row = |orbit: &str| format!("1273529463442,1,5,GPS_L1,1273529463365539137,{orbit},-3793.067,-0.001,23052313.867,4.197,0,7,5\n");
    let whole = file(format!("{HEADER}{}", row("-2179862.557,-26154875.769,-3437694.371,325,-419,3129")).as_bytes());
    let bare = file(format!("{HEADER}{}", row(",,,,,")).as_bytes());
    let has = |path: PathBuf| survey(&Source::File(path), None, &Stop::default()).unwrap().has_corrections;
    assert!(has(whole.path().to_owned()));
    assert!(!has(bare.path().to_owned()));
}

fn shared(path: &str) -> Option<Vec<u8>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/gsdc-2020-05-14-mtv1");
    let path = PathBuf::from(folder).join(path);
    let bytes = std::fs::read(&path).ok();
    if bytes.is_none() {
        println!("skipped: {} is not here", path.display());
    }
    bytes
}

/// The table, which is kept in parts with a header each.
fn table() -> Option<Vec<u8>> {
    let mut whole = Vec::new();
    for part in 0..18 {
        let bytes = shared(&format!("Pixel4_processed/{part}.csv"))?;
        let header = if part == 0 { 0 } else { bytes.iter().position(|b| *b == b'\n').unwrap() + 1 };
        whole.extend_from_slice(&bytes[header..]);
    }
    Some(whole)
}

struct Run {
    span: (GpsTime, GpsTime),
    wls: Vec<Solution>,
    local: Vec<Solution>,
    skips: Skips,
}

fn run(table: &tempfile::NamedTempFile, products: Products, recorded: bool) -> Run {
    let options = PipelineOptions::default();
    let mut pipeline = PhonePipeline::new("pixel4", Arc::new(products), options);
    let mut records = open_file(table.path(), None).unwrap();
    let (mut wls, mut local, mut times) = (Vec::new(), Vec::new(), Vec::new());
    while let Some(record) = records.next(&Stop::default()).unwrap() {
        let Record::Epoch(epoch) = record else { continue };
        let given = records.decoder().recorded_corrections().filter(|_| recorded);
        let message = given.map_or_else(|| pipeline.process(&epoch), |_| unreachable!());
        times.push(message.time_gps);
        let time_gps = message.time_gps;
        wls.extend(message.wls.map(|s| Solution { time_gps, position: s.position, covariance: s.position_covariance }));
        local.extend(message.local.map(|s| Solution {
            time_gps,
            position: s.position(),
            covariance: s.position_covariance(),
        }));
    }
    assert!(records.decoder().skips().total() <= 8);
    Run { span: (times[0], *times.last().unwrap()), wls, local, skips: pipeline.skips() }
}

fn accuracy(truth: &Truth, run: &Run, solutions: &[Solution]) -> Accuracy {
    score(truth, &[1], run.span, solutions).unwrap()
}
