//! What the hub says, and with which exit code.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

#[path = "../../agent/tests/limits/mod.rs"]
mod limits;

use std::path::Path;

use assert_cmd::Command;

fn hub(folder: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::new(env!("CARGO_BIN_EXE_cofix-hub"))
        .current_dir(folder)
        .args(arguments)
        .timeout(limits::LIMIT)
        .assert()
}

/// The hub's standard error, after checking that it failed with exit code 1 and one error.
fn failure(folder: &Path, arguments: &[&str]) -> String {
    let assert = hub(folder, arguments).code(1);
    let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    assert_eq!(text.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{text}");
    assert!(!text.contains("panicked"), "{text}");
    assert!(assert.get_output().stdout.is_empty(), "only the table goes to the standard output");
    text
}

#[test]
fn the_demonstration_records_reports_and_names_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let assert = hub(folder.path(), &["demo", "--report", "demo.json"]).success();
    let text = String::from_utf8(assert.get_output().stdout.clone()).unwrap();
    assert!(text.contains("| joint  | SIM3 "), "{text}");
    assert!(text.contains("Recording: cofix-demo.rrd"), "{text}");
    let attention = text.find("attention").expect("what needs attention is said");
    assert!(text.find("Skipped").is_none_or(|skipped| skipped < attention), "{text}");
    assert!(folder.path().join("cofix-demo.rrd").exists());
    let json = std::fs::read_to_string(folder.path().join("demo.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(report["group"], "demo");
    for key in [
        "epochs",
        "availability",
        "horizontal_p50_m",
        "horizontal_p68_m",
        "horizontal_p95_m",
        "rmse_east_m",
        "rmse_north_m",
        "rmse_up_m",
        "rmse_2d_m",
    ] {
        for method in ["wls", "local", "joint"] {
            assert!(report["methods"][method]["SIM1"][key].is_number(), "{method} {key}");
        }
    }
}

#[test]
fn session_files_that_cannot_be_used_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let phone = "[[phone]]\nname = 'a'\n";
    for (name, content, said) in [
        ("unknown.toml", format!("group = 'g'\ncolour = 'red'\n{phone}"), "unknown field `colour`"),
        ("syntax.toml", "group = ".to_owned(), "syntax.toml"),
        ("recorded.toml", format!("group = 'g'\n{phone}"), "phone 'a' has no observations"),
        (
            "files.toml",
            format!("group = 'g'\n[products]\nsp3 = ['x.sp3']\n{phone}observations = 'a.rnx'"),
            "x.sp3: cannot read the SP3 file",
        ),
        (
            "kind.toml",
            format!("group = 'g'\n[products]\nclock = ['kind.toml']\n{phone}observations = 'a.rnx'"),
            "kind.toml: not usable as RINEX clock file: not a RINEX clock file of version",
        ),
        (
            "truth.toml",
            format!(
                "group = 'g'\n[products]\nsp3 = ['x.sp3']\n{phone}observations = 'a.rnx'\ntruth = 'truth.toml'"
            ),
            "truth.toml: not usable as truth",
        ),
    ] {
        std::fs::write(folder.path().join(name), content).unwrap();
        let text = failure(folder.path(), &["replay", name]);
        assert!(text.contains(said), "expected '{said}' in: {text}");
    }
    assert!(failure(folder.path(), &["replay", "missing.toml"]).contains("missing.toml: cannot read"));
}

#[test]
fn a_taken_endpoint_is_named() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("live.toml"), "group = 'g'\n[[phone]]\nname = 'a'\n").unwrap();
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("tcp/{}", taken.local_addr().unwrap());
    let text = failure(folder.path(), &["run", "live.toml", "--listen", &endpoint]);
    assert!(text.contains("cannot listen on") && text.contains(&endpoint), "{text}");
    let text = failure(folder.path(), &["run", "live.toml", "--listen", "nonsense"]);
    assert!(text.contains("nonsense"), "{text}");
}

#[test]
fn the_log_is_json_when_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let assert =
        hub(folder.path(), &["--log-format", "json", "-v", "demo", "--report", "demo.json"]).success();
    let log = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    assert!(log.lines().count() > 0);
    for line in log.lines() {
        let entry: serde_json::Value = serde_json::from_str(line).unwrap();
        for key in ["time", "level", "target", "message"] {
            assert!(entry[key].is_string(), "{line}");
        }
        assert!(entry["target"].as_str().unwrap().starts_with("cofix_"), "{line}");
    }
    let assert = hub(folder.path(), &["replay", "no\n.toml", "--log-format", "json"]).code(1);
    let log = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    assert_eq!(log.lines().count(), 1, "{log}");
    let entry: serde_json::Value = serde_json::from_str(&log).unwrap();
    assert_eq!(entry["level"], "ERROR");
    assert!(entry["message"].as_str().unwrap().contains("no\n.toml: cannot read"), "{log}");
}

