//! A file that is being written.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::{Bytes, LOOK, PORTION_BYTES, Portion};
use crate::Stop;

/// Number of bytes before the reading position that are compared to tell whether a file goes on or was replaced.
const REMEMBERED_BYTES: usize = 256;

/// A growing file, from its beginning on, until a stop is requested. A file that does not exist yet is waited for: the agent may be started
/// before the logger.
///
/// Its writer may replace it by a longer file of the same beginning (as `rsync` and `adb pull` do): reading goes on at the same position. A file
/// that becomes shorter, or has other bytes before that position, was rewritten and is read from its new beginning.
pub struct Followed {
    path: PathBuf,
    /// `None`: it has not been there yet.
    file: Option<File>,
    at: u64,
    /// The last bytes before `at`.
    last: Vec<u8>,
    /// Neither a pipe nor a device, which go on whatever happens.
    is_file: bool,
}

/// The result of a look at a file.
enum Look {
    /// It has grown.
    More,
    Nothing,
    /// Not the file that it was.
    Other,
}

impl Followed {
    /// Opens the file, or says that it is waited for.
    ///
    /// # Errors
    /// When it is there and cannot be opened, or is a folder.
    pub fn open(path: &Path) -> io::Result<Self> {
        let mut followed = Self { path: path.to_owned(), file: None, at: 0, last: Vec::new(), is_file: true };
        if !followed.open_first()? {
            tracing::info!("{} is not there yet; waiting for it", path.display());
        }
        Ok(followed)
    }

    /// Opens the file for the first time; `false` when it is not there.
    fn open_first(&mut self) -> io::Result<bool> {
        let file = match File::open(&self.path) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
            Err(error) => return Err(error),
        };
        let metadata = file.metadata()?;
        if metadata.is_dir() {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder; name the file in it"));
        }
        (self.is_file, self.file) = (metadata.is_file(), Some(file));
        Ok(true)
    }

    /// Reads what follows what was read, and checks that this is still there.
    fn look(&mut self, buffer: &mut Vec<u8>) -> io::Result<Look> {
        let Some(file) = &mut self.file else { return Ok(Look::Nothing) };
        let known = self.last.len();
        buffer.resize(known + PORTION_BYTES, 0);
        file.seek(SeekFrom::Start(self.at - known as u64))?;
        let mut count = 0;
        loop {
            match file.read(buffer.get_mut(count..).unwrap_or_default()) {
                Ok(0) => break,
                Ok(more) => count += more,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        buffer.truncate(count);
        if !buffer.starts_with(&self.last) {
            return Ok(Look::Other);
        }
        buffer.drain(..known);
        Ok(if buffer.is_empty() { Look::Nothing } else { Look::More })
    }

    /// The same without a check, and without going anywhere in it.
    fn look_at_device(&mut self, buffer: &mut Vec<u8>) -> io::Result<Look> {
        let Some(file) = &mut self.file else { return Ok(Look::Nothing) };
        buffer.resize(PORTION_BYTES, 0);
        match file.read(buffer) {
            Ok(0) => Ok(Look::Nothing),
            Ok(count) => {
                buffer.truncate(count);
                Ok(Look::More)
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => Ok(Look::Nothing),
            Err(error) => Err(error),
        }
    }

    /// Opens the file that has the name now. Between its removal and its rewriting there may be none for a while.
    fn open_again(&mut self) {
        if let Ok(file) = File::open(&self.path) {
            self.file = Some(file);
        }
    }

    /// Remembers what was read.
    fn pass(&mut self, bytes: &[u8]) {
        self.at += bytes.len() as u64;
        self.last.extend_from_slice(bytes);
        self.last.drain(..self.last.len().saturating_sub(REMEMBERED_BYTES));
    }
}

impl Bytes for Followed {
    fn next(&mut self, buffer: &mut Vec<u8>, stop: &Stop) -> io::Result<Portion> {
        loop {
            if stop.is_requested() {
                return Ok(Portion::End);
            }
            if self.file.is_none() {
                if self.open_first()? {
                    tracing::info!("{} is there now", self.path.display());
                } else {
                    stop.sleep(LOOK);
                    continue;
                }
            }
            let look = if self.is_file { self.look(buffer)? } else { self.look_at_device(buffer)? };
            match look {
                Look::More => {
                    self.pass(buffer);
                    return Ok(Portion::Bytes);
                }
                Look::Nothing => {
                    stop.sleep(LOOK);
                    if self.is_file {
                        self.open_again();
                    }
                }
                Look::Other => {
                    self.open_again();
                    (self.at, self.last) = (0, Vec::new());
                    tracing::warn!("{} was written anew; reading it from its beginning", self.path.display());
                    return Ok(Portion::Restarted);
                }
            }
        }
    }
}
