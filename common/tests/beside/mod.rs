//! Reference data: phone recordings with truth and vectors of other programs. They are not the project's to pass on, so they are not in
//! the repository. Tests that need them are `#[ignore = "needs the reference data"]`; `cargo test --workspace -- --include-ignored` runs
//! them and fails where a file is missing.
//!
//! The data lie in the folder `shared` beside the repository, or where `COFIX_REFERENCE_DATA` says.

#![allow(dead_code, clippy::unwrap_used, clippy::panic, clippy::indexing_slicing)] // not every test uses everything; helpers of tests

use std::path::PathBuf;

/// A path below the folder of the reference data, whether it exists or not.
pub fn path(below: &str) -> PathBuf {
    let folder = std::env::var_os("COFIX_REFERENCE_DATA")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared")), PathBuf::from);
    folder.join(below)
}

/// A file of the reference data.
pub fn file(below: &str) -> PathBuf {
    let path = path(below);
    assert!(path.is_file(), "{} is missing: this test needs the reference data", path.display());
    path
}

/// A file's bytes.
pub fn required(below: &str) -> Vec<u8> {
    std::fs::read(file(below)).unwrap()
}

/// The challenge table of the Pixel 4, which is kept in parts with a header each.
pub fn pixel4_table() -> Vec<u8> {
    let mut whole = Vec::new();
    for part in 0..18 {
        let bytes = required(&format!("data/gsdc-2020-05-14-mtv1/Pixel4_processed/{part}.csv"));
        let header = if part == 0 { 0 } else { bytes.iter().position(|b| *b == b'\n').unwrap() + 1 };
        whole.extend_from_slice(&bytes[header..]);
    }
    whole
}
