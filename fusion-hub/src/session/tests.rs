use cofix_common::constraint::{Constraint, Distance, DistanceModel, Heading, VerticalVelocity};
use cofix_common::measurement::{Ionosphere, VarianceModel};
use cofix_common::time::GpsTime;

use super::*;

const SESSION: &str = r#"
group = "wh-3-09"
[products]
sp3 = ["../orbits.sp3"]
clock = ["../clocks.clk"]
bias = ["biases.bia"]
ionex = ["map.20i", "map.21i.gz"]
navigation = ["/data/brdc.rnx.gz"]
[[phone]]
name = "HP30"
observations = "HP30.rnx"
truth = "HP30.truth.csv"
[[phone]]
name = "HP20"
observations = "HP20.rtcm3"
date = "2020-08-13T14:00:00"
[[phone]]
name = "VX30"
[[constraint]]
kind = "distance"
maximum_m = 2.0
[[constraint]]
kind = "vertical-velocity"
maximum_mps = 1.0
phones = ["VX30"]
[[constraint]]
kind = "heading"
phones = ["HP30"]
course_deg = -100.0
tolerance_deg = 10.0
from_gps = "2020-08-13T14:33:00"
to_gps = "2020-08-13T14:34:00"
[evaluation]
truth_quality = [1, 2]
"#;

fn parse(text: &str) -> Result<Session, SessionError> {
    Session::parse(text, Path::new("drives/monday/session.toml"), None)
}

fn refusal(text: &str) -> String {
    parse(text).expect_err(text).to_string()
}

#[test]
fn the_documented_file_is_read() {
    let session = parse(SESSION).unwrap();
    assert_eq!(session.group, "wh-3-09");
    assert_eq!(session.phone_names(), ["HP30", "HP20", "VX30"]);
    assert_eq!(session.products.sp3, [PathBuf::from("drives/monday/../orbits.sp3")]);
    assert_eq!(session.products.clock, [PathBuf::from("drives/monday/../clocks.clk")]);
    assert_eq!(session.products.bias, [PathBuf::from("drives/monday/biases.bia")]);
    assert_eq!(session.products.ionex.len(), 2);
    assert_eq!(session.products.iter().count(), 6);
    assert_eq!(session.products.navigation, [PathBuf::from("/data/brdc.rnx.gz")]);
    assert_eq!(session.phones[0].observations, Some(PathBuf::from("drives/monday/HP30.rnx")));
    assert_eq!(session.phones[1].truth, None);
    assert_eq!(
        (session.phones[0].date, session.phones[1].date),
        (None, Some("2020-08-13T14:00:00".parse().unwrap()))
    );
    assert_eq!(session.truth_quality, [1, 2]);
    assert_eq!(session.settings.preset, Preset::Default);
}

#[test]
fn constraints_are_expanded_to_pairs_and_phones() {
    let constraints = parse(SESSION).unwrap().constraints;
    let pair = |i, j| Constraint::Distance(Distance { phones: [i, j], minimum_m: 0.0, maximum_m: 2.0 });
    let kinds: Vec<_> = constraints.iter().map(|c| c.constraint).collect();
    assert_eq!(kinds[..3], [pair(0, 1), pair(0, 2), pair(1, 2)]);
    assert_eq!(kinds[3], Constraint::VerticalVelocity(VerticalVelocity { phone: 2, maximum_mps: 1.0 }));
    let Constraint::Heading(Heading { phone: 0, course_rad, tolerance_rad }) = kinds[4] else {
        panic!("{kinds:?}")
    };
    assert!((course_rad - 260_f64.to_radians()).abs() < 1e-12);
    assert!((tolerance_rad - 10_f64.to_radians()).abs() < 1e-12);
    assert_eq!(kinds.len(), 5);
    assert_eq!((constraints[0].from_gps, constraints[0].to_gps), (None, None));
    let start: GpsTime = "2020-08-13T14:33:00".parse().unwrap();
    assert_eq!((constraints[4].from_gps, constraints[4].to_gps), (Some(start), Some(start + 60.0)));
}

