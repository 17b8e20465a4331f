//! What was skipped, why, and where first: nothing that is dropped passes silently.

mod reason;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

pub use reason::Reason;

/// The key of a count: a reason's text, with its subject, and behind the stage that counted it. The hub keeps keys of agents of other
/// versions, whose reasons it does not know.
type Key = Cow<'static, str>;

/// Counts of skipped things by reason, with the first instance of each named.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Skips {
    by_reason: BTreeMap<Key, Skip>,
}

/// One reason's count and first instance.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Skip {
    /// How many.
    pub count: u64,
    /// The first one, with its facts (line, satellite, epoch, value, limit).
    pub first: String,
}

impl Skips {
    /// Nothing skipped.
    pub const fn new() -> Self {
        Self { by_reason: BTreeMap::new() }
    }

    /// Counts one skipped thing; `describe` is called only for the first of its reason.
    pub fn add(&mut self, reason: Reason, describe: impl FnOnce() -> String) {
        self.count_as(Key::Borrowed(reason.text()), describe);
    }

    /// Counts one skipped thing under a reason whose text names a subject (see [`Reason::about`]).
    pub fn add_about(
        &mut self,
        reason: Reason,
        subject: impl fmt::Display,
        describe: impl FnOnce() -> String,
    ) {
        self.count_as(Key::Owned(reason.about(subject)), describe);
    }

    /// Counts one skipped thing under a reason behind the place or stage in which it occurred: `place: reason`.
    pub fn add_within(&mut self, place: &str, reason: Reason, describe: impl FnOnce() -> String) {
        self.count_as(Key::Owned(format!("{place}: {reason}")), describe);
    }

    fn count_as(&mut self, key: Key, describe: impl FnOnce() -> String) {
        self.by_reason.entry(key).or_insert_with(|| Skip { count: 0, first: describe() }).count += 1;
    }

    /// Adds another's counts; this one's first instances stay.
    pub fn merge(&mut self, other: &Self) {
        for (reason, skip) in &other.by_reason {
            self.by_reason
                .entry(reason.clone())
                .and_modify(|mine| mine.count += skip.count)
                .or_insert_with(|| skip.clone());
        }
    }

    /// The same counts with something in front of each reason.
    pub fn with_prefix(&self, prefix: &str) -> Self {
        let named = self
            .by_reason
            .iter()
            .map(|(reason, skip)| (Key::Owned(format!("{prefix}{reason}")), skip.clone()));
        Self { by_reason: named.collect() }
    }

    /// The same counts with the place in front of each first instance.
    pub fn with_place(mut self, place: &str) -> Self {
        for skip in self.by_reason.values_mut() {
            skip.first = format!("{place}: {}", skip.first);
        }
        self
    }

    /// Count for a reason, by itself or by its whole key; 0 when it never happened.
    pub fn count(&self, reason: impl AsRef<str>) -> u64 {
        self.get(reason).map_or(0, |skip| skip.count)
    }

    /// Count and first instance of a reason, by itself or by its whole key.
    pub fn get(&self, reason: impl AsRef<str>) -> Option<&Skip> {
        self.by_reason.get(reason.as_ref())
    }

    /// Sum over all reasons.
    pub fn total(&self) -> u64 {
        self.by_reason.values().map(|skip| skip.count).sum()
    }

    /// Whether nothing was skipped.
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
