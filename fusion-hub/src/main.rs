//! The command line of the hub.

mod arguments;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, SystemTime};

use anyhow::Context;
use clap::{Parser, Subcommand, ValueEnum};
use cofix_agent::files::Named;
use cofix_agent::stop::run_until_asked_to_end;
use cofix_agent::{Speed, Stop};
use cofix_common::settings::Preset;
use cofix_console::{Completions, LevelFilter, Lines, Verbosity, start_log};
use cofix_hub::enroll;
use cofix_hub::journal::{JournalReader, Origin, of_group};
use cofix_hub::live::{self, JournalOptions, LiveOptions};
use cofix_hub::network::ListenArguments;
use cofix_hub::outputs::OutputFiles;
use cofix_hub::replay::{Plan, ReplayOptions, replay};
use cofix_hub::session::Session;
use cofix_hub::session::files::{inputs, live_inputs};
use cofix_hub::simulate::{self, simulate};
use cofix_hub::status;

use arguments::{ReportPlan, conclude};

/// Default recording of the demonstration.
const DEMO_RECORDING: &str = "cofix-demo.rrd";

/// Fuses the phones of a group in one constrained filter, publishes, records and scores.
#[derive(Debug, Parser)]
#[command(version = cofix_console::VERSION)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    verbosity: Verbosity,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Listen for the agents of a session's phones, live
    Run {
        /// Session file: group, phones, constraints
        session: PathBuf,
        /// Folder to which the session file's paths are relative [default: its own]
        #[arg(long, value_name = "DIR")]
        data: Option<PathBuf>,
        #[command(flatten)]
        listen: ListenArguments,
        /// End when the agents of all phones have finished, instead of on Ctrl-C
        #[arg(long)]
        until_finished: bool,
        /// Publish the fused states as JSON too, on cofix/GROUP/fused/PHONE/json
        #[arg(long)]
        json: bool,
        /// Longest wait for a phone: an epoch of the others waits so long after its arrival, then they go on without that phone
        /// [default: maximum_wait_s in the session's table alignment, 5]
        #[arg(long, value_name = "SECONDS", value_parser = latency)]
        latency: Option<f64>,
        /// Journal of everything that comes (.mcap), with which a hub that was killed goes on [default: beside the recording; without
        /// one, GROUP-DATE-TIME.mcap in the working directory]
        #[arg(long, value_name = "FILE")]
        journal: Option<PathBuf>,
        /// Write no journal
        #[arg(long, conflicts_with = "journal")]
        no_journal: bool,
        /// Size after which the journal goes on in another file, MB before compression
        #[arg(long, value_name = "MB", default_value_t = 256, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
        journal_size: u64,
        #[command(flatten)]
        outputs: OutputFiles,
    },
    /// Run a recorded session through agents and hub on this machine
    Replay {
        /// Session file with observations for every phone; with a journal, settings to use in place of its own
        #[arg(required_unless_present = "journal")]
        session: Option<PathBuf>,
        /// Journal of a live session, which is done again as it was; of several of one session, as with --late
        #[arg(long, value_name = "FILE")]
        journal: Vec<PathBuf>,
        /// Do the journal again with every epoch in order of its time, also those that came too late, as a replay of recordings would
        #[arg(long, requires = "journal")]
        late: bool,
        /// Folder to which the session file's paths are relative [default: its own]
        #[arg(long, value_name = "DIR")]
        data: Option<PathBuf>,
        /// 'max', or times the recorded speed (1 = as recorded)
        #[arg(long, default_value = "max")]
        speed: Speed,
        #[command(flatten)]
        outputs: OutputFiles,
    },
    /// Six simulated phones in two cars in and around an urban canyon, without any input; recorded to cofix-demo.rrd
    /// unless told otherwise
    Demo {
        #[command(flatten)]
        outputs: OutputFiles,
    },
    /// Make certificates for a group's hub and phones, or revoke a phone's, so that nobody else may listen or speak
    Enroll(enroll::Arguments),
    /// Ask a live hub how its phones are; fails when one has no fresh epoch
    Status(status::Arguments),
    /// Write a simulated scenario as files: observations, navigation messages, truth, and a session to replay
    Simulate(simulate::Arguments),
    /// Print completions of this command line for a shell
    #[command(hide = true)]
    Completions(Completions),
    /// Print every setting of agents and hub as tables for a session file, each with unit, range and meaning
    Settings {
        /// The values that are printed
        #[arg(long, default_value = "default")]
        preset: PresetName,
    },
}

/// [`Preset`] by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum PresetName {
    /// Ours, tuned on real drives
    Default,
    /// The values printed in Peng 2023, section 4
    Peng2023,
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
    // A live hub tells who comes and goes; elsewhere only what is wrong is said.
    let (usual, lines) = match arguments.command {
        Command::Run { .. } => (LevelFilter::INFO, Lines::Timed),
        Command::Replay { .. }
        | Command::Demo { .. }
        | Command::Simulate(_)
        | Command::Settings { .. }
        | Command::Status(_)
        | Command::Completions(_)
        | Command::Enroll(_) => (LevelFilter::WARN, Lines::Plain),
    };
    start_log(arguments.verbosity, usual, lines);
    cofix_console::conclude(run_until_asked_to_end(move |stop| execute(arguments.command, stop)))
}

