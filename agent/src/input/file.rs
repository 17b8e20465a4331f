//! A recorded file, plain or gzip-compressed.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek};
use std::path::Path;

use flate2::read::MultiGzDecoder;

use super::{Bytes, PORTION_BYTES, Portion};
use crate::Stop;

/// A file from its beginning to its end, in portions: it need not fit into memory.
pub struct Recorded {
    reader: Box<dyn Read + Send>,
    taken: u64,
    gzip: bool,
    last_words: Option<String>,
}

impl Recorded {
    /// Opens a file; the first bytes decide whether it is compressed.
    ///
    /// # Errors
    /// When it cannot be opened or read.
    pub fn open(path: &Path) -> io::Result<Self> {
        let mut file = File::open(path)?;
        let mut magic = [0_u8; 2];
        let read = file.read(&mut magic)?;
        file.rewind()?;
        let gzip = read == magic.len() && magic == [0x1f, 0x8b];
        let reader: Box<dyn Read + Send> =
            if gzip { Box::new(MultiGzDecoder::new(BufReader::new(file))) } else { Box::new(file) };
        Ok(Self { reader, taken: 0, gzip, last_words: None })
    }

    /// A damaged archive is used as far as it goes.
    fn damaged(&mut self, error: &io::Error) -> Portion {
        let taken = self.taken;
        self.last_words =
            Some(format!("gzip data is damaged or cut off after {taken} expanded bytes ({error})"));
        Portion::Lost
    }
}

impl Bytes for Recorded {
    fn next(&mut self, buffer: &mut Vec<u8>, stop: &Stop) -> io::Result<Portion> {
        buffer.resize(PORTION_BYTES, 0);
        loop {
            if stop.is_requested() {
                return Ok(Portion::End);
            }
            match self.reader.read(buffer) {
                Ok(0) => return Ok(Portion::End),
                Ok(count) => {
                    buffer.truncate(count);
                    self.taken += count as u64;
                    return Ok(Portion::Bytes);
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if self.gzip => return Ok(self.damaged(&error)),
                Err(error) => return Err(error),
            }
        }
    }

    fn last_words(&self) -> Option<&str> {
        self.last_words.as_deref()
    }
}