#[test]
fn shells_complete_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let assert = hub(folder.path(), &["completions", "bash"]).success();
    let script = String::from_utf8(assert.get_output().stdout.clone()).unwrap();
    for word in ["cofix-hub", "--until-finished", "default peng2023", "--log-format"] {
        assert!(script.contains(word), "{word}");
    }
    let help = hub(folder.path(), &["--help"]).success();
    assert!(!String::from_utf8_lossy(&help.get_output().stdout).contains("completions"));
}

#[test]
fn an_unwritable_recording_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let text = failure(folder.path(), &["demo", "--recording", "no/such/folder/demo.rrd"]);
    assert!(text.contains("no/such/folder/demo.rrd"), "{text}");
    assert_eq!(text.matches("cannot create the recording").count(), 1, "{text}");
}

#[test]
fn an_unwritable_report_is_named_before_anything_is_computed() {
    let folder = tempfile::tempdir().unwrap();
    let text = failure(folder.path(), &["demo", "--report", "no/such/folder/demo.json"]);
    assert!(text.contains("no/such/folder/demo.json: cannot write the report"), "{text}");
    assert!(!folder.path().join("cofix-demo.rrd").exists());
}

#[test]
fn outputs_that_would_overwrite_something_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let session = "group = 'g'\n[[phone]]\nname = 'a'\nobservations = 'a.rnx'\ntruth = 'a.csv'\n";
    std::fs::write(folder.path().join("live.toml"), session).unwrap();
    std::fs::write(folder.path().join("old.rrd"), "precious").unwrap();
    for (arguments, said) in [
        (vec!["replay", "live.toml", "--report", "live.toml"], "overwrite the session file"),
        (vec!["replay", "live.toml", "--recording", "./a.rnx"], "overwrite the observations of a"),
        (vec!["run", "live.toml", "--report", "a.csv"], "overwrite the truth of a"),
        (vec!["run", "live.toml", "--report", "x", "--recording", "./x"], "overwrite the recording"),
        (vec!["demo", "--report", "cofix-demo.rrd"], "overwrite the recording"),
        (vec!["run", "live.toml", "--recording", "old.rrd"], "there is a file already"),
    ] {
        let text = failure(folder.path(), &arguments);
        assert!(text.contains(said), "expected '{said}' in: {text}");
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("old.rrd")).unwrap(), "precious");
    assert_eq!(std::fs::read_to_string(folder.path().join("live.toml")).unwrap(), session);
}

#[test]
fn outputs_that_are_there_are_replaced_only_when_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for output in ["--recording", "--report", "--positions", "--states"] {
        std::fs::write(at("old"), "precious").unwrap();
        // Those that come before it do not appear either.
        let mut arguments = vec!["demo", "--recording", "new.rrd", "--report", "new.json"];
        arguments.extend(["--positions", "new.csv", "--states", "new.jsonl"]);
        let place = arguments.iter().position(|argument| *argument == output).unwrap() + 1;
        arguments[place] = "old";
        let text = failure(folder.path(), &arguments);
        assert!(text.contains("old: there is a file already") && text.contains("--overwrite"), "{text}");
        assert_eq!(std::fs::read_to_string(at("old")).unwrap(), "precious", "{output}");
        let left: Vec<_> =
            std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(left, ["old"], "{output}");
        arguments.push("--overwrite");
        hub(folder.path(), &arguments).success();
        assert_ne!(std::fs::read(at("old")).unwrap(), b"precious", "{output}");
        for name in ["new.rrd", "new.json", "new.csv", "new.jsonl"] {
            let _ = std::fs::remove_file(at(name));
        }
    }
}

