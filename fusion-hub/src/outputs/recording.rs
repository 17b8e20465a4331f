//! A recording that has its name only when it is whole.

use std::ffi::OsString;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::bail;
use cofix_agent::files::{Named, check_absent};
use cofix_agent::status::Moment;
use cofix_common::recording::INCOMPLETE;

use super::sink::{Fused, Late, Opening, Sink, Written};
use crate::outputs::recorder::{Recorded, Recorder, RecorderConfig, RecorderError};

/// How long an epoch of a live session waits to be written.
const LIVE_AGE: Duration = Duration::from_secs(10);

/// Opens a recording.
///
/// # Errors
/// When the file cannot be created.
pub(super) fn open(opening: &Opening<'_>) -> anyhow::Result<Box<dyn Sink>> {
    let config = RecorderConfig { group: opening.group.to_owned(), phones: opening.phones.to_vec() };
    let mut file = RecordingFile::create(opening.path, opening.overwrite, &config)?;
    if opening.is_live {
        file.keep_live(LIVE_AGE);
    }
    Ok(Box::new(file))
}

/// A recording in progress. It is written as `NAME.partial.rrd` and gets its name when it is whole; a killed hub leaves the partial file, which
/// can be opened. A pipe or a device is written directly.
struct RecordingFile {
    recorder: Recorder,
    path: PathBuf,
    partial: Option<PathBuf>,
    overwrite: bool,
    /// Whether the session cannot be run again.
    is_live: bool,
}

impl RecordingFile {
    /// Creates the file. `overwrite`: an existing file may be replaced.
    ///
    /// # Errors
    /// When a file of that name is there, finished or not, or it cannot be created.
    fn create(path: &Path, overwrite: bool, config: &RecorderConfig) -> anyhow::Result<Self> {
        let partial = path.symlink_metadata().map_or(true, |there| there.is_file()).then(|| partial(path));
        if !overwrite {
            check_absent(&Named::new("the recording", path))?;
            if let Some(partial) = partial.as_deref().filter(|partial| partial.exists()) {
                bail!(
                    "{}: a run that did not come to its end has left this; move it away or remove it, name another file for the \
                     recording, or say --overwrite",
                    partial.display()
                );
            }
        }
        let target = partial.as_deref().unwrap_or(path);
        let recorder = Recorder::to_file(target, config).map_err(|error| named(error, path))?;
        Ok(Self { recorder, path: path.to_owned(), partial, overwrite, is_live: false })
    }

    /// For a live session: data older than `age` are written at every tick, and kept in any case.
    fn keep_live(&mut self, age: Duration) {
        self.recorder.write_after(age);
        self.is_live = true;
    }

    /// Ends the file and gives it its name.
    ///
    /// # Errors
    /// Why it is not whole, or does not have its name, and where it is.
    fn put_in_place(self, table: &str) -> Result<(PathBuf, Recorded), String> {
        let Self { recorder, path, partial, overwrite, is_live } = self;
        let recorded = match recorder.finish(table) {
            Ok(recorded) => recorded,
            Err(error) => {
                let left =
                    partial.as_deref().filter(|partial| is_live || std::fs::remove_file(partial).is_err());
                return Err(failure(&path, left, &error));
            }
        };
        let Some(partial) = &partial else { return Ok((path, recorded)) };
        if !overwrite && path.exists() {
            return Err(format!(
                "{}: this file has come meanwhile; the recording is {}",
                path.display(),
                partial.display()
            ));
        }
        match std::fs::rename(partial, &path) {
            Ok(()) => Ok((path, recorded)),
            Err(error) => Err(format!(
                "{}: cannot be given its name: {error}; the recording is {}",
                path.display(),
                partial.display()
            )),
        }
    }
}

impl Sink for RecordingFile {
    fn epoch(&mut self, fused: &Fused<'_>) -> anyhow::Result<()> {
        Ok(self.recorder.record(fused.epoch, &fused.references())?)
    }

    fn late(&mut self, late: Late<'_>) -> anyhow::Result<()> {
        self.recorder.record_late(&late);
        Ok(())
    }

    fn tick(&mut self, _moment: Moment) -> anyhow::Result<()> {
        Ok(self.recorder.tick()?)
    }

