//! The pipeline on recordings of receivers that fail in one way, with truth.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing)] // helpers of tests

mod beside;

use std::sync::Arc;

use cofix_common::accuracy::Truth;
use cofix_common::formats::rinex::ObservationFile;
use cofix_common::frames::{Ecef, LocalFrame};
use cofix_common::gnss::Constellation;
use cofix_common::integrity::Verdict;
use cofix_common::measurement::Usage;
use cofix_common::orbit::{NavigationFile, Products};
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
use cofix_common::wire::EpochMessage;

/// Messages of the phone `phone` of a case, and its truth.
fn run(case: &str, phone: &str) -> (Vec<EpochMessage>, Truth) {
    let file = |name: &str| beside::required(&format!("cases/{case}/{name}"));
    let navigation = NavigationFile::parse(&file("nav.rnx")).unwrap();
    let products = Arc::new(Products::new(Vec::new(), vec![navigation]));
    let mut pipeline = PhonePipeline::new(phone, products, PipelineOptions::default());
    let epochs = ObservationFile::parse(&file(&format!("{phone}.rnx"))).unwrap().epochs;
    let messages: Vec<EpochMessage> = epochs.iter().map(|epoch| pipeline.process(epoch)).collect();
    assert_eq!(messages.len(), 40);
    let (truth, _) = Truth::parse_csv(&file(&format!("{phone}.truth.csv"))[..]).unwrap();
    (messages, truth)
}

/// Median of the horizontal errors of the epochs with a position, m.
fn median_m(
    messages: &[EpochMessage],
    truth: &Truth,
    position: impl Fn(&EpochMessage) -> Option<Ecef>,
) -> f64 {
    let error_m = |message: &EpochMessage| {
        let truth = truth.at(message.time_gps, &[1])?;
        let error = LocalFrame::at(truth.position).ecef_to_enu(position(message)?);
        Some(error.east.hypot(error.north))
    };
    let mut errors_m: Vec<f64> = messages.iter().filter_map(error_m).collect();
    assert!(errors_m.len() + 2 >= messages.len(), "{} of {} epochs", errors_m.len(), messages.len());
    errors_m.sort_by(f64::total_cmp);
    errors_m[errors_m.len() / 2]
}

fn assert_accurate((messages, truth): &(Vec<EpochMessage>, Truth)) {
    let wls_m = median_m(messages, truth, |m| Some(m.wls.as_ref()?.position));
    let local_m = median_m(messages, truth, |m| Some(m.local.as_ref()?.position()));
    assert!(wls_m < 0.8 && local_m < 0.4, "medians {wls_m:.2} m and {local_m:.2} m");
}

/// A car at 15 m/s, with a clock 0.4 s ahead in time tags and pseudoranges.
#[test]
#[ignore = "needs the reference data"]
fn a_clock_0_4_s_ahead_is_no_error() {
    assert_accurate(&run("receiver_clock_offset/400ms", "p1"));
    assert_accurate(&run("receiver_clock_offset/400ms_of_one", "p2"));
}

/// All five Galileo satellites of 28 are wrong by up to 300 km, each by its own, differently in every epoch.
#[test]
#[ignore = "needs the reference data"]
fn a_corrupt_constellation_costs_only_itself() {
    for phone in ["p1", "p2"] {
        let of_case = run("constellation_corrupt", phone);
        assert_accurate(&of_case);
        for message in &of_case.0 {
            assert_eq!(message.raim.verdict, Verdict::Reliable, "{}", message.time_gps);
            let galileo = |o: &&cofix_common::measurement::CorrectedObservation| {
                o.satellite.constellation == Constellation::Galileo
            };
            assert!(message.observations.iter().filter(galileo).all(|o| o.usage == Usage::Excluded));
        }
    }
}
