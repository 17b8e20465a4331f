//! What arrives: decoded, checked and counted, phone by phone, in the order of its sequence numbers. No I/O.
//!
//! An agent's run is told from another by its sender (the id of its Zenoh session). Its messages are numbered from 0, and its last
//! status says how many there were: so the hub knows whether it has everything, and what to ask the agent for. A message waits until the
//! ones before it have come or are given up.

mod desk;
mod run;

use cofix_common::skips::{Reason, Skips};
use cofix_common::wire::{EpochMessage, KeptMessage, MessageKind, Receipt, StatusMessage, WireError, decode};

use desk::Desk;
pub use run::Gap;
use run::{Counted, Run};

/// Bytes from the network, and who they concern.
#[derive(Clone, Debug)]
pub struct Arrival {
    /// The phone in the key.
    pub phone: String,
    /// Who sent them, if the sample says so.
    pub sender: Option<String>,
    /// The message.
    pub bytes: Vec<u8>,
}

/// What an agent said at its end.
#[derive(Clone, Debug, PartialEq)]
pub struct Finished {
    /// Epochs that it published.
    pub epochs_published: u64,
    /// What it skipped.
    pub skips: Skips,
    /// Why it ended early, if it did.
    pub error: Option<String>,
}

/// The hub's desk for arrivals.
#[derive(Debug)]
pub struct Intake {
    names: Vec<String>,
    desks: Vec<Desk>,
    skips: Skips,
}

