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
