//! A settings file of the agent: the tables of a session file with the options of processing.
//!
//! ```toml
//! [filter]
//! preset = "default"
//! rate_sigma_scale = 2.0
//! [masks]
//! elevation_deg = 7.5
//! [log]
//! keep_multipath = false
//! ```
//!
//! The tables are those of [`cofix_common::settings`], and `[masks]` and `[log]`. `[constraints]` and `[alignment]` are the hub's: they are
//! checked here, so that one file serves both, and have no effect on an agent.

mod masks;

use std::path::{Path, PathBuf};

use cofix_common::measurement::CorrectionOptions;
use cofix_common::settings::{
    AlignmentKeys, ConstraintKeys, CorrectionKeys, Document, FilterKeys, IntegrityKeys, Preset, Settings,
    SettingsKeys, StochasticKeys, line_of,
};
use serde::Deserialize;

use masks::entries;
pub use masks::{LogOptions, MaskError, Masks};

/// The content of a settings file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FileSettings {
    /// The preset, which decides the masks that are not given.
    pub preset: Preset,
    /// The estimator's settings.
    pub estimator: Settings,
    /// Satellites and signals that are not used.
    pub masks: Masks,
    /// How GnssLogger text is read.
    pub log: LogOptions,
}

/// A settings file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SettingsFileError {
    /// It cannot be read.
    #[error("{}: cannot read the settings file: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// It is not TOML, or has an unknown key or an invalid value.
    #[error("{}: {reason}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The mistake, with its line.
        reason: String,
    },
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct File {
    correction: CorrectionKeys,
    stochastic: StochasticKeys,
    integrity: IntegrityKeys,
    filter: FilterKeys,
    constraints: ConstraintKeys,
    alignment: AlignmentKeys,
    masks: Masks,
    log: LogOptions,
}

impl FileSettings {
    /// Reads a file.
    ///
    /// # Errors
    /// See [`SettingsFileError`].
    pub fn read(path: &Path) -> Result<Self, SettingsFileError> {
        let text = std::fs::read_to_string(path)
            .map_err(|cause| SettingsFileError::Read { path: path.to_owned(), cause })?;
        Self::parse(&text).map_err(|reason| SettingsFileError::Invalid { path: path.to_owned(), reason })
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// The mistake, with its line.
    pub fn parse(text: &str) -> Result<Self, String> {
        let file: File = toml::from_str(text).map_err(|error| error.to_string().trim_end().to_owned())?;
        let File { correction, stochastic, integrity, filter, constraints, alignment, masks, log } = file;
        refuse_sources(&correction, text)?;
        let keys = SettingsKeys { correction, stochastic, integrity, filter, constraints, alignment };
        let estimator = Settings::of_file(&keys).map_err(|error| error.told(text))?;
        masks.apply(CorrectionOptions::default()).map_err(|error| in_table("masks", &error, text))?;
        log.with(&masks).map_err(|error| in_table("log", &error, text))?;
        let preset = keys.preset();
        Ok(Self { preset, estimator, masks, log })
    }
}

/// Refuses sources of corrections: an agent's are on its command line.
fn refuse_sources(correction: &CorrectionKeys, text: &str) -> Result<(), String> {
    let is_given = [
        ("sources", correction.sources.is_some(), "--corrections SOURCE"),
        ("base_position_m", correction.base_position_m.is_some(), "--base-position X,Y,Z"),
    ];
    let Some((key, _, option)) = is_given.into_iter().find(|(_, is_given, _)| *is_given) else {
        return Ok(());
    };
    let line = line_of(text, "correction", key).unwrap_or_default();
    Err(format!("line {line}: [correction] {key} belongs in session files; give the agent {option}"))
}

/// The message about an invalid value in `table`, with its line.
pub fn in_table(table: &str, error: &MaskError, text: &str) -> String {
    match line_of(text, table, error.key) {
        Some(line) => format!("line {line}: [{table}] {}: {error}", error.key),
        None => format!("[{table}] {}: {error}", error.key),
    }
}

/// Every key of every table as TOML, with its unit, its range and its meaning.
pub fn document(preset: Preset) -> String {
    let mut document: Document = Settings::preset(preset).document(preset);
    for entry in entries(preset) {
        document.add(&entry);
    }
    document.to_string()
}

#[cfg(test)]
mod tests {
    use cofix_common::formats::gnsslogger;

    use super::*;

    #[test]
    fn what_is_printed_is_read_and_says_the_defaults() {
        for preset in [Preset::Default, Preset::Peng2023, Preset::Peng2023Doppler, Preset::Cappello2023] {
            let text = document(preset);
            let read = FileSettings::parse(&text).unwrap();
            assert_eq!(read.estimator, Settings::preset(preset));
            let usual = preset.masked(CorrectionOptions::default());
            let masked =
                read.masks.apply(CorrectionOptions { minimum_cn0_dbhz: 0.0, ..usual.clone() }).unwrap();
            assert_eq!(masked, usual, "{text}");
            // The C/N0 mask of the preset holds for logs too.
            let mut log = gnsslogger::Options::default();
            log.masks.min_cn0_dbhz = usual.minimum_cn0_dbhz;
            assert_eq!(read.log.with(&read.masks), Ok(log), "{text}");
        }
    }

    #[test]
    fn all_keys_of_masks_and_logs_are_printed() {
        let listed = |table: &str| {
            let refused = FileSettings::parse(&format!("[{table}]\n'' = 0")).unwrap_err();
            let (_, expected) = refused.split_once("expected").unwrap();
            expected.split('`').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>()
        };
        for table in ["masks", "log"] {
            let printed: Vec<&str> = entries(Preset::Default)
                .iter()
                .filter(|entry| entry.table == table)
                .map(|entry| entry.key)
                .collect();
            let mut known = listed(table);
            known.sort();
            let mut sorted = printed.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, known);
        }
    }

    #[test]
    fn what_is_wrong_is_named_by_line() {
        for (text, said) in [
            (
                "[filter]\nrate_sigma_scale = 0",
                "line 2: [filter] rate_sigma_scale is 0.0; it must lie within 0.01 to 100",
            ),
            ("[filter]\n\ncode_scale = 1.0", "line 3,"),
            ("[masks]\ncn0_dbhz = 20\nelevation_deg = 91", "line 3: [masks] elevation_deg"),
            ("[log]\nshift_weeks = 5000", "line 2: [log] shift_weeks"),
            (
                "[correction]\nsources = ['a']",
                "line 2: [correction] sources belongs in session files; give the agent --corrections",
            ),
            ("[correction]\nbase_position_m = [1.0, 2.0, 3.0]", "--base-position X,Y,Z"),
            ("group = 'g'", "unknown field `group`"),
        ] {
            let refused = FileSettings::parse(text).unwrap_err();
            assert!(refused.contains(said), "expected '{said}' in: {refused}");
        }
        let refused = FileSettings::read(Path::new("no/such.toml")).unwrap_err().to_string();
        assert!(refused.contains("no/such.toml: cannot read the settings file"), "{refused}");
    }
}
