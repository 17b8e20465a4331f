//! One tree of everything that the estimation may be told. No I/O.
//!
//! [`Settings`] has a table for each part, by the names that files use: session files of the hub and settings files of the agent. Presets are
//! values of it. A file gives [`SettingsKeys`]: what it leaves out is as its preset has it. [`Settings::of_file`] puts both together and
//! refuses values outside of their ranges; [`Settings::document`] prints the tree with its units, ranges and meanings. Masks, and how logs
//! are read, are not part of it.

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
    AlignmentKeys, AlignmentSettings, BaseKeys, BaseSettings, CodeVariance, CodeVarianceKeys, Combination,
    ConstraintKeys, ConstraintSettings, CorrectionKeys, CorrectionSettings, DistanceForm, FilterKeys,
    FilterSettings, IntegrityKeys, IntegritySettings, Preset, RateVariance, RateVarianceKeys, Settings,
    SettingsKeys, StochasticKeys, StochasticSettings, VarianceForm, Widening,
};

use table::Word;

/// A value that makes no sense.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("[{table}] {key} {reason}")]
pub struct SettingsError {
    /// The table, as `stochastic.code`.
    pub table: String,
    /// The key.
    pub key: &'static str,
    /// The value and what it may be.
    pub reason: String,
}

impl SettingsError {
    /// What is wrong with the settings of a file, with the line where that stands in its text.
    pub fn told(&self, text: &str) -> String {
        match line_of(text, &self.table, self.key) {
            Some(line) => format!("line {line}: {self}"),
            None => self.to_string(),
        }
    }
}

impl Preset {
    /// Its name.
    pub fn name(self) -> &'static str {
        self.word()
    }
}

impl Settings {
    /// What a file gives, on the preset that it names or else the default.
    ///
    /// # Errors
    /// A value that makes no sense.
    pub fn of_file(given: &SettingsKeys) -> Result<Self, SettingsError> {
        let mut settings = Self::preset(given.filter.preset.unwrap_or_default());
        settings.take(given);
        settings.check()?;
        Ok(settings)
    }

    /// Every key in the order of the tables.
    pub fn entries(&self) -> Vec<Entry> {
        let mut entries = Vec::new();
        self.visit("", &mut |entry| entries.push(entry));
        entries
    }

    /// Checks every value, by itself and with the others of its table.
    ///
    /// # Errors
    /// A value that makes no sense.
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

    /// The keys, by their paths, whose values are not those of `preset`, with their values.
    pub fn changes_from(&self, preset: Preset) -> Vec<(String, toml::Value)> {
        let before = Self::preset(preset).entries();
        let changed =
            self.entries().into_iter().zip(before).filter(|(now, before)| now.value != before.value);
        changed.filter_map(|(now, _)| Some((now.path(), now.value?))).collect()
    }
}
