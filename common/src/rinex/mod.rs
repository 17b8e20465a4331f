//! RINEX 2, 3 and 4 observation and navigation files (Gurtner, Estey: RINEX 2.11; Romero: RINEX 3.05 and 4.01).
//!
//! Observation files may be in Compact RINEX 1 or 3 (Hatanaka). The decoders take bytes in any portions (see
//! [`crate::decode::Decoder`]) and own no input; the functions over whole files accept plain bytes or those of gzip or `compress`. Damage costs the damaged value, line or record, and is counted in
//! [`crate::skips::Skips`].

mod decimal;
mod decompress;
mod differences;
mod epoch_2;
mod epoch_3;
mod equipment;
mod glonass_record;
mod hatanaka;
mod header;
mod leap_seconds;
mod line_assembly;
mod meaning;
mod navigation;
mod navigation_decoder;
mod navigation_header;
mod navigation_record;
mod observation;
mod observation_file;
mod observation_record;
mod pending;
mod stream;
mod types;
mod types_2;
mod unix_compress;
mod version;
mod writer;

pub(crate) use decimal::{integer, real};
pub use decompress::{DecompressError, MAX_DECOMPRESSED_BYTES, Packing, decompress};
pub use equipment::Equipment;
pub use header::ObservationHeader;
pub use leap_seconds::leap_seconds_at;
pub use line_assembly::MAX_LINE_BYTES;
pub use navigation::NavigationFile;
pub use navigation_decoder::NavigationDecoder;
pub use navigation_header::IonosphereTerms;
pub use observation::ObservationDecoder;
pub use observation_file::ObservationFile;
pub use types::{ObservationKind, ObservationType};
pub use writer::{
    ObservationLayout, ObservationWriter, RecordingInfo, glonass_record, navigation_header, navigation_record,
};

pub(crate) use crate::text::{is_blank, without_mark};
use crate::time_system::TimeSystem;

/// Why a file cannot be read at all.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RinexError {
    /// The first line has no RINEX version label.
    #[error("not a RINEX file: line {line} has no 'RINEX VERSION / TYPE' label, but reads '{found}'")]
    NotRinex {
        /// Line number.
        line: u64,
        /// Its text, shortened.
        found: String,
    },
    /// A RINEX file of another kind.
    #[error("this is a RINEX file of type '{found}'; one of type {expected} is needed")]
    WrongType {
        /// What is needed.
        expected: &'static str,
        /// What the header says.
        found: String,
    },
    /// A version that is not read here.
    #[error(
        "RINEX version {found} is not supported; versions 2.00 to 2.12, 3.00 to 3.05 and 4.00 to 4.02 are"
    )]
    Version {
        /// What the header says.
        found: String,
    },
    /// A Compact RINEX version that is not read here.
    #[error("Compact RINEX (Hatanaka) versions 1 and 3 are read, but this says '{found}'")]
    CompactVersion {
        /// The first line, shortened.
        found: String,
    },
    /// A header line that is needed and cannot be read.
    #[error("header line {line} ({label}) cannot be read: '{text}'")]
    HeaderLine {
        /// Line number.
        line: u64,
        /// Label of the line.
        label: &'static str,
        /// The text, shortened.
        text: String,
    },
    /// The input ended before END OF HEADER.
    #[error("the file ends after {lines} lines, before END OF HEADER")]
    HeaderIncomplete {
        /// Lines read.
        lines: u64,
    },
    /// The header lists no observation types.
    #[error("the header has no list of observation types, so the columns have no meaning")]
    NoObservationTypes,
    /// A time system that is not known.
    #[error("time system '{found}' in TIME OF FIRST OBS is not known; {names} are", names = TimeSystem::NAMES)]
    TimeSystem {
        /// What the header says.
        found: String,
    },
    /// The compressed file is damaged or too large.
    #[error(transparent)]
    Decompress(#[from] DecompressError),
}

/// Text of a line for an error message: the printable start of it.
pub(crate) fn shorten(line: &[u8]) -> String {
    let start = line.get(..line.len().min(60)).unwrap_or_default();
    String::from_utf8_lossy(start).chars().map(|c| if c.is_control() { '?' } else { c }).collect()
}

/// The lines of a file with their numbers from 1, without line ends.
pub(crate) fn lines(bytes: &[u8]) -> impl Iterator<Item = (u64, &[u8])> {
    let mut rest = bytes;
    let mut number = 0;
    std::iter::from_fn(move || {
        let before = rest;
        // Searching a slice in memory cannot fail; `skip_until` is the standard library's fast byte search.
        let taken = std::io::BufRead::skip_until(&mut rest, b'\n').unwrap_or(0);
        number += 1;
        (taken > 0).then(|| (number, trim_end(before.get(..taken).unwrap_or_default())))
    })
}

/// The lines of a file from the first one with content on; a byte order mark before it is no content.
pub(crate) fn lines_of_content(bytes: &[u8]) -> impl Iterator<Item = (u64, &[u8])> {
    lines(bytes).map(|(number, line)| (number, without_mark(line))).skip_while(|(_, line)| is_blank(line))
}

/// The label of a header line, in capitals.
fn label(line: &[u8]) -> Vec<u8> {
    columns(line, 60, 80).trim_ascii().to_ascii_uppercase()
}

/// Removes LF and CR from the end; files that were turned to DOS line ends twice have more than one CR.
pub(crate) fn trim_end(line: &[u8]) -> &[u8] {
    let mut line = line.strip_suffix(b"\n").unwrap_or(line);
    while let Some(shorter) = line.strip_suffix(b"\r") {
        line = shorter;
    }
    line
}

/// Columns `from..to` of a line, as much of them as there is.
pub(crate) fn columns(line: &[u8], from: usize, to: usize) -> &[u8] {
    line.get(from..to.min(line.len())).unwrap_or_default()
}

/// Text of a field: trimmed, damaged UTF-8 replaced.
pub(crate) fn text(field: &[u8]) -> String {
    String::from_utf8_lossy(field.trim_ascii()).into_owned()
}
