//! What the documents show is understood.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

#[path = "../../agent/tests/limits/mod.rs"]
mod limits;

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use cofix_agent::settings::FileSettings;
use cofix_common::settings::Settings;
use cofix_hub::session::Session;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// README.md and all of docs.
fn documents() -> Vec<(String, String)> {
    let in_docs = std::fs::read_dir(root().join("docs")).unwrap().map(|entry| entry.unwrap().path());
    let mut paths: Vec<PathBuf> =
        in_docs.filter(|path| path.extension().is_some_and(|e| e == "md")).collect();
    paths.push(root().join("README.md"));
    paths.sort();
    let named = |path: PathBuf| (path.display().to_string(), std::fs::read_to_string(&path).unwrap());
    paths.into_iter().map(named).collect()
}

/// The TOML blocks of a document.
fn blocks(document: &str) -> Vec<&str> {
    document.split("```toml\n").skip(1).map(|rest| rest.split("\n```").next().unwrap()).collect()
}

#[test]
fn every_block_of_toml_is_a_session_or_settings() {
    let mut sessions = 0;
    let mut settings = 0;
    for (name, text) in documents() {
        for block in blocks(&text) {
            if block.contains("group =") {
                let session = Session::parse(block, Path::new(&name), None).unwrap_or_else(|e| panic!("{e}"));
                session.settings.options().unwrap();
                sessions += 1;
            } else {
                let read = FileSettings::parse(block).unwrap_or_else(|e| panic!("{name}: {e}\n{block}"));
                assert!(
                    read != FileSettings::default(),
                    "{name} shows a block that changes nothing:\n{block}"
                );
                settings += 1;
            }
        }
    }
    assert!(sessions >= 2 && settings >= 1, "{sessions} sessions, {settings} settings");
}

/// The example at the head of the session's source.
#[test]
fn the_documented_session_is_read() {
    let source = include_str!("../src/session/mod.rs");
    let lines = source.lines().map_while(|line| line.strip_prefix("//!"));
    let text: Vec<&str> = lines.map(|line| line.strip_prefix(' ').unwrap_or(line)).collect();
    let text = text.join("\n");
    let [block] = blocks(&text)[..] else { panic!("one block is expected in:\n{text}") };
    let refused = Session::parse(block, Path::new("a.toml"), None).unwrap_err().to_string();
    assert!(refused.contains("at least two phones"), "{refused}");
    let two = block.replacen("[[constraint]]", "[[phone]]\nname = \"b\"\n[[constraint]]", 1);
    let session = Session::parse(
        &two.replace("phones = [\"HP30\"]", "phones = [\"HP30\", \"b\"]"),
        Path::new("a.toml"),
        None,
    );
    assert_eq!(session.unwrap().settings.estimator, Settings::default());
}

#[test]
fn the_message_that_the_document_shows_is_said() {
    let document = std::fs::read_to_string(root().join("docs/settings.md")).unwrap();
    let block = blocks(&document)[0].replace("rate_sigma_scale = 2.0", "rate_sigma_scale = -1.0");
    let refused = Session::parse(&block, Path::new("my-drive.toml"), None).unwrap_err().to_string();
    assert!(document.contains(&format!("\n    {refused}\n")), "not in docs/settings.md: {refused}");
}

#[test]
fn what_the_hub_prints_is_read_back() {
    for preset in ["default", "peng2023"] {
        let hub = Command::new(env!("CARGO_BIN_EXE_cofix-hub"))
            .args(["settings", "--preset", preset])
            .timeout(limits::LIMIT)
            .assert()
            .success();
        let text = String::from_utf8(hub.get_output().stdout.clone()).unwrap();
        let read = FileSettings::parse(&text).unwrap();
        let expected = if preset == "default" { Settings::default() } else { Settings::peng2023() };
        assert_eq!(read.estimator, expected);
        assert!(text.contains(&format!("preset = \"{preset}\"")) && text.contains("[masks]"), "{text}");
        let lines: Vec<&str> = text.lines().collect();
        for (index, line) in lines.iter().enumerate().filter(|(_, line)| !line.starts_with(['#', '['])) {
            let is_told = index > 0 && lines[index - 1].starts_with("# [") && lines[index - 1].ends_with('.');
            assert!(line.is_empty() || is_told, "no comment before: {line}");
        }
    }
    let hub = Command::new(env!("CARGO_BIN_EXE_cofix-hub"))
        .args(["settings", "--preset", "ours"])
        .assert()
        .failure();
    let said = String::from_utf8(hub.get_output().stderr.clone()).unwrap();
    assert!(said.contains("peng2023"), "{said}");
}
