use std::collections::BTreeSet;

use toml::Value;

use super::*;
use crate::fusion::align::AlignOptions;
use crate::fusion::engine::EngineOptions;
use crate::measurement::{DifferentialOptions, Uncorrected, VarianceModel};
use crate::pipeline::PipelineOptions;

const PRESETS: [Preset; 4] =
    [Preset::Default, Preset::Peng2023, Preset::Peng2023Doppler, Preset::Cappello2023];

fn read(text: &str) -> Result<Settings, String> {
    let given: SettingsKeys = toml::from_str(text).map_err(|error| error.to_string())?;
    Settings::of_file(&given).map_err(|error| error.told(text))
}

/// Paths of all keys of a table and its subtables.
fn paths(path: &str, value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Table(table) => {
            table.iter().for_each(|(key, value)| paths(&table::join(path, key), value, found));
        }
        _ => _ = found.insert(path.to_owned()),
    }
}

fn all_paths(value: &Value) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    paths("", value, &mut found);
    found
}

#[test]
fn presets_are_the_options_of_the_parts() {
    for (preset, settings, pipeline, engine) in [
        (Preset::Default, Settings::default(), PipelineOptions::default(), EngineOptions::default()),
        (Preset::Peng2023, Settings::peng2023(), PipelineOptions::peng2023(), EngineOptions::peng2023()),
    ] {
        let told = settings.pipeline();
        assert_eq!(preset.masked(told.correction), pipeline.correction);
        assert_eq!(told.filter, pipeline.filter);
        assert_eq!(format!("{:?}", told.raim), format!("{:?}", pipeline.raim));
        assert!(!told.recorded_corrections);
        let told = settings.engine();
        assert_eq!((told.filter, told.constraints), (engine.filter, engine.constraints));
        assert_eq!(told.feedback, engine.feedback);
        assert_eq!(settings.differential(), DifferentialOptions::default());
        assert_eq!(settings.align(), AlignOptions::default());
        assert_eq!(settings.check(), Ok(()));
    }
    assert_ne!(Settings::default(), Settings::peng2023());
    let cappello = PipelineOptions::cappello2023();
    let told = read("[integrity]\npreset = 'cappello2023'\nmethod = 'subset'").unwrap().pipeline();
    assert_eq!(Preset::Cappello2023.masked(told.correction), cappello.correction);
    assert_eq!((told.raim.method, told.raim.exclude_groups), (crate::integrity::Method::Subset, false));
}

#[test]
fn printed_settings_read_back_to_themselves() {
    for preset in PRESETS {
        let mut settings = Settings::preset(preset);
        let text = settings.document(preset).to_string();
        assert_eq!(read(&text), Ok(settings), "{text}");
        settings.filter.rate_sigma_scale = 1.0 / 3.0;
        settings.constraints.contradiction_sigmas = f64::INFINITY;
        settings.correction.base.keep_uncorrected = false;
        settings.stochastic.code = CodeVariance {
            model: VarianceForm::Elevation,
            floor_m2: None,
            noise_m2: None,
            ura_m: Some(1e-7),
            zenith_m: Some(0.0),
        };
        let text = settings.document(preset).to_string();
        assert_eq!(read(&text), Ok(settings), "{text}");
    }
}

#[test]
fn settings_are_serialised_and_read_whole() {
    for preset in PRESETS {
        let settings = Settings::preset(preset);
        let text = toml::to_string(&settings).unwrap();
        assert_eq!(toml::from_str::<Settings>(&text).unwrap(), settings);
        let strange = text.replace("rate_sigma_scale", "rate_sigma_scales");
        assert!(toml::from_str::<Settings>(&strange).is_err());
    }
}

