//! What the group's thread tells of itself.

use std::path::Path;
use std::time::{Duration, Instant};

use cofix_agent::status::{LastEpochs, Moment};
use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::integrity::{Cause, Verdict};
use cofix_common::skips::Skips;

use super::{PhoneFigures, SCHEMA, SharedStatus, StatusDocument};

/// Interval at which the status is told.
const INTERVAL: Duration = Duration::from_secs(1);

/// Names of the files that a hub writes, without their folders.
#[derive(Clone, Debug, Default)]
pub struct Files {
    /// The journal.
    pub journal: Option<String>,
    /// The recording.
    pub recording: Option<String>,
}

impl Files {
    /// Of files at these paths.
    pub fn named(journal: Option<&Path>, recording: Option<&Path>) -> Self {
        let name = |path: &Path| Some(path.file_name()?.to_string_lossy().into_owned());
        Self { journal: journal.and_then(name), recording: recording.and_then(name) }
    }
}

/// What the group counts of a phone.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    /// Published epochs that were neither fused nor scored.
    pub lost: u64,
    /// Epochs that came after their time was fused.
    pub late: u64,
    /// What was skipped.
    pub skips: Skips,
}

/// Watches the fused epochs, and tells the status.
#[derive(Debug)]
pub struct Watcher {
    shared: SharedStatus,
    files: Files,
    start: Instant,
    /// When the status was told last, by the group's clock.
    told: Option<Duration>,
    phones: Vec<(LastEpochs, Option<Verdict>)>,
}

impl Watcher {
    /// Tells `shared` the status of a hub that writes these files.
    pub fn new(shared: SharedStatus, files: Files) -> Self {
        Self { shared, files, start: Instant::now(), told: None, phones: Vec::new() }
    }

    /// Takes a fused epoch.
    pub fn epoch(&mut self, epoch: &FusedEpoch, moment: Moment) {
        self.phones.resize_with(epoch.phones.len(), Default::default);
        for ((last, verdict), phone) in self.phones.iter_mut().zip(&epoch.phones) {
            let Some(message) = &phone.message else { continue };
            // Its alarms are those of the status lines.
            last.epoch(message, phone.state.as_ref(), moment);
            *verdict = Some(phone.verdict.unwrap_or(message.raim.verdict));
        }
    }

    /// Whether the status should be told at `now`; the caller tells it then.
    pub fn is_due(&mut self, now: Duration) -> bool {
        let is_due = self.told.is_none_or(|told| now.saturating_sub(told) >= INTERVAL);
        if is_due {
            self.told = Some(now);
        }
        is_due
    }

    /// Tells the status of a group with these phones.
    pub fn tell(&mut self, group: &str, epochs_fused: u64, phones: Vec<(String, Counts)>, moment: Moment) {
        self.phones.resize_with(phones.len(), Default::default);
        let told = phones.into_iter().zip(&mut self.phones);
        let phones = told.map(|((name, counts), watched)| figures(name, &counts, watched, moment)).collect();
        self.shared.tell(StatusDocument {
            schema: SCHEMA,
            group: group.to_owned(),
            version: cofix_console::VERSION.to_owned(),
            running_s: self.start.elapsed().as_secs_f64(),
            epochs_fused,
            journal: self.files.journal.clone(),
            recording: self.files.recording.clone(),
            phones,
        });
    }
}

fn figures(
    phone: String,
    counts: &Counts,
    (last, verdict): &mut (LastEpochs, Option<Verdict>),
    moment: Moment,
) -> PhoneFigures {
    let skipped = counts.skips.iter().map(|(reason, skip)| (reason.to_owned(), skip.count)).collect();
    let figures = last.figures(moment);
    PhoneFigures {
        phone,
        age_s: figures.map(|figures| figures.age_s),
        rate_hz: figures.map(|figures| figures.rate_hz),
        satellites: figures.map(|figures| figures.satellites),
        horizontal_sigma_m: figures.and_then(|figures| figures.horizontal_sigma_m),
        verdict: verdict.map(|verdict| verdict.to_string()),
        isolated: *verdict == Some(Verdict::Unreliable(Cause::Peers)),
        epochs: figures.map_or(0, |figures| figures.epochs),
        lost: counts.lost,
        late: counts.late,
        skipped,
    }
}
