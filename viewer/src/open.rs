//! Starts the Rerun viewer.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};

use crate::RERUN_VERSION;

/// The viewer's program.
const PROGRAM: &str = "rerun";
/// Address on which the viewer listens for data of other programs: this computer only. By default it listens to the whole network.
const BIND: [&str; 2] = ["--bind", "127.0.0.1"];
/// Note about the viewer's telemetry.
pub const TELEMETRY: &str = "the Rerun viewer sends statistics of its use to its makers, unless `rerun analytics disable` was said once";

/// Error of running the viewer.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// It is not installed.
    #[error(
        "the Rerun viewer is not installed: no program '{PROGRAM}' is on the PATH; \
         get it with `pip install rerun-sdk=={RERUN_VERSION}` or \
         `cargo install rerun-cli --version {RERUN_VERSION} --locked`"
    )]
    NotInstalled,
    /// It is there but cannot be started.
    #[error("cannot start '{PROGRAM}': {0}")]
    Start(std::io::Error),
    /// It ended with an error.
    #[error("the Rerun viewer ended with {status} on {}", path.display())]
    Failed {
        /// The recording.
        path: PathBuf,
        /// Its exit status.
        status: ExitStatus,
    },
}

/// The version of the installed viewer, by `rerun --version`.
///
/// # Errors
/// When it cannot be started.
pub fn viewer_version() -> Result<String, OpenError> {
    let output = Command::new(PROGRAM).arg("--version").output().map_err(start_error)?;
    Ok(String::from_utf8_lossy(&output.stdout).lines().next().unwrap_or_default().to_owned())
}

/// A warning when that is not the release that fits our recordings.
///
/// A recording is readable by the release that wrote it and the next one only.
pub fn version_warning(version: &str) -> Option<String> {
    let number = version.split_whitespace().find(|word| word.starts_with(|c: char| c.is_ascii_digit()));
    let release = |number: &str| number.splitn(3, '.').take(2).map(str::to_owned).collect::<Vec<_>>();
    if number.map(release) == Some(release(RERUN_VERSION)) {
        return None;
    }
    let found = number.map_or_else(|| format!("says '{version}'"), |n| format!("is {n}"));
    Some(format!("the installed Rerun viewer {found}; recordings are for {RERUN_VERSION} and may not open"))
}

/// Shows a recording, and returns when the viewer is closed.
///
/// # Errors
/// When the viewer cannot be started or ends with an error.
pub fn open(path: &Path) -> Result<(), OpenError> {
    let status = Command::new(PROGRAM).args(BIND).arg(path).status().map_err(start_error)?;
    if status.success() { Ok(()) } else { Err(OpenError::Failed { path: path.to_owned(), status }) }
}

fn start_error(error: std::io::Error) -> OpenError {
    if error.kind() == ErrorKind::NotFound { OpenError::NotInstalled } else { OpenError::Start(error) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_fitting_release_passes() {
        assert_eq!(version_warning("rerun-cli 0.36.3 (base map_view) [rustc 1.95.0]"), None);
        assert_eq!(version_warning("rerun-cli 0.36.1"), None);
        assert!(version_warning("rerun-cli 0.37.0").unwrap().contains("is 0.37.0"));
        assert!(version_warning("rerun-cli 0.3.6").is_some());
        assert!(version_warning("").is_some());
    }
}
