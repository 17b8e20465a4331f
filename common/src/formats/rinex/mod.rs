//! RINEX 2, 3 and 4 observation and navigation files (Gurtner, Estey: RINEX 2.11; Romero: RINEX 3.05 and 4.01).
//!
//! Observation files may be in Compact RINEX 1 or 3 (Hatanaka). The decoders take bytes in any portions (see
//! [`crate::formats::decode::Decoder`]) and own no input; the functions over whole files accept plain bytes or those of gzip or `compress`. Damage costs the damaged value, line or record, and is counted in
//! [`crate::skips::Skips`].

mod differences;
mod epoch_2;
mod epoch_3;
mod equipment;
mod glonass_record;
mod hatanaka;
mod header;
mod leap_seconds;
mod meaning;
mod navigation;
mod navigation_decoder;
mod navigation_header;
mod navigation_record;
mod observation;
mod observation_file;
mod observation_record;
mod pending;
mod stated;
mod stream;
mod types;
mod types_2;
mod version;
mod writer;

pub use equipment::Equipment;
pub use header::ObservationHeader;
pub use navigation_decoder::NavigationDecoder;
pub use observation::ObservationDecoder;
pub use observation_file::ObservationFile;
pub(crate) use stated::{is_compact_first_line, is_first_line};
pub use types::{ObservationKind, ObservationType};
pub use writer::{
    ObservationLayout, ObservationWriter, RecordingInfo, glonass_record, navigation_header, navigation_record,
};

use crate::formats::packing::DecompressError;
use crate::formats::text::columns;
use crate::formats::time_system::TimeSystem;

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
        /// The needed kind.
        expected: &'static str,
        /// The type in the header.
        found: String,
    },
    /// A version that is not read here.
    #[error(
        "RINEX version {found} is not supported; versions 2.00 to 2.12, 3.00 to 3.05 and 4.00 to 4.02 are"
    )]
    Version {
        /// The version in the header.
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
        /// The name in the header.
        found: String,
    },
    /// The compressed file is damaged or too large.
    #[error(transparent)]
    Decompress(#[from] DecompressError),
}

/// The label of a header line, in capitals.
fn label(line: &[u8]) -> Vec<u8> {
    columns(line, 60, 80).trim_ascii().to_ascii_uppercase()
}
