//! Recordings read back with Rerun's own store.

#![allow(clippy::unwrap_used)] // helpers of tests, too

mod support;

use std::fs::File;
use std::path::{Path, PathBuf};

use cofix_common::frames::Ecef;
use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::integrity::Verdict;
use cofix_common::measurement::Usage;
use cofix_common::recording::{APPLICATION_ID, TIMELINE};
use cofix_common::skips::Reason;
use cofix_hub::outputs::recorder::{Recorded, Recorder, RecorderError};
use cofix_hub::report::scores::Reference;
use rerun::external::re_log_types::StoreId;
use rerun::log::Chunk;
use rerun::{ChunkStore, ChunkStoreConfig};

use support::{ACCURACY, MESSAGE_LEAD_S, Session, start};

const SMALL: Session = Session { epochs: 20, phones: 2, satellites: 6, seed: 7 };

/// A file name in a directory that disappears with the first value.
fn scratch() -> (tempfile::TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("session.rrd");
    (directory, path)
}

fn read(path: &Path) -> Vec<(StoreId, ChunkStore)> {
    let mut file = File::open(path).unwrap();
    ChunkStore::from_rrd_reader(&ChunkStoreConfig::ALL_DISABLED, &mut file).unwrap().into_iter().collect()
}

fn recording(path: &Path) -> ChunkStore {
    read(path).into_iter().find(|(id, _)| id.is_recording()).unwrap().1
}

fn chunks<'a>(store: &'a ChunkStore, entity: &str) -> Vec<&'a Chunk> {
    let path = rerun::EntityPath::from(entity);
    store.iter_physical_chunks().filter(|c| c.entity_path() == &path).map(AsRef::as_ref).collect()
}

/// Times (ns) and values of a scalar entity; `None` is an empty row.
fn scalars(store: &ChunkStore, entity: &str) -> Vec<(i64, Option<f64>)> {
    let component = rerun::Scalars::descriptor_scalars().component;
    let mut rows = Vec::new();
    for chunk in chunks(store, entity) {
        let Some(times) = chunk.timelines().values().next() else { continue };
        let values = chunk.iter_slices::<f64>(component).map(|values| values.first().copied());
        rows.extend(times.times_raw().iter().copied().zip(values));
    }
    rows.sort_by_key(|row| row.0);
    rows
}

fn texts(store: &ChunkStore, entity: &str, component: rerun::ComponentIdentifier) -> Vec<String> {
    let slices = chunks(store, entity);
    let texts = slices.iter().flat_map(|chunk| chunk.iter_slices::<String>(component));
    texts.flat_map(|row| row.iter().map(|text| text.as_str().to_owned()).collect::<Vec<_>>()).collect()
}

/// Records epochs of the small session after a change to each.
fn record_changed(path: &Path, change: impl Fn(usize, &mut FusedEpoch)) -> Recorded {
    let mut recorder = Recorder::to_file(path, &SMALL.config()).unwrap();
    for (index, mut epoch) in SMALL.epochs().enumerate() {
        change(index, &mut epoch);
        let truth: Vec<_> = (0..SMALL.phones).map(|phone| Session::reference(&epoch, phone)).collect();
        recorder.record(&epoch, &truth).unwrap();
    }
    recorder.finish(ACCURACY).unwrap()
}

#[test]
fn all_entities_are_there() {
    let (_directory, path) = scratch();
    let recorded = record_changed(&path, |_, _| ());
    assert_eq!(recorded.epochs, 20);
    assert!(recorded.skips.is_empty(), "{}", recorded.skips);
    assert_eq!(recorded.bytes, std::fs::metadata(&path).unwrap().len());
    let store = recording(&path);
    for phone in ["P1", "P2"] {
        for entity in [
            "map/wls",
            "map/local",
            "map/joint",
            "map/truth",
            "map/joint/track",
            "enu/wls",
            "enu/wls/sigma",
            "enu/local/sigma",
            "enu/joint",
            "enu/joint/sigma",
            "enu/joint/track",
            "enu/truth/track",
            "error/horizontal/wls",
            "error/horizontal/local",
            "error/horizontal/joint",
            "error/vertical/wls",
            "error/vertical/local",
            "error/vertical/joint",
            "satellites/cn0/G01\\ 1C",
            "satellites/residual/E02\\ 1C",
            "satellites/usage/C01\\ 2I",
            "quality/satellites",
            "quality/pdop",
            "quality/hpl",
            "quality/vpl",
            "raim",
        ] {
            let entity = format!("/phones/{phone}/{entity}");
            assert!(!chunks(&store, &entity).is_empty(), "{entity}");
        }
    }
    for entity in [
        "/constraints/distance\\ P1–P2/shift",
        "/constraints/distance\\ P1–P2/log",
        "/distances/P1–P2/distance",
        "/distances/P1–P2/minimum",
        "/distances/P1–P2/maximum",
        "/accuracy",
    ] {
        assert!(!chunks(&store, entity).is_empty(), "{entity}");
    }
    let table = texts(&store, "/accuracy", rerun::TextDocument::descriptor_text().component);
    assert_eq!(table, [ACCURACY]);
}

