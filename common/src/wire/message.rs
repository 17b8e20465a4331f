//! What is said on the wire.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::filter::PhoneState;
use crate::integrity::{RaimReport, Verdict};
use crate::measurement::{CorrectedObservation, Usage};
use crate::skips::Skips;
use crate::solve::PointSolution;
use crate::time::GpsTime;

/// One phone at one epoch: `cofix/<group>/phone/<phone>/epoch`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpochMessage {
    /// The phone's name within its group.
    pub phone: String,
    /// 0, 1, 2, … without gaps in one run of an agent.
    pub sequence: u64,
    /// Receive time, GPS time.
    pub time_gps: GpsTime,
    /// Corrected observations.
    pub observations: Vec<CorrectedObservation>,
    /// Epoch-wise solution, if there was one.
    pub wls: Option<PointSolution>,
    /// State of the local filter after this epoch, once it is initialised.
    pub local: Option<PhoneState>,
    /// RAIM on the epoch-wise solution.
    pub raim: RaimReport,
}

impl EpochMessage {
    /// Number of satellites of which a signal is in use.
    pub fn satellites_used(&self) -> usize {
        let used = self.observations.iter().filter(|observation| observation.usage == Usage::Used);
        used.map(|observation| observation.satellite).collect::<BTreeSet<_>>().len()
    }
}

/// One phone after fusion: `cofix/<group>/fused/<phone>`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FusedMessage {
    /// The phone's name within its group.
    pub phone: String,
    /// The time that the state is for, GPS time.
    pub time_gps: GpsTime,
    /// State after fusion and constraints.
    pub state: PhoneState,
    /// The agent's verdict for this epoch; `None` when the phone had no epoch and was carried by prediction.
    pub verdict: Option<Verdict>,
    /// How many constraints acted on this phone at this epoch.
    pub constraints_acted: u16,
}

/// What an agent says about itself: `cofix/<group>/phone/<phone>/status`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StatusMessage {
    /// The phone's name within its group.
    pub phone: String,
    /// What happened.
    pub status: PhoneStatus,
}

/// Which epochs of its run an agent keeps: first in every answer to `cofix/<group>/phone/<phone>/history`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeptMessage {
    /// The phone's name within its group.
    pub phone: String,
    /// Sequence number of the oldest epoch that is kept; `next` when none is.
    pub first: u64,
    /// Sequence number of the epoch that is published next.
    pub next: u64,
}

/// The hub's answer to an agent that asks about its run at `cofix/<group>/phone/<phone>/receipt`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ReceiptMessage {
    /// How far the hub is with the run.
    Run(Receipt),
    /// The session has no phone of the key's name.
    UnknownPhone {
        /// The names of its phones.
        known: Vec<String>,
    },
}

/// How many epochs of one run the hub has decided about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Receipt {
    /// Epochs that have arrived.
    pub received: u64,
    /// Epochs that are missing and no longer expected.
    pub lost: u64,
}

impl Receipt {
    /// Epochs that have arrived or are no longer expected.
    pub const fn settled(self) -> u64 {
        self.received.saturating_add(self.lost)
    }
}

/// The hub's answer to an agent that plays a recording, at `cofix/<group>/phone/<phone>/pace`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PaceMessage {
    /// Time until the first epoch is due, s; negative when it was due earlier.
    pub due_in_s: f64,
}

/// The two ends of an agent's run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum PhoneStatus {
    /// The agent is about to publish its first epoch; sequence numbers start at 0.
    Started {
        /// Source, products and speed, for people.
        summary: String,
        /// How many epochs will come, when the source knows.
        epochs_expected: Option<u64>,
    },
    /// The agent has published its last epoch.
    Finished {
        /// How many epochs were published; their sequence numbers are 0 to this − 1.
        epochs_published: u64,
        /// What was skipped on the way.
        skips: Skips,
        /// Why the run ended early, if it did.
        error: Option<String>,
    },
}
