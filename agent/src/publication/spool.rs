//! The epochs of a run on disk, for a hub that is out of reach for longer than they are kept in memory.
//!
//! Files `PHONE-RUN.1.epochs`, `PHONE-RUN.2.epochs` and so on; the oldest goes when all together are larger than the limit. A record is its length
//! (u32), a CRC-32 of what follows (u32), the sequence number (u64), all little endian, and the message as it is published.

use std::collections::VecDeque;
use std::fs::{File, OpenOptions};
use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::files::numbered;

/// Into how many files the limit is divided.
const FILES: u64 = 8;
/// Length, checksum, sequence number.
const HEAD_BYTES: usize = 16;

/// A spool in progress.
#[derive(Debug)]
pub(crate) struct Spool {
    /// Folder and beginning of the files' names.
    stem: PathBuf,
    limit_bytes: u64,
    /// Number of the newest file.
    number: u64,
    files: VecDeque<Part>,
}

/// One file.
#[derive(Debug)]
struct Part {
    path: PathBuf,
    file: File,
    bytes: u64,
    /// Sequence numbers in ascending order, and where their records are.
    places: Vec<(u64, u64)>,
}

impl Spool {
    /// Begins a spool in a folder, which is made if need be.
    pub(crate) fn create(folder: &Path, name: &str, limit_bytes: u64) -> Result<Self> {
        std::fs::create_dir_all(folder)?;
        let mut spool = Self { stem: folder.join(name), limit_bytes, number: 0, files: VecDeque::new() };
        spool.begin_file()?;
        Ok(spool)
    }

    /// Adds an epoch whose number is higher than all before.
    pub(crate) fn append(&mut self, sequence: u64, message: &[u8]) -> Result<()> {
        if self.files.back().is_none_or(|last| last.bytes >= self.limit_bytes / FILES) {
            self.begin_file()?;
        }
        let last = self.files.back_mut().ok_or(ErrorKind::NotFound)?;
        last.append(sequence, message)
    }

    /// The oldest sequence number that is kept.
    pub(crate) fn first(&self) -> Option<u64> {
        self.files.iter().find_map(|part| part.places.first()).map(|(sequence, _)| *sequence)
    }

    /// The epochs from sequence number `from` to before `to`, at most `most`.
    pub(crate) fn read(&self, from: u64, to: u64, most: usize) -> Result<Vec<Vec<u8>>> {
        let places = self.files.iter().flat_map(|part| {
            let start = part.places.partition_point(|(sequence, _)| *sequence < from);
            part.places.iter().skip(start).map(move |place| (part, place))
        });
        let asked = places.take_while(|(_, (sequence, _))| *sequence < to).take(most);
        asked.map(|(part, (sequence, place))| part.read(*sequence, *place)).collect()
    }

    fn begin_file(&mut self) -> Result<()> {
        self.number += 1;
        let path = numbered(&self.stem, self.number, "epochs");
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(&path)?;
        self.files.push_back(Part { path, file, bytes: 0, places: Vec::new() });
        let size = |files: &VecDeque<Part>| files.iter().map(|part| part.bytes).sum::<u64>();
        while self.files.len() > 1 && size(&self.files) + self.limit_bytes / FILES > self.limit_bytes {
            if let Some(oldest) = self.files.pop_front() {
                std::fs::remove_file(oldest.path)?;
            }
        }
        Ok(())
    }
}

impl Part {
    fn append(&mut self, sequence: u64, message: &[u8]) -> Result<()> {
        let length = u32::try_from(message.len()).map_err(Error::other)?;
        let checksum = checksum(sequence, message);
        let head = [&length.to_le_bytes()[..], &checksum.to_le_bytes(), &sequence.to_le_bytes()].concat();
        self.file.seek(SeekFrom::Start(self.bytes))?;
        self.file.write_all(&[&head, message].concat())?;
        self.places.push((sequence, self.bytes));
        self.bytes += (head.len() + message.len()) as u64;
        Ok(())
    }

    fn read(&self, sequence: u64, place: u64) -> Result<Vec<u8>> {
        let mut file = &self.file;
        file.seek(SeekFrom::Start(place))?;
        let mut head = [0; HEAD_BYTES];
        file.read_exact(&mut head)?;
        let number =
            |at: usize| head.get(at..).and_then(<[u8]>::first_chunk).copied().map(u32::from_le_bytes);
        let (length, expected) = number(0).zip(number(4)).ok_or(ErrorKind::UnexpectedEof)?;
        let left = self.bytes.saturating_sub(place + HEAD_BYTES as u64);
        let damaged = || {
            let text = format!("{}: the record of epoch {sequence} is damaged", self.path.display());
            Error::new(ErrorKind::InvalidData, text)
        };
        if u64::from(length) > left {
            return Err(damaged());
        }
        let mut message = vec![0; length as usize];
        file.read_exact(&mut message)?;
        if checksum(sequence, &message) != expected {
            return Err(damaged());
        }
        Ok(message)
    }
}

fn checksum(sequence: u64, message: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&sequence.to_le_bytes());
    hasher.update(message);
    hasher.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(sequence: u64) -> Vec<u8> {
        vec![u8::try_from(sequence % 251).unwrap(); 84]
    }

    fn spool(folder: &Path, limit_bytes: u64, epochs: u64) -> Spool {
        let mut spool = Spool::create(folder, "pixel-run", limit_bytes).unwrap();
        (0..epochs).for_each(|sequence| spool.append(sequence, &message(sequence)).unwrap());
        spool
    }

    #[test]
    fn what_is_spooled_is_read_and_the_oldest_goes_beyond_the_limit() {
        let folder = tempfile::tempdir().unwrap();
        // Ten records a file.
        let spool = spool(folder.path(), 8_000, 1_000);
        let size: u64 =
            std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().metadata().unwrap().len()).sum();
        assert!(size <= 8_000, "{size}");
        assert_eq!(spool.first(), Some(920));
        let read = |from, to, most| spool.read(from, to, most).unwrap();
        assert_eq!(read(935, 945, 100), (935..945).map(message).collect::<Vec<_>>());
        assert_eq!(read(0, 2_000, 3), (920..923).map(message).collect::<Vec<_>>());
        assert!(read(1_000, 2_000, 3).is_empty() && read(945, 935, 9).is_empty());
    }

    #[test]
    fn the_spool_of_another_run_is_not_written_to() {
        let folder = tempfile::tempdir().unwrap();
        let _other = spool(folder.path(), 8_000, 3);
        let refused = Spool::create(folder.path(), "pixel-run", 8_000).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::AlreadyExists);
    }

    #[test]
    fn a_damaged_record_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let spool = spool(folder.path(), 80_000, 3);
        let path = folder.path().join("pixel-run.1.epochs");
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[150] ^= 1;
        std::fs::write(&path, bytes).unwrap();
        assert!(spool.read(0, 1, 9).is_ok());
        let error = spool.read(0, 3, 9).unwrap_err().to_string();
        assert!(error.contains("pixel-run.1.epochs: the record of epoch 1 is damaged"), "{error}");
        std::fs::write(&path, b"").unwrap();
        assert!(spool.read(0, 3, 9).is_err());
    }
}
