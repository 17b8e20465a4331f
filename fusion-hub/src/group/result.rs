//! The end of a group: agents are told, the result is checked and reported.

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use anyhow::bail;
use cofix_agent::Stop;
use cofix_common::skips::Skips;

use super::{Group, TICK};
use crate::network::Event;
use crate::outputs::Outputs;
use crate::report::Report;

/// Longest wait for the end of agents that were told so.
const LONGEST_STAY_ONCE_TOLD: Duration = Duration::from_secs(1);

impl Group {
    /// Waits until the agents that have finished know that all their epochs arrived, for a limited time: they ask, and end when they know.
    pub fn wait_for_agents(&mut self, events: &Receiver<Event>, stop: &Stop) {
        let start = Instant::now();
        let mut told_since: Option<Instant> = None;
        while self.alive.iter().any(|alive| *alive)
            && start.elapsed() < self.longest_stay
            && !stop.is_requested()
        {
            match events.recv_timeout(TICK) {
                Ok(Event::Alive { phone, alive }) => self.note_alive(&phone, alive),
                Err(RecvTimeoutError::Disconnected) => return,
                _ => {}
            }
            if !self.all_told() {
                told_since = None;
            } else if told_since.get_or_insert_with(Instant::now).elapsed() > LONGEST_STAY_ONCE_TOLD {
                return;
            }
        }
    }

    /// Whether all agents that have ended were told of all their epochs.
    fn all_told(&self) -> bool {
        self.parts.phones.iter().enumerate().all(|(phone, name)| {
            self.intake.finished_runs(phone).all(|(sender, received)| {
                received == 0 || self.parts.receipts.was_told(name, sender, received)
            })
        })
    }

    /// The report, and the outputs to finish.
    pub fn report(&mut self) -> (Report, &mut Outputs) {
        let mut skips = self.intake.skips().clone();
        skips.merge(self.parts.engine.skips());
        let phones = self.parts.outputs.tally.phones(|phone| self.phone_skips(phone));
        let (group, lost) = (self.parts.name.clone(), self.lost());
        let report = Report { group, lost, phones, skips, ..self.parts.outputs.report() };
        (report, &mut self.parts.outputs)
    }

    /// Checks the result of a session that is over.
    ///
    /// # Errors
    /// When a phone had nothing usable, or no two phones were there at one time.
    pub fn check_result(&self) -> anyhow::Result<()> {
        let tally = &self.parts.outputs.tally;
        for (index, name) in self.parts.phones.iter().enumerate() {
            if tally.usable_epochs(index) == 0 {
                let skips = self.phone_skips(index);
                let why = if skips.is_empty() { "nothing was skipped".to_owned() } else { skips.to_string() };
                bail!("{name}: no epoch with a usable observation, so there is nothing to fuse: {why}");
            }
        }
        if self.parts.phones.len() > 1 && tally.common_epochs == 0 {
            let span = |(index, name): (usize, &String)| {
                let span = tally.span_of(index);
                span.map_or_else(|| format!("{name} has none"), |(a, b)| format!("{name} from {a} to {b}"))
            };
            let spans: Vec<String> = self.parts.phones.iter().enumerate().map(span).collect();
            bail!("the phones have no common time, so there is nothing to fuse: {}", spans.join(", "));
        }
        Ok(())
    }

    pub(super) fn phone_skips(&self, phone: usize) -> Skips {
        let mut skips =
            self.intake.finished(phone).map(|finished| finished.skips.clone()).unwrap_or_default();
        for more in [self.intake.phone_skips(phone), self.parts.aligner.skips(phone)].into_iter().flatten() {
            skips.merge(more);
        }
        skips
    }
}
