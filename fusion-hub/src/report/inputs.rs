//! The files that a session reads, each with its digest.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::Context;
use cofix_agent::files::Named;
use serde::Serialize;
use sha2::{Digest, Sha256};

/// Bytes that are read at a time.
const PORTION: usize = 1 << 16;

/// A file that was read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct InputFile {
    /// Its purpose.
    pub what: String,
    /// Its path as the session file has it.
    pub path: String,
    /// Its size.
    pub bytes: u64,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
}

impl InputFile {
    /// Reads a file to its end. Paths in `folder` are given relative to it.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn read(file: &Named, folder: &Path) -> anyhow::Result<Self> {
        let (bytes, sha256) = digest(&file.path)
            .with_context(|| format!("{}: cannot read {}", file.path.display(), file.what))?;
        let path = file.path.strip_prefix(folder).unwrap_or(&file.path).to_string_lossy().into_owned();
        Ok(Self { what: file.what.clone(), path, bytes, sha256 })
    }
}

fn digest(path: &Path) -> std::io::Result<(u64, String)> {
    let (mut file, mut hash, mut length) = (File::open(path)?, Sha256::new(), 0);
    let mut portion = vec![0; PORTION];
    loop {
        let read = file.read(&mut portion)?;
        let Some(bytes) = portion.get(..read).filter(|bytes| !bytes.is_empty()) else { break };
        hash.update(bytes);
        length += read as u64;
    }
    Ok((length, format!("{:x}", hash.finalize())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digests_are_those_of_sha_256_and_paths_as_the_session_has_them() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.txt");
        std::fs::write(&file, "abc").unwrap();
        let named = Named::new("the observations of a", &file);
        let input = InputFile::read(&named, folder.path()).unwrap();
        // FIPS 180-2, appendix B.1.
        assert_eq!(input.sha256, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
        assert_eq!((input.bytes, input.path), (3, "a.txt".to_owned()));
        let error = InputFile::read(&Named::new("a product", &folder.path().join("no")), folder.path());
        assert!(error.unwrap_err().to_string().contains("cannot read a product"));
    }
}