#[test]
fn positions_and_states_have_a_row_for_each_phone_and_epoch() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["demo", "--positions", "demo.csv", "--report", "demo.json", "--states", "demo.jsonl"];
    let assert = hub(folder.path(), &arguments).success();
    let said = String::from_utf8_lossy(&assert.get_output().stdout).into_owned();
    assert!(said.contains("Positions: demo.csv\nStates: demo.jsonl"), "{said}");
    let text = std::fs::read_to_string(folder.path().join("demo.csv")).unwrap();
    agree(&text, &std::fs::read_to_string(folder.path().join("demo.jsonl")).unwrap());
    let json = std::fs::read_to_string(folder.path().join("demo.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    let header = text.lines().next().unwrap();
    assert!(
        header.starts_with("gps_week,gps_tow_s,phone,latitude_deg,longitude_deg,ellipsoidal_height_m,"),
        "{header}"
    );
    for phone in ["SIM1", "SIM2", "SIM3"] {
        let rows: Vec<Vec<&str>> = text
            .lines()
            .map(|line| line.split(',').collect())
            .filter(|row: &Vec<&str>| row[2] == phone)
            .collect();
        let measured = rows.iter().filter(|row| row[9] != "4").count() as u64;
        let epochs = report["phones"][phone]["epochs"].as_u64().unwrap();
        assert!(measured <= epochs && measured + 5 > epochs, "{phone}: {measured} rows, {epochs} epochs");
        assert!(rows.iter().all(|row| row.len() == header.split(',').count() && row[18] == "joint"));
    }
}

/// The lines of the states say what the rows of the table say; the covariance is that of the standard deviations.
fn agree(rows: &str, lines: &str) {
    assert_eq!(rows.lines().count(), lines.lines().count() + 1);
    let mut without_message = 0;
    for (row, line) in rows.lines().skip(1).zip(lines.lines()) {
        let row: Vec<&str> = row.split(',').collect();
        let line: serde_json::Value = serde_json::from_str(line).unwrap();
        let number = |pointer: &str| line.pointer(pointer).and_then(serde_json::Value::as_f64).unwrap();
        assert_eq!(
            (line["phone"].as_str(), number("/time_gps/week").to_string().as_str()),
            (Some(row[2]), row[0])
        );
        for (column, pointer, tolerance) in [
            (1, "/time_gps/tow_s", 1e-8),
            (3, "/latitude_deg", 1e-10),
            (4, "/longitude_deg", 1e-10),
            (5, "/height_m", 1e-4),
            (6, "/velocity_enu_mps/1", 1e-4),
            (7, "/velocity_enu_mps/0", 1e-4),
            (8, "/velocity_enu_mps/2", 1e-4),
            (10, "/position_sigma_enu_m/1", 1e-4),
            (11, "/position_sigma_enu_m/0", 1e-4),
            (12, "/position_sigma_enu_m/2", 1e-4),
        ] {
            let (a, b): (f64, f64) = (row[column].parse().unwrap(), number(pointer));
            assert!((a - b).abs() < tolerance, "{pointer}: {a} {b}");
        }
        for axis in 0..3 {
            let sigma_m = number(&format!("/position_sigma_enu_m/{axis}"));
            let variance = number(&format!("/position_covariance_enu_m2/{axis}/{axis}"));
            assert!((sigma_m * sigma_m - variance).abs() < 1e-9 * variance);
        }
        without_message += usize::from(line["verdict"].is_null());
        assert_eq!(line["verdict"].as_str().unwrap_or_default(), row[17]);
        assert_eq!(line["satellites"].as_u64().map_or_else(String::new, |count| count.to_string()), row[16]);
    }
    assert!(without_message > 0, "the demonstration has phones that fall silent");
}

#[test]
fn a_session_that_fails_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let session = "group = 'g'\n[[phone]]\nname = 'a'\nobservations = 'missing.rnx'\n";
    std::fs::write(folder.path().join("session.toml"), session).unwrap();
    let outputs =
        ["--recording", "a.rrd", "--report", "a.json", "--positions", "a.csv", "--states", "a.jsonl"];
    let arguments: Vec<&str> = ["replay", "session.toml"].into_iter().chain(outputs).collect();
    assert!(failure(folder.path(), &arguments).contains("missing.rnx"));
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, ["session.toml"]);
}

