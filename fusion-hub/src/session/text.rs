//! The session file as it is written.

use std::path::PathBuf;

use cofix_agent::masks::{LogOptions, Masks};
use cofix_common::measurement::{Exclusion, Ionosphere};
use serde::{Deserialize, Serialize};

use super::constraint::ConstraintEntry;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SessionFile {
    pub group: String,
    #[serde(default)]
    pub products: ProductsTable,
    #[serde(default)]
    pub phone: Vec<PhoneEntry>,
    #[serde(default)]
    pub constraint: Vec<ConstraintEntry>,
    #[serde(default)]
    pub evaluation: EvaluationTable,
    #[serde(default)]
    pub filter: FilterTable,
    #[serde(default)]
    pub correction: CorrectionTable,
    #[serde(default)]
    pub masks: Masks,
    #[serde(default)]
    pub log: LogOptions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProductsTable {
    #[serde(default)]
    pub sp3: Vec<PathBuf>,
    #[serde(default)]
    pub clock: Vec<PathBuf>,
    #[serde(default)]
    pub bias: Vec<PathBuf>,
    #[serde(default)]
    pub ionex: Vec<PathBuf>,
    #[serde(default)]
    pub navigation: Vec<PathBuf>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PhoneEntry {
    pub name: String,
    pub observations: Option<PathBuf>,
    pub truth: Option<PathBuf>,
    #[serde(default)]
    pub recorded_corrections: bool,
    pub shift_weeks: Option<i64>,
    pub date: Option<String>,
    #[serde(default)]
    pub exclude: Vec<Exclusion>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EvaluationTable {
    #[serde(default = "fixed_only")]
    pub truth_quality: Vec<u8>,
}

impl Default for EvaluationTable {
    fn default() -> Self {
        Self { truth_quality: fixed_only() }
    }
}

fn fixed_only() -> Vec<u8> {
    vec![1]
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FilterTable {
    #[serde(default)]
    pub preset: Preset,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CorrectionTable {
    #[serde(default)]
    pub ionosphere: Ionosphere,
    #[serde(default)]
    pub sources: Vec<PathBuf>,
    pub base_position_m: Option<[f64; 3]>,
    pub maximum_age_s: Option<f64>,
}

/// Settings of the filter that have a name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Ours, tuned on real drives.
    #[default]
    Default,
    /// The values printed in Peng 2023, section 4.
    Peng2023,
}
