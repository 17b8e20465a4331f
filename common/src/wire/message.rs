//! Messages on the wire.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::filter::PhoneState;
use crate::fusion::peers::{ErrorKind, EventKind};
use crate::integrity::{ProtectionLevels, RaimReport, StateReport, TestReport, Verdict};
use crate::measurement::{CorrectedObservation, Usage};
use crate::skips::Skips;
use crate::solve::PointSolution;
use crate::time::GpsTime;

/// Epoch of one phone: `cofix/<group>/phone/<phone>/epoch`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpochMessage {
    /// The phone's name within its group.
    pub phone: String,
    /// Sequence number, 0, 1, 2, … without gaps in one run of an agent.
    pub sequence: u64,
    /// Time of reception, GPS time: the receiver's time tag less the offset of its clock.
    pub time_gps: GpsTime,
    /// Corrected observations.
    pub observations: Vec<CorrectedObservation>,
    /// Time of the phone's epoch to which the changes of range refer; `None` if there is no change of range.
    pub changes_since_gps: Option<GpsTime>,
    /// Epoch-wise solution, if there was one.
    pub wls: Option<PointSolution>,
    /// State of the local filter after this epoch; `None` before initialisation.
    pub local: Option<PhoneState>,
    /// What integrity monitoring says of that state.
    pub local_integrity: Option<StateReport>,
    /// RAIM report on the epoch-wise solution.
    pub raim: RaimReport,
}

impl EpochMessage {
    /// Number of satellites of which a signal is in use.
    pub fn satellites_used(&self) -> usize {
        let used = self.observations.iter().filter(|observation| observation.usage == Usage::Used);
        used.map(|observation| observation.satellite).collect::<BTreeSet<_>>().len()
    }
}

/// State of one phone after fusion: `cofix/<group>/fused/<phone>`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FusedMessage {
    /// The phone's name within its group.
    pub phone: String,
    /// Time of the state, GPS time.
    pub time_gps: GpsTime,
    /// State after fusion and constraints.
    pub state: PhoneState,
    /// Verdict on this state (see [`crate::fusion::engine::FusedPhone::verdict`]); `None` for a phone without an epoch, whose state is predicted.
    pub verdict: Option<Verdict>,
    /// Test of the epoch's pseudoranges against the prediction; `None` where there is none.
    pub test: Option<TestReport>,
    /// Protection levels of the position; `None` where nothing bounds its error.
    pub protection: Option<ProtectionLevels>,
    /// Number of constraints that acted on this phone at this epoch.
    pub constraints_acted: u16,
}

/// Event of the group's integrity: `cofix/<group>/integrity`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct IntegrityMessage {
    /// Time of the fused epoch, GPS time.
    pub time_gps: GpsTime,
    /// Names of the phones that it is about.
    pub phones: Vec<String>,
    /// What happened.
    pub kind: EventKind,
    /// What is wrong with an isolated phone.
    pub error: Option<ErrorKind>,
    /// The event in words.
    pub detail: String,
}

/// Status of an agent: `cofix/<group>/phone/<phone>/status`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StatusMessage {
    /// The phone's name within its group.
    pub phone: String,
    /// Start or end of the run.
    pub status: PhoneStatus,
}

/// Range of the epochs that an agent keeps: first in every answer to `cofix/<group>/phone/<phone>/history`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeptMessage {
    /// The phone's name within its group.
    pub phone: String,
    /// Sequence number of the oldest kept epoch; equal to `next` if no epoch is kept.
    pub first: u64,
    /// Sequence number of the next epoch to be published.
    pub next: u64,
}

/// Answer of the hub to an agent's query about its run at `cofix/<group>/phone/<phone>/receipt`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ReceiptMessage {
    /// Progress of the hub with the run.
    Run(Receipt),
    /// The session has no phone with the name in the key.
    UnknownPhone {
        /// Names of the session's phones.
        known: Vec<String>,
    },
}

/// Numbers of epochs of one run that have arrived or are given up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Receipt {
    /// Number of received epochs.
    pub received: u64,
    /// Number of missing epochs that are no longer expected.
    pub lost: u64,
}

impl Receipt {
    /// Number of epochs that have arrived or are no longer expected.
    pub const fn settled(self) -> u64 {
        self.received.saturating_add(self.lost)
    }
}

/// Answer of the hub to an agent that plays a recording, at `cofix/<group>/phone/<phone>/pace`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PaceMessage {
    /// Time until the first epoch is due, s; negative if it was due earlier.
    pub due_in_s: f64,
}

/// Start or end of an agent's run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum PhoneStatus {
    /// The agent is about to publish its first epoch; sequence numbers start at 0.
    Started {
        /// Source, products and speed, as text for the user.
        summary: String,
        /// Number of epochs to come, if the source knows it.
        epochs_expected: Option<u64>,
    },
    /// The agent has published its last epoch.
    Finished {
        /// Number of published epochs; their sequence numbers are 0 to this − 1.
        epochs_published: u64,
        /// Counts of skips on the way by reason.
        skips: Skips,
        /// Reason for an early end of the run.
        error: Option<String>,
    },
}
