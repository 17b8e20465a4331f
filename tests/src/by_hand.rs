//! An agent's messages and their publication as separate parts, so that faults can be put between them.

use std::sync::Arc;
use std::time::Duration;

use anyhow::{bail, ensure};
use cofix_agent::publication::Publication;
use cofix_agent::{AgentConfig, ProductSource, Source, Stop};
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
use cofix_common::wire::EpochMessage;
use cofix_hub::replay::Plan;

/// The messages that the agent of a simulated phone would send.
///
/// # Errors
/// When the plan is not of simulated phones.
pub fn messages(plan: &Plan, phone: usize) -> anyhow::Result<Vec<EpochMessage>> {
    let (ProductSource::Loaded(products), Source::Epochs(epochs)) =
        (&plan.products, &plan.phones[phone].source)
    else {
        bail!("the phone is not simulated")
    };
    let mut pipeline =
        PhonePipeline::new(&plan.phones[phone].name, Arc::clone(products), PipelineOptions::default());
    Ok(epochs.iter().map(|epoch| pipeline.process(epoch)).collect())
}

/// The publication of a phone's agent, which keeps a hundred epochs, once the hub listens.
///
/// # Errors
/// When it cannot be declared, or nobody listens within ten seconds.
pub fn publication(plan: &Plan, phone: usize, endpoints: &[String]) -> anyhow::Result<Publication> {
    let agent = AgentConfig {
        connect: endpoints.to_vec(),
        kept_messages: 100,
        ..AgentConfig::new(&plan.group, &plan.phones[phone].name, Source::Epochs(Arc::default()))
    };
    publication_of(&agent)
}

/// The publication of an agent, once the hub listens.
///
/// # Errors
/// As of [`publication`].
pub fn publication_of(agent: &AgentConfig) -> anyhow::Result<Publication> {
    let publication = Publication::declare(crate::connect(agent)?, agent)?;
    ensure!(publication.wait_for_listener(Duration::from_secs(10), &Stop::default())?, "nobody listens");
    Ok(publication)
}