#[test]
fn weeks_are_shifted_by_phone_and_session() {
    let text = "group = 'g'\n[[phone]]\nname = 'a'\nshift_weeks = 1024\n[[phone]]\nname = 'b'\n[log]\nshift_weeks = -1024";
    let session = parse(text).unwrap();
    let shifts: Vec<_> = session.phones.iter().map(|phone| phone.shift_weeks).collect();
    assert_eq!((shifts, session.settings.log.shift_weeks), (vec![Some(1_024), Some(-1_024)], Some(-1_024)));
}

#[test]
fn corrections_are_chosen_by_phone_and_session() {
    let text = "group = 'g'\n[[phone]]\nname = 'a'\nrecorded_corrections = true\n[[phone]]\nname = 'b'\n\
                [correction]\nionosphere = 'pair-only'";
    let session = parse(text).unwrap();
    assert_eq!(session.settings.estimator.correction.ionosphere, Ionosphere::PairOnly);
    assert_eq!(
        session.phones.iter().map(|phone| phone.recorded_corrections).collect::<Vec<_>>(),
        [true, false]
    );
    let refused = refusal("group = 'g'\n[[phone]]\nname = 'a'\n[correction]\nionosphere = 'none'");
    assert!(refused.contains("pair-only"), "{refused}");
}

#[test]
fn bases_and_masks_are_read_and_refused() {
    let phone = "group = 'g'\n[[phone]]\nname = 'a'\n";
    let text = "[correction]\nsources = ['base.obs', '/data/base.rtcm3']\nbase_position_m = [1.0, -2.0, 3.5]\n\
                maximum_age_s = 30\n[masks]\nelevation_deg = 10\n[log]\nkeep_multipath = true";
    let session = parse(&format!("{phone}{text}")).unwrap();
    let file = |path: &str| CorrectionSource::File(path.into());
    assert_eq!(
        session.settings.corrections.sources,
        [file("drives/monday/base.obs"), file("/data/base.rtcm3")]
    );
    assert_eq!(session.settings.corrections.base_position, Some(Ecef::new(1.0, -2.0, 3.5)));
    assert!((session.settings.corrections.options.maximum_age_s - 30.0).abs() < 1e-12);
    assert_eq!(
        (session.settings.masks.elevation_deg, session.settings.log.keep_multipath),
        (Some(10.0), true)
    );
    for (text, said) in [
        ("[correction]\nmaximum_age_s = 30", "need sources"),
        ("[correction]\nsources = ['a']\nmaximum_age_s = -1", "maximum_age_s is -1"),
        ("[masks]\nelevation_deg = 91", "line 5: [masks] elevation_deg"),
        ("[log]\n\nbias_uncertainty_ns = -1", "line 6: [log] bias_uncertainty_ns"),
        ("[log]\nkeep = true", "keep"),
    ] {
        let refused = refusal(&format!("{phone}{text}"));
        assert!(refused.contains(said), "expected '{said}' in: {refused}");
    }
}

