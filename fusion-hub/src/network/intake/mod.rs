//! Decodes, checks and counts arrivals, phone by phone, in the order of their sequence numbers. No I/O.
//!
//! An agent's run is identified by its sender (the id of its Zenoh session). Its messages are numbered from 0, and its last status states how
//! many there were: so the hub knows whether it has all, and which to ask the agent for. A message waits until those before it have arrived or
//! are given up.
//!
//! One agent at a time speaks for a phone. A second one of that name is refused until the first has finished, is gone, or has said nothing for a while; the
//! hub then asks it for what was refused.

mod phone;
mod read;
mod run;
pub(crate) mod words;

use std::time::Duration;

use cofix_common::skips::{Reason, Skips};
use cofix_common::wire::{EpochMessage, Receipt};

use phone::{Heard, PhoneIntake};
use read::Part;
use run::{MAXIMUM_PARKED, Run};

pub use run::Gap;

use super::Event;

/// Bytes from the network, with their phone and sender.
#[derive(Clone, Debug)]
pub struct Arrival {
    /// The phone in the key.
    pub phone: String,
    /// The id of the sender's Zenoh session, if the sample states it.
    pub sender: Option<String>,
    /// The message.
    pub bytes: Vec<u8>,
}

/// The last status of an agent.
#[derive(Clone, Debug, PartialEq)]
pub struct Finished {
    /// Epochs that it published.
    pub epochs_published: u64,
    /// What it skipped.
    pub skips: Skips,
    /// Why it ended early, if it did.
    pub error: Option<String>,
}

/// Why something was refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The phone's index; `None`: it is of no phone of the group.
    pub phone: Option<usize>,
    /// Why.
    pub reason: Reason,
    /// The facts.
    pub text: String,
}

/// Takes the arrivals of all phones.
#[derive(Debug)]
pub struct Intake {
    /// Time of the current step, since the start.
    now: Duration,
    names: Vec<String>,
    phones: Vec<PhoneIntake>,
    skips: Skips,
}

/// The effect of a status.
#[derive(Clone, Debug, PartialEq)]
pub enum Notice {
    /// An agent of the phone has begun.
    Started {
        /// The phone's index.
        phone: usize,
        /// Its summary of source and speed.
        summary: String,
        /// Whether another agent of that name is still there.
        twice: bool,
    },
    /// An agent of the phone has ended.
    Finished {
        /// The phone's index.
        phone: usize,
        /// Why it ended early, if it did.
        error: Option<String>,
    },
}

/// A part of an answer to a question about an agent's history.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// The agent of the phone stated which epochs it keeps.
    Kept(usize),
    /// It repeated an epoch of the phone that was missing.
    Epoch(usize),
    /// It repeated a status that was missing.
    Status(Notice),
}

impl Intake {
    /// For phones of these names.
    pub fn new(names: &[String]) -> Self {
        Self {
            now: Duration::ZERO,
            names: names.to_vec(),
            phones: names.iter().map(|_| PhoneIntake::new(MAXIMUM_PARKED)).collect(),
            skips: Skips::default(),
        }
    }

    /// What arrives from now on arrives at this time, since the start.
    pub fn set_time(&mut self, now: Duration) {
        self.now = now;
    }

    /// Counts messages of a phone that were too many and were not let in. `true` for its first.
    pub fn shed(&mut self, phone: &str, count: u64) -> bool {
        let index = self.index(phone);
        let known = index.and_then(|index| self.phones.get_mut(index)).map(|intake| &mut intake.skips);
        let skips = known.unwrap_or(&mut self.skips);
        let is_first = skips.count(Reason::MessageBeyondRate) == 0;
        skips.add_many(Reason::MessageBeyondRate, count, || words::tamed(phone));
        is_first
    }

    /// For phones of these names, all of whose messages come before the first is taken out: any number may wait for their turn.
    pub fn of_a_whole_trial(names: &[String]) -> Self {
        let mut intake = Self::new(names);
        intake.phones.iter_mut().for_each(|phone| phone.most_parked = usize::MAX);
        intake
    }

    /// Index of a phone of the group.
    pub fn index(&self, phone: &str) -> Option<usize> {
        self.names.iter().position(|name| name == phone)
    }

