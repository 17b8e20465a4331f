//! Output files. An output is neither an input nor another output, replaces no file unless that was asked for, and appears whole or not
//! at all.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile};

/// A file and its purpose.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// Its purpose, with the article: "the report".
    pub what: String,
    /// The file.
    pub path: PathBuf,
}

impl Named {
    /// A file with its purpose.
    pub fn new(what: &str, path: &Path) -> Self {
        Self { what: what.to_owned(), path: path.to_owned() }
    }
}

/// An output that cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// It is an input, or another output.
    #[error("{}: {what} would overwrite {other}; name another file", path.display())]
    Same {
        /// The file.
        path: PathBuf,
        /// The output's purpose.
        what: String,
        /// The purpose of the file that it would overwrite.
        other: String,
    },
    /// A file of that name is there.
    #[error("{}: there is a file already; name another one for {what}, or say --overwrite", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
        /// What it should be.
        what: String,
    },
    /// It cannot be created or written.
    #[error("{}: cannot write {what}: {cause}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What it should be.
        what: String,
        /// Why.
        cause: io::Error,
    },
}

/// Whether outputs are files of their own.
///
/// # Errors
/// [`OutputError::Same`] when an output is another output or an input, also through links and `..`.
pub fn check_outputs(outputs: &[Named], inputs: &[Named]) -> Result<(), OutputError> {
    for (index, output) in outputs.iter().enumerate() {
        let place = place(&output.path);
        let mut others = outputs.iter().take(index).chain(inputs);
        if let Some(other) = others.find(|other| self::place(&other.path) == place) {
            return Err(OutputError::Same {
                path: output.path.clone(),
                what: output.what.clone(),
                other: other.what.clone(),
            });
        }
    }
    Ok(())
}

/// `STEM.NUMBER.EXTENSION`, whatever dots the stem has.
pub fn numbered(stem: &Path, number: u64, extension: &str) -> PathBuf {
    let mut name = stem.as_os_str().to_owned();
    name.push(format!(".{number}.{extension}"));
    name.into()
}

/// Whether an output may be created. A device or a pipe may always be written to.
///
/// # Errors
/// [`OutputError::Exists`] when a file of that name is there.
pub fn check_absent(output: &Named) -> Result<(), OutputError> {
    if output.path.is_file() { Err(exists(output)) } else { Ok(()) }
}

