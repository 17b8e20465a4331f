//! Where fused epochs go: listeners, recording, scores, counts, progress.

use std::path::{Path, PathBuf};
use std::time::Duration;

use cofix_agent::status::Moment;
use cofix_common::constraint::{Constraint, ConstraintAction, ConstraintOutcome};
use cofix_common::wire::FusedMessage;
use indicatif::{ProgressBar, ProgressStyle};

use crate::engine::FusedEpoch;
use crate::network::FusedPublisher;
use crate::recorder::{Recorded, Recorder, RecorderConfig, RecorderError};
use crate::report::Tally;
use crate::scores::Scores;
use crate::status::Status;

/// All consumers of fused epochs.
pub struct Outputs {
    names: Vec<String>,
    publisher: FusedPublisher,
    recorder: Option<(Recorder, PathBuf)>,
    failure: Option<String>,
    progress: ProgressBar,
    status: Option<Status>,
    /// Positions to be scored.
    pub scores: Scores,
    /// Counts.
    pub tally: Tally,
}

impl Outputs {
    /// For a group of phones of these names.
    pub fn new(names: &[String], publisher: FusedPublisher, scores: Scores) -> Self {
        Self {
            names: names.to_vec(),
            publisher,
            recorder: None,
            failure: None,
            progress: ProgressBar::hidden(),
            status: None,
            scores,
            tally: Tally::new(names),
        }
    }

    /// Records into a file, too.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn record_to(&mut self, path: &Path, group: &str) -> anyhow::Result<()> {
        let config = RecorderConfig { group: group.to_owned(), phones: self.names.clone() };
        self.recorder = Some((Recorder::to_file(path, &config)?, path.to_owned()));
        Ok(())
    }

    /// Writes the recording every `age` or so, not only when there is much.
    pub fn write_recording_after(&mut self, age: Duration) {
        if let Some((recorder, _)) = &mut self.recorder {
            recorder.write_after(age);
        }
    }

    /// Says how the phones are, in lines on a terminal or in the log.
    pub fn show_status(&mut self, moment: Moment) {
        self.status = Some(Status::new(&self.names, moment));
    }

    /// Looks at the clock.
    pub fn tick(&mut self, moment: Moment) {
        if let Some(status) = &mut self.status {
            status.look(moment);
        }
        self.with_recorder(Recorder::tick);
    }

    /// Why the recording is incomplete, if it is.
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// A recording that cannot be written ends there; everything else goes on.
    fn with_recorder(&mut self, work: impl FnOnce(&mut Recorder) -> Result<(), RecorderError>) {
        let Some((recorder, path)) = &mut self.recorder else { return };
        if let Err(error) = work(recorder) {
            let failure = format!("{}: the recording is incomplete: {error}", path.display());
            tracing::error!("{failure}");
            self.failure = Some(failure);
            self.recorder = None;
        }
    }

    /// Shows progress on a terminal.
    pub fn show_progress(&mut self) {
        let style = ProgressStyle::with_template("{bar:40} {pos}/{len} phone-epochs, {eta} left");
        self.progress =
            ProgressBar::new(0).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    }

    /// How many phone-epochs there will be.
    pub fn expect(&self, phone_epochs: u64) {
        self.progress.set_length(phone_epochs);
    }

    /// Hands an epoch to everybody.
    ///
    /// # Errors
    /// When Zenoh refuses.
    pub fn push(&mut self, epoch: &FusedEpoch) -> anyhow::Result<()> {
        self.tally.push(epoch);
        if let Some(status) = &mut self.status {
            status.epoch(epoch);
        }
        self.scores.push(epoch);
        for (name, phone) in self.names.iter().enumerate() {
            if let Some(message) = fused_message(epoch, name, phone) {
                self.publisher.publish(&message)?;
            }
        }
        if self.recorder.is_some() {
            let references = self.scores.references(epoch);
            self.with_recorder(|recorder| recorder.record(epoch, &references));
        }
        let messages = epoch.phones.iter().filter(|phone| phone.message.is_some()).count();
        self.progress.inc(messages as u64);
        Ok(())
    }

    /// Ends the progress bar and the recording, into which the accuracy table goes.
    pub fn finish(&mut self, table: &str) -> Option<(PathBuf, Recorded)> {
        self.progress.finish_and_clear();
        self.status = None;
        let (recorder, path) = self.recorder.take()?;
        match recorder.finish(table) {
            Ok(recorded) => Some((path, recorded)),
            Err(error) => {
                let failure = format!("{}: the recording is incomplete: {error}", path.display());
                tracing::error!("{failure}");
                self.failure = Some(failure);
                None
            }
        }
    }
}

fn fused_message(epoch: &FusedEpoch, index: usize, name: &str) -> Option<FusedMessage> {
    let phone = epoch.phones.get(index)?;
    let acted = epoch.actions.iter().filter(|action| concerns(action, index)).count();
    Some(FusedMessage {
        phone: name.to_owned(),
        time_gps: epoch.time_gps,
        state: phone.state.clone()?,
        verdict: phone.message.as_ref().map(|message| message.raim.verdict),
        constraints_acted: u16::try_from(acted).unwrap_or(u16::MAX),
    })
}

/// Whether a constraint was applied to a phone.
fn concerns(action: &ConstraintAction, index: usize) -> bool {
    if matches!(action.outcome, ConstraintOutcome::Skipped(_)) {
        return false;
    }
    match action.constraint {
        Constraint::Distance { phones: (i, j), .. } => i == index || j == index,
        Constraint::VerticalVelocity { phone, .. } | Constraint::Heading { phone, .. } => phone == index,
    }
}
