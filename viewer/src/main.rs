//! Summarises and opens recordings of the fusion hub.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use cofix_viewer::open::{open, version_warning, viewer_version};
use cofix_viewer::summary::Summary;

/// Looks at recordings of cofix-hub.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Prints time span, phones, accuracy table and contents of a recording.
    Summary {
        /// The recording (.rrd).
        file: PathBuf,
        /// Lists every entity.
        #[arg(long)]
        all: bool,
    },
    /// Shows a recording in the Rerun viewer.
    Open {
        /// The recording (.rrd).
        file: PathBuf,
    },
}

fn main() -> ExitCode {
    match execute() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Nothing is left to be done when this cannot be said.
            let _ = writeln!(std::io::stderr(), "error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn execute() -> anyhow::Result<()> {
    match Arguments::parse().command {
        Command::Summary { file, all } => print(&Summary::read(&file)?.render(all)),
        Command::Open { file } => open_checked(&file),
    }
}

/// A reader that closes the pipe early (`| head`) is no failure.
fn print(text: &str) -> anyhow::Result<()> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        result => Ok(result?),
    }
}

fn open_checked(file: &Path) -> anyhow::Result<()> {
    let summary = Summary::read(file)?;
    let warnings = summary.warnings.into_iter().chain(version_warning(&viewer_version()?));
    for warning in warnings {
        writeln!(std::io::stderr(), "warning: {warning}")?;
    }
    Ok(open(file)?)
}