#[test]
fn settings_override_their_preset_wherever_they_act() {
    let text = "group = 'g'\n[[phone]]\nname = 'a'\n[filter]\npreset = 'peng2023'\nmaximum_gap_s = 3\n\
                [stochastic]\nrate = { noise_m2ps2 = 99.0 }\n[integrity]\nmaximum_exclusions = 2\n\
                [constraints]\ndistance_model = 'box'\n[alignment]\ntolerance_s = 0.1\n\
                [correction]\nsources = ['b']\n[correction.base]\nother_code_sigma_m = 3.0";
    let session = parse(text).unwrap();
    let (pipeline, engine) = session.settings.options().unwrap();
    let (peng_pipeline, peng_engine) = (PipelineOptions::peng2023(), EngineOptions::peng2023());
    assert_eq!(pipeline.filter, engine.filter);
    assert_eq!(engine.filter.process, peng_engine.filter.process);
    assert_eq!((engine.filter.maximum_gap_s, pipeline.raim.maximum_exclusions), (3.0, 2));
    assert_eq!(pipeline.correction.stochastic.code, peng_pipeline.correction.stochastic.code);
    let VarianceModel::Cn0 { a: 0.01, b: 99.0 } = pipeline.correction.stochastic.rate else {
        panic!("{:?}", pipeline.correction.stochastic)
    };
    assert_eq!(engine.constraints.distance_model, DistanceModel::Box);
    assert_eq!(engine.constraints.method, peng_engine.constraints.method);
    assert_eq!(session.settings.estimator.align().tolerance_s, Some(0.1));
    assert_eq!(session.settings.corrections.options.other_code_sigma_m, 3.0);
    let outside = refusal("group = 'g'\n[[phone]]\nname = 'a'\n[filter]\nmaximum_gap_s = 1e9");
    let said =
        "session.toml: line 5: [filter] maximum_gap_s is 1000000000.0; it must lie within 0.1 to 3600 [s]";
    assert!(outside.ends_with(said), "{outside}");
}

/// What `cofix-hub settings` prints, put into a session, changes nothing.
#[test]
fn all_that_is_printed_may_stand_in_a_session() {
    for preset in [Preset::Default, Preset::Peng2023] {
        let printed = cofix_agent::settings::document(preset);
        let session = parse(&format!("group = 'g'\n[[phone]]\nname = 'a'\n{printed}")).unwrap();
        let usual =
            parse(&format!("group = 'g'\n[[phone]]\nname = 'a'\n[filter]\npreset = '{}'", preset.name()));
        let usual = usual.unwrap().settings;
        assert_eq!(session.settings.estimator, usual.estimator);
        assert_eq!((session.settings.preset, &session.settings.corrections), (preset, &usual.corrections));
        let correction = |settings: &Settings| settings.options().unwrap().0.correction;
        assert_eq!(correction(&session.settings), correction(&usual));
    }
}

#[test]
fn what_is_not_used_is_named_for_all_phones_and_for_one() {
    let text = "group = 'g'\n[[phone]]\nname = 'a'\nexclude = ['C:1C']\n[[phone]]\nname = 'b'\n[masks]\nexclude = ['E', 'G05', '5X']";
    let session = parse(text).unwrap();
    let named = |masks: &[Exclusion]| masks.iter().map(ToString::to_string).collect::<Vec<_>>();
    assert_eq!(named(&session.settings.options().unwrap().0.correction.exclude), ["E", "G05", "5X"]);
    assert_eq!(named(&session.phones[0].exclude), ["C:1C"]);
    assert!(session.phones[1].exclude.is_empty());
    for text in [
        "group = 'g'\n[[phone]]\nname = 'a'\nexclude = ['GPS']",
        "group = 'g'\n[[phone]]\nname = 'a'\n[masks]\nexclude = ['E', 'GPS']",
    ] {
        let refused = refusal(text);
        assert!(refused.contains("line ") && refused.contains("'GPS' names nothing to exclude"), "{refused}");
    }
}

#[test]
fn a_minimal_file_has_defaults() {
    let session = parse("group = 'g'\n[[phone]]\nname = 'a'\n[filter]\npreset = 'peng2023'").unwrap();
    assert_eq!(session.truth_quality, [1]);
    assert_eq!(session.products, ProductFiles::default());
    assert_eq!(session.settings.preset, Preset::Peng2023);
    assert_eq!(session.settings.estimator.correction.ionosphere, Ionosphere::Model);
    assert!(!session.phones[0].recorded_corrections);
    assert!(session.constraints.is_empty());
}