/// Struct, file keys and printed text have the same keys.
#[test]
fn every_key_is_printed_with_unit_range_and_meaning() {
    for preset in PRESETS {
        let settings = Settings::preset(preset);
        let text = settings.document(preset).to_string();
        let mut printed = all_paths(&toml::from_str(&text).unwrap());
        assert!(printed.remove("filter.preset"));
        assert_eq!(printed, all_paths(&Value::try_from(settings).unwrap()));
        let lines: Vec<&str> = text.lines().collect();
        let keys =
            || lines.iter().enumerate().filter(|(_, line)| line.contains(" = ") && !line.starts_with('#'));
        assert_eq!(keys().count(), printed.len() + 1);
        for (index, line) in keys() {
            let comment = lines[index - 1];
            let (range, meaning) =
                comment.strip_prefix("# [").and_then(|rest| rest.split_once("] ")).unwrap();
            let is_range = range.contains(" to ") || range.contains(" or ");
            assert!(is_range && meaning.ends_with('.') && meaning.len() > 15, "{comment}\n{line}");
        }
        for entry in settings.entries() {
            assert!(
                text.contains(&format!("\n{} = ", entry.key)) || entry.value.is_none(),
                "{}",
                entry.path()
            );
        }
    }
}

/// A key that a preset's choices do not use is nevertheless in the struct, in files and in the text.
#[test]
fn keys_without_use_are_told() {
    let text = Settings::default().document(Preset::Default).to_string();
    assert!(
        text.contains("# enlargement_factor is not used here") && text.contains("# ura_m is not used here")
    );
}

/// Every number has two limits and is refused beyond them with its line, name, value and range.
#[test]
fn values_outside_of_their_ranges_are_refused_by_line() {
    let mut numbers = 0;
    for preset in PRESETS {
        for entry in Settings::preset(preset).entries() {
            let Some(Value::Float(_) | Value::Integer(_)) = entry.value else { continue };
            numbers += 1;
            let is_whole = entry.range.ends_with(", whole");
            for value in if is_whole { ["100001", "4294967295"] } else { ["-1.0", "nan"] } {
                let table = &entry.table;
                let text = format!("# a comment\n\n[filter]\npreset = '{}'\n", preset.name());
                let text = if table == "filter" { text } else { format!("{text}\n[{table}]\n") };
                let refused = read(&format!("{text}{} = {value}\n", entry.key)).unwrap_err();
                let line = text.lines().count() + 1;
                let said = format!("line {line}: [{table}] {} is {value}; it must lie within", entry.key);
                assert!(refused.starts_with(&said), "expected '{said}' in: {refused}");
                assert!(refused.contains(&entry.range) && refused.contains(entry.unit), "{refused}");
            }
        }
    }
    assert!(numbers > 80, "{numbers}");
}

#[test]
fn the_ends_of_the_ranges_are_allowed() {
    for preset in PRESETS {
        for entry in Settings::preset(preset).entries() {
            let Some(Value::Float(_)) = entry.value else { continue };
            let (low, high) = entry.range.split_once(" to ").unwrap();
            for end in [low, high] {
                let end = if end.contains(['.', 'e', 'i']) { end.to_owned() } else { format!("{end}.0") };
                let others = "rate_sigma_scale = 1.0";
                let text =
                    format!("filter.preset = '{}'\nfilter.{others}\n{} = {end}", preset.name(), entry.path());
                let text = if entry.key == "rate_sigma_scale" {
                    text.replace(&format!("filter.{others}\n"), "")
                } else {
                    text
                };
                // A value may still contradict another one, but then the reason is not its range.
                let outcome = read(&text);
                let is_range = |refused: &String| refused.contains("must lie within");
                assert!(!outcome.as_ref().is_err_and(is_range), "{}: {outcome:?}", entry.path());
            }
        }
    }
}

