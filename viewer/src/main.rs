//! Summarises and opens recordings of the fusion hub.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use cofix_console::{Completions, LevelFilter, Lines, Verbosity, conclude, print, start_log};
use cofix_viewer::open::{TELEMETRY, open, version_warning, viewer_version};
use cofix_viewer::summary::Summary;

/// Looks at recordings of cofix-hub.
#[derive(Parser)]
#[command(version = cofix_console::VERSION)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    verbosity: Verbosity,
}

#[derive(Subcommand)]
enum Command {
    /// Prints time span, phones, integrity, accuracy table and contents of a recording.
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
    /// Prints completions of this command line for a shell.
    #[command(hide = true)]
    Completions(Completions),
}

fn main() -> ExitCode {
    let Arguments { command, verbosity } = Arguments::parse();
    start_log(verbosity, LevelFilter::INFO, Lines::Plain);
    conclude(execute(command))
}

fn execute(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Summary { file, all } => print(&Summary::read(&file)?.render(all)),
        Command::Open { file } => open_checked(&file),
        Command::Completions(completions) => completions.print::<Arguments>(),
    }
}

fn open_checked(file: &Path) -> anyhow::Result<()> {
    let summary = Summary::read(file)?;
    let version = viewer_version()?;
    tracing::debug!("the installed viewer says: {version}");
    for warning in summary.warnings.into_iter().chain(version_warning(&version)) {
        tracing::warn!("{warning}");
    }
    tracing::info!("{TELEMETRY}");
    Ok(open(file)?)
}
