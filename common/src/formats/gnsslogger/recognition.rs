//! Recognition of GnssLogger logs.

use super::logcat::Logged;
use crate::formats::decode::WrongStream;
use crate::formats::text::shorten;

/// Kinds of lines that no other format has.
const KINDS: [&[u8]; 4] = [b"Raw,", b"Fix,", b"Nav,", b"Status,"];

/// Whether a line is one of a log, which may be Android's system log.
pub(crate) fn is_log_line(line: &[u8]) -> bool {
    Logged::of(line)
        .map_or_else(|| is_own_line(line), |logged| logged.is_of_gpstest() || is_own_line(logged.message))
}

/// Whether a line is the app's own: of measurements, or of the names of their columns.
pub(super) fn is_own_line(line: &[u8]) -> bool {
    let comment = line.strip_prefix(b"#").map(<[u8]>::trim_ascii_start);
    let kind = comment.unwrap_or(line);
    KINDS.iter().any(|name| kind.starts_with(name))
        || comment.is_some_and(|text| text.starts_with(b"Header Description"))
}

/// A log is recognised within this many lines.
const LINES_TO_RECOGNISE: u64 = 100;

/// The kind of stream by the lines so far.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Recognition {
    /// Not clear; the first line of an unknown kind is kept.
    Open {
        /// Its beginning.
        first: Option<String>,
    },
    /// A log.
    Log,
    /// Another kind of stream.
    Wrong(WrongStream),
}

impl Recognition {
    /// Takes a line into account, until it is clear.
    pub(super) fn line(&mut self, known: bool, number: u64, line: &[u8]) {
        let Self::Open { first } = self else { return };
        if known {
            *self = Self::Log;
            return;
        }
        let first = first.get_or_insert_with(|| shorten(line));
        if number >= LINES_TO_RECOGNISE {
            *self = Self::Wrong(wrong(first, number));
        }
    }

    /// The error, if it is clear that this is no log.
    pub(super) fn check(&self) -> Result<(), WrongStream> {
        match self {
            Self::Wrong(error) => Err(error.clone()),
            Self::Open { .. } | Self::Log => Ok(()),
        }
    }

    /// The error, if it did not turn out to be a log up to the end.
    pub(super) fn check_end(&self, lines: u64) -> Result<(), WrongStream> {
        match self {
            Self::Open { first } => Err(wrong(first.as_deref().unwrap_or("(no line)"), lines)),
            Self::Log | Self::Wrong(_) => self.check(),
        }
    }
}

fn wrong(first: &str, lines: u64) -> WrongStream {
    WrongStream {
        reason: format!(
            "not a GnssLogger text log: none of the first {lines} lines begins with '# Raw,', 'Raw,', 'Fix,' or another \
             kind that the app writes; the first one reads '{first}'"
        ),
    }
}
