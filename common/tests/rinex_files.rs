//! RINEX files: recordings where they are at hand, small ones written here everywhere.

use std::path::PathBuf;

use cofix_common::rinex::{NavigationFile, ObservationFile};

fn shared(path: &str) -> Option<Vec<u8>> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared")).join(path);
    let bytes = std::fs::read(&path).ok();
    if bytes.is_none() {
        println!("skipped: {} is not here", path.display());
    }
    bytes
}

#[test]
fn recordings_have_all_their_epochs() {
    for (path, epochs) in [
        ("WH-3-08/HP20", 640),
        ("WH-3-08/HP30", 640),
        ("WH-3-08/MXT", 703),
        ("WH-3-08/VX30", 642),
        ("WH-3-08/XIM8", 640),
        ("WH-3-09/HP20", 480),
        ("WH-3-09/HP30", 479),
        ("WH-3-09/MXT", 493),
        ("WH-3-09/VX30", 480),
        ("WH-3-09/XIM8", 479),
        ("WH-4-06/HP20", 488),
        ("WH-4-06/HP30", 489),
        ("WH-4-06/VX30", 485),
        ("WH-4-06/XIM8", 490),
    ] {
        let Some(bytes) = shared(&format!("data/whu-wuhan-2020-08-13/{path}.rnx")) else { return };
        let file = ObservationFile::parse(&bytes).unwrap();
        let observations: usize = file.epochs.iter().map(|e| e.observations.len()).sum();
        println!(
            "{path}: {} epochs, {observations} observations, skipped: {}",
            file.epochs.len(),
            file.skips
        );
        assert_eq!(file.epochs.len(), epochs, "{path}");
    }
}

#[test]
fn navigation_files_are_read() {
    for path in [
        "data/ESBC00DNK_R_20201770000_01D_MN.rnx.gz",
        "oracle/inputs/BRD400DLR_20230710000_as_rnx305_GRECJI.rnx.gz",
        "oracle/inputs/CORD00ARG_R_20240920000_01D_MN.rnx.gz",
        "oracle/inputs/mat_base.nav.gz",
    ] {
        let Some(bytes) = shared(path) else { return };
        let file = NavigationFile::parse(&bytes).unwrap();
        println!("{path}: {} ephemerides, {:?}, {}", file.ephemerides.len(), file.ionosphere, file.skips);
    }
}