#[test]
fn keys_override_their_preset() {
    let settings =
        read("[filter]\npreset = 'peng2023'\nmaximum_gap_s = 4\n[stochastic.code]\nnoise_m2 = 3e4").unwrap();
    let peng = Settings::peng2023();
    assert_eq!(settings.engine().filter.maximum_gap_s, 4.0);
    assert_eq!(settings.pipeline().filter.maximum_gap_s, 4.0);
    assert_eq!(settings.pipeline().correction.stochastic.code, VarianceModel::Cn0 { a: 1.0, b: 30_000.0 });
    assert_eq!(settings.engine().constraints, peng.engine().constraints);
    let changed: Vec<String> =
        settings.changes_from(Preset::Peng2023).into_iter().map(|(path, _)| path).collect();
    assert_eq!(changed, ["stochastic.code.noise_m2", "filter.maximum_gap_s"]);
    assert!(peng.changes_from(Preset::Peng2023).is_empty());
}

/// Keys needed in a file in which a key becomes `new`.
fn needed_beside(entry: &Entry, new: &str) -> String {
    let unit = if entry.table.ends_with("rate") { "mps" } else { "m" };
    let variance = &entry.table;
    match (entry.table.as_str(), entry.key, new) {
        (_, _, "'elevation'") => format!("{variance}.ura_{unit} = 1.0\n{variance}.zenith_{unit} = 1.0\n"),
        ("correction.base.code" | "stochastic.code", "model", "'cn0'") => {
            format!("{variance}.floor_m2 = 1.0\n{variance}.noise_m2 = 1.0\n")
        }
        ("filter", "robust_reject_sigmas", _) => "filter.robust_keep_sigmas = 1.0\n".to_owned(),
        _ => String::new(),
    }
}

/// Each key in a file changes its own option; no two keys are mixed up or forgotten.
#[test]
fn every_key_reaches_the_options() {
    let told = |settings: &Settings| {
        let (pipeline, engine) = (settings.pipeline(), settings.engine());
        format!("{pipeline:?} {engine:?} {:?} {:?}", settings.differential(), settings.align())
    };
    let mut seen = BTreeSet::new();
    for preset in PRESETS {
        let before = Settings::preset(preset);
        for entry in before.entries() {
            let new = match &entry.value {
                Some(Value::Float(value)) if value.is_infinite() => "7.5".to_owned(),
                Some(Value::Float(value)) if *value == 0.0 => "0.25".to_owned(),
                Some(Value::Float(value)) => format!("{:e}", value * 0.9),
                Some(Value::Integer(value)) => (value + 1).to_string(),
                Some(Value::Boolean(value)) => (!value).to_string(),
                Some(Value::String(word)) => {
                    let other =
                        entry.range.split('"').skip(1).step_by(2).find(|other| other != word).unwrap();
                    format!("'{other}'")
                }
                _ => continue,
            };
            let mut text = format!("filter.preset = '{}'\n{} = {new}\n", preset.name(), entry.path());
            text += &needed_beside(&entry, &new);
            let after = read(&text).unwrap_or_else(|refused| panic!("{text}{refused}"));
            let changed = after.changes_from(preset);
            assert!(changed.iter().any(|(path, _)| *path == entry.path()), "{text}{changed:?}");
            assert!(told(&after) != told(&before), "{} has no effect", entry.path());
            assert!(seen.insert(told(&after)), "{} does what another key does", entry.path());
        }
    }
}

