//! What came too late for a live hub, or to another one, is fused after the fact from the journals, as if it had come in time.

#![allow(clippy::unwrap_used, clippy::panic, missing_docs)] // helpers of tests

mod hubs;

use std::path::Path;
use std::time::Duration;

use assert_cmd::Command as Checked;
use cofix_agent::AgentConfig;
use hubs::{free_endpoint, limits, plan, read, start_agent, start_hub, undisturbed, write_session};
use serde_json::Value;

fn report(folder: &Path, name: &str) -> Value {
    serde_json::from_str(&read(folder, name)).unwrap()
}

/// Positions and report of journals whose epochs are taken in order of time.
fn in_order(folder: &Path, journals: &[&str]) -> (String, Value) {
    let mut command = Checked::cargo_bin("cofix-hub").unwrap();
    command.current_dir(folder).args([
        "replay",
        "--late",
        "--overwrite",
        "--positions",
        "late.csv",
        "--report",
        "late.json",
    ]);
    for journal in journals {
        command.args(["--journal", journal]);
    }
    command.assert().success();
    (read(folder, "late.csv"), report(folder, "late.json"))
}

#[test]
fn epochs_that_came_too_late_are_fused_after_the_fact() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan();
    write_session(folder.path(), &plan);
    let expected = undisturbed(folder.path(), &plan, "20");
    let endpoint = free_endpoint();
    let outputs = ["--journal", "live.mcap", "--report", "live.json", "--positions", "live.csv"];
    let mut hub = start_hub(folder.path(), &endpoint, "0.5", &outputs);
    let start = |phone| start_agent(&plan, phone, &endpoint, AgentConfig::KEPT_MESSAGES);
    let (last, first) = plan.phones.split_last().unwrap();
    let mut agents: Vec<_> = first.iter().map(start).collect();
    std::thread::sleep(Duration::from_secs(3));
    agents.push(start(last));
    for agent in agents {
        agent.join().unwrap().unwrap();
    }
    assert_eq!(limits::ended(&mut hub).code(), Some(1), "epochs were not fused");
    let live = report(folder.path(), "live.json");
    assert_eq!(live["lost"][&last.name], 0, "they were scored");
    let (positions, late) = in_order(folder.path(), &["live.mcap"]);
    let epochs = |report: &Value| report["phones"][&last.name]["epochs"].as_u64().unwrap();
    assert!(epochs(&live) < epochs(&late));
    assert!(positions == expected, "they are those of an undisturbed hub");
}

#[test]
fn what_two_hubs_have_of_one_trial_counts_once() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan();
    write_session(folder.path(), &plan);
    let expected = undisturbed(folder.path(), &plan, "20");
    let endpoint = free_endpoint();
    let mut hub = start_hub(folder.path(), &endpoint, "20", &["--journal", "one.mcap"]);
    // They keep three seconds' epochs: another hub does not get the first of them.
    let start = |phone| start_agent(&plan, phone, &endpoint, 60);
    let agents: Vec<_> = plan.phones.iter().map(start).collect();
    std::thread::sleep(Duration::from_millis(5_500));
    hub.kill().unwrap();
    hub.wait().unwrap();
    let outputs = ["--journal", "two.mcap", "--report", "two.json"];
    let mut hub = start_hub(folder.path(), &endpoint, "20", &outputs);
    for agent in agents {
        // It tells that the hub has not all.
        agent.join().unwrap().unwrap_err();
    }
    assert_eq!(limits::ended(&mut hub).code(), Some(1), "the first epochs are lost to this hub");
    let two = report(folder.path(), "two.json");
    assert!(
        plan.phones.iter().all(|phone| two["lost"][&phone.name].as_u64().unwrap() > 0),
        "{}",
        two["lost"]
    );
    for journals in [["one.mcap", "two.mcap"], ["two.mcap", "one.mcap"]] {
        let (positions, report) = in_order(folder.path(), &journals);
        assert!(positions == expected, "{journals:?}");
        for phone in &plan.phones {
            assert_eq!(report["lost"][&phone.name], 0);
            assert_eq!(
                report["phones"][&phone.name]["skips"]["by_reason"]["message received twice"],
                Value::Null
            );
        }
    }
}
