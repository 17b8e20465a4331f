//! The session file as it is written.

use std::path::PathBuf;

use cofix_agent::settings::{LogOptions, Masks};
use cofix_common::measurement::Exclusion;
use cofix_common::settings::{
    AlignmentKeys, ConstraintKeys, CorrectionKeys, FilterKeys, IntegrityKeys, SettingsKeys, StochasticKeys,
};
use serde::Deserialize;

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
    pub correction: CorrectionKeys,
    #[serde(default)]
    pub stochastic: StochasticKeys,
    #[serde(default)]
    pub integrity: IntegrityKeys,
    #[serde(default)]
    pub filter: FilterKeys,
    #[serde(default)]
    pub constraints: ConstraintKeys,
    #[serde(default)]
    pub alignment: AlignmentKeys,
    #[serde(default)]
    pub masks: Masks,
    #[serde(default)]
    pub log: LogOptions,
}

impl SessionFile {
    /// Its part of the settings tree.
    pub(super) fn settings(&self) -> SettingsKeys {
        SettingsKeys {
            correction: self.correction.clone(),
            stochastic: self.stochastic.clone(),
            integrity: self.integrity.clone(),
            filter: self.filter.clone(),
            constraints: self.constraints.clone(),
            alignment: self.alignment.clone(),
        }
    }
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
