//! Output files: none of them may be an input, and it is known before a session that they can be written.

use std::ffi::OsString;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use cofix_agent::CorrectionSource;

use crate::session::Session;

/// A file and what it is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// What it is for.
    pub what: String,
    /// The file.
    pub path: PathBuf,
}

impl Named {
    /// A file for something.
    pub fn new(what: &str, path: &Path) -> Self {
        Self { what: what.to_owned(), path: path.to_owned() }
    }
}

/// All files that a session reads, with the session file itself.
pub fn inputs(file: &Path, session: &Session) -> Vec<Named> {
    let mut inputs = vec![Named::new("the session file", file)];
    for path in session.products.iter() {
        inputs.push(Named::new("a product", path));
    }
    for source in &session.settings.corrections.sources {
        if let CorrectionSource::File(path) = source {
            inputs.push(Named::new("a source of corrections", path));
        }
    }
    for phone in &session.phones {
        for (what, path) in [("observations", &phone.observations), ("truth", &phone.truth)] {
            inputs.extend(path.iter().map(|path| Named::new(&format!("the {what} of {}", phone.name), path)));
        }
    }
    inputs
}

/// Whether outputs are files of their own.
///
/// # Errors
/// When an output is another output or an input.
pub fn check_outputs(outputs: &[Named], inputs: &[Named]) -> anyhow::Result<()> {
    for (index, output) in outputs.iter().enumerate() {
        let place = place(&output.path);
        let others = outputs.iter().take(index).chain(inputs);
        if let Some(other) = others.into_iter().find(|other| self::place(&other.path) == place) {
            bail!(
                "{}: {} would overwrite {}; name another file",
                output.path.display(),
                output.what,
                other.what
            );
        }
    }
    Ok(())
}

/// Whether a recording may be created.
///
/// # Errors
/// When a file of that name is there.
pub fn check_absent(path: &Path) -> anyhow::Result<()> {
    if path.is_file() {
        bail!("{}: there is a file already; name another one, or say --overwrite", path.display());
    }
    Ok(())
}

/// One name for one file, as far as links and `..` go.
fn place(path: &Path) -> PathBuf {
    if let Ok(place) = path.canonicalize() {
        return place;
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match (folder.canonicalize(), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path.to_owned(),
    }
}

/// A report that will be written at the end. What was there before stays until then.
#[derive(Debug)]
pub struct ReportFile {
    path: PathBuf,
    /// The file that becomes the report; `None` when it can only be written in place.
    temporary: Option<PathBuf>,
}

impl ReportFile {
    /// Makes sure that the report can be written.
    ///
    /// # Errors
    /// When it cannot.
    pub fn prepare(path: &Path) -> anyhow::Result<Self> {
        let cannot = || format!("{}: cannot write the report", path.display());
        if path.is_dir() {
            bail!("{}: cannot write the report: it is a folder", path.display());
        }
        // A device, a pipe or a link stays what it is.
        let plain = path.symlink_metadata().map_or(true, |metadata| metadata.is_file());
        let temporary = beside(path).filter(|_| plain);
        if let Some(temporary) = temporary.filter(|temporary| File::create(temporary).is_ok()) {
            return Ok(Self { path: path.to_owned(), temporary: Some(temporary) });
        }
        File::options().append(true).create(true).open(path).with_context(cannot)?;
        Ok(Self { path: path.to_owned(), temporary: None })
    }

    /// Writes the report.
    ///
    /// # Errors
    /// When it cannot be written to its end. What was there before is then still there, if possible.
    pub fn write(mut self, text: &str) -> anyhow::Result<()> {
        let written = match self.temporary.take() {
            None => std::fs::write(&self.path, text),
            Some(temporary) => {
                let written =
                    write_whole(&temporary, text).and_then(|()| std::fs::rename(&temporary, &self.path));
                if written.is_err() {
                    let _ = std::fs::remove_file(&temporary);
                }
                written
            }
        };
        written.with_context(|| format!("{}: cannot write the report", self.path.display()))
    }
}

impl Drop for ReportFile {
    fn drop(&mut self) {
        if let Some(temporary) = &self.temporary {
            let _ = std::fs::remove_file(temporary);
        }
    }
}

fn write_whole(path: &Path, text: &str) -> std::io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()
}

/// A file of this process's own in the same folder.
fn beside(path: &Path) -> Option<PathBuf> {
    let mut name = OsString::from(".");
    name.push(path.file_name()?);
    name.push(format!(".{}.partial", std::process::id()));
    Some(path.with_file_name(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_is_no_input_and_no_other_output() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("sub")).unwrap();
        std::fs::write(at("session.toml"), "").unwrap();
        let inputs = [Named::new("the session file", &at("session.toml"))];
        let output = |path: PathBuf| Named::new("the report", &path);
        for same in ["session.toml", "sub/../session.toml", "./session.toml"] {
            let error = check_outputs(&[output(at(same))], &inputs).unwrap_err().to_string();
            assert!(error.contains("the report would overwrite the session file"), "{error}");
        }
        let twice = [Named::new("the recording", &at("new")), output(at("sub/../new"))];
        assert!(check_outputs(&twice, &inputs).is_err());
        assert!(check_outputs(&[output(at("new"))], &inputs).is_ok());
    }

    #[test]
    fn a_report_replaces_the_old_one_only_when_it_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.json");
        std::fs::write(&path, "old").unwrap();
        drop(ReportFile::prepare(&path).unwrap());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        ReportFile::prepare(&path).unwrap().write("new").unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left over");
        assert!(ReportFile::prepare(&folder.path().join("no/report.json")).is_err());
        assert!(ReportFile::prepare(folder.path()).is_err());
    }
}
