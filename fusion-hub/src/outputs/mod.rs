//! Consumers of fused epochs: counts, scores, progress, and a list of independent sinks (listeners, status, files).

mod positions;
mod publisher;
pub mod recorder;
mod recording;
mod sink;
mod states;
mod status;

use std::fmt::Display;
use std::path::PathBuf;

use cofix_agent::files::Named;
use cofix_agent::status::Moment;
use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::wire::EpochMessage;
use indicatif::{ProgressBar, ProgressStyle};

use crate::network::FusedPublisher;
use crate::report::scores::Scores;
use crate::report::{Report, SCHEMA, Tally};

pub use recording::keep_partial;
pub use sink::{Fused, Late, Opening, Sink, Written};
use status::Status;

/// The files that are written on request.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Outputs")]
pub struct OutputFiles {
    /// Where to record to (.rrd)
    #[arg(long, value_name = "FILE")]
    pub recording: Option<PathBuf>,
    /// Where to write the JSON report (docs/report.md)
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Where to write the fused positions (CSV)
    #[arg(long, value_name = "FILE")]
    pub positions: Option<PathBuf>,
    /// Where to write the fused states (JSON lines, docs/states.md)
    #[arg(long, value_name = "FILE")]
    pub states: Option<PathBuf>,
    /// Replace files that are there
    #[arg(long)]
    pub overwrite: bool,
}

/// A file that takes fused epochs.
struct FileSink {
    /// Its purpose, with the article.
    what: &'static str,
    /// Its path.
    path: fn(&OutputFiles) -> Option<&PathBuf>,
    /// Opens it.
    open: fn(&Opening<'_>) -> anyhow::Result<Box<dyn Sink>>,
}

/// All files that take fused epochs. The report is not among them: it is written at the end.
const FILE_SINKS: &[FileSink] = &[
    FileSink { what: "the recording", path: |files| files.recording.as_ref(), open: recording::open },
    FileSink { what: "the positions", path: |files| files.positions.as_ref(), open: positions::open },
    FileSink { what: "the states", path: |files| files.states.as_ref(), open: states::open },
];

impl OutputFiles {
    /// All files that should be written.
    pub fn named(&self) -> Vec<Named> {
        let named = |sink: &FileSink| Some(Named::new(sink.what, (sink.path)(self)?));
        FILE_SINKS.iter().filter_map(named).chain(self.named_report()).collect()
    }

    /// The report's file.
    pub fn named_report(&self) -> Option<Named> {
        self.report.as_deref().map(|path| Named::new("the report", path))
    }
}

/// All consumers of fused epochs.
pub struct Outputs {
    names: Vec<String>,
    sinks: Vec<Box<dyn Sink>>,
    failure: Option<String>,
    progress: ProgressBar,
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
            sinks: vec![Box::new(publisher)],
            failure: None,
            progress: ProgressBar::hidden(),
            scores,
            tally: Tally::new(names),
        }
    }

    /// Adds sinks for files, each of which gets its name at the end.
    ///
    /// # Errors
    /// When a file cannot be created.
    pub fn write_to(&mut self, files: &OutputFiles, group: &str, is_live: bool) -> anyhow::Result<()> {
        for sink in FILE_SINKS {
            let Some(path) = (sink.path)(files) else { continue };
            let overwrite = files.overwrite;
            let opening = Opening { path, overwrite, group, phones: &self.names, is_live };
            self.sinks.push((sink.open)(&opening)?);
        }
        Ok(())
    }

    /// Publishes epochs from now on.
    pub fn publish(&mut self, publisher: FusedPublisher) {
        self.sinks.push(Box::new(publisher));
    }

    /// Adds a sink that shows the phones' status, in lines on a terminal or in the log.
    pub fn show_status(&mut self, moment: Moment) {
        self.sinks.push(Box::new(Status::new(&self.names, moment)));
    }

    /// Looks at the clock.
    pub fn tick(&mut self, moment: Moment) {
        self.each(|sink, _| sink.tick(moment));
    }

    /// Why an output is incomplete, if one is.
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// Calls every sink. A sink that fails ends there; the others go on.
    fn each(&mut self, mut work: impl FnMut(&mut dyn Sink, &Self) -> anyhow::Result<()>) {
        for mut sink in std::mem::take(&mut self.sinks) {
            match work(sink.as_mut(), self) {
                Ok(()) => self.sinks.push(sink),
                Err(error) => self.fail(&sink.give_up(&error)),
            }
        }
    }

    fn fail(&mut self, failure: &str) {
        tracing::error!("{failure}");
        self.failure = Some(match self.failure.take() {
            Some(earlier) => format!("{earlier}; {failure}"),
            None => failure.to_owned(),
        });
    }

    /// The report so far, without the group's part.
    pub fn report(&self) -> Report {
        let span = self.tally.span;
        Report {
            schema: SCHEMA,
            methods: self.scores.methods(),
            unscored: self.scores.unscored(),
            truth: self.scores.truths(),
            first_gps: span.map(|(first, _)| first.iso()),
            last_gps: span.map(|(_, last)| last.iso()),
            epochs: self.tally.epochs,
            common_epochs: self.tally.common_epochs,
            same_observations: self.tally.same_observations(),
            constraints: self.tally.constraints(),
            integrity_events: self.tally.events(),
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

    /// Gives an epoch to all consumers.
    pub fn push(&mut self, epoch: &FusedEpoch) {
        self.tally.push(epoch);
        self.scores.push(epoch);
        self.each(|sink, outputs| {
            sink.epoch(&Fused { epoch, phones: &outputs.names, scores: &outputs.scores })
        });
        let messages = epoch.phones.iter().filter(|phone| phone.message.is_some()).count();
        self.progress.inc(messages as u64);
    }

    /// Gives an epoch of a phone that came too late to be fused to whoever takes what the agent made of it.
    pub fn late(&mut self, phone: usize, message: &EpochMessage) {
        self.scores.late(phone, message);
        let truth = self.scores.truth_at(phone, message.time_gps);
        self.each(|sink, _| sink.late(Late { phone, message, truth }));
        self.progress.inc(1);
    }

    /// Ends the progress bar and all sinks; `text` goes into the recording. Returns the files that are whole.
    pub fn finish(&mut self, text: &str) -> Vec<Written> {
        self.progress.finish_and_clear();
        let mut files = Vec::new();
        for sink in std::mem::take(&mut self.sinks) {
            match sink.finish(text) {
                Ok(written) => files.extend(written),
                Err(failure) => self.fail(&failure),
            }
        }
        files
    }

    /// Ends everything and leaves no file behind: the session did not come to its end and can be run again.
    pub fn remove(&mut self) {
        self.progress.finish_and_clear();
        for sink in std::mem::take(&mut self.sinks) {
            sink.remove();
        }
    }

    /// Ends everything and keeps what there is: the session did not come to its end, and will not come again.
    pub fn keep(&mut self, why: &dyn Display) {
        self.progress.finish_and_clear();
        for sink in std::mem::take(&mut self.sinks) {
            if let Err(failure) = sink.keep(why) {
                self.fail(&failure);
            }
        }
    }
}

#[cfg(test)]
mod tests;
