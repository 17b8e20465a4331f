//! One phone's runs.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use cofix_common::skips::{Reason, Skips};
use cofix_common::wire::{EpochMessage, PhoneStatus};

use super::read::Refusal;
use super::run::{Counted, Run};
use super::{Arrival, Finished, Notice};

/// Most runs remembered for one phone; a phone has one at a time, and one more after each restart. The oldest are forgotten.
pub(super) const MAXIMUM_RUNS: usize = 64;
/// Most lost epochs that are counted one by one; an agent may claim any number.
const MAXIMUM_LOST: u64 = 1_000_000;
/// The sender of samples without a sender.
const ANONYMOUS: &str = "anonymous";

/// How long an agent that says nothing keeps another one of its name out. Longer than a connection that is lost without a word stays open (10 s), and less than what agents keep.
const HOLD: Duration = Duration::from_secs(15);

/// The agent that speaks for a phone.
#[derive(Debug)]
struct Speaker {
    sender: String,
    heard: Duration,
}

/// When an epoch was heard, and whether it was asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Heard {
    pub(super) now: Duration,
    pub(super) from_history: bool,
}

/// One phone's runs.
#[derive(Debug, Default)]
pub(super) struct PhoneIntake {
    pub(super) runs: BTreeMap<String, Run>,
    /// The sender of the last status.
    current: Option<String>,
    speaker: Option<Speaker>,
    runs_seen: u64,
    pub(super) epochs_expected: Option<u64>,
    /// Messages whose turn it is.
    pub(super) ready: VecDeque<EpochMessage>,
    pub(super) skips: Skips,
    /// How many epochs are given up, of all runs.
    pub(super) lost: u64,
    /// Most messages of a run that wait for their turn.
    pub(super) most_parked: usize,
}

impl PhoneIntake {
    /// Of whose runs so many messages may wait for their turn.
    pub(super) fn new(most_parked: usize) -> Self {
        Self { most_parked, ..Self::default() }
    }

    /// The run that an arrival belongs to; a new run may push out the oldest.
    pub(super) fn run(&mut self, arrival: &Arrival) -> &mut Run {
        let sender = arrival.sender.as_deref().unwrap_or(ANONYMOUS);
        if !self.runs.contains_key(sender) {
            if self.runs.len() >= MAXIMUM_RUNS {
                self.forget_oldest();
            }
            self.runs_seen += 1;
        }
        let (rank, anonymous) = (self.runs_seen, arrival.sender.is_none());
        let new = || Run::new(rank, anonymous);
        let run = self.runs.entry(sender.to_owned()).or_insert_with(new);
        run.gone = false;
        run
    }

    /// Whether an epoch counts, of the agent that speaks for the phone; one that comes while nobody else does speaks from now on. Answers to questions decide
    /// nothing.
    fn listens_to(&mut self, arrival: &Arrival, heard: Heard) -> bool {
        let sender = arrival.sender.as_deref().unwrap_or(ANONYMOUS);
        let is_heard = !self.is_second(sender, heard.now);
        if is_heard && !heard.from_history {
            self.speaker = Some(Speaker { sender: sender.to_owned(), heard: heard.now });
        }
        is_heard
    }

    /// Whether another agent speaks for the phone.
    pub(super) fn is_second(&self, sender: &str, now: Duration) -> bool {
        self.speaker.as_ref().is_some_and(|speaker| {
            let is_there = self.runs.get(&speaker.sender).is_some_and(Run::is_living);
            speaker.sender != sender && is_there && now.saturating_sub(speaker.heard) < HOLD
        })
    }

    /// Forgets the oldest run, if possible neither a living run nor the current run.
    fn forget_oldest(&mut self) {
        let current = self.current.as_deref();
        let worth = |sender: &str, run: &Run| (Some(sender) == current, run.is_living(), run.rank());
        let oldest = self.runs.iter().min_by_key(|(sender, run)| worth(sender, run));
        let Some(sender) = oldest.map(|(sender, _)| sender.clone()) else { return };
        self.release_all(&sender, "too many agents came after it");
        self.runs.remove(&sender);
        self.skips.add(Reason::RunForgotten, || format!("{sender}; {MAXIMUM_RUNS} are remembered"));
    }

    pub(super) fn current_run(&self) -> Option<&Run> {
        self.runs.get(self.current.as_ref()?)
    }

    /// What could be read; what could not is counted.
    pub(super) fn read<T>(&mut self, read: Result<T, Refusal>) -> Option<T> {
        read.map_err(|(reason, text)| self.skips.add(reason, || text)).ok()
    }

