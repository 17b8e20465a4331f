use std::path::Path;

use cofix_common::constraint::Constraint;
use cofix_common::formats::rinex::ObservationFile;
use cofix_common::orbit::NavigationFile;

use super::*;
use crate::session::Session;
use crate::testing::names;

fn arguments(scenario: Kind, out: &Path) -> Arguments {
    Arguments { scenario, out: out.to_owned(), seed: 3, duration: 40.0, phones: None, overwrite: false }
}

fn write(arguments: &Arguments) -> anyhow::Result<PathBuf> {
    simulate(arguments, &Stop::default())
}

#[test]
fn a_sample_is_the_same_byte_for_byte_and_another_seed_another() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str, seed| Arguments { seed, ..arguments(Kind::Canyon, &folder.path().join(name)) };
    for (name, seed) in [("a/b", 3), ("c", 3), ("d", 4)] {
        assert_eq!(write(&at(name, seed)).unwrap(), folder.path().join(name).join("session.toml"));
    }
    let files = names(&folder.path().join("c"));
    assert_eq!(files.len(), 6 * 2 + 2, "{files:?}");
    for file in files {
        let text = |name: &str| std::fs::read(folder.path().join(name).join(&file)).unwrap();
        assert_eq!(text("a/b"), text("c"), "{file}");
        // The truth does not depend on the seed.
        assert!(text("c") != text("d") || file.ends_with(".truth.csv"), "{file}");
    }
}

#[test]
fn what_is_written_reads_back_to_the_digits_of_rinex() {
    for kind in Kind::ALL {
        let folder = tempfile::tempdir().unwrap();
        let arguments = arguments(kind, folder.path());
        let session = Session::read(&write(&arguments).unwrap(), None).unwrap();
        let simulation = Simulation::new(arguments.scenario()).unwrap();
        assert_eq!(session.phone_names(), simulation.phone_names());
        let constraints: Vec<Constraint> = session.constraints.iter().map(|c| c.constraint).collect();
        let expected =
            [simulation.distance_constraints(), simulation.vertical_velocity_constraints()].concat();
        assert_eq!(constraints, expected, "{kind:?}");
        for (index, phone) in session.phones.iter().enumerate() {
            let bytes = std::fs::read(phone.observations.as_ref().unwrap()).unwrap();
            let file = ObservationFile::parse(&bytes).unwrap();
            assert!(file.skips.is_empty(), "{}", file.skips);
            let epochs: Vec<_> = simulation.epochs(index).map(|simulated| simulated.epoch).collect();
            assert_eq!(file.epochs.len(), epochs.len());
            for (read, epoch) in file.epochs.iter().zip(&epochs) {
                assert_eq!(read.time_gps, epoch.time_gps);
                assert_eq!(read.observations.len(), epoch.observations.len());
                for o in &epoch.observations {
                    let same =
                        read.observations.iter().find(|r| (r.satellite, r.signal) == (o.satellite, o.signal));
                    let same = same.unwrap();
                    let pairs = [
                        (same.pseudorange_m, o.pseudorange_m),
                        (same.doppler_hz, o.doppler_hz),
                        (same.cn0_dbhz, o.cn0_dbhz),
                    ];
                    for (read, written) in pairs {
                        assert!((read.unwrap() - written.unwrap()).abs() < 5.1e-4, "{same:?} {o:?}");
                    }
                }
            }
        }
        let bytes = std::fs::read(folder.path().join("navigation.rnx")).unwrap();
        let navigation = NavigationFile::parse(&bytes).unwrap();
        assert_eq!(navigation.ephemerides.len(), simulation.ephemerides().len());
        assert_eq!(navigation.ionosphere, simulation.navigation().ionosphere);
        // The reader has its own order.
        let mut read = navigation.ephemerides.clone();
        read.sort_by_key(|ephemeris| (ephemeris.satellite, ephemeris.toe));
        let mut told = simulation.ephemerides().to_vec();
        told.sort_by_key(|ephemeris| (ephemeris.satellite, ephemeris.toe));
        for (read, told) in read.iter().zip(&told) {
            assert_eq!((read.satellite, read.toe, read.message), (told.satellite, told.toe, told.message));
            for after_s in [0.0, 1_800.0, 3_600.0] {
                let (a, b) = (read.state(told.toe + after_s), told.state(told.toe + after_s));
                let apart_m = a.position.distance_m(b.position);
                assert!(apart_m < 1e-3, "{}: {apart_m} m", told.satellite);
                assert!((a.clock_s - b.clock_s).abs() < 1e-14, "{}", told.satellite);
            }
        }
    }
}

#[test]
fn files_that_are_there_are_kept_unless_they_may_be_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("sample");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("SIM2.rnx"), "mine").unwrap();
    let arguments = arguments(Kind::Convoy, &out);
    let error = write(&arguments).unwrap_err().to_string();
    assert!(
        error.contains("SIM2.rnx: there is a file already; ") && error.contains("--overwrite"),
        "{error}"
    );
    assert_eq!(names(&out), ["SIM2.rnx"]);
    assert_eq!(std::fs::read(out.join("SIM2.rnx")).unwrap(), b"mine");
    let overwriting = Arguments { overwrite: true, ..arguments.clone() };
    write(&overwriting).unwrap();
    assert!(std::fs::read(out.join("SIM2.rnx")).unwrap().len() > 1_000);
    let error = write(&arguments).unwrap_err().to_string();
    assert!(error.contains("(and 7 more of the sample's names)"), "{error}");
    assert_eq!(names(&out).len(), 8);
}

#[test]
fn nothing_is_left_of_a_sample_that_does_not_become_complete() {
    let folder = tempfile::tempdir().unwrap();
    let stop = Stop::default();
    stop.request();
    let out = folder.path().join("deep/er/sample");
    let error = simulate(&arguments(Kind::Car, &out), &stop).unwrap_err().to_string();
    assert!(error.contains("nothing was written"), "{error}");
    assert!(names(folder.path()).is_empty(), "{:?}", names(folder.path()));
    // A folder where a file should be.
    std::fs::create_dir_all(out.join("session.toml")).unwrap();
    let overwriting = Arguments { overwrite: true, ..arguments(Kind::Car, &out) };
    let error = write(&overwriting).unwrap_err().to_string();
    assert!(error.contains("session.toml: a folder is where a file"), "{error}");
    assert_eq!(names(&out), ["session.toml"]);
    // A file where the folder should be.
    std::fs::write(folder.path().join("file"), "").unwrap();
    let error = write(&arguments(Kind::Car, &folder.path().join("file/sample"))).unwrap_err().to_string();
    assert!(error.contains("file/sample: the folder cannot be made"), "{error}");
}

#[test]
fn a_write_that_fails_midway_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("new");
    let mut files = Folder::open(&out, &[], false).unwrap();
    files.write("first", |put| put("complete")).unwrap();
    let error = files
        .write("second", |put| put("half").and_then(|()| Err(std::io::Error::other("disk full"))))
        .unwrap_err();
    assert!(format!("{error:#}").contains("second: cannot be written: disk full"), "{error:#}");
    assert!(!names(&out).is_empty());
    drop(files);
    assert!(!out.exists());
}

#[test]
fn durations_are_told_their_limits() {
    assert_eq!(duration("600"), Ok(600.0));
    for wrong in ["29", "86401", "NaN", "inf", "an hour"] {
        assert!(duration(wrong).unwrap_err().contains("from 30 to 86400"), "{wrong}");
    }
}