fn execute(command: Command, stop: &Stop) -> anyhow::Result<()> {
    match command {
        Command::Run {
            session: file,
            data,
            listen,
            until_finished,
            json,
            latency,
            journal,
            no_journal,
            journal_size,
            outputs,
        } => {
            let session = Session::read(&file, data.as_deref())?;
            let read = live_inputs(&file, &session);
            let named = inputs(&file, &session);
            let report = ReportPlan::new(&outputs, &named, read, folder(&file, data.as_deref()))?;
            let listening = listen.of_group(&session.group, &session.phone_names())?;
            let latency = latency.map(Duration::from_secs_f64);
            let beside = || outputs.recording.as_ref().map(|recording| recording.with_extension("mcap"));
            let usual = || of_group(Path::new("."), &session.group, outputs.overwrite, SystemTime::now());
            let journal = (!no_journal).then(|| journal.or_else(beside).unwrap_or_else(usual));
            let segment_bytes = journal_size * 1_000_000;
            let journal =
                journal.map(|path| JournalOptions { path, session_path: file, data, segment_bytes });
            let options = LiveOptions { listening, files: outputs, until_finished, latency, json, journal };
            conclude(live::run(&session, &options, stop)?, report)
        }
        Command::Replay { session, journal, late, data, outputs, .. } if !journal.is_empty() => {
            again(session.as_deref(), &journal, late, data.as_deref(), &outputs)
        }
        Command::Replay { session, data, speed, outputs, .. } => {
            let file = session.context("a session file is missing")?;
            let session = Session::read(&file, data.as_deref())?;
            let inputs = inputs(&file, &session);
            let report = ReportPlan::new(&outputs, &inputs, inputs.clone(), folder(&file, data.as_deref()))?;
            let plan = Plan::from_session(&session)?;
            conclude(replay(&plan, &replay_options(outputs, speed), stop)?, report)
        }
        Command::Demo { mut outputs } => {
            outputs.recording.get_or_insert_with(|| DEMO_RECORDING.into());
            let report = ReportPlan::new(&outputs, &[], Vec::new(), Path::new(""))?;
            let plan = cofix_hub::demo::plan(cofix_hub::demo::scenario())?;
            conclude(replay(&plan, &replay_options(outputs, Speed::Maximum), stop)?, report)
        }
        Command::Enroll(arguments) => cofix_console::print(&enroll::enroll(&arguments)?),
        Command::Simulate(arguments) => {
            let session = simulate(&arguments, stop)?;
            cofix_console::print(&format!("Session: {}\n", session.display()))
        }
        Command::Status(arguments) => {
            let (connect, credentials) = arguments.hub()?;
            let document = status::ask(&arguments.group, &connect, credentials, stop)?;
            let json = || Ok::<_, serde_json::Error>(serde_json::to_string_pretty(&document)? + "\n");
            cofix_console::print(&if arguments.json { json()? } else { document.table() })?;
            document.check(f64::from(arguments.within))
        }
        Command::Completions(completions) => completions.print::<Arguments>(),
        Command::Settings { preset } => {
            let preset = match preset {
                PresetName::Default => Preset::Default,
                PresetName::Peng2023 => Preset::Peng2023,
            };
            cofix_console::print(&cofix_agent::settings::document(preset))
        }
    }
}

/// Does a journal again, or several, with the settings of a session file or those of the first; `late`: in order of time.
fn again(
    file: Option<&Path>,
    journals: &[PathBuf],
    late: bool,
    data: Option<&Path>,
    outputs: &OutputFiles,
) -> anyhow::Result<()> {
    let mut readers: Vec<JournalReader> =
        journals.iter().map(|path| JournalReader::open(path)).collect::<Result<_, _>>()?;
    let first = readers.first_mut().context("a journal is missing")?;
    let Origin { header, session } = first.origin()?.clone();
    let (file, data) =
        file.map_or((header.session_path.as_path(), header.data.as_deref()), |file| (file, data));
    let session = match session {
        Some(text) if file == header.session_path => Session::parse(&text, file, data)?,
        _ => Session::read(file, data)?,
    };
    let mut read = live_inputs(file, &session);
    read.retain(|input| input.path.is_file());
    let named: Vec<Named> = read
        .iter()
        .cloned()
        .chain(journals.iter().map(|journal| Named::new("the journal", journal)))
        .collect();
    let report = ReportPlan::new(outputs, &named, read, folder(file, data))?;
    let outcome = if late || journals.len() > 1 {
        live::in_order(&session, &mut readers, outputs)?
    } else {
        live::again(&session, first, outputs)?
    };
    conclude(outcome, report)
}

fn replay_options(files: OutputFiles, speed: Speed) -> ReplayOptions {
    ReplayOptions { files, speed, progress: true }
}

/// The folder to which a session file's paths are relative.
fn folder<'a>(file: &'a Path, data: Option<&'a Path>) -> &'a Path {
    data.or(file.parent()).unwrap_or(Path::new(""))
}