/// The path of a file without links and `..`.
fn place(path: &Path) -> PathBuf {
    if let Ok(place) = path.canonicalize() {
        return place;
    }
    match (folder(path).canonicalize(), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path.to_owned(),
    }
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn exists(output: &Named) -> OutputError {
    OutputError::Exists { path: output.path.clone(), what: output.what.clone() }
}

/// A file that is written beside its place, and put there once it is whole: until [`OutputFile::commit`] what was there
/// before stays, and without it nothing is left behind. A device or a pipe is written directly.
#[derive(Debug)]
pub struct OutputFile {
    output: Named,
    overwrite: bool,
    to: Destination,
}

#[derive(Debug)]
enum Destination {
    /// The file that will be put at `place`.
    Beside { file: BufWriter<NamedTempFile>, place: PathBuf },
    /// A pipe or a device.
    Direct(BufWriter<File>),
}

impl OutputFile {
    /// Makes sure that the output can be written, and opens it. `overwrite`: a file that is there may be replaced.
    ///
    /// # Errors
    /// [`OutputError::Exists`], and [`OutputError::Write`] for a folder or a place where no file can be created.
    pub fn create(output: Named, overwrite: bool) -> Result<Self, OutputError> {
        if !overwrite {
            check_absent(&output)?;
        }
        match destination(&output.path) {
            Ok(to) => Ok(Self { output, overwrite, to }),
            Err(cause) => Err(write_error(&output, cause)),
        }
    }

    /// The name that the file will have.
    pub fn path(&self) -> &Path {
        &self.output.path
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// When the rest cannot be written, or a file has appeared there meanwhile that may not be replaced.
    pub fn commit(self) -> Result<(), OutputError> {
        let Self { output, overwrite, to } = self;
        let failed = |cause| write_error(&output, cause);
        match to {
            Destination::Direct(mut file) => file.flush().map_err(failed),
            Destination::Beside { file, place } => {
                let file = file.into_inner().map_err(|error| failed(error.into_error()))?;
                file.as_file().sync_all().map_err(failed)?;
                let put = if overwrite { file.persist(place) } else { file.persist_noclobber(place) };
                match put {
                    Ok(_) => Ok(()),
                    Err(error) if error.error.kind() == io::ErrorKind::AlreadyExists => Err(exists(&output)),
                    Err(error) => Err(failed(error.error)),
                }
            }
        }
    }

    /// Writes the whole text and puts the file in its place.
    ///
    /// # Errors
    /// As [`OutputFile::commit`].
    pub fn write_whole(mut self, text: &str) -> Result<(), OutputError> {
        self.put(text)?;
        self.commit()
    }

    /// Writes a piece of text.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn put(&mut self, text: &str) -> Result<(), OutputError> {
        self.write_all(text.as_bytes()).map_err(|cause| write_error(&self.output, cause))
    }
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.to {
            Destination::Beside { file, .. } => file.write(bytes),
            Destination::Direct(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.to {
            Destination::Beside { file, .. } => file.flush(),
            Destination::Direct(file) => file.flush(),
        }
    }
}

fn write_error(output: &Named, cause: io::Error) -> OutputError {
    OutputError::Write { path: output.path.clone(), what: output.what.clone(), cause }
}

fn destination(path: &Path) -> io::Result<Destination> {
    let there = match path.metadata() {
        Ok(metadata) if metadata.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
        Ok(metadata) if !metadata.is_file() => {
            let direct = OpenOptions::new().write(true).open(path)?;
            return Ok(Destination::Direct(BufWriter::new(direct)));
        }
        Ok(metadata) => Some(metadata),
        Err(_) if path.is_symlink() => {
            return Err(io::Error::other("it is a link to a file that is not there; name that file"));
        }
        Err(_) => None,
    };
    // A link stays one: the file that it leads to is replaced.
    let place = if there.is_some() { path.canonicalize()? } else { path.to_owned() };
    let mut prefix = std::ffi::OsString::from(".");
    prefix.push(place.file_name().ok_or(io::ErrorKind::InvalidFilename)?);
    let mut builder = Builder::new();
    builder.prefix(&prefix).suffix(".partial");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The process's mask takes its bits from these.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    // Of the temporary file's error only the kind is told: its name is of no use to the reader.
    folder(&place).metadata()?;
    let file = builder.tempfile_in(folder(&place)).map_err(|error| io::Error::from(error.kind()))?;
    if let Some(metadata) = there {
        file.as_file().set_permissions(metadata.permissions())?;
    }
    Ok(Destination::Beside { file: BufWriter::new(file), place })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn an_output_is_no_input_and_no_other_output() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("sub")).unwrap();
        std::fs::write(at("input"), "").unwrap();
        let inputs = [Named::new("the input", &at("input"))];
        let output = |path: PathBuf| Named::new("the report", &path);
        for same in ["input", "sub/../input", "./input"] {
            let error = check_outputs(&[output(at(same))], &inputs).unwrap_err().to_string();
            assert!(error.contains("the report would overwrite the input"), "{error}");
        }
        let twice = [Named::new("the recording", &at("new")), output(at("sub/../new"))];
        assert!(check_outputs(&twice, &inputs).is_err());
        assert!(check_outputs(&[output(at("new"))], &inputs).is_ok());
    }

    #[test]
    fn a_file_appears_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let output = Named::new("the report", &folder.path().join("report.json"));
        let mut dropped = OutputFile::create(output.clone(), false).unwrap();
        dropped.put("half").unwrap();
        drop(dropped);
        assert!(names(folder.path()).is_empty(), "{:?}", names(folder.path()));
        OutputFile::create(output.clone(), false).unwrap().write_whole("new").unwrap();
        assert_eq!(std::fs::read_to_string(&output.path).unwrap(), "new");
        assert_eq!(names(folder.path()), ["report.json"]);
    }

    #[test]
    fn a_file_that_is_there_is_replaced_only_when_asked_for_and_only_by_a_whole_one() {
        let folder = tempfile::tempdir().unwrap();
        let output = Named::new("the report", &folder.path().join("report.json"));
        std::fs::write(&output.path, "old").unwrap();
        let error = OutputFile::create(output.clone(), false).unwrap_err().to_string();
        assert!(error.contains("--overwrite") && error.contains("report.json"), "{error}");
        drop(OutputFile::create(output.clone(), true).unwrap());
        assert_eq!(std::fs::read_to_string(&output.path).unwrap(), "old");
        OutputFile::create(output.clone(), true).unwrap().write_whole("new").unwrap();
        assert_eq!(std::fs::read_to_string(&output.path).unwrap(), "new");
        assert_eq!(names(folder.path()), ["report.json"]);
    }

    #[test]
    fn a_file_that_appears_meanwhile_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let output = Named::new("the report", &folder.path().join("report.json"));
        let file = OutputFile::create(output.clone(), false).unwrap();
        std::fs::write(&output.path, "another's").unwrap();
        assert!(matches!(file.write_whole("ours"), Err(OutputError::Exists { .. })));
        assert_eq!(std::fs::read_to_string(&output.path).unwrap(), "another's");
        assert_eq!(names(folder.path()), ["report.json"]);
    }

    #[test]
    fn what_cannot_be_written_is_said_once() {
        let folder = tempfile::tempdir().unwrap();
        for path in [folder.path().to_owned(), folder.path().join("no/report.json")] {
            let output = Named::new("the report", &path);
            let error = OutputFile::create(output, false).unwrap_err().to_string();
            assert!(error.starts_with(&format!("{}: cannot write the report: ", path.display())), "{error}");
            assert_eq!(error.matches(folder.path().to_str().unwrap()).count(), 1, "{error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn devices_links_and_permissions_stay_what_they_are() {
        use std::os::unix::fs::PermissionsExt;
        let null = Named::new("the report", Path::new("/dev/null"));
        OutputFile::create(null, false).unwrap().write_whole("text").unwrap();
        assert!(!Path::new("/dev/null").is_file());

        let folder = tempfile::tempdir().unwrap();
        let (target, link) = (folder.path().join("target"), folder.path().join("link"));
        std::fs::write(&target, "old").unwrap();
        std::fs::set_permissions(&target, std::fs::Permissions::from_mode(0o640)).unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        assert!(OutputFile::create(Named::new("the report", &link), false).is_err());
        OutputFile::create(Named::new("the report", &link), true).unwrap().write_whole("new").unwrap();
        assert!(link.is_symlink());
        assert_eq!(std::fs::read_to_string(&target).unwrap(), "new");
        assert_eq!(target.metadata().unwrap().permissions().mode() & 0o777, 0o640);

        let fresh = folder.path().join("fresh");
        OutputFile::create(Named::new("the report", &fresh), false).unwrap().write_whole("new").unwrap();
        std::fs::write(folder.path().join("plain"), "").unwrap();
        let mode = |path: &Path| path.metadata().unwrap().permissions().mode() & 0o777;
        assert_eq!(mode(&fresh), mode(&folder.path().join("plain")));
    }
}