#[test]
fn times_are_those_of_messages_and_epochs() {
    let (_directory, path) = scratch();
    record_changed(&path, |_, _| ());
    let store = recording(&path);
    let first = |entity: &str| scalars(&store, entity).first().unwrap().0;
    let message = (start() - MESSAGE_LEAD_S).as_unix_calendar_nanos();
    assert_eq!(first("/phones/P1/error/horizontal/wls"), message);
    assert_eq!(first("/phones/P1/error/horizontal/local"), message);
    assert_eq!(first("/phones/P1/error/horizontal/joint"), start().as_unix_calendar_nanos());
    let timelines: Vec<_> =
        store.iter_physical_chunks().flat_map(|chunk| chunk.timelines().values()).collect();
    assert!(timelines.iter().all(|column| column.name() == TIMELINE));
    let last = timelines.iter().flat_map(|column| column.times_raw()).max().unwrap();
    assert_eq!(*last, (start() + 19.0).as_unix_calendar_nanos());
}

#[test]
fn values_round_trip() {
    let (_directory, path) = scratch();
    record_changed(&path, |_, _| ());
    let store = recording(&path);
    let epoch = SMALL.epochs().nth(4).unwrap();
    let Reference { at_message, at_epoch } = Session::reference(&epoch, 1);
    let (wls, joint) = {
        let phone = &epoch.phones[1];
        let wls = phone.message.as_ref().unwrap().wls.as_ref().unwrap().position;
        (wls, phone.state.as_ref().unwrap().position())
    };

    // Horizontal and vertical error make up the distance: against the truth of the right instant.
    for (method, position, truth) in [("wls", wls, at_message), ("joint", joint, at_epoch)] {
        let error = |direction| {
            let rows = scalars(&store, &format!("/phones/P2/error/{direction}/{method}"));
            rows[4].1.unwrap()
        };
        let distance = f64::hypot(error("horizontal"), error("vertical"));
        let expected = position.distance_m(truth.unwrap());
        assert!((distance - expected).abs() < 1e-6, "{method}: {distance} {expected}");
    }

    let point = rerun::GeoPoints::descriptor_positions().component;
    let map = chunks(&store, "/phones/P2/map/joint");
    let chunk = map.iter().find(|chunk| !chunk.is_static()).unwrap();
    let [latitude_deg, longitude_deg] = chunk.iter_slices::<[f64; 2]>(point).nth(4).unwrap()[0];
    let geodetic = joint.ecef_to_geodetic();
    assert!((latitude_deg - geodetic.latitude_deg()).abs() < 1e-12);
    assert!((longitude_deg - geodetic.longitude_deg()).abs() < 1e-12);
}

#[test]
fn the_first_fix_is_the_origin_of_the_local_frame() {
    let (_directory, path) = scratch();
    record_changed(&path, |_, _| ());
    let store = recording(&path);
    let component = rerun::Points3D::descriptor_positions().component;
    let points = chunks(&store, "/phones/P1/enu/joint");
    let chunk = points.iter().find(|chunk| !chunk.is_static()).unwrap();
    let first = chunk.iter_slices::<[f32; 3]>(component).next().unwrap()[0];
    assert!(first.iter().all(|c| c.abs() < 1e-3), "{first:?}");
    let half_sizes = rerun::Ellipsoids3D::descriptor_half_sizes().component;
    let ellipsoids = chunks(&store, "/phones/P1/enu/joint/sigma");
    let chunk = ellipsoids.iter().find(|chunk| !chunk.is_static()).unwrap();
    let mut sigmas = chunk.iter_slices::<[f32; 3]>(half_sizes).next().unwrap()[0];
    sigmas.sort_by(f32::total_cmp);
    for (sigma, expected) in sigmas.iter().zip([1.0_f32, 1.5_f32.sqrt(), 2.0].map(|s| s * 0.6)) {
        assert!((sigma - expected).abs() < 1e-4, "{sigma} {expected}");
    }
}

