//! The program on recordings that the hub's recorder wrote.

#![allow(clippy::unwrap_used)] // helpers of tests, too

#[path = "../../agent/tests/limits/mod.rs"]
mod limits;
#[path = "../../fusion-hub/tests/support/mod.rs"]
mod support;

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use cofix_hub::outputs::recorder::Recorder;
use cofix_viewer::summary::{Summary, SummaryError};
use support::{ACCURACY, MESSAGE_LEAD_S, Session, start};
use tempfile::TempDir;

const SMALL: Session = Session { epochs: 20, phones: 2, satellites: 6, seed: 7 };

fn recorded() -> (TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("session.rrd");
    SMALL.record(Recorder::to_file(&path, &SMALL.config()).unwrap());
    (directory, path)
}

fn viewer() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cofix-viewer"));
    command.timeout(limits::LIMIT);
    command
}

fn stdout(command: &mut Command) -> String {
    String::from_utf8(command.assert().success().get_output().stdout.clone()).unwrap()
}

/// What a failing command says.
fn complaint(command: &mut Command) -> String {
    String::from_utf8(command.assert().failure().get_output().stderr.clone()).unwrap()
}

fn summarise(path: &Path) -> Command {
    let mut command = viewer();
    command.arg("summary").arg(path);
    command
}

#[test]
fn summary_holds_what_was_recorded() {
    let (_directory, path) = recorded();
    let summary = Summary::read(&path).unwrap();
    assert_eq!(summary.group.as_deref(), Some("synthetic"));
    assert_eq!(summary.phones, ["P1", "P2"]);
    assert_eq!(summary.span_gps, Some((start() - MESSAGE_LEAD_S, start() + 19.0)));
    assert_eq!(summary.accuracy.as_deref(), Some(ACCURACY));
    assert_eq!(summary.bytes, std::fs::metadata(&path).unwrap().len());
    assert!(summary.has_layout);
    assert!(summary.warnings.is_empty(), "{:?}", summary.warnings);
    // 20 rows of each phone, and a row of style.
    assert_eq!(summary.groups["/phones/*/enu/joint"].entities, 2);
    assert_eq!(summary.groups["/phones/*/enu/joint"].rows, 42);
    assert_eq!(summary.groups["/phones/*/satellites/cn0/*"].entities, 12);
    assert_eq!(summary.groups["/distances/*/distance"].entities, 1);
}

#[test]
fn the_program_prints_it() {
    let (_directory, path) = recorded();
    let text = stdout(&mut summarise(&path));
    for expected in [
        "group synthetic",
        "gps_time: 2020-08-13T14:29:59.750 to 2020-08-13T14:30:19.000 GPS, 19.2 s",
        "phones: 2 (P1, P2)",
        "| joint | P1 | 0.75 |",
        "/phones/*/satellites/usage/*",
    ] {
        assert!(text.contains(expected), "{expected}:\n{text}");
    }
    assert!(!text.contains("warning"), "{text}");
    let all = stdout(summarise(&path).arg("--all"));
    assert!(all.contains("/phones/P2/satellites/residual/E01\\ 1C"), "{all}");
    assert!(!all.contains('*'), "{all}");
}

#[test]
fn files_that_are_no_recording_are_named() {
    let directory = tempfile::tempdir().unwrap();
    let missing = directory.path().join("missing.rrd");
    assert!(complaint(&mut summarise(&missing)).contains("cannot read"));
    for (name, content) in [("text.rrd", "not a recording at all"), ("short.rrd", "RR"), ("empty.rrd", "")] {
        let path = directory.path().join(name);
        std::fs::write(&path, content).unwrap();
        let text = complaint(&mut summarise(&path));
        assert!(text.contains(name) && text.contains("recording"), "{text}");
    }
    assert!(complaint(&mut summarise(directory.path())).contains("cannot read"));
}