#[test]
fn unknown_keys_are_named_wherever_they_are() {
    let phones = "[[phone]]\nname = 'a'\n[[phone]]\nname = 'b'\n";
    for (key, text) in [
        ("grupo", format!("group = 'g'\ngrupo = 'x'\n{phones}")),
        ("sp4", format!("group = 'g'\n{phones}[products]\nsp4 = []")),
        ("colour", format!("group = 'g'\n{phones}colour = 'red'")),
        ("maximum", format!("group = 'g'\n{phones}[[constraint]]\nkind = 'distance'\nmaximum = 2.0")),
        ("truth_qualities", format!("group = 'g'\n{phones}[evaluation]\ntruth_qualities = [1]")),
        ("presets", format!("group = 'g'\n{phones}[filter]\npresets = 'default'")),
        ("constrains", format!("group = 'g'\n{phones}[[constrains]]\nkind = 'distance'")),
        ("code_scale", format!("group = 'g'\n{phones}[filter]\ncode_scale = 1.0")),
        ("zenith", format!("group = 'g'\n{phones}[stochastic.code]\nzenith = 1.0")),
        (
            "course_deg",
            format!("group = 'g'\n{phones}[[constraint]]\nkind='distance'\nmaximum_m=2\ncourse_deg=1"),
        ),
    ] {
        let message = refusal(&text);
        assert!(message.contains(&format!("`{key}`")), "{message}");
        assert!(message.contains("drives/monday/session.toml"), "{message}");
        assert!(message.contains("unknown"), "{message}");
    }
}

#[test]
fn nonsense_is_refused_with_a_reason() {
    let group = "group = 'g'\n[[phone]]\nname = 'a'\n[[phone]]\nname = 'b'\n";
    let rule = |keys: &str| format!("{group}[[constraint]]\n{keys}");
    for (reason, text) in [
        ("no phone", "group = 'g'".to_owned()),
        ("missing field `group`", "[[phone]]\nname = 'a'".to_owned()),
        ("group: the name 'a/b' contains '/'", "group = 'a/b'\n[[phone]]\nname = 'a'".to_owned()),
        (
            "number 2: the name is empty",
            "group = 'g'\n[[phone]]\nname = 'a'\n[[phone]]\nname = ''".to_owned(),
        ),
        ("'a' is there twice", "group = 'g'\n[[phone]]\nname = 'a'\n[[phone]]\nname = 'a'".to_owned()),
        ("'c' is not one of a, b", rule("kind='distance'\nmaximum_m=2\nphones=['a','c']")),
        ("'a' is named twice", rule("kind='distance'\nmaximum_m=2\nphones=['a','a']")),
        ("at least two phones", rule("kind='distance'\nmaximum_m=2\nphones=['a']")),
        ("phones is empty", rule("kind='distance'\nmaximum_m=2\nphones=[]")),
        ("missing field `maximum_m`", rule("kind='distance'")),
        ("maximum_m is -1", rule("kind='distance'\nmaximum_m=-1")),
        ("maximum_m is NaN", rule("kind='distance'\nmaximum_m=nan")),
        ("minimum_m is -1", rule("kind='distance'\nmaximum_m=2\nminimum_m=-1")),
        ("minimum_m 3 is above maximum_m 2", rule("kind='distance'\nmaximum_m=2\nminimum_m=3")),
        ("maximum_mps is 0", rule("kind='vertical-velocity'\nmaximum_mps=0")),
        ("missing field `course_deg`", rule("kind='heading'\ntolerance_deg=10")),
        ("course_deg is 400", rule("kind='heading'\ncourse_deg=400\ntolerance_deg=10")),
        ("tolerance_deg is 90; it must be below 90", rule("kind='heading'\ncourse_deg=0\ntolerance_deg=90")),
        ("unknown variant `depth`", rule("kind='depth'")),
        ("minimum_mps 3 is above maximum_mps 2", rule("kind='speed'\nmaximum_mps=2\nminimum_mps=3")),
        ("write at least one of both", rule("kind='speed'")),
        (
            "[[constraint]] number 1: from_gps: 'noon' is not a GPS time",
            rule("kind='distance'\nmaximum_m=2\nfrom_gps='noon'"),
        ),
        (
            "is after to_gps",
            rule(
                "kind='distance'\nmaximum_m=2\nfrom_gps='2020-08-13T15:00:00'\nto_gps='2020-08-13T14:00:00'",
            ),
        ),
        (
            "date of phone 'a': 'noon' is not a GPS time",
            "group='g'\n[[phone]]\nname='a'\ndate='noon'".to_owned(),
        ),
        ("truth_quality is empty", format!("{group}[evaluation]\ntruth_quality = []")),
        ("invalid type", "group = 3".to_owned()),
    ] {
        let message = refusal(&text);
        assert!(message.contains(reason), "expected '{reason}' in: {message}");
    }
}

