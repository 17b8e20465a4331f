//! The session file as it is written.

use std::path::PathBuf;

use cofix_agent::masks::{LogOptions, Masks};
use cofix_common::measurement::Exclusion;
use cofix_common::settings::{
    AlignmentKeys, ConstraintKeys, CorrectionKeys, FilterKeys, IntegrityKeys, SettingsKeys, StochasticKeys,
};
use serde::Deserialize;

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
    /// What it gives of the settings tree.
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

/// All keys of all kinds; [`super::rules`] says which belong to which.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ConstraintEntry {
    pub kind: ConstraintKind,
    pub phones: Option<Vec<String>>,
    pub from_gps: Option<String>,
    pub to_gps: Option<String>,
    pub minimum_m: Option<f64>,
    pub maximum_m: Option<f64>,
    pub maximum_mps: Option<f64>,
    pub course_deg: Option<f64>,
    pub tolerance_deg: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum ConstraintKind {
    Distance,
    VerticalVelocity,
    Heading,
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
