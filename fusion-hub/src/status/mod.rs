//! The status of a live hub, for whoever asks: the group's thread tells it once a second, and a thread of Zenoh's answers.

mod ask;
mod watcher;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use serde::{Deserialize, Serialize};

pub use ask::{Arguments, ask};
pub use watcher::{Counts, Files, Watcher};

/// Version of the document.
pub const SCHEMA: u32 = 1;

/// The status of a group, as JSON in docs/live.md.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StatusDocument {
    /// [`SCHEMA`].
    pub schema: u32,
    /// The group.
    pub group: String,
    /// Version and build of the hub.
    pub version: String,
    /// Time since the hub's start, s.
    pub running_s: f64,
    /// Fused epochs of the group, with those of the hub whose journal this one goes on with.
    pub epochs_fused: u64,
    /// Name of the journal's first file, without its folder; `None`: no journal is written.
    pub journal: Option<String>,
    /// Name of the recording, without its folder; `None`: nothing is recorded.
    pub recording: Option<String>,
    /// The phones, in the order of the session.
    pub phones: Vec<PhoneFigures>,
}

/// The status of a phone. What is of its last epoch is `None` before there is one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PhoneFigures {
    /// Its name.
    pub phone: String,
    /// Age of the last fused epoch by the hub's clock, s; of a recording, time since it was fused.
    pub age_s: Option<f64>,
    /// Epochs per second in the last ten seconds, Hz.
    pub rate_hz: Option<f64>,
    /// Satellites used in the last epoch.
    pub satellites: Option<usize>,
    /// Horizontal standard deviation of the fused position, m.
    pub horizontal_sigma_m: Option<f64>,
    /// Verdict on the fused position, or, where there is none, on the agent's.
    pub verdict: Option<String>,
    /// Whether it contradicted the other phones at the last epoch, and is coupled to none.
    pub isolated: bool,
    /// Fused epochs.
    pub epochs: u64,
    /// Published epochs that were neither fused nor scored.
    pub lost: u64,
    /// Epochs that came after their time was fused.
    pub late: u64,
    /// What was skipped, by reason.
    pub skipped: BTreeMap<String, u64>,
}

/// The last status that the group's thread has told. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct SharedStatus {
    shared: Arc<Mutex<Option<(Instant, StatusDocument)>>>,
}

impl SharedStatus {
    /// Replaces the status.
    fn tell(&self, document: StatusDocument) {
        *self.shared.lock().unwrap_or_else(PoisonError::into_inner) = Some((Instant::now(), document));
    }

    /// The status with the ages of now; `None` before the group is at work.
    pub fn now(&self) -> Option<StatusDocument> {
        let told = self.shared.lock().unwrap_or_else(PoisonError::into_inner).clone();
        told.map(|(at, document)| document.later(at.elapsed().as_secs_f64()))
    }
}

impl StatusDocument {
    fn later(mut self, seconds: f64) -> Self {
        self.running_s += seconds;
        for age_s in self.phones.iter_mut().filter_map(|phone| phone.age_s.as_mut()) {
            *age_s += seconds;
        }
        self
    }
}
