//! Decoders of streams: bytes go in as they come, records come out as they are complete.
//!
//! A file, a growing file, standard input, a socket and a fuzzer drive the same decoder. It never blocks and never fails
//! on content: lines and messages that cannot be read are counted and named in [`Decoder::skips`]. Only a stream of another kind is
//! an error.

use crate::gnss::{Event, ObservationEpoch};
use crate::orbit::{GlonassEphemeris, KeplerEphemeris};
use crate::skips::Skips;

/// A record of a stream.
#[derive(Clone, Debug, PartialEq)]
pub enum Record {
    /// Observations of one epoch.
    Epoch(ObservationEpoch),
    /// A broadcast ephemeris.
    Ephemeris(Box<KeplerEphemeris>),
    /// A GLONASS broadcast ephemeris.
    Glonass(Box<GlonassEphemeris>),
    /// What happened between two epochs, for information.
    Event(Box<Event>),
}

/// The stream is not of the decoder's kind, or of a version that it does not read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{reason}")]
pub struct WrongStream {
    /// The found text or bytes, their place, and what was expected.
    pub reason: String,
}

/// A decoder of one kind of stream.
pub trait Decoder {
    /// Takes the next bytes, in any portions.
    ///
    /// # Errors
    /// [`WrongStream`] when the beginning shows another kind of stream; nothing more will come out then.
    fn feed(&mut self, bytes: &[u8]) -> Result<(), WrongStream>;

    /// The stream has ended: completes the last record, or counts it where it is cut off.
    ///
    /// # Errors
    /// [`WrongStream`] when it ended before it could be recognised.
    fn finish(&mut self) -> Result<(), WrongStream>;

    /// The next record, in the stream's order; `None` until more bytes come.
    fn next_record(&mut self) -> Option<Record>;

    /// What was skipped so far, by reason.
    fn skips(&self) -> &Skips;
}
