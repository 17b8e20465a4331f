//! Why there is no summary.

use std::path::PathBuf;

use cofix_common::recording::APPLICATION_ID;

/// Why there is no summary.
#[derive(Debug, thiserror::Error)]
pub enum SummaryError {
    /// The file cannot be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The file is something else.
    #[error("{} is not a Rerun recording that can be read here: {message}; give the .rrd file that `cofix-hub … --recording` wrote", path.display())]
    NotARecording {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// The file ends before it says what it holds.
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
