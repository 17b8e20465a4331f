//! How a session was processed.

use cofix_agent::CorrectionSource;
use cofix_agent::masks::{LogOptions, Masks};
use cofix_common::measurement::Ionosphere;
use serde::Serialize;

use crate::session::{Preset, Settings};

/// How a session was processed, by the keys of session files; what is null there is as by default.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SettingsReport {
    /// The estimator's settings.
    pub preset: Preset,
    /// What is done about the ionosphere.
    pub ionosphere: Ionosphere,
    /// Sources of corrections from elsewhere.
    pub sources: Vec<String>,
    /// The base's antenna, ECEF, m, where it was given.
    pub base_position_m: Option<[f64; 3]>,
    /// Largest age of a base's corrections, s.
    pub maximum_age_s: f64,
    /// Qualities of truth rows that count.
    pub truth_quality: Vec<u8>,
    /// What is not used.
    pub masks: Masks,
    /// How GnssLogger text is read.
    pub log: LogOptions,
}

impl SettingsReport {
    /// Of a session's settings.
    pub fn new(settings: &Settings, truth_quality: &[u8]) -> Self {
        let corrections = &settings.corrections;
        let name = |source: &CorrectionSource| match source {
            CorrectionSource::File(path) => {
                path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
            }
            CorrectionSource::Live(source) => source.to_string(),
        };
        Self {
            preset: settings.preset,
            ionosphere: settings.ionosphere,
            sources: corrections.sources.iter().map(name).collect(),
            base_position_m: corrections.base_position.map(|position| position.0.into()),
            maximum_age_s: corrections.options.maximum_age_s,
            truth_quality: truth_quality.to_vec(),
            masks: settings.masks.clone(),
            log: settings.log.clone(),
        }
    }
}
