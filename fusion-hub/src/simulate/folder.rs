//! A folder that gets either all files of a sample or none.

use std::ffi::OsString;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

/// Files being written, each under a temporary name of this process until all are complete.
#[derive(Debug)]
pub(super) struct Folder {
    path: PathBuf,
    /// Folders that were made for it, the innermost first.
    made: Vec<PathBuf>,
    /// Temporary paths, and the paths that they become.
    files: Vec<(PathBuf, PathBuf)>,
}

/// A function that takes text.
pub(super) type Put<'a> = dyn FnMut(&str) -> std::io::Result<()> + 'a;

impl Folder {
    /// Creates the folder, if it is not there, and checks that no file of these names is there, unless it may be replaced.
    pub(super) fn open(path: &Path, names: &[String], overwrite: bool) -> anyhow::Result<Self> {
        let at = |name: &String| path.join(name);
        if let Some(folder) = names.iter().map(at).find(|file| file.is_dir()) {
            bail!("{}: a folder is where a file must be written; name another --out", folder.display());
        }
        let mut present = names.iter().map(at).filter(|file| file.symlink_metadata().is_ok());
        if let (Some(first), false) = (present.next(), overwrite) {
            let more = match present.count() {
                0 => String::new(),
                more => format!(" (and {more} more of the sample's names)"),
            };
            bail!(
                "{}: there is a file already{more}; name another --out, or say --overwrite",
                first.display()
            );
        }
        let missing =
            path.ancestors().take_while(|folder| !folder.as_os_str().is_empty() && !folder.exists());
        let made = missing.map(Path::to_owned).collect();
        let folder = Self { path: path.to_owned(), made, files: Vec::new() };
        std::fs::create_dir_all(path)
            .with_context(|| format!("{}: the folder cannot be made", path.display()))?;
        Ok(folder)
    }

    /// Writes a file by `fill`, which is given a function that takes its text.
    pub(super) fn write(
        &mut self,
        name: &str,
        fill: impl FnOnce(&mut Put<'_>) -> std::io::Result<()>,
    ) -> anyhow::Result<()> {
        let target = self.path.join(name);
        let mut own = OsString::from(".");
        own.push(format!("{name}.{}.partial", std::process::id()));
        let under_way = self.path.join(own);
        self.files.push((under_way.clone(), target.clone()));
        let write = || {
            let mut file = BufWriter::new(File::create(&under_way)?);
            fill(&mut |text| file.write_all(text.as_bytes()))?;
            file.into_inner()?.sync_all()
        };
        write().with_context(|| format!("{}: cannot be written", target.display()))
    }

    /// Gives all files their names.
    pub(super) fn finish(mut self) -> anyhow::Result<()> {
        for (under_way, target) in &self.files {
            std::fs::rename(under_way, target)
                .with_context(|| format!("{}: cannot be written", target.display()))?;
        }
        self.files.clear();
        self.made.clear();
        Ok(())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        for (under_way, _) in &self.files {
            let _ = std::fs::remove_file(under_way);
        }
        // Fails, as it should, where something else is in it.
        for folder in &self.made {
            let _ = std::fs::remove_dir(folder);
        }
    }
}
