//! Counts of skipped data by reason, with the first instance of each. Dropped data is always counted.

mod reason;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

pub use reason::Reason;

/// Key of a count: the text of a reason, with its subject, preceded by its stage if there is one. The hub keeps unknown keys from agents of
/// other versions.
type Key = Cow<'static, str>;

/// Counts of skipped data by reason, each with its first instance.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Skips {
    by_reason: BTreeMap<Key, Skip>,
}

/// One reason's count and first instance.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Skip {
    /// Number of instances.
    pub count: u64,
    /// Description of the first instance, with its facts (line, satellite, epoch, value, limit).
    pub first: String,
}

impl Skips {
    /// Empty counts.
    pub const fn new() -> Self {
        Self { by_reason: BTreeMap::new() }
    }

    /// Counts one instance; `describe` is called only for the first instance of a reason.
    pub fn add(&mut self, reason: Reason, describe: impl FnOnce() -> String) {
        self.count_as(Key::Borrowed(reason.text()), describe);
    }

    /// Counts `count` instances at once.
    pub fn add_many(&mut self, reason: Reason, count: u64, describe: impl FnOnce() -> String) {
        if count > 0 {
            let skip = Skip { count, first: describe() };
            self.merge(&Self { by_reason: [(Key::Borrowed(reason.text()), skip)].into() });
        }
    }

    /// Counts one instance of a reason whose text names a subject (see [`Reason::about`]).
    pub fn add_about(
        &mut self,
        reason: Reason,
        subject: impl fmt::Display,
        describe: impl FnOnce() -> String,
    ) {
        self.count_as(Key::Owned(reason.about(subject)), describe);
    }

    /// Counts one instance with the place or stage in front of the reason: `place: reason`.
    pub fn add_within(&mut self, place: &str, reason: Reason, describe: impl FnOnce() -> String) {
        self.count_as(Key::Owned(format!("{place}: {reason}")), describe);
    }

    fn count_as(&mut self, key: Key, describe: impl FnOnce() -> String) {
        let skip = self.by_reason.entry(key).or_insert_with(|| Skip { count: 0, first: describe() });
        skip.count = skip.count.saturating_add(1);
    }

    /// Adds other counts; existing first instances are kept.
    pub fn merge(&mut self, other: &Self) {
        for (reason, skip) in &other.by_reason {
            self.by_reason
                .entry(reason.clone())
                .and_modify(|mine| mine.count = mine.count.saturating_add(skip.count))
                .or_insert_with(|| skip.clone());
        }
    }

    /// The same counts with `prefix` in front of each reason.
    pub fn with_prefix(&self, prefix: &str) -> Self {
        let named = self
            .by_reason
            .iter()
            .map(|(reason, skip)| (Key::Owned(format!("{prefix}{reason}")), skip.clone()));
        Self { by_reason: named.collect() }
    }

    /// At most `limit` of these counts, with `change` made to each text.
    pub fn with_texts(&self, limit: usize, change: impl Fn(&str) -> String) -> Self {
        let mut changed = Self::new();
        for (reason, skip) in self.by_reason.iter().take(limit) {
            let skip = Skip { count: skip.count, first: change(&skip.first) };
            changed.merge(&Self { by_reason: [(Key::Owned(change(reason)), skip)].into() });
        }
        changed
    }

    /// The same counts with `place` in front of each first instance.
    pub fn with_place(mut self, place: &str) -> Self {
        for skip in self.by_reason.values_mut() {
            skip.first = format!("{place}: {}", skip.first);
        }
        self
    }

    /// Count for a reason or for a whole key; 0 if there is none.
    pub fn count(&self, reason: impl AsRef<str>) -> u64 {
        self.get(reason).map_or(0, |skip| skip.count)
    }

    /// Count and first instance for a reason or for a whole key.
    pub fn get(&self, reason: impl AsRef<str>) -> Option<&Skip> {
        self.by_reason.get(reason.as_ref())
    }

    /// Sum over all reasons.
    pub fn total(&self) -> u64 {
        self.by_reason.values().fold(0, |sum, skip| sum.saturating_add(skip.count))
    }

    /// Whether there are no counts.
    pub fn is_empty(&self) -> bool {
        self.by_reason.is_empty()
    }

    /// Reasons in alphabetical order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Skip)> {
        self.by_reason.iter().map(|(reason, skip)| (reason.as_ref(), skip))
    }
}

impl fmt::Display for Skips {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, (reason, skip)) in self.iter().enumerate() {
            let separator = if index == 0 { "" } else { "; " };
            write!(f, "{separator}{} × {reason} (first: {})", skip.count, skip.first)?;
        }
        Ok(())
    }
}