#[test]
fn choices_take_and_refuse_their_keys() {
    let code = |text: &str| read(&format!("[stochastic.code]\n{text}"));
    let cn0 = code("model = 'cn0'").unwrap().pipeline().correction.stochastic.code;
    assert_eq!(cn0, VarianceModel::Cn0 { a: 1.0, b: 20_000.0 });
    let elevation = code("model = 'elevation'\nura_m = 2").unwrap().pipeline().correction.stochastic.code;
    assert_eq!(elevation, VarianceModel::Elevation { ura: 2.0, zenith: 0.5 });
    let dropped = read("[correction.base]\nkeep_uncorrected = false").unwrap();
    assert_eq!(dropped.differential().uncorrected, Uncorrected::Dropped);
    let sequential = read("[constraints]\nmethod = 'sequential'\nenlargement = 'peng'").unwrap();
    let (wished, peng) = (sequential.engine().constraints, Settings::peng2023().engine().constraints);
    assert_eq!(wished.enlargement, peng.enlargement);
    for (text, said) in [
        (
            "[stochastic.code]\nmodel = 'elevation'",
            "line 1: [stochastic.code] ura_m is missing; it belongs to model = \"elevation\"",
        ),
        (
            "[stochastic.code]\nmodel = 'cn0'\nzenith_m = 1",
            "line 3: [stochastic.code] zenith_m has no effect",
        ),
        ("[stochastic.rate]\nfloor_m2ps2 = 0\nnoise_m2ps2 = 0", "variance of 0"),
        (
            "[constraints]\nmethod = 'sequential'\ndamping = 0.1",
            "line 3: [constraints] damping has no effect",
        ),
        ("[constraints]\nenlargement_factor = 2", "leave it out with enlargement = \"fixed\""),
        (
            "[filter]\n\nrobust_reject_sigmas = 0.5",
            "line 3: [filter] robust_reject_sigmas is 0.5; it must not be below robust_keep_sigmas, 1",
        ),
        (
            "[alignment]\ntolerance_s = 0.5\nsimultaneous_s = 0.6",
            "line 3: [alignment] simultaneous_s is 0.6; it must not be above tolerance_s, 0.5",
        ),
    ] {
        let refused = read(text).unwrap_err();
        assert!(refused.contains(said), "expected '{said}' in: {refused}");
    }
}

#[test]
fn strange_keys_and_words_are_named_by_line() {
    for (text, line, said) in [
        ("[filter]\nhorizontal_jerk = 1.0", 2, "unknown field `horizontal_jerk`"),
        ("[stochastic.code]\nnoise_m = 1.0", 2, "unknown field `noise_m`"),
        ("[correction.base.codes]\nmodel = 'cn0'", 1, "unknown field `codes`"),
        ("\n[constraints]\nmethod = 'ep'", 3, "unknown variant `ep`"),
        ("[integrity]\nmaximum_exclusions = 1.5", 2, "invalid type: floating point"),
        ("[integrity]\nmaximum_exclusions = -1", 2, "-1"),
        ("[alignment]\ntolerance_s = '0.5'", 2, "invalid type: string"),
        ("[masks]\nelevation_deg = 5", 1, "unknown field `masks`"),
    ] {
        let refused = read(text).unwrap_err();
        assert!(refused.contains(&format!("line {line},")) && refused.contains(said), "{refused}");
    }
}

/// The printed words are those accepted.
#[test]
fn words_are_those_of_the_types() {
    for entry in Settings::default().entries() {
        let unit = entry.unit;
        if unit != "word" {
            continue;
        }
        let refused = read(&format!("{} = '?'", entry.path())).unwrap_err();
        let told: Vec<&str> = entry.range.split('"').skip(1).step_by(2).collect();
        let understood: Vec<&str> =
            refused.split_once("expected").unwrap().1.split('`').skip(1).step_by(2).collect();
        assert_eq!(told, understood, "{refused}");
    }
}

#[test]
fn lines_are_found_in_every_notation() {
    let text =
        "a = 1\nfilter.preset = 'default'\n[stochastic]\n  code = { model = 'cn0',\n    noise_m2 = 3.0 }\n";
    assert_eq!(line_of(text, "", "a"), Some(1));
    assert_eq!(line_of(text, "filter", "preset"), Some(2));
    assert_eq!(line_of(text, "stochastic.code", "noise_m2"), Some(5));
    assert_eq!(
        line_of(text, "stochastic.code", "floor_m2"),
        Some(4),
        "the table's where the key is not there"
    );
    assert_eq!(line_of(text, "masks", "exclude"), None);
    assert_eq!(line_of("a = ", "", "a"), None);
}
