//! A file that is being written.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::{Bytes, LOOK, PORTION_BYTES, Portion};
use crate::Stop;

/// A growing file, from its beginning on, until a stop is requested. One that becomes shorter was written anew and is read
/// from its new beginning.
pub struct Followed {
    path: PathBuf,
    file: File,
    at: u64,
}

impl Followed {
    /// Opens the file, which must exist.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(path: &Path) -> io::Result<Self> {
        Ok(Self { path: path.to_owned(), file: File::open(path)?, at: 0 })
    }

    /// Whether the file is shorter than what was read of it; if so, goes back to its beginning. A file that was replaced by
    /// another of the same name is opened anew.
    fn was_rewritten(&mut self) -> io::Result<bool> {
        // Between removing and writing anew there may be no file for a moment.
        let Ok(named) = std::fs::metadata(&self.path) else { return Ok(false) };
        if named.len() >= self.at {
            return Ok(false);
        }
        self.file = File::open(&self.path)?;
        self.at = self.file.seek(SeekFrom::Start(0))?;
        Ok(true)
    }
}

impl Bytes for Followed {
    fn next(&mut self, buffer: &mut Vec<u8>, stop: &Stop) -> io::Result<Portion> {
        buffer.resize(PORTION_BYTES, 0);
        loop {
            if stop.is_requested() {
                return Ok(Portion::End);
            }
            match self.file.read(buffer) {
                Ok(0) if self.was_rewritten()? => {
                    tracing::warn!("{} became shorter; reading it from its beginning", self.path.display());
                    return Ok(Portion::Broken);
                }
                Ok(0) => {
                    stop.sleep(LOOK);
                }
                Ok(count) => {
                    buffer.truncate(count);
                    self.at += count as u64;
                    return Ok(Portion::Bytes);
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }
}
