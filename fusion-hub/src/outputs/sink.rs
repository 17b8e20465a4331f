//! The interface of outputs of fused epochs.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use cofix_agent::status::Moment;
use cofix_common::frames::Ecef;
use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::skips::Skips;
use cofix_common::wire::EpochMessage;

use crate::report::scores::{Reference, Scores};

/// A consumer of fused epochs. An error of `epoch` or `tick` ends that sink (see [`Sink::give_up`]) and nothing else; it is
/// reported at the end of the run, which then fails.
pub trait Sink: Send {
    /// Takes an epoch.
    ///
    /// # Errors
    /// When it cannot be written or sent.
    fn epoch(&mut self, fused: &Fused<'_>) -> anyhow::Result<()>;

    /// Takes an epoch of a phone that came too late to be fused.
    ///
    /// # Errors
    /// When it cannot be written.
    fn late(&mut self, late: Late<'_>) -> anyhow::Result<()> {
        let _ = late;
        Ok(())
    }

    /// Called about twenty times a second while the group works.
    ///
    /// # Errors
    /// When data that are due cannot be written or sent.
    fn tick(&mut self, moment: Moment) -> anyhow::Result<()> {
        let _ = moment;
        Ok(())
    }

    /// Ends a whole output. `text` has the session's tables and findings. A sink that leaves no file returns `None`.
    ///
    /// # Errors
    /// Why the output is not whole, with its file.
    fn finish(self: Box<Self>, text: &str) -> Result<Option<Written>, String>;

    /// Ends it after an error of its own. Returns which of its files is incomplete, and why.
    fn give_up(self: Box<Self>, why: &dyn Display) -> String {
        format!("{why:#}")
    }

    /// Ends it and keeps its data: the session did not come to its end, and cannot be run again.
    ///
    /// # Errors
    /// Why the output is not whole, with its file.
    fn keep(self: Box<Self>, why: &dyn Display) -> Result<(), String> {
        let _ = why;
        self.finish("").map(|_| ())
    }

    /// Ends it and leaves no file: the session did not come to its end, and can be run again.
    fn remove(self: Box<Self>) {}
}

/// An epoch for sinks, with names and truths.
#[derive(Clone, Copy)]
pub struct Fused<'a> {
    /// The epoch.
    pub epoch: &'a FusedEpoch,
    /// The phones' names, in the order of the epoch's.
    pub phones: &'a [String],
    /// Source of the truths.
    pub(super) scores: &'a Scores,
}

/// An epoch of a phone that came too late to be fused.
#[derive(Clone, Copy)]
pub struct Late<'a> {
    /// The phone's index.
    pub phone: usize,
    /// What its agent sent.
    pub message: &'a EpochMessage,
    /// The phone's true position at the message's time, where a row of a counted quality gives it.
    pub truth: Option<Ecef>,
}

impl Fused<'_> {
    /// The phones' true positions, where rows of a counted quality give them.
    pub fn references(&self) -> Vec<Reference> {
        self.scores.references(self.epoch)
    }
}

/// Parameters for opening the sink of a file.
#[derive(Clone, Copy)]
pub struct Opening<'a> {
    /// The file.
    pub path: &'a Path,
    /// Whether a file that is there may be replaced.
    pub overwrite: bool,
    /// The group's name.
    pub group: &'a str,
    /// The phones' names.
    pub phones: &'a [String],
    /// Whether the session happens now and cannot be run again.
    pub is_live: bool,
}

/// A file that is whole.
#[derive(Clone, Debug)]
pub struct Written {
    /// Its title, at the head of a line.
    pub title: &'static str,
    /// The file.
    pub path: PathBuf,
    /// Its figures for people; may be empty.
    pub figures: String,
    /// Data that are not in it.
    pub skips: Skips,
}
