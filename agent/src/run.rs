//! From source to wire.

use std::sync::Arc;

use cofix_common::skips::Skips;
use cofix_common::wire::{PhoneStatus, check_name};

use crate::link::{self, LinkError};
use crate::pace::Pace;
use crate::pipeline::PhonePipeline;
use crate::publication::{Publication, PublicationError, Publisher};
use crate::source::{self, Observations, SourceError};
use crate::{AgentConfig, Source, Speed, Stop};

/// Why an agent's run failed.
#[derive(Debug, thiserror::Error)]
pub enum AgentError {
    /// A file cannot be used.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The hub cannot be reached.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Publishing failed.
    #[error(transparent)]
    Publication(#[from] PublicationError),
    /// The hub did not get everything.
    #[error("the hub has confirmed {confirmed} of {published} epochs; did it stop?")]
    NotConfirmed {
        /// Epochs that the hub has.
        confirmed: u64,
        /// Epochs published.
        published: u64,
    },
}

/// What an agent did.
#[derive(Clone, Debug)]
pub struct AgentReport {
    /// Epochs published.
    pub epochs_published: u64,
    /// Whether it was asked to stop before the end.
    pub stopped: bool,
    /// What was skipped, from the file to the solution.
    pub skips: Skips,
}

/// Runs an agent to the end of its source, or until asked to stop. Blocks.
///
/// # Errors
/// When a name or a file cannot be used, the hub cannot be reached, does not listen or does not know the phone, or did not confirm all
/// epochs.
pub fn run(config: &AgentConfig, stop: &Stop) -> Result<AgentReport, AgentError> {
    for name in [&config.group, &config.phone] {
        check_name(name).map_err(PublicationError::from)?;
    }
    let observations = source::observations(&config.source)?;
    let (products, product_skips) = source::products(&config.products)?;
    let covering = Arc::clone(&products);
    let Some(session) = link::connect_unless_stopped(&config.connect, config.patience, stop)? else {
        return Ok(AgentReport { epochs_published: 0, stopped: true, skips: Skips::default() });
    };
    let publisher =
        Publisher { group: &config.group, phone: &config.phone, kept_messages: config.kept_messages };
    let mut publication = Publication::declare(session, publisher)?;
    let mut pipeline = PhonePipeline::new(&config.phone, products, config.pipeline.clone());
    let mut skips = observations.skips.clone();
    skips.merge(&product_skips);
    source::note_shortcomings(&observations.epochs, &covering, &mut skips);
    let outcome = publish(config, &observations, &mut pipeline, &mut publication, stop);
    skips.merge(&pipeline.skips());
    let finished = finish(config, &publication, &outcome, &skips, stop);
    let report =
        AgentReport { epochs_published: publication.published(), stopped: stop.is_requested(), skips };
    let closed = publication.close();
    outcome?;
    finished?;
    closed?;
    Ok(report)
}

fn publish(
    config: &AgentConfig,
    observations: &Observations,
    pipeline: &mut PhonePipeline,
    publication: &mut Publication,
    stop: &Stop,
) -> Result<(), AgentError> {
    if !publication.wait_for_listener(config.patience, stop)? {
        return Ok(());
    }
    publication.introduce()?;
    let epochs_expected = u64::try_from(observations.epochs.len()).ok();
    publication.status(PhoneStatus::Started { summary: summary(config), epochs_expected })?;
    let mut pace = Pace::new(config.speed);
    for epoch in observations.epochs.iter() {
        if pace.wait(epoch.time_gps, stop) {
            break;
        }
        publication.epoch(&pipeline.process(epoch))?;
    }
    Ok(())
}

/// Says goodbye and waits until the hub has everything.
fn finish(
    config: &AgentConfig,
    publication: &Publication,
    outcome: &Result<(), AgentError>,
    skips: &Skips,
    stop: &Stop,
) -> Result<(), AgentError> {
    if matches!(outcome, Err(AgentError::Publication(PublicationError::Refused(_)))) {
        return Ok(());
    }
    let stopped = stop.is_requested().then(|| "stopped before the end of the source".to_owned());
    let error = outcome.as_ref().err().map(ToString::to_string).or(stopped);
    let published = publication.published();
    publication.status(PhoneStatus::Finished { epochs_published: published, skips: skips.clone(), error })?;
    if outcome.is_err() || published == 0 {
        return Ok(());
    }
    match publication.wait_for_receipt(config.patience, stop).unwrap_or(0) {
        confirmed if confirmed >= published => Ok(()),
        confirmed => Err(AgentError::NotConfirmed { confirmed, published }),
    }
}

fn summary(config: &AgentConfig) -> String {
    let source = match &config.source {
        Source::File(path) => path.display().to_string(),
        Source::Epochs(_) => "epochs in memory".to_owned(),
    };
    match config.speed {
        Speed::Maximum => format!("{source}, as fast as it goes"),
        Speed::Times(times) => format!("{source}, {times} times real time"),
    }
}
