//! The journal of a live group: everything that its thread takes in, written before it is used, with the clock of every step. So what a live
//! hub did can be done again after the fact, bit for bit, and a hub that was killed goes on where it was.
//!
//! # Files
//!
//! Segments in the container format MCAP (<https://mcap.dev>): chunks with a CRC, compressed, written out at least every second. The first has
//! the journal's name, `drive.mcap`; a new one, `drive.2.mcap` and so on, is begun after 256 MB (an option), and by every hub that goes on. A segment of a
//! hub that was killed ends without an end mark, perhaps within a chunk; that chunk is left out and told.
//!
//! # Records
//!
//! | schema | topic | data |
//! |---|---|---|
//! | `cofix.epoch`, `cofix.status`, `cofix.history` | key of the message | the message as it came; the sequence number is that of its sender |
//! | `cofix.answered` | key of the question | nothing; the sequence number is that of the run's sender |
//! | `cofix.alive` | key of the token | 1: an agent is there; 0: it is gone |
//! | `cofix.refused` | `cofix/<group>/refused` | what was refused, not as it came but as counts by reason, with the first instance of each: postcard of phone (none: of no phone of the group) and counts |
//! | `cofix.sender` | `cofix/<group>/sender` | the id of a sender; its number is the record's sequence number, from 1 (0: no sender) |
//! | `cofix.step` | `cofix/<group>/step` | the hub's steady clock, ns (u64), and GPS time by its computer's clock, ns (i64), little endian: everything before is used now |
//! | `cofix.resumed` | `cofix/<group>/step` | nothing: another hub goes on from here |
//! | `cofix.ended` | `cofix/<group>/step` | nothing: everything before is used, and the session ends |
//! | `foxglove.LocationFix` | `cofix/<group>/fused/<phone>` | a fused position with its covariance, for maps; nothing else reads it |
//!
//! Fused positions are written after the step that gave them, and a hub that goes on does not write those again that come of doing the journal
//! again. So no position stands twice; those of the last second before a kill may be missing.
//!
//! The metadata record `cofix` of each segment has group, phones, latency, wire version and program; the session file is attached to the first.

mod fix;
mod place;
mod reader;
mod writer;

use std::path::{Path, PathBuf};
use std::time::Duration;

use cofix_common::time::GpsTime;
use serde::{Deserialize, Serialize};

use crate::network::Event;

pub use fix::{CovarianceType, LocationFix};
pub use place::{has_ended, in_use, of_group, segments};
pub use reader::{JournalReader, Origin};
pub use writer::Journal;

/// Name of the metadata record, and prefix of schemas.
const NAME: &str = "cofix";
/// Name of the attached session file.
const SESSION: &str = "session.toml";

/// A record of a journal.
#[derive(Debug)]
pub enum Entry {
    /// Something that came from the network.
    Event(Event),
    /// Everything before is used at this time.
    Step {
        /// The hub's steady clock.
        now: Duration,
        /// GPS time by the clock of its computer.
        wall_gps: GpsTime,
    },
    /// Another hub goes on from here.
    Resumed,
    /// Everything before is used, and the session ends.
    Ended,
}

/// What a journal is of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The group's name.
    pub group: String,
    /// The phones' names, in the group's order.
    pub phones: Vec<String>,
    /// Longest wait of the group for a phone.
    pub latency: Duration,
    /// Where the session file was.
    pub session_path: PathBuf,
    /// Folder to which the session file's paths were relative, if not its own.
    pub data: Option<PathBuf>,
}

/// Kinds of records, by the names of their schemas.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
enum Kind {
    Epoch,
    Status,
    History,
    Answered,
    Alive,
    Shed,
    Refused,
    Sender,
    Step,
    Resumed,
    Ended,
}

impl Kind {
    const ALL: [Self; 11] = [
        Self::Epoch,
        Self::Status,
        Self::History,
        Self::Answered,
        Self::Alive,
        Self::Shed,
        Self::Refused,
        Self::Sender,
        Self::Step,
        Self::Resumed,
        Self::Ended,
    ];

    const fn schema(self) -> &'static str {
        match self {
            Self::Epoch => "cofix.epoch",
            Self::Status => "cofix.status",
            Self::History => "cofix.history",
            Self::Answered => "cofix.answered",
            Self::Alive => "cofix.alive",
            Self::Shed => "cofix.shed",
            Self::Refused => "cofix.refused",
            Self::Sender => "cofix.sender",
            Self::Step => "cofix.step",
            Self::Resumed => "cofix.resumed",
            Self::Ended => "cofix.ended",
        }
    }

    fn of_schema(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.schema() == name)
    }
}

/// The file of a segment: `drive.mcap`, `drive.2.mcap`, …
fn segment(path: &Path, number: u32) -> PathBuf {
    if number <= 1 {
        return path.to_owned();
    }
    let extension = path.extension().map_or_else(|| "mcap".into(), |e| e.to_string_lossy().into_owned());
    path.with_extension(format!("{number}.{extension}"))
}

/// Removes a journal with all its segments, if there is one.
///
/// # Errors
/// When one cannot be removed.
pub fn remove(path: &Path) -> std::io::Result<()> {
    let files = (1..).map(|number| segment(path, number)).take_while(|file| file.exists());
    files.into_iter().try_for_each(std::fs::remove_file)
}

#[cfg(test)]
mod tests;
