//! What arrives: decoded, checked and counted, phone by phone. No I/O.
//!
//! An agent's run is told from another by its sender (the id of its Zenoh session). Its messages are numbered from 0, and its last
//! status says how many there were: so the hub knows whether it has everything.

use std::collections::BTreeMap;

use cofix_common::skips::Skips;
use cofix_common::wire::{EpochMessage, PhoneStatus, StatusMessage, decode};

/// Most senders remembered for one phone; a phone has one at a time, and one more after each restart.
const MAXIMUM_SENDERS: usize = 64;
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
    finished: Option<Finished>,
}

#[derive(Debug, Default)]
struct Desk {
    runs: BTreeMap<String, Run>,
    /// The sender of the last status.
    current: Option<String>,
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

    /// Whether the phone's last agent has ended and all its epochs are here.
    pub fn is_complete(&self, phone: usize) -> bool {
        self.shortfall(phone) == Some(0)
    }

    /// How many epochs of the phone's last agent are missing; `None` while it runs.
    pub fn shortfall(&self, phone: usize) -> Option<u64> {
        let run = self.desks.get(phone)?.current_run()?;
        run.finished.as_ref().map(|finished| finished.epochs_published.saturating_sub(run.received))
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
    fn run(&mut self, arrival: &Arrival) -> Option<&mut Run> {
        let sender = arrival.sender.as_deref().unwrap_or(ANONYMOUS);
        if !self.runs.contains_key(sender) && self.runs.len() >= MAXIMUM_SENDERS {
            self.skips.add("too many senders", || format!("{sender}; {MAXIMUM_SENDERS} were there already"));
            return None;
        }
        Some(self.runs.entry(sender.to_owned()).or_default())
    }

    fn current_run(&self) -> Option<&Run> {
        self.runs.get(self.current.as_ref()?)
    }

    /// Counts a message of a run; `false` when it was there already.
    fn count(&mut self, arrival: &Arrival, sequence: u64) -> bool {
        let Some(run) = self.run(arrival) else { return false };
        if sequence < run.next {
            return false;
        }
        run.next = sequence.saturating_add(1);
        run.received += 1;
        true
    }

    fn status(&mut self, phone: usize, arrival: &Arrival, status: PhoneStatus) -> Notice {
        self.current = Some(arrival.sender.clone().unwrap_or_else(|| ANONYMOUS.to_owned()));
        match status {
            PhoneStatus::Started { summary, epochs_expected } => {
                self.epochs_expected = epochs_expected;
                self.run(arrival);
                Notice::Started { phone, summary }
            }
            PhoneStatus::Finished { epochs_published, skips, error } => {
                if let Some(run) = self.run(arrival) {
                    run.finished = Some(Finished { epochs_published, skips, error: error.clone() });
                }
                Notice::Finished { phone, error }
            }
        }
    }
}

#[cfg(test)]
mod tests;