    /// Takes an epoch. The phone, whose [`Intake::next_ready`] may have messages now; `None`, counted, when it is of no phone of the group, no
    /// message, absurd, or there already.
    pub fn epoch(&mut self, arrival: &Arrival) -> Option<usize> {
        let now = self.now;
        let (phone, intake) = self.intake_of(arrival)?;
        let message = intake.read(read::epoch(arrival))?;
        intake.epoch(arrival, message, Heard { now, from_history: false }).then_some(phone)
    }

    /// The next of a phone's messages, in order.
    pub fn next_ready(&mut self, phone: usize) -> Option<EpochMessage> {
        self.phones.get_mut(phone)?.ready.pop_front()
    }

    /// Takes a status. `None`, counted, when it is of no phone of the group or no message; `None` also when it is known.
    pub fn status(&mut self, arrival: &Arrival) -> Option<Notice> {
        let (phone, intake) = self.intake_of(arrival)?;
        let message = intake.read(read::status(arrival))?;
        intake.status(phone, arrival, message.status)
    }

    /// Takes a part of an agent's answer to a question about its history. `None`, counted, when it is none.
    pub fn history(&mut self, arrival: &Arrival) -> Option<Answer> {
        let now = self.now;
        let (phone, intake) = self.intake_of(arrival)?;
        match intake.read(read::history(arrival))? {
            Part::Kept(kept) => {
                intake.run(arrival).note_kept(kept.first, kept.next);
                Some(Answer::Kept(phone))
            }
            Part::Epoch(message) => intake
                .epoch(arrival, *message, Heard { now, from_history: true })
                .then_some(phone)
                .map(Answer::Epoch),
            Part::Status(message) => intake.status(phone, arrival, message.status).map(Answer::Status),
        }
    }

    /// Why an event is refused, whatever else comes, if it is: it is of no phone of the group, no message, or an epoch that is there already.
    pub fn refusal(&self, event: &Event) -> Option<Refusal> {
        let (Event::Epoch(arrival) | Event::Status(arrival) | Event::History(arrival)) = event else {
            return None;
        };
        let Some((phone, intake)) = self.index(&arrival.phone).zip(self.phone(&arrival.phone)) else {
            return Some(Refusal { phone: None, reason: Reason::PhoneUnknown, text: self.stranger(arrival) });
        };
        let refused = match event {
            Event::Epoch(_) => read::epoch(arrival).and_then(|message| intake.check_new(arrival, &message)),
            Event::Status(_) => read::status(arrival).map(drop),
            _ => read::history(arrival).map(drop),
        };
        refused.err().map(|(reason, text)| Refusal { phone: Some(phone), reason, text })
    }

    /// Whether something of that phone was refused for that reason before.
    pub fn has_refused(&self, refusal: &Refusal) -> bool {
        let skips = refusal.phone.map_or(Some(&self.skips), |phone| self.phone_skips(phone));
        skips.is_some_and(|skips| skips.count(refusal.reason) > 0)
    }

    /// Counts what was refused of a phone; `None`: of no phone of the group.
    pub fn refuse(&mut self, phone: Option<&str>, refused: &Skips) {
        let index = phone.and_then(|phone| self.index(phone));
        match index.and_then(|index| self.phones.get_mut(index)) {
            Some(intake) => intake.skips.merge(refused),
            None => self.skips.merge(refused),
        }
    }

    /// What is missing of the phones' runs: phone, sender, gap. Nothing of agents that are gone, unless later epochs wait for it.
    pub fn gaps(&self) -> impl Iterator<Item = (usize, &str, Gap)> {
        let runs = self.phones.iter().enumerate().flat_map(|(phone, intake)| {
            let asked = intake.runs.iter().filter(|(sender, _)| !intake.is_second(sender, self.now));
            asked.map(move |(sender, run)| (phone, sender, run))
        });
        runs.filter_map(|(phone, sender, run)| Some((phone, sender.as_str(), run.gap()?, run.gone)))
            .filter(|(_, _, gap, gone)| gap.waited_on || !gone)
            .map(|(phone, sender, gap, _)| (phone, sender, gap))
    }

    /// Gives up a run's missing epochs before sequence number `to`, and counts them. Returns their number.
    pub fn skip(&mut self, phone: usize, sender: &str, to: u64, why: &str) -> u64 {
        let Some(intake) = self.phones.get_mut(phone) else { return 0 };
        intake.skip(sender, to, why)
    }