#[test]
fn session_files_are_told_what_to_write() {
    let folder = tempfile::tempdir().unwrap();
    let phone = "[[phone]]\nname = 'a'\n";
    for (content, said) in [
        ("group = 'g'\n[phone]\nname = 'a'\n".to_owned(), "write [[phone]], with two brackets"),
        (format!("group = 'g'\n{phone}[products]\nsp3 = 'a.sp3'\n"), "write a list: sp3 = ['a.sp3']"),
        (format!("group = 'g'\n{phone}date = 2020-08-13T14:00:00\n"), "in quotes, in GPS time"),
        (
            format!("group = 'g'\n{phone}[[constraint]]\nkind = 'distance'\nmax_m = 2\n"),
            "did you mean `maximum_m`?",
        ),
    ] {
        std::fs::write(folder.path().join("session.toml"), content).unwrap();
        let text = failure(folder.path(), &["replay", "session.toml"]);
        assert!(text.contains(said), "expected '{said}' in: {text}");
    }
}

#[test]
fn a_live_hub_tells_its_status() {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};
    limits::watch();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("live.toml"), "group = 'g'\n[[phone]]\nname = 'a'\n").unwrap();
    let mut live = Command::new(env!("CARGO_BIN_EXE_cofix-hub"))
        .current_dir(folder.path())
        .args(["run", "live.toml", "--listen", "tcp/127.0.0.1:0", "--recording", "live.rrd"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut log = BufReader::new(live.stderr.take().unwrap()).lines();
    let line = log.find(|line| line.as_ref().unwrap().contains("listens on")).unwrap().unwrap();
    let endpoint = line.split_once("listens on ").unwrap().1.to_owned();
    let ask = |more: &[&str]| {
        let arguments = [&["status", "g", "--connect", &endpoint], more].concat();
        hub(folder.path(), &arguments).code(1)
    };
    // Until the group is at work, the hub has no status.
    let told = (0..100).map(|_| ask(&["--json"])).find(|told| !told.get_output().stdout.is_empty()).unwrap();
    let status: serde_json::Value = serde_json::from_slice(&told.get_output().stdout).unwrap();
    assert_eq!((&status["group"], &status["phones"][0]["phone"]), (&"g".into(), &"a".into()));
    assert_eq!((&status["journal"], &status["recording"]), (&"live.mcap".into(), &"live.rrd".into()));
    let told = ask(&[]);
    let text = String::from_utf8_lossy(&told.get_output().stdout).into_owned();
    assert!(text.contains("\n| a     |      - |"), "{text}");
    assert_eq!(String::from_utf8_lossy(&told.get_output().stderr), "error: a: no epoch yet\n");
    live.kill().unwrap();
    live.wait().unwrap();
    let gone = ask(&[]);
    assert!(String::from_utf8_lossy(&gone.get_output().stderr).contains("no hub answers at"));
}

#[cfg(target_os = "linux")]
#[test]
fn signals_end_a_live_hub_in_order() {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};
    limits::watch();
    for signal in ["-TERM", "-HUP", "-INT"] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("live.toml"), "group = 'g'\n[[phone]]\nname = 'a'\n").unwrap();
        // A hub that is started with SIGHUP ignored, as under `nohup`, goes on ignoring it.
        let mut hub = Command::new("env")
            .args(["--default-signal=HUP", env!("CARGO_BIN_EXE_cofix-hub")])
            .current_dir(folder.path())
            .args(["run", "live.toml", "--listen", "tcp/127.0.0.1:0"])
            .args(["--recording", "live.rrd", "--report", "live.json"])
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(hub.stderr.take().unwrap()).lines();
        assert!(lines.any(|line| line.unwrap().contains("listens on")));
        let sent = Command::new("kill").args([signal, &hub.id().to_string()]).status().unwrap();
        assert!(sent.success());
        assert!(limits::ended(&mut hub).success(), "{signal}");
        assert!(folder.path().join("live.json").exists() && folder.path().join("live.rrd").exists());
    }
}

#[cfg(unix)]
#[test]
fn a_recording_that_breaks_off_fails_at_the_end_and_costs_nothing_else() {
    use std::io::Read;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("demo.rrd");
    assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
    let reader = limits::spawn(move || {
        let mut first = Vec::new();
        std::fs::File::open(path).unwrap().take(200_000).read_to_end(&mut first).unwrap();
    });
    let assert = hub(folder.path(), &["demo", "--recording", "demo.rrd", "--report", "demo.json"]).code(1);
    reader.join().unwrap();
    let output = assert.get_output();
    assert!(String::from_utf8_lossy(&output.stdout).contains("| joint  | SIM3 "));
    assert!(String::from_utf8_lossy(&output.stderr).contains("the recording is incomplete"));
    assert!(folder.path().join("demo.json").exists());
}
