//! What a listener without Rust hears: fused states as JSON, and the Python example.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stderr)] // helpers of tests

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use cofix_common::wire::{all_fused_key, fused_json_key};
use cofix_hub::group::Course;
use cofix_tests::{Hub, limits, run_agents, small_plan};
use zenoh::Wait;

fn example() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/listen.py")
}

/// Whether Python can do this.
fn python_can(code: &str) -> bool {
    let python = Command::new("python3").args(["-c", code]).stderr(Stdio::null()).status();
    python.is_ok_and(|status| status.success())
}

#[test]
fn the_python_example_compiles() {
    if !python_can("") {
        eprintln!("not tested: python3 is missing");
        return;
    }
    let code = format!("compile(open({:?}).read(), 'listen.py', 'exec')", example().display().to_string());
    assert!(python_can(&code));
}

/// Python with the example's package: that of COFIX_PYTHON, or the system's.
fn python() -> String {
    std::env::var("COFIX_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

#[test]
fn states_are_heard_as_json_too() {
    let plan = small_plan(2, 20.0).unwrap();
    let hub = Hub::start(&plan, Course::Replay).unwrap();
    let listener = hub.foreign_session().unwrap();
    let name = &plan.phones[0].name;
    let json = listener.declare_subscriber(fused_json_key(&plan.group, name).unwrap()).wait().unwrap();
    let all = listener.declare_subscriber(all_fused_key(&plan.group).unwrap()).wait().unwrap();
    let mut python = start_python(&plan.group, &hub.endpoints[0]);
    run_agents(&plan, &hub.endpoints).unwrap();
    hub.join().unwrap();
    let texts: Vec<String> = std::iter::from_fn(|| json.try_recv().ok().flatten())
        .map(|sample| sample.payload().try_to_string().unwrap().into_owned())
        .collect();
    assert!(texts.len() > 10, "{}", texts.len());
    for text in &texts {
        assert!(
            text.starts_with("{\"time_gps\":") && text.contains(&format!("\"phone\":\"{name}\"")),
            "{text}"
        );
    }
    let messages = std::iter::from_fn(|| all.try_recv().ok().flatten());
    let of_phone = messages.filter(|sample| sample.key_expr().as_str().ends_with(name.as_str())).count();
    assert_eq!(of_phone, texts.len(), "as many as messages, none of which is heard on the other key");
    if let Some(python) = &mut python {
        assert!(limits::ended(python).success());
        let mut said = String::new();
        python.stdout.take().unwrap().read_to_string(&mut said).unwrap();
        let lines: Vec<&str> = said.lines().collect();
        assert_eq!(lines.len(), 10, "{said}");
        assert!(lines.iter().all(|line| line.contains("sigma")), "{said}");
    }
}

/// The example, once it listens; `None` where its package is missing.
fn start_python(group: &str, endpoint: &str) -> Option<Child> {
    let can = Command::new(python()).args(["-c", "import zenoh"]).stderr(Stdio::null()).status();
    if !can.is_ok_and(|status| status.success()) {
        eprintln!("not tested: python3 with eclipse-zenoh is missing");
        return None;
    }
    let mut child = Command::new(python())
        .arg(example())
        .args([group, "--connect", endpoint, "--count", "10"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stderr.take().unwrap()).read_line(&mut line).unwrap();
    assert!(line.contains("listening on"), "{line}");
    Some(child)
}
