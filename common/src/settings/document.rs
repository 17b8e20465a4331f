//! Settings as commented TOML.

use std::fmt;

use super::table::{Entry, Word, words_of};
use super::tables::{Preset, Settings};

/// Settings as TOML, each key preceded by a comment with its unit, range and meaning.
#[derive(Clone, Debug, Default)]
pub struct Document {
    text: String,
    table: String,
}

impl Document {
    /// Adds a key, preceded by the header of its table if the table is new.
    pub fn add(&mut self, entry: &Entry) {
        let Entry { table, about, key, meaning, unit, range, value, .. } = entry;
        if *table != self.table {
            let gap = if self.text.is_empty() { "" } else { "\n" };
            let head = format!("{gap}# {about}\n[{table}]\n");
            self.text += &head;
            self.table.clone_from(table);
        }
        let range =
            if matches!(*unit, "word" | "switch") { range.clone() } else { format!("{unit}; {range}") };
        let comment = format!("# [{range}] {meaning}\n");
        let line = match value {
            Some(value) => format!("{key} = {value}\n"),
            None => format!("# {key} is not used here\n"),
        };
        self.text += &comment;
        self.text += &line;
    }
}

impl fmt::Display for Document {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Settings {
    /// All keys as TOML for a settings file; `preset` is the preset of the file.
    pub fn document(&self, preset: Preset) -> Document {
        let mut document = Document::default();
        for entry in self.entries() {
            if entry.table == "filter" && document.table != "filter" {
                document.add(&preset_entry(&entry, preset));
            }
            document.add(&entry);
        }
        document
    }
}

/// The entry of the preset, in the table of `first`.
fn preset_entry(first: &Entry, preset: Preset) -> Entry {
    Entry {
        key: "preset",
        meaning: "The values of all keys, of all tables, that a file leaves out.".to_owned(),
        unit: "word",
        range: words_of::<Preset>(),
        value: Some(toml::Value::String(preset.word().to_owned())),
        is_within: true,
        ..first.clone()
    }
}
