//! Recordings and reference vectors that lie beside the repository, when they are there.

#![allow(dead_code, clippy::unwrap_used)] // not every test uses everything; helpers of tests

use std::path::PathBuf;

/// A file, or `None` (said aloud) when it is not there.
pub fn file(path: &str) -> Option<PathBuf> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared")).join(path);
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