    /// How many of the phone's epochs are given up.
    pub fn lost(&self, phone: usize) -> u64 {
        self.phones.get(phone).map_or(0, |intake| intake.lost)
    }

    /// Whether the phone's last agent has ended, no other of that name lives, and all epochs are here or given up.
    pub fn is_complete(&self, phone: usize) -> bool {
        let Some(intake) = self.phones.get(phone) else { return false };
        intake.current_run().is_some_and(|run| run.finished.is_some())
            && !intake.runs.values().any(Run::is_living)
            && self.shortfall(phone) == Some(0)
    }

    /// How many epochs of the phone's agents that have ended are missing and not given up; `None` while the last one runs.
    pub fn shortfall(&self, phone: usize) -> Option<u64> {
        let intake = self.phones.get(phone)?;
        intake.current_run()?.finished.as_ref()?;
        Some(intake.runs.values().filter_map(Run::missing).fold(0, u64::saturating_add))
    }

    /// Gives up the missing epochs of agents that have finished, and counts them.
    pub fn give_up(&mut self, phone: usize) {
        let Some(intake) = self.phones.get_mut(phone) else { return };
        let finished = intake.runs.iter().filter(|(_, run)| run.finished.is_some());
        let senders: Vec<String> = finished.map(|(sender, _)| sender.clone()).collect();
        for sender in senders {
            intake.release_all(&sender, "its agent has finished");
            intake.give_up_rest(&sender);
        }
    }

    /// Gives up, and counts, the epochs that are known to exist and have not arrived, since the session ends.
    pub fn release_all(&mut self) {
        for intake in &mut self.phones {
            for sender in intake.runs.keys().cloned().collect::<Vec<_>>() {
                intake.release_all(&sender, "the session ended");
            }
        }
    }

    /// The phone's agents are gone, whether they finished or not.
    pub fn gone(&mut self, phone: usize) {
        if let Some(intake) = self.phones.get_mut(phone) {
            intake.runs.values_mut().for_each(|run| run.gone = true);
        }
    }

    /// The senders of the phone's runs that have finished, with the number of epochs received.
    pub fn finished_runs(&self, phone: usize) -> impl Iterator<Item = (&str, u64)> {
        let runs = self.phones.get(phone).into_iter().flat_map(|intake| &intake.runs);
        runs.filter(|(_, run)| run.finished.is_some()).map(|(sender, run)| (sender.as_str(), run.received))
    }

    /// The last status of the phone's last agent.
    pub fn finished(&self, phone: usize) -> Option<&Finished> {
        self.phones.get(phone)?.current_run()?.finished.as_ref()
    }

    /// How many epochs of a sender's run have arrived, and how many are given up.
    pub fn receipt(&self, phone: usize, sender: &str) -> Receipt {
        let run = self.phones.get(phone).and_then(|intake| intake.runs.get(sender));
        run.map_or(Receipt::default(), |run| Receipt { received: run.received, lost: run.lost })
    }

    /// How many epochs the phones' agents have announced.
    pub fn expected(&self) -> u64 {
        self.phones.iter().filter_map(|intake| intake.epochs_expected).sum()
    }

    /// Parts of a phone's messages that were skipped.
    pub fn phone_skips(&self, phone: usize) -> Option<&Skips> {
        self.phones.get(phone).map(|intake| &intake.skips)
    }

    /// Messages of phones outside the group.
    pub const fn skips(&self) -> &Skips {
        &self.skips
    }

    fn intake_of(&mut self, arrival: &Arrival) -> Option<(usize, &mut PhoneIntake)> {
        let Some(phone) = self.index(&arrival.phone) else {
            let text = self.stranger(arrival);
            self.skips.add(Reason::PhoneUnknown, || text);
            return None;
        };
        self.phones.get_mut(phone).map(|intake| (phone, intake))
    }

    fn phone(&self, name: &str) -> Option<&PhoneIntake> {
        self.phones.get(self.index(name)?)
    }

    fn stranger(&self, arrival: &Arrival) -> String {
        format!("'{}'; the session has {}", words::tamed(&arrival.phone), self.names.join(", "))
    }
}

#[cfg(test)]
mod tests;
