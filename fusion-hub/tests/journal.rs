//! Journals of live hubs that run as processes of their own: done again bit for bit, and gone on with after a kill.

#![allow(clippy::unwrap_used, clippy::panic, missing_docs)] // helpers of tests

mod hubs;

use std::path::Path;
use std::time::Duration;

use assert_cmd::Command as Checked;
use cofix_hub::replay::Plan;
use hubs::{free_endpoint, limits, plan, read, start_agents, start_hub, write_session};

/// Runs agents against a hub that is killed this many times, and started again.
fn run(folder: &Path, plan: &Plan, kills: u32, outputs: &[&str]) {
    let endpoint = free_endpoint();
    let mut hub = start_hub(folder, &endpoint, "20", outputs);
    let agents = start_agents(plan, &endpoint);
    for _ in 0..kills {
        std::thread::sleep(Duration::from_millis(1_200));
        hub.kill().unwrap();
        hub.wait().unwrap();
        hub = start_hub(folder, &endpoint, "20", outputs);
    }
    for agent in agents {
        agent.join().unwrap().unwrap();
    }
    assert!(limits::ended(&mut hub).success());
}

/// Journals in a folder, in order of their names.
fn journals(folder: &Path) -> Vec<String> {
    let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let journals = paths.filter(|path| path.extension().is_some_and(|extension| extension == "mcap"));
    let mut journals: Vec<String> =
        journals.map(|path| path.file_name().unwrap().to_string_lossy().into_owned()).collect();
    journals.sort_unstable();
    journals
}

/// How many fused positions a file has.
fn fixes(path: &Path) -> usize {
    let bytes = std::fs::read(path).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let is_fix = |message: &mcap::Message<'_>| {
        message.channel.schema.as_ref().is_some_and(|schema| schema.name == "foxglove.LocationFix")
    };
    messages.filter(is_fix).count()
}

#[test]
fn a_hub_that_nobody_told_where_to_write_has_a_journal_too() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan();
    write_session(folder.path(), &plan);
    run(folder.path(), &plan, 1, &["--report", "live.json"]);
    let names = journals(folder.path());
    let [second, first] = names.as_slice() else { panic!("{names:?}") };
    let stem = first.strip_suffix(".mcap").unwrap();
    assert!(stem.starts_with(&format!("{}-20", plan.group)), "{names:?}");
    assert_eq!(*second, format!("{stem}.2.mcap"));
    let mut command = Checked::cargo_bin("cofix-hub").unwrap();
    let arguments = ["replay", "--journal", first, "--report", "again.json"];
    command.current_dir(folder.path()).args(arguments).assert().success();
    assert_eq!(read(folder.path(), "again.json"), read(folder.path(), "live.json"));
}

#[test]
fn a_journal_is_done_again_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan();
    write_session(folder.path(), &plan);
    let outputs = ["--recording", "live.rrd", "--report", "live.json", "--positions", "live.csv"];
    run(folder.path(), &plan, 0, &outputs);
    let rows = read(folder.path(), "live.csv").lines().count() - 1;
    assert_eq!(fixes(&folder.path().join("live.mcap")), rows);
    let again = |arguments: &[&str]| {
        let mut command = Checked::cargo_bin("cofix-hub").unwrap();
        let outputs = ["--report", "again.json", "--positions", "again.csv", "--overwrite"];
        command.current_dir(folder.path()).args(["replay", "--journal", "live.mcap"]).args(outputs);
        command.args(arguments).assert()
    };
    for session in [&[][..], &["car.toml"]] {
        again(session).success();
        assert_eq!(read(folder.path(), "again.json"), read(folder.path(), "live.json"));
        assert_eq!(read(folder.path(), "again.csv"), read(folder.path(), "live.csv"));
    }
    // With other settings.
    let other = format!("{}[filter]\npreset = 'peng2023'\n", read(folder.path(), "car.toml"));
    std::fs::write(folder.path().join("other.toml"), other).unwrap();
    let text = String::from_utf8_lossy(&again(&["other.toml"]).get_output().stderr.clone()).into_owned();
    assert_ne!(read(folder.path(), "again.csv"), read(folder.path(), "live.csv"), "{text}");
    // A session that has ended is not gone on with.
    let mut command = Checked::cargo_bin("cofix-hub").unwrap();
    let arguments = ["run", "car.toml", "--listen", "tcp/127.0.0.1:0", "--journal", "live.mcap"];
    let refused = command.current_dir(folder.path()).args(arguments).assert().code(1);
    assert!(String::from_utf8_lossy(&refused.get_output().stderr).contains("came to its end"));
}

#[test]
fn hubs_that_are_killed_go_on_from_their_journal() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan();
    write_session(folder.path(), &plan);
    run(folder.path(), &plan, 0, &["--no-journal", "--positions", "undisturbed.csv"]);
    assert_eq!(journals(folder.path()), Vec::<String>::new());
    run(folder.path(), &plan, 3, &["--recording", "live.rrd", "--positions", "killed.csv"]);
    assert_eq!(read(folder.path(), "killed.csv"), read(folder.path(), "undisturbed.csv"));
    let mut files: Vec<String> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|name| name.starts_with("live."))
        .collect();
    files.sort_unstable();
    let journal = ["live.2.mcap", "live.3.mcap", "live.4.mcap", "live.mcap"];
    let recordings = ["live.partial.1.rrd", "live.partial.2.rrd", "live.partial.3.rrd", "live.rrd"];
    let mut expected = [journal, recordings].concat();
    expected.sort_unstable();
    assert_eq!(files, expected);
    let mut command = Checked::cargo_bin("cofix-hub").unwrap();
    let outputs = ["--positions", "again.csv"];
    command
        .current_dir(folder.path())
        .args(["replay", "--journal", "live.mcap"])
        .args(outputs)
        .assert()
        .success();
    assert_eq!(read(folder.path(), "again.csv"), read(folder.path(), "undisturbed.csv"));
}
