//! The result of a session: for machines (JSON, documented in `docs/report.md`) and for people (tables).

pub mod attention;
mod constraints;
mod events;
mod innovations;
mod inputs;
mod presence;
pub mod scores;
mod settings;
mod table;
mod tally;

use std::collections::BTreeMap;

use cofix_common::formats::phone::Typical;
use cofix_common::fusion::peers::{ErrorKind, EventKind};
use cofix_common::skips::Skips;
use serde::Serialize;

use attention::Finding;
pub(crate) use constraints::label;
pub use constraints::{ConstraintReport, describe};
pub use innovations::FilterReport;
pub use inputs::InputFile;
use scores::{Methods, TruthReport};
pub use settings::SettingsReport;
pub(crate) use table::Verdicts;
pub use tally::Tally;

/// Version of the JSON report: it grows when a key is renamed, removed or changes its meaning.
pub const SCHEMA: u32 = 1;

/// The report of a session. Keys are in a fixed order and nothing depends on the wall clock.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: u32,
    /// The program that wrote it.
    pub program: Program,
    /// The group's name.
    pub group: String,
    /// The settings of the session's processing.
    pub settings: SettingsReport,
    /// The files that were read.
    pub inputs: Vec<InputFile>,
    /// Findings that need attention, most harmful first.
    pub attention: Vec<Finding>,
    /// Accuracy by method and phone; null for phones without a score.
    pub methods: Methods,
    /// Why phones are not scored.
    pub unscored: BTreeMap<String, String>,
    /// How truths and recordings match, by phone.
    pub truth: BTreeMap<String, TruthReport>,
    /// First epoch of the group, GPS time.
    pub first_gps: Option<String>,
    /// Last epoch of the group, GPS time.
    pub last_gps: Option<String>,
    /// Epochs of the group.
    pub epochs: u64,
    /// Epochs of the group in which more than one phone took part.
    pub common_epochs: u64,
    /// By phone, how many published epochs were neither fused nor scored.
    pub lost: BTreeMap<String, u64>,
    /// Counts and figures of each phone.
    pub phones: BTreeMap<String, PhoneReport>,
    /// Phones whose observations are the same.
    pub same_observations: Vec<SameObservations>,
    /// Counts of each constraint, whether in force or not, by a key of its kind and phones.
    pub constraints: BTreeMap<String, ConstraintReport>,
    /// What happened to the group's integrity, in order of time.
    pub integrity_events: Vec<EventReport>,
    /// Skipped, and of no phone.
    pub skips: Skips,
}

/// An event of the group's integrity.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct EventReport {
    /// Time, GPS time.
    pub time_gps: String,
    /// The phone, or the phones with commas between.
    pub phone: String,
    /// What happened.
    pub kind: EventKind,
    /// What kind of error an isolated phone has; null for other events.
    pub error: Option<ErrorKind>,
    /// In words.
    pub detail: String,
}

/// The program that wrote a report.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Program {
    /// Its name.
    pub name: &'static str,
    /// Its version.
    pub version: &'static str,
    /// The commit that it was built from; null when it is not known, as of debug builds.
    pub commit: Option<&'static str>,
}

impl Default for Program {
    fn default() -> Self {
        Self {
            name: env!("CARGO_PKG_NAME"),
            version: env!("CARGO_PKG_VERSION"),
            commit: cofix_console::COMMIT,
        }
    }
}

/// One phone in a session.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PhoneReport {
    /// Epochs fused.
    pub epochs: u64,
    /// Time that its epochs cover / time of the group.
    pub share_of_group: Option<f64>,
    /// Epochs without any usable observation.
    pub empty_epochs: u64,
    /// Epochs without a least-squares solution.
    pub epochs_without_solution: u64,
    /// First epoch, GPS time.
    pub first_gps: Option<String>,
    /// Last epoch, GPS time.
    pub last_gps: Option<String>,
    /// Corrected observations that arrived.
    pub observations: u64,
    /// Those with a range rate, from Doppler.
    pub observations_with_rate: u64,
    /// Mean number of satellites in use.
    pub mean_satellites: Option<f64>,
    /// Horizontal standard deviation of the fused position, the root of both variances' sum, m.
    pub horizontal_sigma_m: Option<Typical>,
    /// The same of the height, m.
    pub vertical_sigma_m: Option<Typical>,
    /// Epochs by the agent's integrity verdict.
    pub verdicts: BTreeMap<String, u64>,
    /// Epochs by the verdict on the fused position (see [`cofix_common::fusion::engine::FusedPhone::verdict`]).
    pub fused_verdicts: BTreeMap<String, u64>,
    /// What the filter without constraints made of the measurements.
    pub filter: FilterReport,
    /// Distance of the fused position from that without constraints, m.
    pub constraint_shift_m: Option<Typical>,
    /// Skipped by the agent and by the hub.
    pub skips: Skips,
}

/// Two phones whose observations are the same: one recording was named twice.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SameObservations {
    /// The phones.
    pub phones: [String; 2],
    /// Epochs at which all their common observations were the same.
    pub epochs: u64,
}

impl Report {
    /// The report as JSON text with a line end.
    ///
    /// # Errors
    /// When it cannot be serialised, which does not happen.
    pub fn json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string_pretty(self).map(|text| text + "\n")
    }

    /// Skipped parts, in a line for each phone and a line for the group; empty when there are none.
    pub fn skipped(&self) -> String {
        let counts = |skips: &Skips| {
            let counts: Vec<String> =
                skips.iter().map(|(reason, skip)| format!("{} × {reason}", skip.count)).collect();
            counts.join(", ")
        };
        let phones = self.phones.iter().map(|(name, phone)| (name.as_str(), &phone.skips));
        phones
            .chain([("group", &self.skips)])
            .filter(|(_, skips)| !skips.is_empty())
            .map(|(name, skips)| format!("{name}: {}", counts(skips)))
            .collect::<Vec<_>>()
            .join("\n")
    }
}

#[cfg(test)]
mod tests;
