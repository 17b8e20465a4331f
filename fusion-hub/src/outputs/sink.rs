//! What an output is to those that hand fused epochs on.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use cofix_agent::status::Moment;
use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::skips::Skips;

use crate::report::scores::{Reference, Scores};

/// A consumer of fused epochs. An error of `epoch` or `tick` ends that sink (see [`Sink::give_up`]) and nothing else; it is told
/// at the end of the run, which then fails.
pub trait Sink: Send {
    /// Takes an epoch in.
    ///
    /// # Errors
    /// When it cannot be written or sent.
    fn epoch(&mut self, fused: &Fused<'_>) -> anyhow::Result<()>;

    /// Looks at the clock: some twenty times a second while the group is at work.
    ///
    /// # Errors
    /// When what is due cannot be written or sent.
    fn tick(&mut self, moment: Moment) -> anyhow::Result<()> {
        let _ = moment;
        Ok(())
    }

    /// Ends a whole output. `text` has the session's tables and findings. A sink that leaves no file returns `None`.
    ///
    /// # Errors
    /// Why the output is not whole, with its file.
    fn finish(self: Box<Self>, text: &str) -> Result<Option<Written>, String>;

    /// Ends it after an error of its own, and says which of its files is incomplete and why.
    fn give_up(self: Box<Self>, why: &dyn Display) -> String {
        format!("{why:#}")
    }

    /// Ends it with what there is: the session did not come to its end, and will not come again.
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

/// An epoch for sinks, with what is known beside it.
#[derive(Clone, Copy)]
pub struct Fused<'a> {
    /// The epoch.
    pub epoch: &'a FusedEpoch,
    /// The phones' names, in the order of the epoch's.
    pub phones: &'a [String],
    /// Where the truth is.
    pub(super) scores: &'a Scores,
}

impl Fused<'_> {
    /// Where the phones truly were, as far as counted truth says so.
    pub fn references(&self) -> Vec<Reference> {
        self.scores.references(self.epoch)
    }
}

/// What the sink of a file is opened with.
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
    /// What it is, as the head of a line.
    pub title: &'static str,
    /// The file.
    pub path: PathBuf,
    /// Its figures for people; may be empty.
    pub figures: String,
    /// What is not in it.
    pub skips: Skips,
}
