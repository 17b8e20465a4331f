//! What the agent says, and with which exit code, when it cannot work.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod limits;
mod recordings;

use std::path::Path;

use assert_cmd::Command;

use recordings::{ONE_SATELLITE_HEADER, one_satellite_epoch};

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

/// The agent's standard error, after checking that it failed with exit code 1 and one error.
fn failure(folder: &Path, observations: &str, products: &[&str]) -> String {
    let assert = agent(folder, observations, products).code(1);
    let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    assert_eq!(text.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{text}");
    assert!(!text.contains("panicked"), "{text}");
    text
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("good.rnx"),
        format!("{ONE_SATELLITE_HEADER}{}", one_satellite_epoch(2)),
    )
    .unwrap();
    std::fs::write(folder.path().join("nav.rnx"), NAVIGATION).unwrap();
    let header: String = NAVIGATION.split_inclusive('\n').take(2).collect();
    std::fs::write(folder.path().join("no.nav"), header).unwrap();
    let cut: String = ONE_SATELLITE_HEADER.split_inclusive('\n').take(2).collect();
    std::fs::write(folder.path().join("cut.rnx"), cut).unwrap();
    std::fs::write(folder.path().join("header.rnx"), ONE_SATELLITE_HEADER).unwrap();
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
    std::fs::write(
        folder.path().join("good.rnx.Z"),
        compress(format!("{ONE_SATELLITE_HEADER}{}", one_satellite_epoch(2)).as_bytes()),
    )
    .unwrap();
    let report = |name: &str| {
        let output = command(folder.path(), &["inspect", name]).success().get_output().stdout.clone();
        String::from_utf8(output).unwrap().replace(name, "")
    };
    assert_eq!(report("good.rnx.Z"), report("good.rnx"));
}

#[test]
fn recordings_are_converted() {
    let folder = folder();
    command(folder.path(), &["convert", "good.rnx", "--output-observations", "out.rnx"]).success();
    let text = std::fs::read_to_string(folder.path().join("out.rnx")).unwrap();
    assert!(text.starts_with("     3.05           OBSERVATION DATA"), "{text}");
    assert!(text.contains("G07  22100000.000 7 116000000.000 7     -1200.000          45.000\n"), "{text}");
}

/// What is refused or fails leaves every file as it was, and no new one.
#[test]
fn conversions_that_fail_destroy_nothing_and_leave_nothing_behind() {
    let folder = folder();
    let empty = format!("{ONE_SATELLITE_HEADER}> 2020 08 13 14 19  2.00000x0  0  1\n");
    std::fs::write(folder.path().join("empty.rnx"), empty).unwrap();
    std::fs::write(folder.path().join("precious"), "precious").unwrap();
    let before = contents(folder.path());
    for (arguments, code, said) in [
        (vec!["good.rnx", "--output-observations", "good.rnx"], 1, "would overwrite a file that is read"),
        (vec!["good.rnx", "--output-observations", "./good.rnx", "--overwrite"], 1, "would overwrite a file"),
        (vec!["good.rnx", "nav.rnx", "--output-navigation", "nav.rnx", "--overwrite"], 1, "would overwrite"),
        (vec!["good.rnx", "--output-observations", "precious"], 1, "there is a file already"),
        (vec!["nav.rnx", "--output-navigation", "precious"], 1, "--overwrite"),
        (
            vec!["good.rnx", "nav.rnx", "--output-observations", "a", "--output-navigation", "a"],
            1,
            "the navigation file would overwrite the observation file",
        ),
        (vec!["good.rnx", "--navigation", "precious"], 2, "--output-navigation"),
        (vec!["good.rnx", "--observations", "precious"], 2, "--output-observations"),
        (vec!["good.rnx"], 2, "--output-observations"),
        (
            vec!["good.rnx", "--output-observations", "no/out.rnx"],
            1,
            "cannot write the observation file: No such",
        ),
        (vec!["good.rnx", "--output-navigation", "out.nav"], 1, "have no navigation message"),
        (
            vec!["good.rnx", "--output-observations", "a", "--output-navigation", "b"],
            1,
            "have no navigation message",
        ),
        (vec!["nav.rnx", "--output-observations", "out.rnx"], 1, "have no epoch"),
        (
            vec!["header.rnx", "--output-observations", "out.rnx"],
            1,
            "header.rnx: not usable as observation file: it holds no epoch",
        ),
        (
            vec!["good.rnx", "empty.rnx", "--output-observations", "precious", "--overwrite"],
            1,
            "it holds no epoch; skipped: 1 ×",
        ),
        (vec!["good.rnx", "noise.txt", "--output-observations", "precious", "--overwrite"], 1, "noise.txt"),
    ] {
        let assert = command(folder.path(), &[&["convert"], &arguments[..]].concat()).code(code);
        let text = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
        assert!(text.contains(said), "expected '{said}' in: {text}");
        assert_eq!(contents(folder.path()), before, "{arguments:?}");
    }
    command(folder.path(), &["convert", "good.rnx", "--output-observations", "precious", "--overwrite"])
        .success();
    assert!(contents(folder.path())["precious"].contains("OBSERVATION DATA"));
}

