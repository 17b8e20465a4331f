//! Sources of corrections, as they are named.

use std::path::PathBuf;
use std::str::FromStr;

use cofix_common::frames::Ecef;
use cofix_common::measurement::DifferentialOptions;

use crate::input::{AddressError, LiveSource};

/// Sources of corrections, and how the corrections are used.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Corrections {
    /// The sources; each may carry ephemerides and the observations of one base.
    pub sources: Vec<CorrectionSource>,
    /// The base's antenna, in place of what its stream states. It holds for all sources.
    pub base_position: Option<Ecef>,
    /// Age limit and sigmas.
    pub options: DifferentialOptions,
}

/// A source of corrections.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CorrectionSource {
    /// A recorded file of any format that is read.
    File(PathBuf),
    /// A server.
    Live(LiveSource),
}

/// Text that names no source of corrections.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CorrectionSourceError {
    /// Standard input, which is the rover's.
    #[error("corrections do not come from standard input: name a file, tcp://HOST:PORT or ntrip://…/MOUNT")]
    StandardInput,
    /// An address that cannot be read.
    #[error(transparent)]
    Address(#[from] AddressError),
}

impl FromStr for CorrectionSource {
    type Err = CorrectionSourceError;

    fn from_str(text: &str) -> Result<Self, CorrectionSourceError> {
        if text == "-" {
            return Err(CorrectionSourceError::StandardInput);
        }
        if LiveSource::is_named_by(text) {
            return Ok(Self::Live(text.parse()?));
        }
        Ok(Self::File(text.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_are_told_apart() {
        assert_eq!("base.rnx".parse(), Ok(CorrectionSource::File("base.rnx".into())));
        let caster: CorrectionSource = "ntrip://me:secret@host/M".parse().unwrap();
        assert!(matches!(caster, CorrectionSource::Live(LiveSource::Ntrip { .. })));
        assert!(matches!("tcp://h:1".parse(), Ok(CorrectionSource::Live(LiveSource::Tcp { .. }))));
        assert_eq!("-".parse::<CorrectionSource>(), Err(CorrectionSourceError::StandardInput));
        let error = "ntrip://me:secret@host".parse::<CorrectionSource>().unwrap_err().to_string();
        assert!(error.contains("mount point") && !error.contains("secret"), "{error}");
    }
}
