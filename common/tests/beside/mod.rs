//! Recordings and reference vectors that lie beside the repository, when they are there.

#![allow(dead_code, clippy::unwrap_used, clippy::panic, clippy::indexing_slicing)] // not every test uses everything; helpers of tests

use std::path::PathBuf;

/// A path below the folder of the reference data, whether it exists or not.
pub fn path(below: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared")).join(below)
}

/// A file, or `None` (said aloud) when it is not there.
pub fn file(path: &str) -> Option<PathBuf> {
    let path = self::path(path);
    if path.is_file() {
        return Some(path);
    }
    println!("skipped: {} is not here", path.display());
    None
}

/// Its bytes.
pub fn shared(path: &str) -> Option<Vec<u8>> {
    file(path).map(|path| std::fs::read(path).unwrap())
}

/// Its bytes, for a test that is `#[ignore]`d because it needs them: without the file it fails.
pub fn required(path: &str) -> Vec<u8> {
    shared(path).unwrap_or_else(|| panic!("{path} is not beside the repository, and this test needs it"))
}

/// The challenge table of the Pixel 4, which is kept in parts with a header each.
pub fn pixel4_table() -> Option<Vec<u8>> {
    let mut whole = Vec::new();
    for part in 0..18 {
        let bytes = shared(&format!("data/gsdc-2020-05-14-mtv1/Pixel4_processed/{part}.csv"))?;
        let header = if part == 0 { 0 } else { bytes.iter().position(|b| *b == b'\n').unwrap() + 1 };
        whole.extend_from_slice(&bytes[header..]);
    }
    Some(whole)
}
