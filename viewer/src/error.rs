//! Errors of reading a recording.

use std::path::PathBuf;

use cofix_common::recording::APPLICATION_ID;

/// Error of reading a recording.
#[derive(Debug, thiserror::Error)]
pub enum SummaryError {
    /// The file cannot be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The file is something else.
    #[error("{} is not a Rerun recording that can be read here: {message}; give the .rrd file that `cofix-hub … --recording` wrote", path.display())]
    NotARecording {
        /// The file.
        path: PathBuf,
        /// The defect.
        message: String,
    },
    /// The file ends before its first recording.
    #[error("{} holds no recording; it may have been cut off at its start", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// A recording of another program.
    #[error("{} is a recording of '{application}', not of {APPLICATION_ID}; `rerun {}` may open it", path.display(), path.display())]
    OtherApplication {
        /// The file.
        path: PathBuf,
        /// The application id in it.
        application: String,
    },
}