    /// Takes an epoch. Whether it counts and is usable.
    pub(super) fn epoch(&mut self, arrival: &Arrival, message: EpochMessage, heard: Heard) -> bool {
        let sequence = message.sequence;
        if !self.listens_to(arrival, heard) {
            self.run(arrival).note_existence(sequence.saturating_add(1));
            self.skips.add(Reason::MessageOfSecondAgent, || numbered(&message));
            return false;
        }
        let has_room = self.runs.values().map(Run::parked).sum::<usize>() < self.most_parked;
        match self.run(arrival).count(sequence, heard.from_history, has_room) {
            Counted::New => {}
            Counted::Repeated { asked_for: false } => {
                self.skips.add(Reason::MessageReceivedTwice, || numbered(&message));
                return false;
            }
            Counted::Repeated { asked_for: true } | Counted::TooEarly => return false,
        }
        let message = message.sanitise(&arrival.phone, &mut self.skips);
        let is_usable = message.is_some();
        let sender = arrival.sender.as_deref().unwrap_or(ANONYMOUS);
        if let Some(run) = self.runs.get_mut(sender) {
            run.take(sequence, message, &mut self.ready);
        }
        is_usable
    }

    /// Checks that an epoch is not there already. (One that was asked for may be, and one of an agent that was gone tells that it is back.)
    pub(super) fn check_new(&self, arrival: &Arrival, message: &EpochMessage) -> Result<(), Refusal> {
        let run = self.runs.get(arrival.sender.as_deref().unwrap_or(ANONYMOUS));
        if run.is_some_and(|run| !run.gone && run.repeats(message.sequence)) {
            return Err((Reason::MessageReceivedTwice, numbered(message)));
        }
        Ok(())
    }

    pub(super) fn skip(&mut self, sender: &str, to: u64, why: &str) -> u64 {
        let Some(run) = self.runs.get_mut(sender) else { return 0 };
        let from = run.gap().map_or(0, |gap| gap.from);
        let lost = run.skip(to, &mut self.ready);
        self.count_lost(lost, || format!("{lost} from sequence {from} on: {why}"));
        lost
    }

    /// Gives up the epochs that are known to exist and have not arrived.
    pub(super) fn release_all(&mut self, sender: &str, why: &str) {
        while let Some(gap) = self.runs.get(sender).and_then(Run::gap) {
            self.skip(sender, gap.to, why);
        }
    }

    /// Gives up the epochs that an agent states as published and that never arrived.
    pub(super) fn give_up_rest(&mut self, sender: &str) {
        let Some(run) = self.runs.get_mut(sender) else { return };
        let missing = run.missing().unwrap_or(0);
        run.lost = run.lost.saturating_add(missing);
        self.count_lost(missing, || format!("{missing} are missing"));
    }

    fn count_lost(&mut self, lost: u64, describe: impl Fn() -> String) {
        self.lost = self.lost.saturating_add(lost);
        for _ in 0..lost.min(MAXIMUM_LOST) {
            self.skips.add(Reason::EpochsNotArrived, &describe);
        }
    }

    pub(super) fn status(&mut self, phone: usize, arrival: &Arrival, status: PhoneStatus) -> Option<Notice> {
        let sender = arrival.sender.clone().unwrap_or_else(|| ANONYMOUS.to_owned());
        match status {
            // An agent's history repeats its statuses.
            PhoneStatus::Started { .. } if self.run(arrival).started => None,
            PhoneStatus::Finished { .. } if self.run(arrival).finished.is_some() => None,
            PhoneStatus::Started { summary, epochs_expected } => {
                let other = self.runs.iter().find(|(other, run)| **other != sender && run.is_living());
                let other = other.map(|(other, _)| other.clone());
                let twice = other.is_some();
                if let Some(other) = other {
                    self.skips.add(Reason::TwoAgentsOfOneName, || format!("{sender} beside {other}"));
                }
                self.epochs_expected = epochs_expected;
                self.current = Some(sender);
                self.run(arrival).started = true;
                Some(Notice::Started { phone, summary, twice })
            }
            PhoneStatus::Finished { epochs_published, skips, error } => {
                self.current = Some(sender);
                let run = self.run(arrival);
                run.note_existence(epochs_published);
                run.finished = Some(Finished { epochs_published, skips, error: error.clone() });
                Some(Notice::Finished { phone, error })
            }
        }
    }
}

fn numbered(message: &EpochMessage) -> String {
    format!("sequence {} at {}", message.sequence, message.time_gps)
}
