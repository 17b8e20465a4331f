//! A phone in the city, without ionosphere terms: accuracy of its filter must not slip by a tenth.

#![allow(clippy::unwrap_used)] // helpers of tests

mod beside;

use std::sync::Arc;

use cofix_common::accuracy::{Accuracy, Solution, Truth, score};
use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::packing::decompress;
use cofix_common::formats::stream::StreamDecoder;
use cofix_common::orbit::{NavigationFile, Products};
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;

const SLIP: f64 = 1.10;

/// Accuracy of the local filter on a recording of the UNISOC phone in Beijing.
fn local(place: &str) -> Accuracy {
    let read = |ending: &str| {
        let bytes = beside::required(&format!("data/beijing-2025/{place}.{ending}"));
        decompress(&bytes).unwrap().into_owned()
    };
    let navigation = NavigationFile::parse(&read("nav.gz")).unwrap();
    let products = Arc::new(Products::new(Vec::new(), vec![navigation]));
    let mut pipeline = PhonePipeline::new("unisoc", products, PipelineOptions::default());
    let mut decoder = StreamDecoder::new(GpsTime::from_week_tow(2361, 0.0));
    decoder.feed(&read("obs.gz")).unwrap();
    decoder.finish().unwrap();
    let (mut solutions, mut times) = (Vec::new(), Vec::new());
    while let Some(record) = decoder.next_record() {
        let Record::Epoch(epoch) = record else { continue };
        let message = pipeline.process_last(&epoch, &decoder);
        times.push(message.time_gps);
        solutions.extend(message.local.map(|state| Solution {
            time_gps: message.time_gps,
            position: state.position(),
            covariance: state.covariance.fixed_view::<3, 3>(0, 0).into_owned(),
        }));
    }
    let skips = pipeline.skips();
    assert!(skips.count(Reason::NoIonosphereModel) > 10_000, "{skips}");
    assert!(skips.count(Reason::PhaseTooNoisy) > 5_000, "its phases are integrated Dopplers: {skips}");
    let truth = Truth::parse_csv(&read("truth.csv")).unwrap().0;
    score(&truth, &[1], (times[0], *times.last().unwrap()), &solutions).unwrap()
}

#[test]
#[ignore = "needs the reference data"]
fn street_and_elevated_road() {
    for (place, p50_m, p95_m, up_m) in [("street", 4.91, 10.92, 5.66), ("elevated", 4.16, 14.87, 6.43)] {
        let accuracy = local(place);
        let Accuracy { horizontal_p50_m, horizontal_p95_m, rmse_up_m, nees_horizontal, .. } = accuracy;
        println!("{place}: {horizontal_p50_m:.2} / {horizontal_p95_m:.2} m, height {rmse_up_m:.2} m");
        assert!(horizontal_p50_m < SLIP * p50_m && horizontal_p95_m < SLIP * p95_m, "{accuracy:?}");
        assert!(rmse_up_m < SLIP * up_m && nees_horizontal < 2.6, "{accuracy:?}");
    }
}
