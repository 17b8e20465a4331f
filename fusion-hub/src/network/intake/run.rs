//! One run of an agent: its messages in order, whatever the order in which they came.

use std::collections::{BTreeMap, VecDeque};

use cofix_common::wire::EpochMessage;

use super::Finished;

/// Most messages of a phone that wait for their turn, whatever senders they name. Further ones are dropped: the agent keeps them.
pub(super) const MAXIMUM_PARKED: usize = 1_024;

/// The outcome of counting a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Counted {
    /// It is new and counts.
    New,
    /// It was there already, as is expected when it was asked for.
    Repeated {
        /// Whether it was among those asked for.
        asked_for: bool,
    },
    /// It is new, and there is no room for it until those before it have arrived.
    TooEarly,
}

/// Epochs of a run that exist and have not arrived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// The first sequence number that is missing.
    pub from: u64,
    /// The first after it that has arrived, or does not exist yet.
    pub to: u64,
    /// Whether later epochs have arrived and wait.
    pub waited_on: bool,
    /// The oldest epoch that its agent keeps, as far as the agent has stated.
    pub kept_from: u64,
}

#[derive(Debug, Default)]
pub(super) struct Run {
    /// Sequence number of the message whose turn it is.
    next: u64,
    /// One more than the highest sequence number known to exist.
    exist: u64,
    /// Messages that arrived before their turn; `None` for an unusable message.
    parked: BTreeMap<u64, Option<EpochMessage>>,
    /// Up to which sequence number the agent's history was received.
    fetched_to: u64,
    kept_from: u64,
    /// How many have arrived.
    pub(super) received: u64,
    /// How many are missing and no longer expected.
    pub(super) lost: u64,
    /// Whether its agent has stated that it started.
    pub(super) started: bool,
    pub(super) finished: Option<Finished>,
    /// Whether its agent is gone without having finished; it may come back.
    pub(super) gone: bool,
    /// Place among the phone's runs by first message.
    rank: u64,
    /// Whether its sender is unknown, so that no agent can be asked for missing epochs.
    anonymous: bool,
}

impl Run {
    /// The phone's run number `rank`.
    pub(super) fn new(rank: u64, anonymous: bool) -> Self {
        Self { rank, anonymous, ..Self::default() }
    }

    /// Its place among the phone's runs.
    pub(super) const fn rank(&self) -> u64 {
        self.rank
    }

    /// Whether its agent has started, has not finished, and is there.
    pub(super) const fn is_living(&self) -> bool {
        self.started && self.finished.is_none() && !self.gone
    }

    /// How many epochs are missing of a run that has finished, without those given up.
    pub(super) fn missing(&self) -> Option<u64> {
        let settled = self.received.saturating_add(self.lost);
        self.finished.as_ref().map(|finished| finished.epochs_published.saturating_sub(settled))
    }

    /// Notes that the epochs before sequence number `exist` were published.
    pub(super) fn note_existence(&mut self, exist: u64) {
        self.exist = self.exist.max(exist);
    }

    /// Notes what its agent keeps.
    pub(super) fn note_kept(&mut self, first: u64, next: u64) {
        self.kept_from = self.kept_from.max(first.min(next));
        self.note_existence(next);
    }

    /// How many of its messages wait for their turn.
    pub(super) fn parked(&self) -> usize {
        self.parked.len()
    }

    /// Whether a message of this number is new. One whose turn it is not yet needs room to wait.
    pub(super) fn count(&mut self, sequence: u64, from_history: bool, has_room: bool) -> Counted {
        let asked_for = from_history || sequence < self.fetched_to;
        if from_history {
            self.fetched_to = self.fetched_to.max(sequence.saturating_add(1));
        }
        if sequence < self.next || self.parked.contains_key(&sequence) {
            return Counted::Repeated { asked_for };
        }
        self.note_existence(sequence.saturating_add(1));
        if sequence != self.next && !self.anonymous && !has_room {
            return Counted::TooEarly;
        }
        self.received += 1;
        Counted::New
    }

    /// Whether a message of this number is there already and was not asked for.
    pub(super) fn repeats(&self, sequence: u64) -> bool {
        sequence >= self.fetched_to && (sequence < self.next || self.parked.contains_key(&sequence))
    }

    /// Takes a message that counts; messages whose turn it is go to `ready`.
    pub(super) fn take(
        &mut self,
        sequence: u64,
        message: Option<EpochMessage>,
        ready: &mut VecDeque<EpochMessage>,
    ) {
        if self.anonymous {
            self.next = sequence;
        }
        self.parked.insert(sequence, message);
        self.release(ready);
    }

    fn release(&mut self, ready: &mut VecDeque<EpochMessage>) {
        while let Some(message) = self.parked.remove(&self.next) {
            self.next = self.next.saturating_add(1);
            ready.extend(message);
        }
    }

    /// The gap before the next message, or at the end.
    pub(super) fn gap(&self) -> Option<Gap> {
        let parked = self.parked.keys().next().copied();
        let to = parked.unwrap_or(self.exist);
        let gap = Gap { from: self.next, to, waited_on: parked.is_some(), kept_from: self.kept_from };
        (!self.anonymous && gap.from < gap.to).then_some(gap)
    }

    /// Gives up the missing epochs before sequence number `to`. Returns their number.
    pub(super) fn skip(&mut self, to: u64, ready: &mut VecDeque<EpochMessage>) -> u64 {
        let Some(gap) = self.gap() else { return 0 };
        let to = to.clamp(gap.from, gap.to);
        self.next = to;
        self.lost = self.lost.saturating_add(to - gap.from);
        self.release(ready);
        to - gap.from
    }
}
