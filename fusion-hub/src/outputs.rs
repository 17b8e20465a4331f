//! Where fused epochs go: listeners, recording, table of positions, scores, counts, progress.

mod recording;

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context;
use cofix_agent::files::{Named, OutputFile};
use cofix_agent::status::Moment;
use cofix_common::constraint::{ConstraintAction, ConstraintOutcome};
use cofix_common::wire::FusedMessage;
use indicatif::{ProgressBar, ProgressStyle};

use crate::network::FusedPublisher;
use crate::positions::PositionTable;
use crate::recorder::{Recorded, Recorder, RecorderConfig, RecorderError};
use crate::report::{Report, SCHEMA, Tally};
use crate::scores::Scores;
use crate::status::Status;
use cofix_common::fusion::engine::FusedEpoch;
use recording::RecordingFile;

/// All consumers of fused epochs.
pub struct Outputs {
    names: Vec<String>,
    publisher: FusedPublisher,
    recorder: Option<RecordingFile>,
    positions: Option<(PositionTable<OutputFile>, PathBuf)>,
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
            positions: None,
            failure: None,
            progress: ProgressBar::hidden(),
            status: None,
            scores,
            tally: Tally::new(names),
        }
    }

    /// Records into a file, too, which gets its name at the end; `overwrite`: one that is there may be replaced.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn record_to(&mut self, path: &Path, group: &str, overwrite: bool) -> anyhow::Result<()> {
        let config = RecorderConfig { group: group.to_owned(), phones: self.names.clone() };
        self.recorder = Some(RecordingFile::create(path, overwrite, &config)?);
        Ok(())
    }

    /// Writes fused positions into a table (see [`crate::positions`]), too, which is there at the end.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn write_positions_to(&mut self, path: &Path, overwrite: bool) -> anyhow::Result<()> {
        let file = OutputFile::create(Named::new("the positions", path), overwrite)?;
        let table = PositionTable::new(file, &self.names).with_context(|| cannot_write(path))?;
        self.positions = Some((table, path.to_owned()));
        Ok(())
    }

    /// Records a live session: the recording is written every `age` or so, not only when there is much, and left when it is not whole.
    pub fn write_recording_after(&mut self, age: Duration) {
        if let Some(file) = &mut self.recorder {
            file.keep_live(age);
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

    /// Why an output is incomplete, if one is.
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// A recording that cannot be written ends there; everything else goes on.
    fn with_recorder(&mut self, work: impl FnOnce(&mut Recorder) -> Result<(), RecorderError>) {
        let Some(file) = &mut self.recorder else { return };
        if let Err(error) = work(file.recorder())
            && let Some(file) = self.recorder.take()
        {
            self.fail(file.give_up(&error));
        }
    }

    fn fail(&mut self, failure: String) {
        tracing::error!("{failure}");
        self.failure = Some(match self.failure.take() {
            Some(earlier) => format!("{earlier}; {failure}"),
            None => failure,
        });
    }

    /// A table that cannot be written ends there; everything else goes on.
    fn add_positions(&mut self, epoch: &FusedEpoch) {
        let Some((table, path)) = &mut self.positions else { return };
        if let Err(error) = table.push(epoch) {
            let failure = format!("{}: {error}", cannot_write(path));
            self.positions = None;
            self.fail(failure);
        }
    }

    /// What is known so far, without what the group knows.
    pub fn report(&self) -> Report {
        let span = self.tally.group_span();
        Report {
            schema: SCHEMA,
            methods: self.scores.methods(),
            unscored: self.scores.unscored(),
            truth: self.scores.truths(),
            first_gps: span.map(|(first, _)| first.iso()),
            last_gps: span.map(|(_, last)| last.iso()),
            epochs: self.tally.epochs(),
            common_epochs: self.tally.common_epochs(),
            same_observations: self.tally.same_observations(),
            constraints: self.tally.constraints(),
            ..Report::default()
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
        self.add_positions(epoch);
        let messages = epoch.phones.iter().filter(|phone| phone.message.is_some()).count();
        self.progress.inc(messages as u64);
        Ok(())
    }

    /// Ends the progress bar, the table of positions, and the recording, into which the text goes.
    pub fn finish(&mut self, text: &str) -> Finished {
        self.progress.finish_and_clear();
        self.status = None;
        let positions = self.finish_positions();
        let recording = self.recorder.take().and_then(|file| match file.finish(text) {
            Ok(recorded) => Some(recorded),
            Err(failure) => {
                self.fail(failure);
                None
            }
        });
        Finished { recording, positions }
    }

    fn finish_positions(&mut self) -> Option<PathBuf> {
        let (table, path) = self.positions.take()?;
        let whole = table.finish().with_context(|| cannot_write(&path)).and_then(|file| Ok(file.commit()?));
        match whole {
            Ok(()) => Some(path),
            Err(error) => {
                self.fail(format!("{error:#}"));
                None
            }
        }
    }

    /// Ends everything and leaves no file behind: the session did not come to its end and can be run again.
    pub fn remove(&mut self) {
        self.progress.finish_and_clear();
        self.positions = None;
        if let Some(file) = self.recorder.take() {
            file.remove();
        }
    }

    /// Ends everything and keeps what there is: the session did not come to its end, and will not come again.
    pub fn keep(&mut self, why: &dyn std::fmt::Display) {
        self.progress.finish_and_clear();
        self.finish_positions();
        if let Some(file) = self.recorder.take() {
            self.fail(file.give_up(why));
        }
    }
}

/// The outputs that have come to their end.
#[derive(Debug, Default)]
pub struct Finished {
    /// The recording.
    pub recording: Option<(PathBuf, Recorded)>,
    /// The table of positions.
    pub positions: Option<PathBuf>,
}

fn cannot_write(path: &Path) -> String {
    format!("{}: cannot write the positions", path.display())
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
    !matches!(action.outcome, ConstraintOutcome::Skipped(_)) && action.constraint.phones().contains(&index)
}
