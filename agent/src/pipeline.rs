//! One phone's processing: correct → solve → RAIM → local filter, an epoch at a time. No I/O.

use std::sync::Arc;

use cofix_common::gnss::ObservationEpoch;
use cofix_common::orbit::Products;
use cofix_common::skips::Skips;
use cofix_common::wire::EpochMessage;

/// What the pipeline may be told.
#[derive(Clone, Debug, Default)]
pub struct PipelineOptions {}

/// One phone's pipeline.
pub struct PhonePipeline {
    skips: Skips,
}

impl PhonePipeline {
    /// A pipeline for the phone `name`.
    pub fn new(_name: &str, _products: Arc<Products>, _options: PipelineOptions) -> Self {
        Self { skips: Skips::default() }
    }

    /// Processes one epoch; epochs come in order of time.
    pub fn process(&mut self, _epoch: &ObservationEpoch) -> EpochMessage {
        todo!()
    }

    /// What was skipped so far.
    pub fn skips(&self) -> &Skips {
        &self.skips
    }
}
