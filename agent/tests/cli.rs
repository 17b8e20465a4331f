//! What the agent says, and with which exit code, when it cannot work.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod limits;

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
R01 2020 08 13 14 15 00-2.458319067955E-05 0.000000000000E+00 3.960000000000E+05
     1.422012255859E+04-4.938831329346E-01-9.313225746155E-10 0.000000000000E+00
    -2.043351660156E+04 5.933942794800E-01 9.313225746155E-10 1.000000000000E+00
     5.539755371094E+03 3.461606979370E+00 0.000000000000E+00 0.000000000000E+00
";

/// A challenge's table with one satellite.
const TABLE: &str = "millisSinceGpsEpoch,constellationType,svid,signalType,receivedSvTimeInGpsNanos,xSatPosM,ySatPosM,zSatPosM,\
    xSatVelMps,ySatVelMps,zSatVelMps,satClkBiasM,satClkDriftMps,rawPrM,rawPrUncM,isrbM,ionoDelayM,tropoDelayM
1273529463442,1,5,GPS_L1,1273529463365539137,-2179862.557,-26154875.769,-3437694.371,325,-419,3129,-3793,0,23052313.867,4,0,7,5
";

fn agent(folder: &Path, observations: &str, products: &[&str]) -> assert_cmd::assert::Assert {
    Command::new(env!("CARGO_BIN_EXE_cofix-agent"))
        .timeout(limits::LIMIT)
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
    let header: String = NAVIGATION.split_inclusive('\n').take(2).collect();
    std::fs::write(folder.path().join("no.nav"), header).unwrap();
    let cut: String = OBSERVATIONS.split_inclusive('\n').take(2).collect();
    std::fs::write(folder.path().join("cut.rnx"), cut).unwrap();
    let header: String = OBSERVATIONS.split_inclusive('\n').take(3).collect();
    std::fs::write(folder.path().join("header.rnx"), header).unwrap();
    std::fs::write(folder.path().join("noise.bin"), [0x1f, 0x8b, 8, 0, 1, 2, 3]).unwrap();
    std::fs::write(folder.path().join("noise.txt"), "lorem ipsum").unwrap();
    std::fs::write(folder.path().join("table.csv"), TABLE).unwrap();
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
        (vec!["--navigation", "no.nav"], "no orbits"),
        (
            vec!["--navigation", "nav.rnx", "--clock", "missing.clk"],
            "missing.clk: cannot read the RINEX clock file",
        ),
        (
            vec!["--clock", "good.rnx"],
            "good.rnx: not usable as RINEX clock file: not a RINEX clock file of version",
        ),
        (
            vec!["--bias", "nav.rnx"],
            "nav.rnx: not usable as Bias-SINEX file: not a Bias-SINEX file of version",
        ),
        (vec!["--ionex", "noise.bin"], "noise.bin: not usable as IONEX file: gzip data is damaged"),
        (vec!["--sp3", "good.rnx"], "good.rnx: not usable as SP3 file"),
        (vec!["--navigation", "good.rnx"], "good.rnx: not usable as RINEX navigation file"),
    ] {
        let text = failure(folder.path(), "good.rnx", &products);
        assert!(text.contains(said), "expected '{said}' in: {text}");
    }
}

/// The tables of challenges bring their own satellites, if that is wished for.
#[test]
fn recorded_corrections_stand_in_for_products() {
    let folder = folder();
    let text = failure(folder.path(), "table.csv", &[]);
    assert!(text.contains("no orbits") && text.contains("--recorded-corrections"), "{text}");
    let text = failure(folder.path(), "good.rnx", &["--recorded-corrections"]);
    assert!(text.contains("no orbits"), "{text}");
    let text = failure(folder.path(), "table.csv", &["--recorded-corrections", "--ionosphere", "pair"]);
    assert!(text.contains("no hub answers"), "{text}");
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
    let both = ["--recorded-corrections", "--corrections", "good.rnx"];
    let assert = agent(folder.path(), "good.rnx", &both).code(1);
    let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    assert!(text.contains("do not go together"), "{text}");
    let assert = agent(folder.path(), "good.rnx", &["--ionosphere", "none"]).code(2);
    let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    assert!(text.contains("'pair-only'"), "{text}");
}

