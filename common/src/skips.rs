//! What was skipped, why, and where first: nothing that is dropped passes silently.

use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

/// Counts of skipped things by reason, with the first instance of each named.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Skips {
    by_reason: BTreeMap<String, Skip>,
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
    pub fn add(&mut self, reason: &str, describe: impl FnOnce() -> String) {
        if let Some(skip) = self.by_reason.get_mut(reason) {
            skip.count += 1;
        } else {
            self.by_reason.insert(reason.to_owned(), Skip { count: 1, first: describe() });
        }
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
        let named = self.by_reason.iter().map(|(reason, skip)| (format!("{prefix}{reason}"), skip.clone()));
        Self { by_reason: named.collect() }
    }

    /// Count for a reason, 0 when it never happened.
    pub fn count(&self, reason: &str) -> u64 {
        self.by_reason.get(reason).map_or(0, |skip| skip.count)
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
        self.by_reason.iter().map(|(reason, skip)| (reason.as_str(), skip))
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
