//! Inspection of a recording with orbits.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::Path;
use std::sync::Arc;

use cofix_agent::inspect::{InspectOptions, inspect};
use cofix_agent::{ProductSource, Stop};
use cofix_common::gnss::ObservationEpoch;
use cofix_common::rinex::{ObservationLayout, ObservationWriter, RecordingInfo};
use cofix_common::simulation::{Scenario, Simulation};

fn write(path: &Path, epochs: &[ObservationEpoch]) {
    let mut layout = ObservationLayout::default();
    for epoch in epochs {
        layout.include(epoch);
    }
    let mut writer = ObservationWriter::new(layout);
    let mut text = writer.header(&RecordingInfo::default());
    for epoch in epochs {
        text += &writer.epoch(epoch);
    }
    std::fs::write(path, text).unwrap();
}

#[test]
fn with_orbits_the_masks_that_need_them_are_counted() {
    let simulation = Simulation::new(Scenario { seed: 2, duration_s: 10.0, ..Scenario::default() }).unwrap();
    let mut epochs: Vec<_> = simulation.epochs(0).map(|simulated| simulated.epoch).collect();
    epochs[0].observations[0].cn0_dbhz = Some(5.0);
    let observations: usize = epochs.iter().map(|epoch| epoch.observations.len()).sum();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("phone.rnx");
    write(&path, &epochs);

    let inspection = inspect(&path, &InspectOptions::default(), &Stop::default()).unwrap();
    assert_eq!((inspection.epochs, inspection.trial), (epochs.len() as u64, None));

    let products = ProductSource::Loaded(Arc::new(simulation.products()));
    let options = InspectOptions { products, ..InspectOptions::default() };
    let inspection = inspect(&path, &options, &Stop::default()).unwrap();
    let text = inspection.to_string();
    let trial = inspection.trial.unwrap();
    assert_eq!(trial.solved, epochs.len() as u64, "{text}");
    let low = trial.skips.count("elevation below the mask");
    assert!(low > 0 && text.contains("elevation below the mask"), "{text}");
    assert_eq!(trial.skips.count("C/N0 below the mask"), 1, "{text}");
    assert_eq!(trial.used + trial.excluded + low + 1, observations as u64, "{text}");
}