#[test]
fn a_missing_epoch_leaves_an_empty_row() {
    let (_directory, path) = scratch();
    record_changed(&path, |_, _| ());
    let store = recording(&path);
    for entity in
        ["/phones/P2/error/horizontal/wls", "/phones/P2/satellites/cn0/E02\\ 1C", "/phones/P2/quality/pdop"]
    {
        let rows = scalars(&store, entity);
        let gaps: Vec<_> = rows.iter().filter(|row| row.1.is_none()).map(|row| row.0).collect();
        assert_eq!(gaps, [(start() + 10.0).as_unix_calendar_nanos()], "{entity}");
        assert_eq!(rows.len(), 19, "{entity}: 18 values and the end of the tenth");
    }
}

#[test]
fn only_verdicts_that_matter_are_logged() {
    let (_directory, path) = scratch();
    record_changed(&path, |_, _| ());
    let store = recording(&path);
    let levels = texts(&store, "/phones/P1/raim", rerun::TextLog::descriptor_level().component);
    assert_eq!(levels, ["INFO", "ERROR", "INFO"]);
    let lines = texts(&store, "/phones/P1/raim", rerun::TextLog::descriptor_text().component);
    let said = "unreliable: tests failed; D 61.2 > 38.6, 19 dof; 3 excluded; HPL 12.0 m, VPL 18.0 m";
    assert_eq!(lines[1], format!("14:30:04 GPS P1: {said}"));
    let (_directory, path) = scratch();
    record_changed(&path, |_, epoch| {
        for message in epoch.phones.iter_mut().filter_map(|phone| phone.message.as_mut()) {
            message.raim.verdict = Verdict::CannotBeChecked;
        }
    });
    let levels = texts(&recording(&path), "/phones/P1/raim", rerun::TextLog::descriptor_level().component);
    assert_eq!(levels, ["WARN"; 20]);
}

#[test]
fn a_layout_is_in_the_file() {
    let (_directory, path) = scratch();
    record_changed(&path, |_, _| ());
    let stores = read(&path);
    assert!(stores.iter().all(|(id, _)| id.application_id().as_str() == APPLICATION_ID));
    let (_, blueprint) = stores.iter().find(|(id, _)| id.is_blueprint()).unwrap();
    let entities: Vec<_> = blueprint.iter_physical_chunks().map(|c| c.entity_path().to_string()).collect();
    assert!(entities.contains(&"/viewport".to_owned()));
    let axes = entities.iter().filter(|e| e.ends_with("/TimeAxis")).count();
    assert_eq!(
        axes, 17,
        "2 × (horizontal, vertical, C/N0, residuals), all joint, 2 of constraints, 6 of quality"
    );
    let ids: Vec<_> = stores.iter().map(|(id, _)| id.recording_id().clone()).collect();
    let (_other_directory, other) = scratch();
    record_changed(&other, |_, _| ());
    assert!(read(&other).iter().all(|(id, _)| !ids.contains(id.recording_id())), "ids are fresh");
}

#[test]
fn values_that_are_not_finite_are_counted() {
    let (_directory, path) = scratch();
    let recorded = record_changed(&path, |index, epoch| {
        if index != 3 {
            return;
        }
        let phone = &mut epoch.phones[0];
        phone.state.as_mut().unwrap().mean[1] = f64::NAN;
        let message = phone.message.as_mut().unwrap();
        message.wls.as_mut().unwrap().dops.pdop = f64::INFINITY;
        message.wls.as_mut().unwrap().position_covariance[(0, 0)] = f64::NAN;
        message.observations[0].cn0_dbhz = Some(f64::NAN);
        epoch.distances[0].maximum_m = f64::INFINITY; // no bound: not an error
    });
    assert_eq!(recorded.skips.count(Reason::NotFinite), 2, "{}", recorded.skips);
    assert_eq!(recorded.skips.total(), 4, "and a position and a covariance: {}", recorded.skips);
    let store = recording(&path);
    let time_ns = (start() + 3.0).as_unix_calendar_nanos();
    let rows = scalars(&store, "/phones/P1/error/horizontal/joint");
    assert_eq!(rows[3], (time_ns, None));
    assert!(rows[4].1.is_some(), "the next one is recorded");
    assert_eq!(scalars(&store, "/distances/P1–P2/maximum")[3], (time_ns, None));
}

#[test]
fn absurd_input_is_counted() {
    let (_directory, path) = scratch();
    let absurd = cofix_common::time::GpsTime::from_nanos(i64::MAX);
    let recorded = record_changed(&path, |index, epoch| match index {
        2 => epoch.time_gps = absurd,
        5 => epoch.phones[1].message.as_mut().unwrap().time_gps = absurd,
        7 => epoch.phones.truncate(1),
        8 => epoch.distances[0].phones = (0, 99),
        9 => {
            let message = epoch.phones[0].message.as_mut().unwrap();
            message.observations[1] = message.observations[0].clone();
        }
        11 => epoch.phones[0].state = Some(support::state(Ecef::new(1e300, 0.0, 0.0), 1.0)),
        _ => (),
    });
    assert_eq!(recorded.epochs, 19);
    assert_eq!(recorded.skips.total(), 5, "{}", recorded.skips);
    assert!(!chunks(&recording(&path), "/distances/P1–phone\\ 99/distance").is_empty());
}