/// All files of a folder with what they hold.
fn contents(folder: &Path) -> std::collections::BTreeMap<String, String> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let read = |path: std::path::PathBuf| {
        let text = String::from_utf8_lossy(&std::fs::read(&path).unwrap()).into_owned();
        (path.file_name().unwrap().to_str().unwrap().to_owned(), text)
    };
    entries.map(read).collect()
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
        &["convert", "a.20g", "good.rnx", "--output-navigation", "out.nav", "--output-observations", "o.rnx"],
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
            vec![
                "--group",
                "g",
                "--phone",
                "p",
                "--follow",
                "missing.rnx",
                "--connect",
                "tcp/127.0.0.1:9",
                "--patience",
                "1",
            ],
            "missing.rnx is not there yet; waiting for it",
        ),
        (
            vec!["--group", "g", "--phone", "p", "--follow", ".", "--connect", "tcp/127.0.0.1:9"],
            "it is a folder",
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

/// What a command says on the standard error.
fn said(assert: &assert_cmd::assert::Assert) -> String {
    String::from_utf8(assert.get_output().stderr.clone()).unwrap()
}

/// A file without one epoch, or a navigation file without one message, is shown, and fails with what was skipped.
#[test]
fn inspecting_nothing_fails() {
    let folder = folder();
    let bad_epoch = format!("{ONE_SATELLITE_HEADER}> 2020 08 13 14 19  2.00000x0  0  1\n");
    let log = "# Header Description:\n# Raw,a,b\nRaw,1\n";
    let table = TABLE.split_inclusive('\n').next().unwrap();
    for (name, text, what) in [
        ("epochs.rnx", bad_epoch.as_str(), "it holds no epoch; skipped: "),
        ("header.rnx", ONE_SATELLITE_HEADER, "it holds no epoch"),
        ("log.txt", log, "it holds no epoch; skipped: "),
        ("only-names.csv", table, "it holds no epoch"),
        ("no.nav", &NAVIGATION.split_inclusive('\n').take(2).collect::<String>(), "it holds no message"),
    ] {
        std::fs::write(folder.path().join(name), text).unwrap();
        let assert = command(folder.path(), &["inspect", name]).code(1);
        let text = said(&assert);
        assert!(text.contains(&format!("error: {name}: not usable as ")) && text.contains(what), "{text}");
        let shown = String::from_utf8(assert.get_output().stdout.clone()).unwrap();
        assert!(shown.starts_with(name), "{shown}");
    }
    let assert = command(folder.path(), &["inspect", "header.rnx", "good.rnx"]).code(1);
    assert!(said(&assert).contains("error: 1 of 2 files cannot be used"));
}

#[test]
fn an_agent_without_an_epoch_fails() {
    let folder = folder();
    let text = failure(folder.path(), "header.rnx", &["--navigation", "nav.rnx"]);
    assert!(text.contains("it holds no epoch"), "{text}");
}

#[test]
fn files_in_the_wrong_place_are_told_where_they_go() {
    let folder = folder();
    let line = |version: &str, kind: &str, label: &str| format!("{version:<20}{kind:<40}{label}\n");
    for (name, text) in [
        ("a.sp3", "#aP2025  1  1  0  0  0.00000000\n".to_owned()),
        ("a.bia", "%=BIA 1.00 COD 2020:001:00000\n".to_owned()),
        ("a.clk", line("     3.00", "CLOCK DATA", "RINEX VERSION / TYPE")),
        ("a.20i", line("     1.0", "IONOSPHERE MAPS     GNSS", "IONEX VERSION / TYPE")),
        ("truth.csv", "gps_week,gps_tow_s,latitude_deg,longitude_deg\n".to_owned()),
    ] {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let packed = std::fs::File::create(folder.path().join("a.clk.gz")).unwrap();
    let mut packed = flate2::write::GzEncoder::new(packed, flate2::Compression::fast());
    std::io::Write::write_all(&mut packed, line("3.00", "CLOCK DATA", "RINEX VERSION / TYPE").as_bytes())
        .unwrap();
    packed.finish().unwrap();
    for (arguments, told) in [
        (vec!["inspect", "a.sp3"], "--sp3"),
        (vec!["inspect", "a.bia"], "--bias"),
        (vec!["inspect", "a.clk"], "--clock"),
        (vec!["inspect", "a.clk.gz"], "--clock"),
        (vec!["inspect", "a.20i"], "--ionex"),
        (vec!["inspect", "truth.csv"], "truth of [[phone]]"),
        (vec!["inspect", "good.rnx", "--sp3", "nav.rnx"], "--navigation"),
        (vec!["inspect", "good.rnx", "--sp3", "a.20i"], "--ionex"),
        (vec!["inspect", "good.rnx", "--clock", "a.bia"], "--bias"),
        (vec!["inspect", "good.rnx", "--bias", "a.clk.gz"], "--clock"),
        (vec!["inspect", "good.rnx", "--ionex", "good.rnx"], "--observations"),
        (vec!["inspect", "good.rnx", "--navigation", "a.sp3"], "--sp3"),
        (vec!["inspect", "good.rnx", "--navigation", "table.csv"], "--observations"),
        (vec!["convert", "a.clk", "--output-observations", "new"], "--clock"),
        (vec!["--group", "g", "--phone", "p", "--observations", "nav.rnx"], "--navigation"),
    ] {
        let assert = command(folder.path(), &arguments).code(1);
        let text = said(&assert);
        assert!(text.contains("this looks like") && text.contains(told), "expected '{told}' in: {text}");
    }
}

#[test]
fn masks_by_name_are_counted_and_one_that_names_nothing_is_said() {
    let folder = folder();
    let assert =
        command(folder.path(), &["inspect", "good.rnx", "--exclude", "G07,E", "--exclude", "5X"]).success();
    let table = String::from_utf8(assert.get_output().stdout.clone()).unwrap();
    for line in [
        "exclude G07: 1 observations\n",
        "exclude E: 0 observations, it names nothing that occurs",
        "exclude 5X: 0 observations, it names nothing that occurs",
    ] {
        assert!(table.contains(line), "expected '{line}' in: {table}");
    }
    let assert = command(folder.path(), &["inspect", "good.rnx", "--exclude", "Galileo"]).code(2);
    assert!(said(&assert).contains("'Galileo' names nothing to exclude"), "{}", said(&assert));
}

#[test]
fn settings_of_a_file_act_and_wrong_ones_are_named_by_line() {
    let folder = folder();
    let at = |text: &str| std::fs::write(folder.path().join("settings.toml"), text).unwrap();
    let inspected = || {
        let arguments = ["inspect", "good.rnx", "--json", "--settings", "settings.toml"];
        let assert = command(folder.path(), &arguments).success();
        String::from_utf8(assert.get_output().stdout.clone()).unwrap()
    };
    at("[masks]\ncn0_dbhz = 15.0\n");
    let usual = inspected();
    at("[masks]\ncn0_dbhz = 60.0\n");
    assert!(inspected() != usual, "{usual}");
    for (text, expected) in [
        (
            "[filter]\n\nrate_sigma_scale = 0\n",
            "settings.toml: line 3: [filter] rate_sigma_scale is 0.0; it must lie within 0.01 to 100",
        ),
        ("[filter]\ncode_scale = 1\n", "settings.toml: TOML parse error at line 2, column 1"),
    ] {
        at(text);
        for arguments in [
            &["inspect", "good.rnx", "--settings", "settings.toml"][..],
            &["--group", "g", "--phone", "p", "--observations", "good.rnx", "--settings", "settings.toml"],
        ] {
            let text = said(&command(folder.path(), arguments).code(1));
            assert!(text.contains(expected), "expected '{expected}' in: {text}");
        }
    }
}

#[test]
fn version_and_verbosity() {
    let folder = folder();
    let version = command(folder.path(), &["--version"]).success().get_output().stdout.clone();
    let version = String::from_utf8(version).unwrap();
    assert_eq!(version, format!("cofix-agent {}\n", cofix_console::VERSION));
    let convert = |more: &[&str]| {
        let arguments =
            [&["convert", "good.rnx", "--output-observations", "new", "--overwrite"], more].concat();
        said(&command(folder.path(), &arguments).success())
    };
    assert_eq!(convert(&[]), "wrote 1 epochs, 0 events and 0 ephemerides\n");
    assert_eq!(convert(&["-q"]), "");
    assert_eq!(convert(&["-v"]), convert(&[]));
    let quiet = command(folder.path(), &["inspect", "missing", "-qqq"]).code(1);
    assert!(said(&quiet).starts_with("error: missing: cannot read the observation file"), "{}", said(&quiet));
}
