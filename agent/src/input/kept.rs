//! A live source whose bytes are kept in files as they come, so that the same recording can be read again.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::PathBuf;

use cofix_common::skips::Skips;

use super::{Bytes, Portion};
use crate::Stop;
use crate::files::numbered;

/// Where raw input is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawFiles {
    /// Folder and beginning of the files' names: `STEM.1.raw`, and another for every file that the source begins anew.
    pub stem: PathBuf,
    /// Largest size of all together, bytes; what comes after is not kept.
    pub limit_bytes: u64,
}

/// A source whose bytes are kept.
pub(crate) struct Kept {
    source: Box<dyn Bytes>,
    files: RawFiles,
    number: u64,
    /// `None` before the first byte of a file, and after the end of keeping.
    file: Option<File>,
    left_bytes: u64,
    ended: bool,
}

impl Kept {
    pub(crate) fn new(source: Box<dyn Bytes>, files: RawFiles) -> Self {
        let left_bytes = files.limit_bytes;
        Self { source, files, number: 0, file: None, left_bytes, ended: false }
    }

    fn keep(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        let length = bytes.len() as u64;
        self.left_bytes = self.left_bytes.checked_sub(length).ok_or_else(|| {
            std::io::Error::other(format!("{} bytes are kept, the limit", self.files.limit_bytes))
        })?;
        if self.file.is_none() {
            self.number += 1;
            let path = numbered(&self.files.stem, self.number, "raw");
            path.parent().map_or(Ok(()), std::fs::create_dir_all)?;
            self.file = Some(OpenOptions::new().write(true).create_new(true).open(path)?);
        }
        self.file.as_mut().map_or(Ok(()), |file| file.write_all(bytes))
    }
}

impl Bytes for Kept {
    fn next(&mut self, buffer: &mut Vec<u8>, stop: &Stop) -> std::io::Result<Portion> {
        let portion = self.source.next(buffer, stop)?;
        if portion == Portion::Restarted {
            self.file = None;
        }
        if portion == Portion::Bytes
            && !self.ended
            && let Err(error) = self.keep(buffer)
        {
            tracing::error!("{}: raw input is kept no longer: {error}", self.files.stem.display());
            (self.file, self.ended) = (None, true);
        }
        Ok(portion)
    }

    fn failure_reason(&self) -> Option<&str> {
        self.source.failure_reason()
    }

    fn rejected(&mut self, reason: &str) -> bool {
        self.source.rejected(reason)
    }

    fn skips(&self) -> Option<&Skips> {
        self.source.skips()
    }
}

#[cfg(test)]
mod tests {
    use cofix_common::skips::Reason;

    use super::*;

    /// Gives these portions.
    struct Given(Vec<(Portion, &'static str)>);

    impl Bytes for Given {
        fn next(&mut self, buffer: &mut Vec<u8>, _stop: &Stop) -> std::io::Result<Portion> {
            let (portion, text) = if self.0.is_empty() { (Portion::End, "") } else { self.0.remove(0) };
            *buffer = text.as_bytes().to_vec();
            Ok(portion)
        }
    }

    /// A port on which a sender of garbage is closed and counted.
    #[derive(Default)]
    struct Port(Skips);

    impl Bytes for Port {
        fn next(&mut self, _buffer: &mut Vec<u8>, _stop: &Stop) -> std::io::Result<Portion> {
            Ok(Portion::End)
        }

        fn rejected(&mut self, reason: &str) -> bool {
            self.0.add(Reason::SenderOfNoObservations, || reason.to_owned());
            true
        }

        fn skips(&self) -> Option<&Skips> {
            Some(&self.0)
        }
    }

    #[test]
    fn a_source_that_is_kept_goes_on_with_another_sender_and_counts() {
        let files = RawFiles { stem: PathBuf::from("none"), limit_bytes: 30 };
        let mut kept = Kept::new(Box::new(Port::default()), files);
        assert!(kept.rejected("no format"));
        assert_eq!(kept.skips().unwrap().count(Reason::SenderOfNoObservations), 1);
    }

    #[test]
    fn bytes_are_kept_as_they_come() {
        let folder = tempfile::tempdir().unwrap();
        let portions = vec![
            (Portion::Bytes, "head\n"),
            (Portion::Bytes, "one\n"),
            (Portion::Broken, ""),
            (Portion::Bytes, "two\n"),
            (Portion::Restarted, ""),
            (Portion::Bytes, "head again\n"),
            (Portion::Bytes, "too much"),
            (Portion::Bytes, "x"),
        ];
        let files = RawFiles { stem: folder.path().join("spool/pixel-run"), limit_bytes: 30 };
        let mut kept = Kept::new(Box::new(Given(portions.clone())), files);
        let (mut buffer, mut passed) = (Vec::new(), Vec::new());
        loop {
            match kept.next(&mut buffer, &Stop::default()).unwrap() {
                Portion::End => break,
                portion => passed.push((portion, String::from_utf8(buffer.clone()).unwrap())),
            }
        }
        let expected: Vec<_> =
            portions.into_iter().map(|(portion, text)| (portion, text.to_owned())).collect();
        assert_eq!(passed, expected);
        let read = |name: &str| std::fs::read_to_string(folder.path().join("spool").join(name)).unwrap();
        assert_eq!(read("pixel-run.1.raw"), "head\none\ntwo\n");
        assert_eq!(read("pixel-run.2.raw"), "head again\n");
    }
}