#[test]
fn names_may_hold_any_character() {
    let (_directory, path) = scratch();
    let mut config = SMALL.config();
    config.phones = vec!["a/b c".to_owned(), "é\\*".to_owned()];
    let mut recorder = Recorder::to_file(&path, &config).unwrap();
    SMALL.epochs().for_each(|epoch| recorder.record(&epoch, &[]).unwrap());
    recorder.finish("").unwrap();
    let store = recording(&path);
    let phones: std::collections::BTreeSet<_> = store
        .iter_physical_chunks()
        .filter(|chunk| chunk.entity_path().starts_with(&"/phones".into()))
        .map(|chunk| chunk.entity_path().as_slice()[1].unescaped_str().to_owned())
        .collect();
    assert_eq!(phones.into_iter().collect::<Vec<_>>(), config.phones);
}

#[test]
fn a_session_without_an_epoch_is_a_valid_file() {
    let (_directory, path) = scratch();
    let recorded = Recorder::to_file(&path, &SMALL.config()).unwrap().finish("nothing").unwrap();
    assert_eq!(recorded.epochs, 0);
    assert_eq!(read(&path).len(), 2, "a recording and a layout");
}

#[test]
fn a_path_that_cannot_be_written_is_an_error() {
    let (directory, _) = scratch();
    let path = directory.path().join("missing").join("session.rrd");
    let error = Recorder::to_file(&path, &SMALL.config()).err().unwrap();
    assert!(matches!(error, RecorderError::Create { .. }));
    assert!(error.to_string().contains(&path.display().to_string()), "{error}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_an_error() {
    let full = Path::new("/dev/full");
    if !full.exists() {
        println!("skipped: no /dev/full");
        return;
    }
    let record = || {
        let mut recorder = Recorder::to_file(full, &SMALL.config())?;
        for epoch in SMALL.epochs() {
            recorder.record(&epoch, &[])?;
        }
        recorder.finish("")
    };
    let error = record().unwrap_err();
    assert!(matches!(error, RecorderError::Write { .. }), "{error}");
}

#[test]
fn full_session_stays_small() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("full-session.rrd");
    let session = Session { epochs: 640, phones: 4, satellites: 25, seed: 1 };
    let begun = std::time::Instant::now();
    let recorded = session.record(Recorder::to_file(&path, &session.config()).unwrap());
    println!("{} bytes in {:?}: {}", recorded.bytes, begun.elapsed(), path.display());
    assert_eq!(recorded.epochs, 640);
    assert!(recorded.bytes < 20_000_000, "{} bytes", recorded.bytes);
    assert!(recorded.skips.is_empty(), "{}", recorded.skips);
    // Columns in segments, not rows: two segments and a style for each of the scalars.
    assert!(recording(&path).num_physical_chunks() < 2_000);
}

#[test]
fn usage_is_recorded_where_it_changes() {
    let (_directory, path) = scratch();
    record_changed(&path, |index, epoch| {
        let Some(message) = &mut epoch.phones[0].message else { return };
        message.observations.retain(|o| o.satellite.to_string() == "E02");
        let usage = if (4..7).contains(&index) { Usage::Excluded } else { Usage::Used };
        message.observations[0].usage = usage;
        if index >= 15 {
            message.observations.clear();
        }
    });
    let store = recording(&path);
    let usage = chunks(&store, "/phones/P1/satellites/usage/E02\\ 1C");
    let chunk = usage.iter().find(|chunk| !chunk.is_static()).unwrap();
    let state = rerun::StateChange::descriptor_state().component;
    let states: Vec<_> =
        chunk.iter_slices::<String>(state).map(|row| row.first().map(|s| s.as_str().to_owned())).collect();
    let named = |name: &str| Some(name.to_owned());
    assert_eq!(states, [named("used"), named("excluded"), named("used"), None]);
    let times = chunk.timelines().values().next().unwrap().times_raw();
    let expected = [0.0, 4.0, 7.0, 15.0].map(|t| (start() + t - MESSAGE_LEAD_S).as_unix_calendar_nanos());
    assert_eq!(times, expected);
}

#[test]
fn a_recorder_may_move_to_a_thread_of_its_own() {
    fn assert_send<T: Send>() {}
    assert_send::<Recorder>();
}
