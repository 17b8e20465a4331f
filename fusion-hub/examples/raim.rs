//! Forward-Backward against Subset (Cappello 2023, figure 5 and table 1): reliable epochs, and errors of all positions, on a phone that stands
//! for 14 hours in a simulated street, with GPS alone and with GPS and Galileo, by the preset `cappello2023`.
//!
//!     cargo run --release -p cofix-hub --example raim
//!     cargo run --release -p cofix-hub --example raim -- LOG NAVIGATION LATITUDE LONGITUDE HEIGHT
//!
//! The second form takes a GnssLogger log of a phone that stood at that place (degrees, m).

use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, bail};
use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::stream::StreamDecoder;
use cofix_common::frames::{Ecef, Geodetic, LocalFrame};
use cofix_common::gnss::{Constellation, ObservationEpoch};
use cofix_common::integrity::{Method, Verdict};
use cofix_common::orbit::{NavigationFile, Products};
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
use cofix_common::simulation::{Canyon, Facade, Scenario, Simulation};
use cofix_common::time::GpsTime;

/// Epochs with the true position, and what their satellites are computed from.
struct Recording {
    epochs: Vec<(ObservationEpoch, Ecef)>,
    products: Arc<Products>,
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let recording = match &arguments[..] {
        [] => simulated()?,
        [log, navigation, place @ ..] => recorded(log, navigation, place)?,
        [_] => bail!("a log needs a navigation file and its place"),
    };
    println!(
        "| satellites | method | positions | reliable | p95 horizontal m | p95 up m | excluded per epoch | ms per epoch |"
    );
    println!("|:--|:--|--:|--:|--:|--:|--:|--:|");
    let gps = [Constellation::Gps].as_slice();
    for (name, constellations) in
        [("GPS", gps), ("GPS and Galileo", &[Constellation::Gps, Constellation::Galileo])]
    {
        for (method_name, method) in [
            ("none", Method::None),
            ("Subset", Method::Subset),
            ("Forward-Backward", Method::ForwardBackward),
        ] {
            println!("| {name} | {method_name} | {} |", row(&recording, constellations, method));
        }
    }
    Ok(())
}

/// 14 hours at 30 s between houses of four storeys on both sides, 14 m from the phone.
fn simulated() -> anyhow::Result<Recording> {
    let mut scenario = Scenario { duration_s: 14.0 * 3_600.0, interval_s: 30.0, ..Scenario::stationary(1) };
    scenario.canyons = vec![Canyon::symmetric(-200.0, 200.0, Facade { height_m: 14.0, distance_m: 14.0 })];
    let simulation = Simulation::new(scenario)?;
    let epochs = simulation.epochs(0).map(|simulated| (simulated.epoch, simulated.truth.position)).collect();
    Ok(Recording { epochs, products: Arc::new(simulation.products()) })
}

fn recorded(log: &str, navigation: &str, place: &[String]) -> anyhow::Result<Recording> {
    let number = |index: usize| -> anyhow::Result<f64> {
        place.get(index).context("latitude, longitude and height are missing")?.parse().context("place")
    };
    let at = Geodetic::from_degrees(number(0)?, number(1)?, number(2)?).geodetic_to_ecef();
    let file = NavigationFile::parse(&std::fs::read(navigation)?)?;
    let mut decoder = StreamDecoder::new(GpsTime::default());
    decoder.feed(&std::fs::read(log)?)?;
    decoder.finish()?;
    let mut epochs = Vec::new();
    while let Some(record) = decoder.next_record() {
        if let Record::Epoch(epoch) = record {
            epochs.push((epoch, at));
        }
    }
    Ok(Recording { epochs, products: Arc::new(Products::new(Vec::new(), vec![file])) })
}

/// First band of the constellations.
fn first_band(epoch: &ObservationEpoch, constellations: &[Constellation]) -> ObservationEpoch {
    let mut kept = epoch.clone();
    kept.observations
        .retain(|o| constellations.contains(&o.satellite.constellation) && o.signal.band == b'1');
    kept
}

fn row(recording: &Recording, constellations: &[Constellation], method: Method) -> String {
    let mut options = PipelineOptions::cappello2023();
    options.raim.method = method;
    let mut pipeline = PhonePipeline::new("phone", Arc::clone(&recording.products), options);
    let (mut horizontal, mut vertical) = (Vec::new(), Vec::new());
    let (mut reliable, mut excluded) = (0_usize, 0_usize);
    let started = Instant::now();
    for (epoch, truth) in &recording.epochs {
        let message = pipeline.process(&first_band(epoch, constellations));
        reliable += usize::from(message.raim.verdict == Verdict::Reliable);
        excluded += usize::from(message.raim.excluded);
        if let Some(solution) = message.wls {
            let error = LocalFrame::at(*truth).ecef_to_enu(solution.position);
            horizontal.push(error.horizontal());
            vertical.push(error.up.abs());
        }
    }
    let epochs = recording.epochs.len().max(1) as f64;
    let each_ms = 1e3 * started.elapsed().as_secs_f64() / epochs;
    format!(
        "{} | {:.1} % | {:.2} | {:.2} | {:.2} | {each_ms:.2}",
        horizontal.len(),
        100.0 * reliable as f64 / epochs,
        percentile_95(&mut horizontal),
        percentile_95(&mut vertical),
        excluded as f64 / epochs
    )
}

fn percentile_95(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() * 95 / 100).copied().unwrap_or(f64::NAN)
}
