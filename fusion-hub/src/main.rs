//! The command line of the hub.

use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::bail;
use clap::{Parser, Subcommand};
use cofix_agent::signals::run_until_asked_to_end;
use cofix_agent::{Speed, Stop};
use cofix_hub::align::AlignOptions;
use cofix_hub::files::{Named, ReportFile, check_absent, check_outputs, inputs};
use cofix_hub::live::{self, LiveOptions};
use cofix_hub::replay::{Outcome, Plan, ReplayOptions, replay};
use cofix_hub::session::Session;
use cofix_hub::simulate::{self, simulate};

/// Fuses the phones of a group in one constrained filter, publishes, records and scores.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Listen for the agents of a session's phones, live
    Run {
        /// Session file: group, phones, constraints
        session: PathBuf,
        /// Zenoh endpoint to listen on; may be repeated
        #[arg(long, value_name = "ENDPOINT", default_value = "tcp/0.0.0.0:7447")]
        listen: Vec<String>,
        /// End when the agents of all phones have finished, instead of on Ctrl-C
        #[arg(long)]
        until_finished: bool,
        /// How long a phone may be silent before the others go on without it; it may lag by twice as much
        #[arg(long, value_name = "SECONDS", default_value_t = 5.0, value_parser = latency)]
        latency: f64,
        /// Replace a recording that is there
        #[arg(long)]
        overwrite: bool,
        #[command(flatten)]
        outputs: OutputArguments,
    },
    /// Run a recorded session through agents and hub on this machine
    Replay {
        /// Session file with observations for every phone
        session: PathBuf,
        /// 'max', or times the recorded speed (1 = as recorded)
        #[arg(long, default_value = "max")]
        speed: Speed,
        #[command(flatten)]
        outputs: OutputArguments,
    },
    /// Six simulated phones in two cars in and around an urban canyon, without any input
    Demo {
        /// Where to record to
        #[arg(long, value_name = "FILE", default_value = "cofix-demo.rrd")]
        recording: PathBuf,
        /// Where to write the JSON report
        #[arg(long, value_name = "FILE")]
        report: Option<PathBuf>,
    },
    /// Write a simulated scenario as files: observations, navigation messages, truth, and a session to replay
    Simulate(simulate::Arguments),
}

#[derive(Debug, clap::Args)]
struct OutputArguments {
    /// Where to record to (.rrd)
    #[arg(long, value_name = "FILE")]
    recording: Option<PathBuf>,
    /// Where to write the JSON report
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// Seconds between a tenth and an hour.
fn latency(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.1..=3_600.0).contains(&seconds) => Ok(seconds),
        _ => Err("write seconds from 0.1 to 3600".to_owned()),
    }
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    log_to_stderr(&arguments.command);
    match run_until_asked_to_end(move |stop| execute(arguments.command, stop)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            tracing::error!("{error:#}");
            ExitCode::FAILURE
        }
    }
}

/// A live hub tells who comes and goes; elsewhere only what is wrong is said. `RUST_LOG` overrides.
fn log_to_stderr(command: &Command) {
    let own = if matches!(command, Command::Run { .. }) { "info" } else { "warn" };
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new(format!("error,cofix_hub={own}")));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .init();
}

fn execute(command: Command, stop: &Stop) -> anyhow::Result<()> {
    match command {
        Command::Run { session: file, listen, until_finished, latency, overwrite, outputs } => {
            let session = Session::read(&file)?;
            let report = outputs.prepare(&inputs(&file, &session))?;
            if let (Some(path), false) = (&outputs.recording, overwrite) {
                check_absent(path)?;
            }
            let align = AlignOptions::with_latency(Duration::from_secs_f64(latency));
            let options = LiveOptions { listen, recording: outputs.recording, until_finished, align };
            conclude(&live::run(&session, &options, stop)?, report)
        }
        Command::Replay { session: file, speed, outputs } => {
            let session = Session::read(&file)?;
            let report = outputs.prepare(&inputs(&file, &session))?;
            let plan = Plan::from_session(&session)?;
            let options = ReplayOptions { recording: outputs.recording, speed, progress: true };
            conclude(&replay(&plan, &options, stop)?, report)
        }
        Command::Demo { recording, report } => {
            let outputs = OutputArguments { recording: Some(recording), report };
            let report = outputs.prepare(&[])?;
            let plan = cofix_hub::demo::plan(cofix_hub::demo::scenario())?;
            let options =
                ReplayOptions { recording: outputs.recording, speed: Speed::Maximum, progress: true };
            conclude(&replay(&plan, &options, stop)?, report)
        }
        Command::Simulate(arguments) => {
            let session = simulate(&arguments, stop)?;
            writeln!(std::io::stdout(), "Session: {}", session.display())?;
            Ok(())
        }
    }
}

impl OutputArguments {
    /// Checks that the outputs are files of their own and that the report can be written.
    fn prepare(&self, inputs: &[Named]) -> anyhow::Result<Option<ReportFile>> {
        let named = |what, path: &Option<PathBuf>| path.as_deref().map(|path| Named::new(what, path));
        let outputs = [named("the recording", &self.recording), named("the report", &self.report)];
        let outputs: Vec<Named> = outputs.into_iter().flatten().collect();
        check_outputs(&outputs, inputs)?;
        self.report.as_deref().map(ReportFile::prepare).transpose()
    }
}

/// Prints the table, then writes the report.
fn conclude(outcome: &Outcome, report: Option<ReportFile>) -> anyhow::Result<()> {
    let printed = print(outcome);
    if let Some(report) = report {
        report.write(&outcome.report.json()?)?;
    }
    printed?;
    if let Some(failure) = &outcome.failure {
        bail!("{failure}");
    }
    Ok(())
}

fn print(outcome: &Outcome) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", outcome.table)?;
    let skipped = outcome.report.skipped();
    if !skipped.is_empty() {
        writeln!(out, "Skipped (the report names the first of each):\n{skipped}\n")?;
    }
    if let Some((path, recorded)) = &outcome.recording {
        let megabytes = recorded.bytes as f64 * 1e-6;
        writeln!(out, "Recording: {} ({megabytes:.1} MB, {} epochs)", path.display(), recorded.epochs)?;
    }
    Ok(())
}
