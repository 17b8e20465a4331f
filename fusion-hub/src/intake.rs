//! What arrives: decoded, checked and counted, phone by phone. No I/O.
//!
//! An agent's run is told from another by its sender (the id of its Zenoh session). Its messages are numbered from 0, and its last
//! status says how many there were: so the hub knows whether it has everything.

use std::collections::BTreeMap;

use cofix_common::skips::Skips;
use cofix_common::wire::{EpochMessage, PhoneStatus, StatusMessage, decode};

/// Most runs remembered for one phone; a phone has one at a time, and one more after each restart. The oldest are forgotten.
const MAXIMUM_RUNS: usize = 64;
/// Most lost epochs that are counted one by one; an agent may claim any number.
const MAXIMUM_LOST: u64 = 1_000_000;
/// The sender of samples that do not say who sent them.
const ANONYMOUS: &str = "anonymous";

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

#[derive(Debug, Default)]
struct Run {
    next: u64,
    received: u64,
    /// Whether its agent said that it started.
    started: bool,
    finished: Option<Finished>,
    /// Whether its agent is gone without a word; it may speak again.
    gone: bool,
    /// Whether the epochs that are missing are not waited for.
    given_up: bool,
    /// Place among the phone's runs by first message.
    rank: u64,
}

impl Run {
    /// Whether its agent started, did not say that it finished, and is there.
    const fn is_living(&self) -> bool {
        self.started && self.finished.is_none() && !self.gone
    }

    fn missing(&self) -> Option<u64> {
        self.finished.as_ref().map(|finished| finished.epochs_published.saturating_sub(self.received))
    }
}

#[derive(Debug, Default)]
struct Desk {
    runs: BTreeMap<String, Run>,
    /// The sender of the last status.
    current: Option<String>,
    runs_seen: u64,
    epochs_expected: Option<u64>,
    skips: Skips,
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

    /// Takes an epoch. `None`, counted, when it is of no phone of the group, no message, absurd, or there already.
    pub fn epoch(&mut self, arrival: &Arrival) -> Option<(usize, EpochMessage)> {
        let (phone, desk) = self.desk(arrival)?;
        let message = match decode::<EpochMessage>(&arrival.bytes) {
            Ok(message) => message,
            Err(error) => {
                desk.skips.add("message unreadable", || error.to_string());
                return None;
            }
        };
        let sequence = message.sequence;
        if !desk.count(arrival, sequence) {
            desk.skips
                .add("message received twice", || format!("sequence {sequence} at {}", message.time_gps));
            return None;
        }
        message.sanitise(&arrival.phone, &mut desk.skips).map(|message| (phone, message))
    }

    /// Takes a status. `None`, counted, when it is of no phone of the group or no message.
    pub fn status(&mut self, arrival: &Arrival) -> Option<Notice> {
        let (phone, desk) = self.desk(arrival)?;
        let message = match decode::<StatusMessage>(&arrival.bytes) {
            Ok(message) if message.phone == arrival.phone => message,
            Ok(message) => {
                desk.skips.add("status of another phone", || format!("it names '{}'", message.phone));
                return None;
            }
            Err(error) => {
                desk.skips.add("status unreadable", || error.to_string());
                return None;
            }
        };
        Some(desk.status(phone, arrival, message.status))
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
        Some(
            desk.runs
                .values()
                .filter(|run| !run.given_up)
                .filter_map(Run::missing)
                .fold(0, u64::saturating_add),
        )
    }

    /// Does not wait any longer for epochs of agents that have ended, and counts them. How many are missing.
    pub fn give_up(&mut self, phone: usize) -> u64 {
        let missing = self.shortfall(phone).unwrap_or(0);
        let Some(desk) = self.desks.get_mut(phone) else { return 0 };
        for run in desk.runs.values_mut().filter(|run| run.finished.is_some()) {
            run.given_up = true;
        }
        for _ in 0..missing.min(MAXIMUM_LOST) {
            desk.skips.add("published epochs did not arrive", || format!("{missing} are missing"));
        }
        missing
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

    /// How many epochs of a sender's run are here.
    pub fn received(&self, phone: usize, sender: &str) -> u64 {
        self.desks.get(phone).and_then(|desk| desk.runs.get(sender)).map_or(0, |run| run.received)
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
            self.skips.add("phone unknown to the session", || {
                format!("'{}'; the session has {}", arrival.phone, self.names.join(", "))
            });
            return None;
        };
        self.desks.get_mut(phone).map(|desk| (phone, desk))
    }
}

impl Desk {
    /// The run that an arrival belongs to; one that is new may push out the oldest.
    fn run(&mut self, arrival: &Arrival) -> &mut Run {
        let sender = arrival.sender.as_deref().unwrap_or(ANONYMOUS);
        if !self.runs.contains_key(sender) {
            if self.runs.len() >= MAXIMUM_RUNS {
                self.forget_oldest();
            }
            self.runs_seen += 1;
        }
        let rank = self.runs_seen;
        let run = self.runs.entry(sender.to_owned()).or_insert_with(|| Run { rank, ..Run::default() });
        run.gone = false;
        run
    }

    /// Forgets the oldest run, if possible one that is neither living nor the current one.
    fn forget_oldest(&mut self) {
        let current = self.current.as_deref();
        let worth = |sender: &str, run: &Run| (Some(sender) == current, run.is_living(), run.rank);
        let oldest = self.runs.iter().min_by_key(|(sender, run)| worth(sender, run));
        let Some(sender) = oldest.map(|(sender, _)| sender.clone()) else { return };
        self.runs.remove(&sender);
        self.skips.add("run of an agent forgotten: too many", || {
            format!("{sender}; {MAXIMUM_RUNS} are remembered")
        });
    }

    fn current_run(&self) -> Option<&Run> {
        self.runs.get(self.current.as_ref()?)
    }

    /// Counts a message of a run; `false` when it was there already.
    fn count(&mut self, arrival: &Arrival, sequence: u64) -> bool {
        let run = self.run(arrival);
        if sequence < run.next {
            return false;
        }
        run.next = sequence.saturating_add(1);
        run.received += 1;
        true
    }

    fn status(&mut self, phone: usize, arrival: &Arrival, status: PhoneStatus) -> Notice {
        let sender = arrival.sender.clone().unwrap_or_else(|| ANONYMOUS.to_owned());
        match status {
            PhoneStatus::Started { summary, epochs_expected } => {
                let other = self.runs.iter().find(|(other, run)| **other != sender && run.is_living());
                let other = other.map(|(other, _)| other.clone());
                let twice = other.is_some();
                if let Some(other) = other {
                    self.skips.add("two agents of one name at a time", || format!("{sender} beside {other}"));
                }
                self.epochs_expected = epochs_expected;
                self.current = Some(sender);
                self.run(arrival).started = true;
                Notice::Started { phone, summary, twice }
            }
            PhoneStatus::Finished { epochs_published, skips, error } => {
                self.current = Some(sender);
                self.run(arrival).finished = Some(Finished { epochs_published, skips, error: error.clone() });
                Notice::Finished { phone, error }
            }
        }
    }
}

#[cfg(test)]
mod tests;