#[test]
fn a_key_of_another_kind_is_refused_with_the_keys_of_its_own() {
    let message = refusal(
        "group = 'g'\n[[phone]]\nname = 'a'\n[[phone]]\nname = 'b'\n[[constraint]]\nkind = 'distance'\nmaximum_m = 2\n\
         [[constraint]]\ncourse_deg = 1\nkind = 'distance'\nmaximum_m = 2",
    );
    assert!(
        message.ends_with(
            "[[constraint]] number 2: unknown key `course_deg` for kind distance, which has minimum_m, maximum_m: it \
             belongs to heading"
        ),
        "{message}"
    );
}

#[test]
fn a_value_of_a_constraint_is_refused_with_its_line() {
    let message =
        refusal("group = 'g'\n[[phone]]\nname = 'a'\n[[constraint]]\nkind = 'heading'\ncourse_deg = 'north'");
    assert!(message.contains("line 6") && message.contains("expected f64"), "{message}");
    let message = refusal("group = 'g'\n[[phone]]\nname = 'a'\n[[constraint]]\nheight_m = 1");
    assert!(message.contains("line 5") && message.contains("`kind`, `phones`, `from_gps`"), "{message}");
}

#[test]
fn a_missing_file_is_named() {
    let message = Session::read(Path::new("no/such/session.toml"), None).unwrap_err().to_string();
    assert!(message.contains("no/such/session.toml") && message.contains("cannot read"), "{message}");
}

#[test]
fn paths_are_relative_to_a_folder_that_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("session.toml");
    std::fs::write(&file, SESSION).unwrap();
    let data = folder.path().join("data of mine");
    let refused = Session::read(&file, Some(&data)).unwrap_err().to_string();
    assert!(
        refused.contains("session.toml") && refused.contains("data of mine, which is no folder"),
        "{refused}"
    );
    std::fs::create_dir(&data).unwrap();
    let session = Session::read(&file, Some(&data)).unwrap();
    assert_eq!(session.products.bias, [data.join("biases.bia")]);
    assert_eq!(session.products.navigation, [PathBuf::from("/data/brdc.rnx.gz")], "absolute paths stay");
    assert_eq!(session.phones[0].observations, Some(data.join("HP30.rnx")));
    assert_eq!(session.phones[0].truth, Some(data.join("HP30.truth.csv")));
    let beside = Session::read(&file, None).unwrap();
    assert_eq!(beside.phones[0].truth, Some(folder.path().join("HP30.truth.csv")));
}

/// The sessions of the published dataset: four phones, a log and a truth each.
#[test]
fn the_sessions_to_reproduce_are_read() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/reproduce");
    for name in ["WH-3-08", "WH-3-09", "WH-4-06"] {
        let session = Session::read(&folder.join(format!("{name}.toml")), None).unwrap();
        assert_eq!(session.phone_names(), ["HP30", "HP20", "VX30", "XIM8"], "{name}");
        for phone in &session.phones {
            let log = phone.observations.as_ref().unwrap().display().to_string();
            assert!(log.contains(name) && log.ends_with(&format!("spare_log_{}.txt", phone.name)), "{log}");
            assert!(
                phone.truth.as_ref().unwrap().starts_with(folder.join("Ground Truth/2020-08-13")),
                "{log}"
            );
        }
        assert_eq!(session.constraints.len(), 6 + 4, "{name}");
    }
}