    fn finish(self: Box<Self>, text: &str) -> Result<Option<Written>, String> {
        let (path, recorded) = self.put_in_place(text)?;
        let megabytes = recorded.bytes as f64 * 1e-6;
        let figures = format!("{megabytes:.1} MB, {} epochs", recorded.epochs);
        Ok(Some(Written { title: "Recording", path, figures, skips: recorded.skips }))
    }

    /// The recording of a live session is left under its partial name; that of a replay, which can be repeated, is removed.
    fn give_up(self: Box<Self>, why: &dyn Display) -> String {
        if !self.is_live {
            let text = failure(&self.path, None, why);
            self.remove();
            return text;
        }
        let text = failure(&self.path, self.partial.as_deref(), why);
        // The error is reported already; this only saves the data so far.
        let _ = self.recorder.finish(&format!("{INCOMPLETE}: {why}"));
        text
    }

    fn keep(self: Box<Self>, why: &dyn Display) -> Result<(), String> {
        Err(self.give_up(why))
    }

    fn remove(self: Box<Self>) {
        drop(self.recorder);
        if let Some(partial) = self.partial {
            let _ = std::fs::remove_file(partial);
        }
    }
}

fn failure(path: &Path, partial: Option<&Path>, why: &dyn Display) -> String {
    let place = partial.map_or_else(String::new, |partial| format!("; it is left as {}", partial.display()));
    format!("{}: the recording is incomplete: {why}{place}", path.display())
}

/// Keeps what a hub that was killed has left of a recording, since another hub goes on: `drive.partial.rrd` becomes `drive.partial.1.rrd`.
///
/// # Errors
/// When it cannot be renamed.
pub fn keep_partial(path: &Path, number: u32) -> std::io::Result<()> {
    let left = partial(path);
    if !left.is_file() {
        return Ok(());
    }
    let kept = left.with_extension(format!("{number}.rrd"));
    std::fs::rename(&left, &kept)
}

/// `drive.rrd` → `drive.partial.rrd`, so that Rerun opens it.
fn partial(path: &Path) -> PathBuf {
    let mut name = path.file_stem().map(OsString::from).unwrap_or_default();
    name.push(".partial");
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// The file as the user named it.
fn named(error: RecorderError, path: &Path) -> RecorderError {
    match error {
        RecorderError::Create { source, .. } => RecorderError::Create { path: path.to_owned(), source },
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::names;

    #[test]
    fn a_recording_has_its_name_only_when_it_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.rrd");
        let config = RecorderConfig { group: "g".to_owned(), phones: vec!["a".to_owned()] };
        let create = |overwrite| RecordingFile::create(&path, overwrite, &config).map(Box::new);
        let file = create(false).unwrap();
        assert_eq!(names(folder.path()), ["drive.partial.rrd"]);
        let (place, recorded) = file.put_in_place("table").unwrap();
        assert_eq!((place.as_path(), recorded.bytes), (path.as_path(), path.metadata().unwrap().len()));
        assert_eq!(names(folder.path()), ["drive.rrd"]);
        assert!(create(false).err().unwrap().to_string().contains("there is a file already"));

        let before = std::fs::read(&path).unwrap();
        let said = create(true).unwrap().give_up(&"the disk is full");
        assert!(said.contains("drive.rrd: the recording is incomplete: the disk is full"), "{said}");
        assert_eq!(names(folder.path()), ["drive.rrd"], "a replay can be made again");
        let mut live = create(true).unwrap();
        live.keep_live(Duration::from_secs(10));
        let said = live.give_up(&"the disk is full");
        assert!(said.contains("it is left as") && said.contains("drive.partial.rrd"), "{said}");
        assert_eq!(names(folder.path()), ["drive.partial.rrd", "drive.rrd"]);
        assert_eq!(std::fs::read(&path).unwrap(), before, "the one before is still there");

        std::fs::remove_file(&path).unwrap();
        assert!(create(false).err().unwrap().to_string().contains("did not come to its end"));
        create(true).unwrap().remove();
        assert_eq!(names(folder.path()), Vec::<String>::new());
    }
}
