//! What the agent says, and with which exit code, when it cannot work.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

use std::path::Path;

use assert_cmd::Command;

const OBSERVATIONS: &str = "     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE
G    4 C1C L1C D1C S1C                                      SYS / # / OBS TYPES
                                                            END OF HEADER
> 2020 08 13 14 19  2.0000000  0  1
G07  22100000.000 8 116000000.000 8     -1200.000 8        45.000 8
";
const NAVIGATION: &str = "     3.04           N: GNSS NAV DATA    M: MIXED            RINEX VERSION / TYPE
                                                            END OF HEADER
";

fn agent(folder: &Path, observations: &str, products: &[&str]) -> assert_cmd::assert::Assert {
    Command::new(env!("CARGO_BIN_EXE_cofix-agent"))
        .current_dir(folder)
        .args([
            "--group",
            "g",
            "--phone",
            "p",
            "--connect",
            "tcp/127.0.0.1:9",
            "--speed",
            "max",
            "--patience",
            "1",
        ])
        .args(["--observations", observations])
        .args(products)
        .assert()
}

/// The agent's last words, after checking that it failed with exit code 1 and one line.
fn failure(folder: &Path, observations: &str, products: &[&str]) -> String {
    let assert = agent(folder, observations, products).code(1);
    let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    assert_eq!(text.lines().filter(|line| line.contains("ERROR")).count(), 1, "{text}");
    assert!(!text.contains("panicked"), "{text}");
    text
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("good.rnx"), OBSERVATIONS).unwrap();
    std::fs::write(folder.path().join("nav.rnx"), NAVIGATION).unwrap();
    let cut: String = OBSERVATIONS.split_inclusive('\n').take(2).collect();
    std::fs::write(folder.path().join("cut.rnx"), cut).unwrap();
    let header: String = OBSERVATIONS.split_inclusive('\n').take(3).collect();
    std::fs::write(folder.path().join("header.rnx"), header).unwrap();
    std::fs::write(folder.path().join("noise.bin"), [0x1f, 0x8b, 8, 0, 1, 2, 3]).unwrap();
    std::fs::write(folder.path().join("noise.txt"), "lorem ipsum").unwrap();
    folder
}

#[test]
fn unusable_observations_are_named() {
    let folder = folder();
    for (file, said) in [
        ("missing.rnx", "cannot read the observation file"),
        ("nav.rnx", "not usable as observation file"),
        ("cut.rnx", "before END OF HEADER"),
        ("header.rnx", "holds no epoch"),
        ("noise.bin", "gzip data is damaged"),
        ("noise.txt", "it begins with 'lorem ipsum'; read are RINEX 2, 3 and 4"),
    ] {
        let text = failure(folder.path(), file, &["--navigation", "nav.rnx"]);
        assert!(text.contains(said) && text.contains(file), "expected '{said}' in: {text}");
    }
}

#[test]
fn unusable_products_are_named() {
    let folder = folder();
    for (products, said) in [
        (vec![], "no orbits"),
        (vec!["--sp3", "missing.sp3"], "missing.sp3: cannot read the SP3 file"),
        (vec!["--sp3", "good.rnx"], "good.rnx: not usable as SP3 file"),
        (vec!["--navigation", "good.rnx"], "good.rnx: not usable as RINEX navigation file"),
    ] {
        let text = failure(folder.path(), "good.rnx", &products);
        assert!(text.contains(said), "expected '{said}' in: {text}");
    }
}

#[test]
fn a_hub_that_does_not_answer_is_named() {
    let folder = folder();
    let text = failure(folder.path(), "good.rnx", &["--navigation", "nav.rnx"]);
    assert!(text.contains("no hub answers at tcp/127.0.0.1:9"), "{text}");
}

#[test]
fn wrong_arguments_are_refused() {
    let folder = folder();
    let assert = agent(folder.path(), "good.rnx", &["--speed", "fast"]).code(2);
    let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    assert!(text.contains("speed"), "{text}");
}

/// Runs the agent on arguments of its own.
fn command(folder: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::new(env!("CARGO_BIN_EXE_cofix-agent")).current_dir(folder).args(arguments).assert()
}

