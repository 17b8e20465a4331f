//! The command line of the agent.

mod arguments;
mod watch;

use std::process::ExitCode;

use clap::Parser;
use cofix_agent::convert::Outputs;
use cofix_agent::input::ntrip::{self, Caster};
use cofix_agent::inspect::InspectOptions;
use cofix_agent::settings::FileSettings;
use cofix_agent::settings::Masks;
use cofix_agent::source::Reading;
use cofix_agent::stop::run_until_asked_to_end;
use cofix_agent::{AgentConfig, ProductSource, Stop};
use cofix_common::measurement::DifferentialCounts;
use cofix_console::{LevelFilter, Lines, conclude, print, say_error, start_log};

use arguments::{Arguments, Command, Convert, Files, Inspect};

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let lines = if arguments.command.is_some() { Lines::Plain } else { Lines::Timed };
    start_log(arguments.verbosity, LevelFilter::INFO, lines);
    conclude(work(arguments))
}

fn work(arguments: Arguments) -> anyhow::Result<()> {
    let Arguments { command, publish, products, settings: file, masks, log, verbosity: _ } = arguments;
    match (command, publish) {
        (Some(Command::Inspect(arguments)), _) => inspect(&arguments),
        (Some(Command::Convert(arguments)), _) => convert(arguments),
        (Some(Command::Sourcetable(arguments)), _) => {
            let caster: Caster = arguments.caster.parse()?;
            let trust = arguments::trust(arguments.caster_ca.as_deref(), caster.trust().is_some())?;
            let caster = caster.trusting(&trust);
            print(&ntrip::sourcetable(&caster, &Stop::default())?.to_string())
        }
        (Some(Command::Completions(completions)), _) => completions.print::<Arguments>(),
        (None, Some(publish)) => {
            start(publish.config(products, &arguments::settings(file.as_deref(), masks, log)?)?)
        }
        (None, None) => anyhow::bail!("nothing to do; see --help"),
    }
}

/// A file that cannot be used does not keep the others from being shown, and makes the exit code 1.
fn inspect(arguments: &Inspect) -> anyhow::Result<()> {
    let (masks, log) = (arguments.masks.clone(), arguments.log.clone());
    let FileSettings { preset, estimator, masks, log } =
        arguments::settings(arguments.settings.as_deref(), masks, log)?;
    let mut pipeline = estimator.pipeline();
    pipeline.correction = masks.apply(preset.masked(pipeline.correction))?;
    let options = InspectOptions {
        reading: Reading { near: arguments.read.date, log: log.with(&masks)?, ..Reading::default() },
        products: ProductSource::Files(arguments.products.clone()),
        pipeline,
    };
    let mut inspections = Vec::new();
    let mut errors = Vec::new();
    for path in &arguments.read.files {
        match cofix_agent::inspect::inspect_any(path, &options, &Stop::default()) {
            Ok(inspection) => inspections.push(inspection),
            Err(error) => errors.push(error),
        }
    }
    let text = if arguments.json {
        serde_json::to_string_pretty(&inspections)? + "\n"
    } else {
        inspections.iter().map(ToString::to_string).collect()
    };
    print(&text)?;
    errors.extend(inspections.iter().filter_map(|inspection| inspection.check().err()));
    if let ([error], [_]) = (&errors[..], &arguments.read.files[..]) {
        anyhow::bail!("{error}");
    }
    for error in &errors {
        say_error(error);
    }
    anyhow::ensure!(
        errors.is_empty(),
        "{} of {} files cannot be used",
        errors.len(),
        arguments.read.files.len()
    );
    Ok(())
}

fn convert(arguments: Convert) -> anyhow::Result<()> {
    let Convert {
        read: Files { files, date },
        output_observations,
        output_navigation,
        overwrite,
        cn0_mask,
        log,
    } = arguments;
    let outputs = Outputs { observations: output_observations, navigation: output_navigation, overwrite };
    let log = log.with(&Masks { cn0_dbhz: cn0_mask, ..Masks::default() })?;
    let reading = Reading { near: date, log, ..Reading::default() };
    let converted = run_until_asked_to_end(move |stop| {
        Ok(cofix_agent::convert::convert(&files, &outputs, &reading, stop)?)
    })?;
    for (reason, skip) in converted.skips.iter() {
        tracing::warn!("skipped {} × {reason}, first: {}", skip.count, skip.first);
    }
    let (epochs, events, ephemerides) = (converted.epochs, converted.events, converted.ephemerides);
    tracing::info!("wrote {epochs} epochs, {events} events and {ephemerides} ephemerides");
    Ok(())
}

fn start(config: AgentConfig) -> anyhow::Result<()> {
    let phone = config.phone.clone();
    let report = run_until_asked_to_end(move |stop| {
        let mut watch = watch::Watch::start(&config.phone)?;
        Ok(cofix_agent::run_watched(&config, stop, &mut |message| watch.epoch(message))?)
    })?;
    for (reason, skip) in report.skips.iter() {
        tracing::warn!("skipped {} × {reason}, first: {}", skip.count, skip.first);
    }
    let DifferentialCounts { corrected, other_code, missing, too_old, refused } = report.corrections;
    if report.corrections != DifferentialCounts::default() {
        tracing::info!(
            "{phone}: {corrected} observations corrected by a base, {other_code} by another code, {missing} without a correction, \
             {too_old} too late for one, {refused} refused"
        );
    }
    let how = if report.stopped { "stopped" } else { "finished" };
    tracing::info!("{phone}: {how} after {} epochs", report.epochs_published);
    Ok(())
}
