//! Recordings read back with Rerun's own store.

#![allow(clippy::unwrap_used)] // helpers of tests, too

mod support;

use std::fs::File;
use std::path::{Path, PathBuf};

use cofix_common::frames::Ecef;
use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::fusion::peers::{EventKind, IntegrityEvent};
use cofix_common::integrity::{Cause, ProtectionLevels, Verdict};
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

/// Seconds after the start and states of an entity; `None` is an empty row.
fn states(store: &ChunkStore, entity: &str) -> Vec<(f64, Option<String>)> {
    let component = rerun::StateChange::descriptor_state().component;
    let chunks = chunks(store, entity);
    let chunk = chunks.iter().find(|chunk| !chunk.is_static()).unwrap();
    let states = chunk.iter_slices::<String>(component);
    let states = states.map(|row| row.first().map(|state| state.as_str().to_owned()));
    let seconds = |time_ns: &i64| (time_ns - start().as_unix_calendar_nanos()) as f64 / 1e9;
    let times = chunk.timelines().values().next().unwrap().times_raw();
    times.iter().map(seconds).zip(states).collect()
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
            "quality/fused_hpl",
            "quality/fused_vpl",
            "quality/fused_vpl_below",
            "integrity/verdict/wls",
            "integrity/verdict/joint",
            "integrity/group",
            "integrity/diagram/horizontal/wls/bounded",
            "integrity/diagram/vertical/joint/bounded",
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
        "/integrity/diagram/diagonal",
        "/integrity/diagram/axes",
        "/integrity/diagram/scale",
        "/integrity/counts",
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
    let diagrams = entities.iter().filter(|e| e.ends_with("/VisualBounds2D")).count();
    assert_eq!(diagrams, 4, "2 × (horizontal, vertical)");
    let axes = entities.iter().filter(|e| e.ends_with("/TimeAxis")).count();
    assert_eq!(
        axes, 25,
        "2 × (horizontal, vertical, 4 of levels, C/N0, residuals), all joint, 2 of constraints, 6 of quality"
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
    // An hour of these takes less than 50 MB.
    assert!(recorded.bytes < 50_000_000 * 640 / 3_600, "{} bytes", recorded.bytes);
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
    let named = |name: &str| Some(name.to_owned());
    let expected = [(0.0, named("used")), (4.0, named("excluded")), (7.0, named("used")), (15.0, None)];
    let expected = expected.map(|(second, state)| (second - MESSAGE_LEAD_S, state));
    assert_eq!(states(&store, "/phones/P1/satellites/usage/E02\\ 1C"), expected);
}

#[test]
fn verdicts_are_recorded_where_they_change() {
    let (_directory, path) = scratch();
    record_changed(&path, |index, epoch| {
        let verdict = match index {
            5 => Verdict::Unreliable(Cause::Peers),
            6..8 => Verdict::CannotBeChecked,
            _ => Verdict::Reliable,
        };
        epoch.phones[0].verdict = Some(verdict);
        if index == 12 {
            epoch.phones[0].message = None;
            epoch.phones[0].verdict = None;
        }
    });
    let store = recording(&path);
    let named = |name: &str| Some(name.to_owned());
    let expected = [
        (0.0, named("reliable")),
        (5.0, named("unreliable: contradicts the other phones")),
        (6.0, named("cannot be checked")),
        (8.0, named("reliable")),
        (12.0, None),
        (13.0, named("reliable")),
    ];
    assert_eq!(states(&store, "/phones/P1/integrity/verdict/joint"), expected);
    let own = states(&store, "/phones/P1/integrity/verdict/wls");
    let expected = [
        (0.0, named("reliable")),
        (5.0, named("unreliable: tests failed")),
        (6.0, named("reliable")),
        (12.0 + MESSAGE_LEAD_S, None),
        (13.0, named("reliable")),
    ];
    assert_eq!(own, expected.map(|(second, state)| (second - MESSAGE_LEAD_S, state)));
}

#[test]
fn who_was_isolated_when_is_recorded() {
    let (_directory, path) = scratch();
    record_changed(&path, |index, epoch| {
        let kinds = match index {
            4 => &[EventKind::Isolated][..],
            9 => &[EventKind::Readmitted, EventKind::CannotTell],
            _ => &[],
        };
        let event = |kind: &EventKind| {
            let phones = if *kind == EventKind::CannotTell { vec![0, 1] } else { vec![1] };
            IntegrityEvent { time_gps: epoch.time_gps, phones, constraint: None, kind: *kind, error: None }
        };
        epoch.events = kinds.iter().map(event).collect();
    });
    let store = recording(&path);
    let named = |name: &str| Some(name.to_owned());
    let expected = [(0.0, named("with the group")), (4.0, named("isolated")), (9.0, named("with the group"))];
    assert_eq!(states(&store, "/phones/P2/integrity/group"), expected);
    assert_eq!(states(&store, "/phones/P1/integrity/group"), expected[..1]);
    let lines = texts(&store, "/integrity/log", rerun::TextLog::descriptor_text().component);
    let expected = [
        "14:30:04 GPS P2 contradicts the other phones and is isolated: the kind of its error is unknown",
        "14:30:09 GPS P2 agrees with the other phones again",
        "14:30:09 GPS P1, P2 contradict each other, and which is wrong is open",
    ];
    assert_eq!(lines, expected);
    let levels = texts(&store, "/integrity/log", rerun::TextLog::descriptor_level().component);
    assert_eq!(levels, ["ERROR", "INFO", "WARN"]);
}

#[test]
fn levels_below_errors_have_an_entity_of_their_own() {
    let (_directory, path) = scratch();
    record_changed(&path, |index, epoch| {
        let phone = &mut epoch.phones[0];
        match index {
            2 => phone.protection = Some(ProtectionLevels { horizontal_m: 1e-6, vertical_m: 14.0 }),
            3 => phone.protection = None,
            // Not reliable, so nothing is claimed.
            4 => {
                phone.protection = Some(ProtectionLevels { horizontal_m: 1e-6, vertical_m: 1e-6 });
                phone.verdict = Some(Verdict::Unreliable(Cause::TestsFailed));
            }
            _ => (),
        }
    });
    let store = recording(&path);
    let points = |entity: &str| -> Vec<[f32; 2]> {
        let component = rerun::Points2D::descriptor_positions().component;
        let chunks = chunks(&store, &format!("/phones/P1/integrity/diagram/{entity}"));
        let slices = chunks.iter().flat_map(|chunk| chunk.iter_slices::<[f32; 2]>(component));
        slices.flat_map(<[_]>::to_vec).collect()
    };
    // Of 20 epochs two are not reliable: the fourth here, and the fifth of the session.
    assert_eq!(points("horizontal/joint/bounded").len(), 16);
    let [misleading] = points("horizontal/joint/misleading")[..] else { panic!("one point") };
    let errors = scalars(&store, "/phones/P1/error/horizontal/joint");
    assert!((f64::from(misleading[0]) - errors[2].1.unwrap()).abs() < 1e-5);
    assert!((f64::from(misleading[1]) + 1e-6).abs() < 1e-9, "the axis points down");
    assert_eq!(points("vertical/joint/bounded").len(), 17);
    assert!(points("vertical/joint/misleading").is_empty());
    let counts = texts(&store, "/integrity/counts", rerun::TextDocument::descriptor_text().component);
    assert!(counts[0].contains("| joint | P1 | 18 | 88.89 % | 94.44 % | 2 |"), "{}", counts[0]);
    let level = scalars(&store, "/phones/P1/quality/fused_hpl");
    assert_eq!((level[1].1, level[2].1, level[3].1), (Some(8.0), Some(1e-6), None));
    assert_eq!(scalars(&store, "/phones/P1/quality/fused_vpl_below")[1].1, Some(-14.0));
}

#[test]
fn without_a_truth_there_are_no_diagrams() {
    let (_directory, path) = scratch();
    let mut recorder = Recorder::to_file(&path, &SMALL.config()).unwrap();
    SMALL.epochs().for_each(|epoch| recorder.record(&epoch, &[]).unwrap());
    recorder.finish("").unwrap();
    let stores = read(&path);
    let all: Vec<String> = stores
        .iter()
        .flat_map(|(_, store)| store.iter_physical_chunks().map(|chunk| chunk.entity_path().to_string()))
        .collect();
    assert!(!all.iter().any(|entity| entity.contains("diagram") || entity.contains("VisualBounds2D")));
    assert!(all.contains(&"/phones/P1/integrity/group".to_owned()));
}

#[test]
fn a_recorder_may_move_to_a_thread_of_its_own() {
    fn assert_send<T: Send>() {}
    assert_send::<Recorder>();
}
