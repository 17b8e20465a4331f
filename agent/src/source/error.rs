//! Errors of sources.

use std::fmt::Display;
use std::path::PathBuf;

use cofix_common::formats::kinds::OBSERVATIONS;
use cofix_common::skips::Skips;

/// A source that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// It cannot be read.
    #[error("{}: cannot read the {kind} file: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The expected kind.
        kind: &'static str,
        /// Why.
        cause: std::io::Error,
    },
    /// A live source fails.
    #[error("no observations: {}", once_named(name, cause))]
    Live {
        /// The source.
        name: String,
        /// Why.
        cause: std::io::Error,
    },
    /// It is of another kind.
    #[error("{source_name}: not usable as {kind} file: {reason}")]
    Unusable {
        /// The file or live source.
        source_name: String,
        /// The expected kind.
        kind: &'static str,
        /// The parser's message.
        reason: String,
    },
    /// There are no orbits at all.
    #[error(
        "no orbits: name at least one SP3 or RINEX navigation file that has some (the observations carry neither navigation \
         messages nor states of satellites by the phone; a challenge table carries its own satellite states: \
         --recorded-corrections, or recorded_corrections = true in a session)"
    )]
    NoProducts,
}

/// A source's name and its error, with the name once.
pub(crate) fn once_named(name: &str, error: &impl Display) -> String {
    let error = error.to_string();
    if error.starts_with(name) { error } else { format!("{name}: {error}") }
}

/// A reason with a hint at the file's kind, unless the reason contains it.
pub(crate) fn with_hint(reason: String, hint: Option<&str>) -> String {
    match hint {
        Some(hint) if !reason.contains(hint) => format!("{reason}; {hint}"),
        _ => reason,
    }
}

/// The error of a source of observations without an epoch, with the skipped parts.
pub(crate) fn no_epoch(name: &str, skips: &Skips) -> SourceError {
    nothing_in(name, OBSERVATIONS, "epoch", skips)
}

/// The error of a file without content of its kind, with the skipped parts.
pub(crate) fn nothing_in(name: &str, kind: &'static str, what: &str, skips: &Skips) -> SourceError {
    let reason = format!("it holds no {what}{}", and_skipped(skips));
    SourceError::Unusable { source_name: name.to_owned(), kind, reason }
}

/// The end of a sentence, with the skipped parts.
pub(crate) fn and_skipped(skips: &Skips) -> String {
    if skips.is_empty() { String::new() } else { format!("; skipped: {skips}") }
}