/// Runs the agent on arguments of its own.
fn command(folder: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::new(env!("CARGO_BIN_EXE_cofix-agent"))
        .current_dir(folder)
        .args(arguments)
        .timeout(limits::LIMIT)
        .assert()
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

/// Packs as `compress` may: nine bits for each byte, and before they become too few, code 256 and the rest of the group of eight.
fn compress(bytes: &[u8]) -> Vec<u8> {
    let mut codes = Vec::new();
    for piece in bytes.chunks(200) {
        codes.extend(piece.iter().map(|byte| u32::from(*byte)));
        codes.push(256);
        codes.resize(codes.len().next_multiple_of(8), 0);
    }
    let bits: Vec<u8> =
        codes.iter().flat_map(|code| (0..9).map(move |k| u8::from(code >> k & 1 == 1))).collect();
    let packed = bits.chunks(8).map(|byte| byte.iter().rev().fold(0, |value, bit| value << 1 | bit));
    [0x1f, 0x9d, 0x90].into_iter().chain(packed).collect()
}

#[test]
fn packed_recordings_are_read_as_plain_ones() {
    let folder = folder();
    std::fs::write(folder.path().join("good.rnx.Z"), compress(OBSERVATIONS.as_bytes())).unwrap();
    let report = |name: &str| {
        let output = command(folder.path(), &["inspect", name]).success().get_output().stdout.clone();
        String::from_utf8(output).unwrap().replace(name, "")
    };
    assert_eq!(report("good.rnx.Z"), report("good.rnx"));
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
        (vec!["convert", "nav.rnx", "--observations", "out.rnx"], 1, "has no epoch"),
        (vec!["convert", "good.rnx"], 2, "--observations"),
        (vec!["convert", "header.rnx", "--observations", "out.rnx"], 1, "has no epoch"),
    ] {
        let assert = command(folder.path(), &arguments).code(code);
        let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        assert!(text.contains(said), "expected '{said}' in: {text}");
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("good.rnx")).unwrap(), OBSERVATIONS);
}

/// A GLONASS file of RINEX 2 becomes one of RINEX 3.05, and observations beside it are converted as ever.
#[test]
fn navigation_files_are_converted() {
    let folder = folder();
    let glonass = "     2.01           G: GLONASS NAV DATA                     RINEX VERSION / TYPE
    18                                                      LEAP SECONDS
                                                            END OF HEADER
 7 20  8 13 14 15  0.0 3.456789627671D-05 9.094947017729D-13 3.132000000000D+05
    1.023456787109D+04-1.234567642212D+00-1.862645149231D-09 0.000000000000D+00
   -1.234567871094D+04 2.345678329468D+00 0.000000000000D+00-4.000000000000D+00
    1.987654345703D+04-9.012346267700D-01 9.313225746155D-10 1.000000000000D+00
";
    std::fs::write(folder.path().join("a.20g"), glonass).unwrap();
    command(
        folder.path(),
        &["convert", "a.20g", "good.rnx", "--navigation", "out.nav", "--observations", "o.rnx"],
    )
    .success();
    let text = std::fs::read_to_string(folder.path().join("out.nav")).unwrap();
    assert!(text.contains("R07 2020 08 13 14 15 00 3.456789627671E-05 9.094947017729E-13"), "{text}");
    assert!(
        text.contains("    -1.234567871094E+04 2.345678329468E+00 0.000000000000E+00-4.000000000000E+00"),
        "{text}"
    );
    assert!(folder.path().join("o.rnx").exists());
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
        (vec!["good.rnx", "--corrections", "ntrips://me:secret@host"], "there is no mount point"),
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
