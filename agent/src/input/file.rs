//! A recorded file, plain or compressed.

use std::fs::File;
use std::io::{self, Read, Seek};
use std::path::Path;

use cofix_common::formats::packing::Packing;

use super::{Bytes, PORTION_BYTES, Portion};
use crate::Stop;

/// A file from its beginning to its end, in portions: it need not fit into memory.
pub struct Recorded {
    reader: Box<dyn Read + Send>,
    taken: u64,
    packing: Option<Packing>,
    failure_reason: Option<String>,
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
        let packing = Packing::of(magic.get(..read).unwrap_or_default());
        let reader: Box<dyn Read + Send> = match packing {
            Some(packing) => packing.expand(file),
            None => Box::new(file),
        };
        Ok(Self { reader, taken: 0, packing, failure_reason: None })
    }

    /// A damaged archive is used as far as it goes.
    fn damaged(&mut self, packing: Packing, error: &io::Error) -> Portion {
        let taken = self.taken;
        self.failure_reason =
            Some(format!("{packing} data is damaged or cut off after {taken} expanded bytes ({error})"));
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
                Err(error) => {
                    return self.packing.map(|packing| self.damaged(packing, &error)).ok_or(error);
                }
            }
        }
    }

    fn failure_reason(&self) -> Option<&str> {
        self.failure_reason.as_deref()
    }
}