/// What a status amounts to.
#[derive(Clone, Debug, PartialEq)]
pub enum Notice {
    /// An agent of the phone has begun.
    Started {
        /// The phone's index.
        phone: usize,
        /// Its own words.
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
    /// The agent of the phone said what it keeps.
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
            names: names.to_vec(),
            desks: names.iter().map(|_| Desk::default()).collect(),
            skips: Skips::default(),
        }
    }

    /// Index of a phone of the group.
    pub fn index(&self, phone: &str) -> Option<usize> {
        self.names.iter().position(|name| name == phone)
    }

    /// Takes an epoch. The phone, whose [`Intake::next_ready`] may have messages now; `None`, counted, when it is of no phone of the group, no
    /// message, absurd, or there already.
    pub fn epoch(&mut self, arrival: &Arrival) -> Option<usize> {
        self.count_epoch(arrival, false)
    }

    /// The next of a phone's messages, in order.
    pub fn next_ready(&mut self, phone: usize) -> Option<EpochMessage> {
        self.desks.get_mut(phone)?.ready.pop_front()
    }

    /// Takes a status. `None`, counted, when it is of no phone of the group or no message; `None` also when it is known.
    pub fn status(&mut self, arrival: &Arrival) -> Option<Notice> {
        let (phone, desk) = self.desk(arrival)?;
        let message = match decode::<StatusMessage>(&arrival.bytes) {
            Ok(message) if message.phone == arrival.phone => message,
            Ok(message) => {
                desk.skips.add(Reason::StatusOfOtherPhone, || format!("it names '{}'", message.phone));
                return None;
            }
            Err(error) => {
                desk.skips.add(Reason::StatusUnreadable, || error.to_string());
                return None;
            }
        };
        desk.status(phone, arrival, message.status)
    }

    /// Takes a part of an agent's answer to a question about its history. `None`, counted, when it is none.
    pub fn history(&mut self, arrival: &Arrival) -> Option<Answer> {
        let error = match decode::<KeptMessage>(&arrival.bytes) {
            Ok(kept) if kept.phone == arrival.phone => {
                let (phone, desk) = self.desk(arrival)?;
                desk.run(arrival).note_kept(kept.first, kept.next);
                return Some(Answer::Kept(phone));
            }
            Ok(kept) => format!("it names '{}'", kept.phone),
            Err(WireError::WrongKind { found: MessageKind::Epoch, .. }) => {
                return self.count_epoch(arrival, true).map(Answer::Epoch);
            }
            Err(WireError::WrongKind { found: MessageKind::Status, .. }) => {
                return self.status(arrival).map(Answer::Status);
            }
            Err(error) => error.to_string(),
        };
        let (_, desk) = self.desk(arrival)?;
        desk.skips.add(Reason::HistoryUnreadable, || error);
        None
    }

    fn count_epoch(&mut self, arrival: &Arrival, from_history: bool) -> Option<usize> {
        let (phone, desk) = self.desk(arrival)?;
        let message = match decode::<EpochMessage>(&arrival.bytes) {
            Ok(message) => message,
            Err(error) => {
                desk.skips.add(Reason::MessageUnreadable, || error.to_string());
                return None;
            }
        };
        let sequence = message.sequence;
        match desk.run(arrival).count(sequence, from_history) {
            Counted::New => {}
            Counted::Repeated { asked_for: false } => {
                let time = message.time_gps;
                desk.skips.add(Reason::MessageReceivedTwice, || format!("sequence {sequence} at {time}"));
                return None;
            }
            Counted::Repeated { asked_for: true } | Counted::TooEarly => return None,
        }
        let message = message.sanitise(&arrival.phone, &mut desk.skips);
        let is_usable = message.is_some();
        desk.take(arrival, sequence, message);
        is_usable.then_some(phone)
    }

    /// What is missing of the phones' runs: phone, sender, gap. Nothing of agents that are gone, unless later epochs wait for it.
    pub fn gaps(&self) -> impl Iterator<Item = (usize, &str, Gap)> {
        let runs = self
            .desks
            .iter()
            .enumerate()
            .flat_map(|(phone, desk)| desk.runs.iter().map(move |(sender, run)| (phone, sender, run)));
        runs.filter_map(|(phone, sender, run)| Some((phone, sender.as_str(), run.gap()?, run.gone)))
            .filter(|(_, _, gap, gone)| gap.waited_on || !gone)
            .map(|(phone, sender, gap, _)| (phone, sender, gap))
    }

    /// Does not wait any longer for a run's missing epochs before sequence number `to`, and counts them. How many they are.
    pub fn skip(&mut self, phone: usize, sender: &str, to: u64, why: &str) -> u64 {
        let Some(desk) = self.desks.get_mut(phone) else { return 0 };
        desk.skip(sender, to, why)
    }

    /// How many of the phone's epochs are given up.
    pub fn lost(&self, phone: usize) -> u64 {
        let runs = self.desks.get(phone).into_iter().flat_map(|desk| desk.runs.values());
        runs.fold(0, |sum, run| sum.saturating_add(run.lost))
    }

    /// Whether the phone's last agent has ended, no other of that name lives, and all epochs are here or given up.
    pub fn is_complete(&self, phone: usize) -> bool {
        let Some(desk) = self.desks.get(phone) else { return false };
        desk.current_run().is_some_and(|run| run.finished.is_some())
            && !desk.runs.values().any(Run::is_living)
            && self.shortfall(phone) == Some(0)
    }

    /// How many epochs of the phone's agents that have ended are missing and not given up; `None` while the last one runs.
    pub fn shortfall(&self, phone: usize) -> Option<u64> {
        let desk = self.desks.get(phone)?;
        desk.current_run()?.finished.as_ref()?;
        Some(desk.runs.values().filter_map(Run::missing).fold(0, u64::saturating_add))
    }

    /// Does not wait any longer for epochs of agents that have ended, and counts them. How many are missing.
    pub fn give_up(&mut self, phone: usize) -> u64 {
        let missing = self.shortfall(phone).unwrap_or(0);
        let Some(desk) = self.desks.get_mut(phone) else { return 0 };
        let finished = desk.runs.iter().filter(|(_, run)| run.finished.is_some());
        let senders: Vec<String> = finished.map(|(sender, _)| sender.clone()).collect();
        for sender in senders {
            desk.release_all(&sender, "its agent has finished");
            desk.give_up_rest(&sender);
        }
        missing
    }

    /// Hands out what waits for missing epochs of any run, which are counted: the session ends.
    pub fn release_all(&mut self) {
        for desk in &mut self.desks {
            for sender in desk.runs.keys().cloned().collect::<Vec<_>>() {
                desk.release_all(&sender, "the session ended");
            }
        }
    }

    /// The phone's agents are gone, with or without a word.
    pub fn gone(&mut self, phone: usize) {
        if let Some(desk) = self.desks.get_mut(phone) {
            desk.runs.values_mut().for_each(|run| run.gone = true);
        }
    }

    /// The senders of the phone's runs that have finished, with the number of epochs received.
    pub fn finished_runs(&self, phone: usize) -> impl Iterator<Item = (&str, u64)> {
        let runs = self.desks.get(phone).into_iter().flat_map(|desk| &desk.runs);
        runs.filter(|(_, run)| run.finished.is_some()).map(|(sender, run)| (sender.as_str(), run.received))
    }

    /// What the phone's last agent said at its end.
    pub fn finished(&self, phone: usize) -> Option<&Finished> {
        self.desks.get(phone)?.current_run()?.finished.as_ref()
    }

    /// How many epochs of a sender's run are here, and how many are given up.
    pub fn receipt(&self, phone: usize, sender: &str) -> Receipt {
        let run = self.desks.get(phone).and_then(|desk| desk.runs.get(sender));
        run.map_or(Receipt::default(), |run| Receipt { received: run.received, lost: run.lost })
    }

    /// How many epochs the phones' agents have announced.
    pub fn expected(&self) -> u64 {
        self.desks.iter().filter_map(|desk| desk.epochs_expected).sum()
    }

    /// What was dropped of a phone's messages.
    pub fn phone_skips(&self, phone: usize) -> Option<&Skips> {
        self.desks.get(phone).map(|desk| &desk.skips)
    }

    /// What came from elsewhere.
    pub const fn skips(&self) -> &Skips {
        &self.skips
    }

    fn desk(&mut self, arrival: &Arrival) -> Option<(usize, &mut Desk)> {
        let Some(phone) = self.index(&arrival.phone) else {
            self.skips.add(Reason::PhoneUnknown, || {
                format!("'{}'; the session has {}", arrival.phone, self.names.join(", "))
            });
            return None;
        };
        self.desks.get_mut(phone).map(|desk| (phone, desk))
    }
}

#[cfg(test)]
mod tests;
