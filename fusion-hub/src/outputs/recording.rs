//! A recording that has its name only when it is whole.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::bail;
use cofix_agent::files::{Named, check_absent};

use crate::recorder::{INCOMPLETE, Recorded, Recorder, RecorderConfig, RecorderError};

/// A recording at work. It is written as `NAME.partial.rrd` and gets its name at the end: what has the name is whole, and what
/// a killed hub leaves can be told from it and opened. A pipe or a device is written directly.
pub(super) struct RecordingFile {
    recorder: Recorder,
    path: PathBuf,
    partial: Option<PathBuf>,
    overwrite: bool,
}

impl RecordingFile {
    /// Creates the file. `overwrite`: one that is there may be replaced.
    ///
    /// # Errors
    /// When a file of that name is there, finished or not, or it cannot be created.
    pub(super) fn create(path: &Path, overwrite: bool, config: &RecorderConfig) -> anyhow::Result<Self> {
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
        Ok(Self { recorder, path: path.to_owned(), partial, overwrite })
    }

    pub(super) fn recorder(&mut self) -> &mut Recorder {
        &mut self.recorder
    }

    /// Ends the file and gives it its name.
    ///
    /// # Errors
    /// Why it is not whole, or has not its name, and where it is.
    pub(super) fn finish(self, table: &str) -> Result<(PathBuf, Recorded), String> {
        let Self { recorder, path, partial, overwrite } = self;
        let incomplete = |why: &dyn std::fmt::Display| failure(&path, partial.as_deref(), why);
        let recorded = recorder.finish(table).map_err(|error| incomplete(&error))?;
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

    /// Ends a file that will not be whole, and leaves it under its other name. Says where and why.
    pub(super) fn keep(self, why: &dyn std::fmt::Display) -> String {
        let text = failure(&self.path, self.partial.as_deref(), why);
        // What is written so far is worth more than a second complaint.
        let _ = self.recorder.finish(&format!("{INCOMPLETE}: {why}"));
        text
    }

    /// Leaves nothing behind.
    pub(super) fn remove(self) {
        drop(self.recorder);
        if let Some(partial) = self.partial {
            let _ = std::fs::remove_file(partial);
        }
    }
}

fn failure(path: &Path, partial: Option<&Path>, why: &dyn std::fmt::Display) -> String {
    let place = partial.map_or_else(String::new, |partial| format!("; it is left as {}", partial.display()));
    format!("{}: the recording is incomplete: {why}{place}", path.display())
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
