//! The pipeline's result for a recording: masks that need orbits, and RAIM.

use std::fmt;
use std::sync::Arc;

use cofix_common::gnss::ObservationEpoch;
use cofix_common::integrity::Verdict;
use cofix_common::measurement::Usage;
use cofix_common::orbit::Products;
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
use cofix_common::skips::Skips;
use serde::Serialize;

use super::directions::{DirectionReport, Directions};
use crate::source::products::note_shortcomings;
use crate::source::records::Records;

/// Counts of a run of the pipeline over all epochs.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Trial {
    /// Epochs with a position of their own.
    pub solved: u64,
    /// Epochs that RAIM calls reliable.
    pub reliable: u64,
    /// Observations used in those positions.
    pub used: u64,
    /// Observations that RAIM excluded.
    pub excluded: u64,
    /// The phone's own directions of satellites against those of the orbits, where it states them.
    pub directions: Option<DirectionReport>,
    /// Observations left out by masks and for other reasons, by reason.
    pub skips: Skips,
}

/// A trial in progress.
pub(super) struct Running {
    products: Arc<Products>,
    is_first: bool,
    /// Shortcomings of the products, and weeks that were not rolled over.
    shortcomings: Skips,
    pipeline: PhonePipeline,
    counts: Trial,
    directions: Directions,
}

impl Running {
    pub(super) fn new(products: Arc<Products>, options: PipelineOptions) -> Self {
        let pipeline = PhonePipeline::new("trial", Arc::clone(&products), options);
        Self {
            products,
            is_first: true,
            shortcomings: Skips::default(),
            pipeline,
            counts: Trial::default(),
            directions: Directions::default(),
        }
    }

    /// The epoch that `records` gave last.
    pub(super) fn epoch(&mut self, epoch: &ObservationEpoch, records: &Records) {
        let is_first = std::mem::take(&mut self.is_first);
        note_shortcomings(epoch.time_gps, is_first, &self.products, &mut self.shortcomings);
        let message = self.pipeline.process_last(epoch, records.decoder());
        self.directions.add(&message, records.decoder().phone().directions());
        let counts = &mut self.counts;
        counts.solved += u64::from(message.wls.is_some());
        counts.reliable += u64::from(message.raim.verdict == Verdict::Reliable);
        counts.used += message.wls.map_or(0, |solution| u64::from(solution.used));
        counts.excluded +=
            message.observations.iter().filter(|observation| observation.usage != Usage::Used).count() as u64;
    }

    pub(super) fn end(self) -> Trial {
        let mut skips = self.pipeline.skips();
        skips.merge(&self.shortcomings);
        Trial { skips, directions: self.directions.report(), ..self.counts }
    }
}

impl fmt::Display for Trial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { solved, reliable, used, excluded, .. } = self;
        writeln!(
            f,
            "  positions   {solved} epochs of {used} observations; RAIM: {reliable} reliable, {excluded} observations excluded"
        )?;
        self.directions.iter().try_for_each(|directions| write!(f, "{directions}"))?;
        for (reason, skip) in self.skips.iter() {
            writeln!(f, "  of which    {} × {reason}, first: {}", skip.count, skip.first)?;
        }
        Ok(())
    }
}
