//! The settings of a session's processing.

use std::collections::BTreeMap;

use cofix_agent::CorrectionSource;
use cofix_agent::settings::{LogOptions, Masks};
use cofix_common::measurement::Ionosphere;
use serde::Serialize;
use serde_json::Value;

use crate::session::{Preset, Settings};

/// The settings of a session's processing, by the keys of session files; null stands for the default.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SettingsReport {
    /// The estimator's settings.
    pub preset: Preset,
    /// Treatment of the ionosphere.
    pub ionosphere: Ionosphere,
    /// Sources of corrections beside the products.
    pub sources: Vec<String>,
    /// The base's antenna, ECEF, m, where it was given.
    pub base_position_m: Option<[f64; 3]>,
    /// Largest age of a base's corrections, s.
    pub maximum_age_s: f64,
    /// Qualities of truth rows that count.
    pub truth_quality: Vec<u8>,
    /// Satellites and signals that are not used.
    pub masks: Masks,
    /// How GnssLogger text is read.
    pub log: LogOptions,
    /// The other keys of the settings tree that are not as the preset has them, by their paths.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub changed: BTreeMap<String, Value>,
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
            ionosphere: settings.estimator.correction.ionosphere,
            sources: corrections.sources.iter().map(name).collect(),
            base_position_m: corrections.base_position.map(|position| position.0.into()),
            maximum_age_s: corrections.options.maximum_age_s,
            truth_quality: truth_quality.to_vec(),
            masks: settings.masks.clone(),
            log: settings.log.clone(),
            changed: changed(settings),
        }
    }
}

/// Keys that have a place of their own in the report.
const OWN_PLACE: [&str; 2] = ["correction.ionosphere", "correction.maximum_age_s"];

fn changed(settings: &Settings) -> BTreeMap<String, Value> {
    let changes = settings.estimator.changes_from(settings.preset).into_iter();
    // JSON has no infinite numbers: they are written as in session files.
    let json = |value: toml::Value| match value {
        toml::Value::Float(number) if !number.is_finite() => Value::String(value.to_string()),
        value => serde_json::to_value(&value).unwrap_or_else(|_| Value::String(value.to_string())),
    };
    changes
        .filter(|(path, _)| !OWN_PLACE.contains(&path.as_str()))
        .map(|(path, value)| (path, json(value)))
        .collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::session::Session;

    fn report(text: &str) -> Value {
        let text = format!("group = 'g'\n[[phone]]\nname = 'a'\n{text}");
        let session = Session::parse(&text, Path::new("a.toml"), None).unwrap();
        serde_json::to_value(SettingsReport::new(&session.settings, &session.truth_quality)).unwrap()
    }

    #[test]
    fn what_is_changed_is_told_and_nothing_else() {
        for text in ["", "[filter]\npreset = 'peng2023'", "[correction]\nionosphere = 'pair'"] {
            assert_eq!(report(text).get("changed"), None, "{text}");
        }
        let text = "[filter]\npreset = 'peng2023'\nmaximum_gap_s = 4\n[constraints]\nmaximum_sweeps = 7\n\
                    [correction]\nionosphere = 'pair'\n[integrity]\nmaximum_pdop = inf";
        let expected = serde_json::json!({
            "constraints.maximum_sweeps": 7, "filter.maximum_gap_s": 4.0, "integrity.maximum_pdop": "inf",
        });
        assert_eq!(report(text)["changed"], expected);
        assert_eq!(report(text)["ionosphere"], "pair");
    }
}
