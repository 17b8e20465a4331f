//! A group and its journal: what is taken in is written first, and what was written is done again.

use std::time::Duration;

use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::time::GpsTime;

use super::Group;
use crate::journal::{Entry, Journal};
use crate::network::{Event, HistoryQuestions};

impl Group {
    /// Does again what a journal tells. Returns whether the session came to its end there; if not, it can go on.
    ///
    /// # Errors
    /// As [`Group::work`].
    pub fn retrace(&mut self, entries: impl Iterator<Item = Entry>) -> anyhow::Result<bool> {
        let mut events = Vec::new();
        for entry in entries {
            match entry {
                Entry::Event(event) => events.push(event),
                Entry::Step { now, wall_gps } => self.step(events.drain(..), now, wall_gps)?,
                Entry::Resumed => self.forget_agents(),
                Entry::Ended => {
                    self.end(events)?;
                    return Ok(true);
                }
            }
        }
        self.unused = events;
        Ok(false)
    }

    /// Ends a session that was retraced and did not come to its end.
    ///
    /// # Errors
    /// As [`Group::work`].
    pub fn end_retraced(&mut self) -> anyhow::Result<()> {
        self.end(Vec::new())
    }

    /// Goes on after [`Group::retrace`], with questions to the agents that are there now.
    pub fn go_on(&mut self, history: HistoryQuestions) {
        self.parts.history = history;
        self.forget_agents();
    }

    /// Writes everything to a journal from now on, before it is used.
    pub fn write_to(&mut self, journal: Journal) {
        self.journal = Some(journal);
    }

    /// Why the journal is incomplete, if it is.
    pub fn journal_failure(&self) -> Option<&str> {
        self.journal_failure.as_deref()
    }

    /// Agents of an earlier hub: who is there is told anew, and no question to them will be answered.
    fn forget_agents(&mut self) {
        self.alive.fill(false);
        self.recovery.forget();
        self.recovered_at = None;
    }

    pub(super) fn note_step(&mut self, events: &[Event], now: Duration, wall_gps: GpsTime) {
        self.note(|journal| {
            events.iter().try_for_each(|event| journal.event(event))?;
            journal.step(now, wall_gps)
        });
    }

    pub(super) fn note_end(&mut self, last: &[Event]) {
        self.note(|journal| {
            last.iter().try_for_each(|event| journal.event(event))?;
            journal.end()
        });
    }

    pub(super) fn note_fused(&mut self, epoch: &FusedEpoch) {
        self.note(|journal| journal.fused(epoch));
    }

    /// Closes the journal: the session is over.
    pub(super) fn close_journal(&mut self) {
        if let Some(Err(error)) = self.journal.take().map(Journal::finish) {
            self.note_failure(&error);
        }
    }

    /// A journal that cannot be written ends; the group goes on.
    fn note(&mut self, write: impl FnOnce(&mut Journal) -> anyhow::Result<()>) {
        if let Some(Err(error)) = self.journal.as_mut().map(write) {
            self.note_failure(&error);
            self.journal = None;
        }
    }

    fn note_failure(&mut self, error: &anyhow::Error) {
        tracing::error!("{error:#}; the group goes on without its journal");
        self.journal_failure = Some(format!("{error:#}"));
    }
}
