//! One tree of all options of the estimation. No I/O.
//!
//! [`Settings`] has a table for each part, with the names used in files: session files of the hub and settings files of the agent. Presets
//! are values of it. A file is read as [`SettingsKeys`]; omitted keys have the values of the preset. [`Settings::of_file`] combines both
//! and refuses values outside of their ranges; [`Settings::document`] prints the tree with units, ranges and meanings. Masks, and options
//! for reading logs, are not part of it.

mod document;
mod options;
mod place;
mod rules;
mod table;
mod tables;
#[cfg(test)]
mod tests;

pub use document::Document;
pub use place::line_of;
pub use table::Entry;
pub use tables::{
    AlignmentKeys, AlignmentSettings, BaseKeys, BaseSettings, Carrier, CodeVariance, CodeVarianceKeys,
    Combination, ConstraintKeys, ConstraintSettings, CorrectionKeys, CorrectionSettings, DistanceForm,
    FilterKeys, FilterSettings, IntegrityKeys, IntegritySettings, Preset, RateVariance, RateVarianceKeys,
    Settings, SettingsKeys, StochasticKeys, StochasticSettings, VarianceForm, Widening,
};

use table::Word;

/// Error for an invalid value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("[{table}] {key} {reason}")]
pub struct SettingsError {
    /// Table of the key, as `stochastic.code`.
    pub table: String,
    /// Name of the key.
    pub key: &'static str,
    /// The value and the allowed values.
    pub reason: String,
}

impl SettingsError {
    /// Error text with the line of the key in the text of the file.
    pub fn told(&self, text: &str) -> String {
        match line_of(text, &self.table, self.key) {
            Some(line) => format!("line {line}: {self}"),
            None => self.to_string(),
        }
    }
}

impl Preset {
    /// Name of the preset.
    pub fn name(self) -> &'static str {
        self.word()
    }
}

impl SettingsKeys {
    /// The preset that a file names: in the table filter, or else in the table integrity.
    pub fn preset(&self) -> Preset {
        self.filter.preset.or(self.integrity.preset).unwrap_or_default()
    }
}

impl Settings {
    /// Settings of a file, based on its preset or else on the default.
    ///
    /// # Errors
    /// An invalid value.
    pub fn of_file(given: &SettingsKeys) -> Result<Self, SettingsError> {
        let mut settings = Self::preset(given.preset());
        settings.take(given);
        settings.check()?;
        Ok(settings)
    }

    /// All keys in the order of the tables.
    pub fn entries(&self) -> Vec<Entry> {
        let mut entries = Vec::new();
        self.visit("", &mut |entry| entries.push(entry));
        entries
    }

    /// Checks every value by itself and with the others of its table.
    ///
    /// # Errors
    /// An invalid value.
    pub fn check(&self) -> Result<(), SettingsError> {
        if let Some(Entry { table, key, range, unit, value, .. }) =
            self.entries().into_iter().find(|entry| !entry.is_within)
        {
            let value = value.map(|value| value.to_string()).unwrap_or_default();
            let reason = format!("is {value}; it must lie within {range} [{unit}]");
            return Err(SettingsError { table, key, reason });
        }
        match self.contradiction("") {
            Some((table, key, reason)) => Err(SettingsError { table, key, reason }),
            None => Ok(()),
        }
    }

    /// Paths and values of the keys that differ from `preset`.
    pub fn changes_from(&self, preset: Preset) -> Vec<(String, toml::Value)> {
        let before = Self::preset(preset).entries();
        let changed =
            self.entries().into_iter().zip(before).filter(|(now, before)| now.value != before.value);
        changed.filter_map(|(now, _)| Some((now.path(), now.value?))).collect()
    }
}
