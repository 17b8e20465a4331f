//! Inspection of a recording with orbits.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::Path;
use std::sync::Arc;

use cofix_agent::inspect::{InspectOptions, Inspected, inspect, inspect_any};
use cofix_agent::{ProductSource, Stop};
use cofix_common::formats::rinex::{
    ObservationLayout, ObservationWriter, RecordingInfo, navigation_header, navigation_record,
};
use cofix_common::gnss::ObservationEpoch;
use cofix_common::measurement::CorrectionOptions;
use cofix_common::pipeline::PipelineOptions;
use cofix_common::simulation::{Scenario, Simulation};
use cofix_common::skips::Reason;

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
    let low = trial.skips.count(Reason::ElevationBelowMask);
    assert!(low > 0 && text.contains(Reason::ElevationBelowMask.text()), "{text}");
    assert_eq!(trial.skips.count(Reason::Cn0BelowMask), 1, "{text}");
    assert_eq!(trial.used + trial.excluded + low + 1, observations as u64, "{text}");
}

/// What masks exclude by name is counted by mask, does not take part, and the rest is as before.
#[test]
fn constellations_satellites_and_signals_can_be_excluded() {
    let simulation = Simulation::new(Scenario { seed: 2, duration_s: 10.0, ..Scenario::default() }).unwrap();
    let epochs: Vec<_> = simulation.epochs(0).map(|simulated| simulated.epoch).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("phone.rnx");
    write(&path, &epochs);
    let trial = |exclude: &[&str]| {
        let products = ProductSource::Loaded(Arc::new(simulation.products()));
        let exclude = exclude.iter().map(|text| text.parse().unwrap()).collect();
        let correction = CorrectionOptions { exclude, ..CorrectionOptions::default() };
        let pipeline = PipelineOptions { correction, ..PipelineOptions::default() };
        let options = InspectOptions { products, pipeline, ..InspectOptions::default() };
        inspect(&path, &options, &Stop::default()).unwrap().trial.unwrap()
    };
    let observations = || epochs.iter().flat_map(|epoch| &epoch.observations);
    let first = epochs[0].observations[0];
    let (system, satellite) = (first.satellite.constellation.letter(), first.satellite);
    let of_signal = format!("{system}:{}", first.signal);
    let all = trial(&[]);
    for (mask, named) in [
        (system.to_string(), observations().filter(|o| o.satellite.constellation.letter() == system).count()),
        (satellite.to_string(), observations().filter(|o| o.satellite == satellite).count()),
        (
            of_signal,
            observations()
                .filter(|o| o.satellite.constellation == satellite.constellation && o.signal == first.signal)
                .count(),
        ),
    ] {
        let some = trial(&[&mask]);
        assert!(named > 0 && named < observations().count());
        assert_eq!(
            some.skips.count(format!("excluded by the mask {mask}")),
            named as u64,
            "{:?}",
            some.skips
        );
        assert!(some.used < all.used, "{mask}");
    }
    let idle = trial(&["S20", "S", "8"]);
    for mask in ["S20", "S", "8"] {
        assert_eq!(idle.skips.count(format!("mask {mask} names nothing that occurs")), 1, "{:?}", idle.skips);
    }
    assert_eq!((idle.used, idle.solved), (all.used, all.solved));
}

#[test]
fn navigation_files_are_told_from_recordings() {
    let simulation = Simulation::new(Scenario { seed: 2, duration_s: 10.0, ..Scenario::default() }).unwrap();
    let mut file = simulation.navigation();
    let count = file.ephemerides.len();
    file.ephemerides[0].health = 1.0;
    let sick = file.ephemerides[0].satellite;
    let mut text = navigation_header("", &file.ionosphere, Some(18));
    text.extend(file.ephemerides.iter().map(|ephemeris| navigation_record(ephemeris).unwrap()));
    text += "I02 2020 08 13 14 00 00 1.0\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("any.name");
    std::fs::write(&path, text).unwrap();

    let inspected = inspect_any(&path, &InspectOptions::default(), &Stop::default()).unwrap();
    let Inspected::Navigation(found) = &inspected else { panic!("{inspected}") };
    assert_eq!(found.messages.iter().map(|m| m.messages).sum::<u64>(), count as u64);
    let of_sick = found.messages.iter().find(|m| m.system == sick.constellation.letter()).unwrap();
    assert_eq!(of_sick.unhealthy, [sick.to_string()]);
    assert_eq!((found.leap_seconds, found.ionosphere.as_slice()), (Some(18), ["GPS"].as_slice()));
    assert_eq!(found.skips.total(), 1, "{inspected}");
    let shown = inspected.to_string();
    assert!(shown.contains("LNAV") && shown.contains(&sick.to_string()), "{shown}");

    let recording = folder.path().join("phone.rnx");
    write(&recording, &simulation.epochs(0).map(|simulated| simulated.epoch).collect::<Vec<_>>());
    let inspected = inspect_any(&recording, &InspectOptions::default(), &Stop::default()).unwrap();
    assert!(matches!(inspected, Inspected::Recording(_)));
}
