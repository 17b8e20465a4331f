//! Epochs that were published and have not arrived.

use anyhow::bail;

use super::{Course, Group, TICK};
use crate::network::intake::Intake;
use crate::network::recovery::{Question, Step};

impl Group {
    /// Asks agents for missing epochs, and gives up those that they do not have.
    pub(super) fn recover(&mut self) {
        let now = self.now;
        if self.recovered_at.is_some_and(|last| now.saturating_sub(last) < TICK) {
            return;
        }
        self.recovered_at = Some(now);
        for step in self.recovery.steps(&self.intake, now) {
            match step {
                Step::Ask(question) => self.ask(question),
                Step::GiveUp { phone, sender, to, why } => self.give_up(phone, &sender, to, why),
            }
        }
        for phone in self.recovery.slow(now) {
            if !self.parts.aligner.awaits(phone) {
                self.give_up_gaps(phone);
            }
        }
    }

    /// Gives up the gaps of a phone that the group does not wait for: its newest epochs must not wait for missing ones before them.
    pub(super) fn give_up_gaps(&mut self, phone: usize) {
        let gap = |intake: &Intake| {
            let mut gaps = intake.gaps().filter(|(of, _, gap)| *of == phone && gap.waited_on);
            gaps.next().map(|(_, sender, gap)| (sender.to_owned(), gap.to))
        };
        while let Some((sender, to)) = gap(&self.intake) {
            self.give_up(phone, &sender, to, "the group did not wait for them any longer");
        }
    }

    fn ask(&mut self, question: Question) {
        let Some(name) = self.parts.phones.get(question.phone) else { return };
        if !self.parts.history.ask(name, question.clone())
            && let Some((sender, ..)) = question.epochs
        {
            self.recovery.answered(question.phone, &sender);
        }
    }

    fn give_up(&mut self, phone: usize, sender: &str, to: u64, why: &str) {
        let lost = self.intake.skip(phone, sender, to, why);
        let name = self.parts.phones.get(phone).map_or("?", String::as_str);
        tracing::warn!("{name}: {lost} epochs are lost: {why}");
        self.parts.receipts.note(name, sender, self.intake.receipt(phone, sender));
        self.align(phone);
        self.end_if_complete(phone);
    }

    /// Epochs that an agent has published and that do not come are lost: an error in a replay, counted live.
    pub(super) fn check_stragglers(&mut self) -> anyhow::Result<()> {
        for phone in 0..self.parts.phones.len() {
            let lost = if self.parts.course == Course::Replay { self.intake.lost(phone) } else { 0 };
            let missing = self.intake.shortfall(phone).unwrap_or(0);
            let Some(slot) = self.missing.get_mut(phone) else { continue };
            if missing == 0 && lost == 0 {
                *slot = None;
                continue;
            }
            // Waits as long as the number still falls.
            let known = slot.filter(|(before, _)| *before == missing);
            let (_, since) = *slot.insert(known.unwrap_or((missing, self.now)));
            if lost == 0 && self.now.saturating_sub(since) < self.grace {
                continue;
            }
            let name = self.parts.phones.get(phone).map_or("?", String::as_str);
            let missing = missing.saturating_add(lost);
            if self.parts.course == Course::Replay {
                bail!("{name}: {missing} published epochs did not arrive");
            }
            tracing::warn!("{name}: {missing} published epochs did not arrive");
            self.intake.give_up(phone);
            self.note_receipts(phone);
            self.align(phone);
            self.end_if_complete(phone);
        }
        Ok(())
    }

    /// Notes for the agents of a phone's finished runs how many epochs are given up.
    fn note_receipts(&self, phone: usize) {
        let Some(name) = self.parts.phones.get(phone) else { return };
        for (sender, _) in self.intake.finished_runs(phone) {
            self.parts.receipts.note(name, sender, self.intake.receipt(phone, sender));
        }
    }
}