#[test]
fn a_file_that_was_cut_off_is_summarised_as_far_as_it_goes() {
    let (directory, path) = recorded();
    let whole = std::fs::read(&path).unwrap();
    let cut = directory.path().join("cut.rrd");
    std::fs::write(&cut, &whole[..whole.len() / 5]).unwrap();
    let text = stdout(&mut summarise(&cut));
    assert!(text.contains("warning: the file ends after message"), "{text}");
    assert!(text.contains("warning: no accuracy table"), "{text}");
    assert!(text.contains("P1"), "{text}");
    // Cut anywhere, flip anything: an answer or an error, never a panic.
    for keep in (0..whole.len()).step_by(whole.len() / 15) {
        std::fs::write(&cut, &whole[..keep]).unwrap();
        let _ = Summary::read(&cut);
        let mut damaged = whole.clone();
        damaged[keep] ^= 0x55;
        std::fs::write(&cut, &damaged).unwrap();
        let _ = Summary::read(&cut);
    }
}

#[test]
fn a_damaged_end_mark_costs_no_memory() {
    let (directory, path) = recorded();
    let mut damaged = std::fs::read(&path).unwrap();
    let count = damaged.len() - 4;
    damaged[count + 3] = 0x55; // a milliard entries
    let file = directory.path().join("damaged.rrd");
    std::fs::write(&file, &damaged).unwrap();
    let text = stdout(&mut summarise(&file));
    assert!(text.contains("end mark") && text.contains("is damaged") && text.contains("P1"), "{text}");
}

#[test]
fn a_recording_of_another_program_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("other.rrd");
    let stream = rerun::RecordingStreamBuilder::new("somebody_else").save(&path).unwrap();
    stream.log_static("/note", &rerun::TextDocument::new("x")).unwrap();
    stream.flush_blocking().unwrap();
    drop(stream);
    let error = Summary::read(&path).unwrap_err();
    assert!(matches!(error, SummaryError::OtherApplication { .. }), "{error}");
    assert!(error.to_string().contains("'somebody_else'"), "{error}");
}

#[test]
fn without_the_viewer_it_says_how_to_get_it() {
    let (directory, path) = recorded();
    let text = complaint(viewer().env("PATH", directory.path()).arg("open").arg(&path));
    assert!(text.contains("pip install rerun-sdk==0.36.3"), "{text}");
    assert!(text.contains("cargo install rerun-cli --version 0.36.3 --locked"), "{text}");
}

/// Puts a program `rerun` into a directory: it tells its version and notes its arguments.
#[cfg(unix)]
fn install_viewer(directory: &Path, version: &str, status: i32) {
    use std::os::unix::fs::PermissionsExt as _;
    let notes = directory.join("arguments");
    let script = format!(
        "#!/bin/sh\nif [ \"$1\" = --version ]; then echo 'rerun-cli {version}'; exit 0; fi\n\
         echo \"$@\" > '{}'\nexit {status}\n",
        notes.display()
    );
    let program = directory.join("rerun");
    std::fs::write(&program, script).unwrap();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
#[cfg(unix)]
fn the_viewer_gets_the_file() {
    let (directory, path) = recorded();
    let open = || {
        let mut command = viewer();
        command.env("PATH", directory.path()).arg("open").arg(&path);
        command
    };
    install_viewer(directory.path(), "0.36.3", 0);
    let told = open().assert().success().get_output().stderr.clone();
    let told = String::from_utf8(told).unwrap();
    assert!(told.contains("rerun analytics disable") && told.lines().count() == 1, "{told}");
    let quiet = open().arg("-q").assert().success().get_output().stderr.clone();
    assert!(quiet.is_empty(), "{}", String::from_utf8_lossy(&quiet));
    let arguments = std::fs::read_to_string(directory.path().join("arguments")).unwrap();
    assert_eq!(arguments.trim(), format!("--bind 127.0.0.1 {}", path.display()));

    install_viewer(directory.path(), "0.37.1", 0);
    let warned = open().assert().success().get_output().stderr.clone();
    let warned = String::from_utf8(warned).unwrap();
    assert!(warned.starts_with("warning: ") && warned.contains("is 0.37.1"), "{warned}");

    install_viewer(directory.path(), "0.36.3", 3);
    assert!(complaint(&mut open()).contains("ended with"));
}