#[test]
fn recordings_are_inspected_as_table_and_as_json() {
    let folder = folder();
    let table = command(folder.path(), &["inspect", "good.rnx"]).success();
    let table = String::from_utf8(table.get_output().stdout.clone()).unwrap();
    assert!(table.contains("good.rnx: RINEX observations") && table.contains("G 1C"), "{table}");
    let json = command(folder.path(), &["inspect", "--json", "noise.txt", "good.rnx"]).code(1);
    let output = json.get_output();
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(value[0]["format"], "rinex");
    assert_eq!(value[0]["epochs"], 1);
    assert_eq!(value[0]["constellations"][0]["signals"][0]["cn0_dbhz"]["mean"], 45.0);
    let said = String::from_utf8(output.stderr.clone()).unwrap();
    assert!(said.contains("1 of 2 files cannot be used") && said.contains("noise.txt"), "{said}");
}

#[test]
fn recordings_are_converted() {
    let folder = folder();
    command(folder.path(), &["convert", "good.rnx", "--observations", "out.rnx"]).success();
    let text = std::fs::read_to_string(folder.path().join("out.rnx")).unwrap();
    assert!(text.starts_with("     3.05           OBSERVATION DATA"), "{text}");
    assert!(text.contains("G07  22100000.000 7 116000000.000 7     -1200.000          45.000\n"), "{text}");
    for (arguments, code, said) in [
        (vec!["convert", "good.rnx", "--observations", "good.rnx"], 1, "would be overwritten"),
        (vec!["convert", "good.rnx", "--navigation", "out.nav"], 1, "has no navigation message"),
        (vec!["convert", "good.rnx"], 2, "--observations"),
        (vec!["convert", "header.rnx", "--observations", "out.rnx"], 1, "has no epoch"),
    ] {
        let assert = command(folder.path(), &arguments).code(code);
        let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        assert!(text.contains(said), "expected '{said}' in: {text}");
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("good.rnx")).unwrap(), OBSERVATIONS);
}

#[test]
fn a_source_is_one_of_file_and_live() {
    let folder = folder();
    for (arguments, said) in [
        (vec!["--group", "g", "--phone", "p", "--observations", "tcp://nowhere"], "tcp://HOST:PORT"),
        (
            vec!["--group", "g", "--phone", "p", "--follow", "missing.rnx", "--connect", "tcp/127.0.0.1:9"],
            "missing.rnx",
        ),
    ] {
        let assert = command(folder.path(), &arguments).code(1);
        let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        assert!(text.contains(said), "expected '{said}' in: {text}");
    }
    command(folder.path(), &["--group", "g", "--phone", "p"]).code(2);
    command(folder.path(), &["--group", "g", "--phone", "p", "--follow", "a", "--observations", "b"]).code(2);
}

/// Whatever is wrong with an address, nothing shows its password.
#[test]
fn passwords_are_not_shown() {
    let folder = folder();
    let publish = ["--group", "g", "--phone", "p", "--navigation", "nav.rnx", "--observations"];
    for (arguments, said) in [
        (vec!["good.rnx", "--corrections", "ntrip://me:secret@host"], "there is no mount point"),
        (vec!["good.rnx", "--corrections", "ntrips://me:secret@host/M"], "TLS is not spoken"),
        (vec!["good.rnx", "--corrections", "tcp://me:secret@host"], "tcp://me:…@host"),
        (vec!["good.rnx", "--corrections", "-"], "not come from standard input"),
        (vec!["ntrip://me:secret@host:0/M"], "host or port is none"),
        (vec!["good.rnx", "--corrections", "missing.rnx"], "missing.rnx"),
    ] {
        let assert = command(folder.path(), &[&publish[..], &arguments].concat()).code(1);
        let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        assert!(text.contains(said) && !text.contains("secret"), "expected '{said}' in: {text}");
    }
    let assert = command(folder.path(), &["sourcetable", "host:secret@"]).code(1);
    let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    assert!(text.contains("does not begin with ntrip://") && !text.contains("secret"), "{text}");
    let base = ["good.rnx", "--corrections", "base.rnx", "--base-position", "35.1,136.9,104"];
    let assert = command(folder.path(), &[&publish[..], &base].concat()).code(2);
    let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    assert!(text.contains("metres (ECEF)"), "{text}");
}
