//! SESSION.toml: who takes part, with which files, under which constraints.
//!
//! ```toml
//! group = "wh-3-09"                   # chunk of the key expressions
//! [products]                          # optional: live, agents have theirs; recordings may carry navigation messages
//! sp3 = ["orbits.sp3"]                # precise orbits and clocks; .gz too, as all of these
//! clock = ["clocks.clk"]              # RINEX clocks to go with them
//! bias = ["biases.bia"]               # Bias-SINEX code biases to go with them
//! ionex = ["map.20i"]                 # ionosphere maps in place of Klobuchar
//! navigation = ["brdc.rnx.gz"]        # group delays and Klobuchar; orbits too where valid
//! [[phone]]
//! name = "HP30"                       # unique within the group
//! observations = "HP30.rnx"           # needed by `replay`, ignored by `run`
//! truth = "HP30.truth.csv"            # optional: the phone is scored against it; or a challenge's ground_truth.csv, a solution of RTKLIB (.pos), NMEA, or a truth table of
//!                                     # the WHU-Smartphone dataset
//! date = "2020-08-13T14:00:00"        # optional, for RTCM 3 without products, and for a truth without a week: an instant within three days
//!                                     # of the beginning
//! exclude = ["E12"]                 # optional: not used of this phone, beside what [masks] excludes for all
//! recorded_corrections = false        # true: the satellite states and delays of its own recording (challenge tables) in
//!                                     # place of the products', which need not be named then
//! shift_weeks = 1024                  # optional: weeks to add to its times, where its week was not rolled over; before [log]'s
//! [[constraint]]
//! kind = "distance"                   # every pair of the named phones
//! phones = ["HP30"]                   # default: all; every constraint has it
//! minimum_m = 0.0                     # default 0
//! maximum_m = 2.0
//! from_gps = "2020-08-13T14:33:00"    # optional: holds from here …
//! to_gps = "2020-08-13T14:34:00"      # … to here; every constraint has them
//! [[constraint]]
//! kind = "vertical-velocity"
//! maximum_mps = 1.0
//! [[constraint]]
//! kind = "heading"
//! course_deg = 260.0                  # over ground, clockwise from north
//! tolerance_deg = 10.0                # below 90
//! [[constraint]]
//! kind = "speed"                      # horizontal, of each of the named phones
//! minimum_mps = 0.0                   # default 0; it acts where the direction of motion is certain
//! maximum_mps = 14.0                  # default none; at least one of both must be there
//! [[constraint]]
//! kind = "height"                     # above the WGS 84 ellipsoid, of each of the named phones
//! minimum_m = 25.0                    # default none
//! maximum_m = 30.0                    # default none; at least one of both must be there
//! [[constraint]]
//! kind = "same-vehicle"               # every pair of the named phones: they move as one body, which may turn
//! maximum_mps = 0.8                   # difference of their velocities
//! [evaluation]
//! truth_quality = [1]                 # rows of the truth that count; this is the default
//! [filter]
//! preset = "default"                  # or "peng2023", "cappello2023"; single keys of the tables below override it
//! [correction]
//! sources = ["base.rtcm3"]            # optional: recordings of base stations and of ephemerides, for all phones
//! base_position_m = [4e6, 5e5, 5e6]   # optional: the base's antenna, ECEF, in place of what its recording states
//! maximum_age_s = 60.0                # of a base's corrections; this is the default
//! ionosphere = "model"                # or "pair": ionosphere-free pair of satellites with two bands, or "pair-only"
//! [masks]                             # what is not used; these are the defaults
//! elevation_deg = 7.5
//! cn0_dbhz = 15.0
//! exclude = []                        # constellations, satellites, signals: ["E", "G05", "C:1C", "E12:5X", "G:5", "5X"]
//! [log]                               # GnssLogger text and tables with its columns; these are the defaults
//! received_time_uncertainty_ns = 500.0
//! bias_uncertainty_ns = 1e7
//! rate_uncertainty_mps = 10.0         # beyond it the code is used without the rate
//! keep_multipath = false              # use what the phone flags as multipath
//! keep_untimed = false                # use times of transmission that no state bit vouches for
//! keep_invalid_phase = false
//! bias_reference = "each-epoch"       # or "first-epoch"
//! shift_weeks = 0                     # weeks to add to the times of all phones, of RINEX and tables too
//! ```
//!
//! The tables `[correction]`, `[stochastic]`, `[integrity]`, `[filter]`, `[constraints]` and `[alignment]` are the settings tree
//! ([`cofix_common::settings`]); `cofix-hub settings` prints all of its keys with units, ranges and defaults.
//!
//! Paths are relative to the file, or to a folder that is named when it is read. Unknown keys are errors.

mod advice;
mod constraint;
pub mod files;
mod rules;
mod text;
pub mod truths;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

pub use cofix_agent::ProductFiles;
use cofix_agent::settings::in_table;
use cofix_agent::settings::{LogOptions, MaskError, Masks};
use cofix_agent::{CorrectionSource, Corrections};
use cofix_common::frames::Ecef;
use cofix_common::fusion::engine::{EngineOptions, ScheduledConstraint};
use cofix_common::measurement::Exclusion;
use cofix_common::pipeline::PipelineOptions;
pub use cofix_common::settings::Preset;
use cofix_common::settings::{CorrectionKeys, Settings as Estimator};
use cofix_common::time::GpsTime;
use cofix_common::wire::check_name;

/// A checked session.
#[derive(Clone, Debug, PartialEq)]
pub struct Session {
    /// The group's name.
    pub group: String,
    /// Products; paths are absolute or relative to the working directory.
    pub products: ProductFiles,
    /// The phones, in the order of the file; constraints refer to them by index.
    pub phones: Vec<SessionPhone>,
    /// The constraints, a pair or a phone each.
    pub constraints: Vec<ScheduledConstraint>,
    /// Qualities of truth rows that count.
    pub truth_quality: Vec<u8>,
    /// The settings of its processing.
    pub settings: Settings,
}

/// The settings of a session's processing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// The preset that the estimator's settings began with.
    pub preset: Preset,
    /// The estimator's settings, of agents and hub.
    pub estimator: Estimator,
    /// Sources of corrections beside the products, for all phones.
    pub corrections: Corrections,
    /// Satellites and signals that are not used.
    pub masks: Masks,
    /// How GnssLogger text is read.
    pub log: LogOptions,
}

impl Settings {
    /// The agents' settings and the hub's.
    ///
    /// # Errors
    /// Invalid mask.
    pub fn options(&self) -> Result<(PipelineOptions, EngineOptions), MaskError> {
        let mut pipeline = self.estimator.pipeline();
        pipeline.correction = self.masks.apply(self.preset.masked(pipeline.correction))?;
        Ok((pipeline, self.estimator.engine()))
    }

    /// Of a file with this text.
    fn new(file: &text::SessionFile, text: &str, folder: &Path) -> Result<Self, String> {
        let given = file.settings();
        let estimator = Estimator::of_file(&given).map_err(|error| error.told(text))?;
        let preset = given.preset();
        let settings = Self {
            preset,
            estimator,
            corrections: corrections(&file.correction, &estimator, preset, folder)?,
            masks: file.masks.clone(),
            log: file.log.clone(),
        };
        settings.options().map_err(|error| in_table("masks", &error, text))?;
        settings.log.with(&settings.masks).map_err(|error| in_table("log", &error, text))?;
        Ok(settings)
    }
}

/// One phone of a session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SessionPhone {
    /// Its name within the group.
    pub name: String,
    /// Its recorded observations.
    pub observations: Option<PathBuf>,
    /// Its reference trajectory.
    pub truth: Option<PathBuf>,
    /// Whether its recording's own satellite states and delays are taken, where it has them.
    pub recorded_corrections: bool,
    /// Weeks to add to its times: its own, or those of the session.
    pub shift_weeks: Option<i64>,
    /// An instant within three days of the recording's beginning.
    pub date: Option<GpsTime>,
    /// Satellites and signals of it that are not used, beside those that the masks exclude for all phones.
    pub exclude: Vec<Exclusion>,
}

/// A session file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The file cannot be read.
    #[error("{}: cannot read the session file: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// Not TOML, an unknown key, a missing key or a value of the wrong type.
    #[error("{}: {message}", path.display())]
    Text {
        /// The file.
        path: PathBuf,
        /// The parser's message, with line and key.
        message: String,
    },
    /// Well-formed, but invalid.
    #[error("{}: {reason}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The mistake and its remedy.
        reason: String,
    },
}

impl Session {
    /// Reads a session file whose paths are relative to the folder `data`; to its own without one.
    ///
    /// # Errors
    /// See [`SessionError`].
    pub fn read(path: &Path, data: Option<&Path>) -> Result<Self, SessionError> {
        let text = std::fs::read_to_string(path)
            .map_err(|cause| SessionError::Read { path: path.to_owned(), cause })?;
        if let Some(folder) = data.filter(|folder| !folder.is_dir()) {
            let reason = format!("its data should lie in {}, which is no folder", folder.display());
            return Err(SessionError::Invalid { path: path.to_owned(), reason });
        }
        Self::parse(&text, path, data)
    }

    /// Reads the text of a session file that lies at `path`; its paths are relative as of [`Session::read`].
    ///
    /// # Errors
    /// See [`SessionError`].
    pub fn parse(text: &str, path: &Path, data: Option<&Path>) -> Result<Self, SessionError> {
        let file: text::SessionFile = toml::from_str(text).map_err(|error| SessionError::Text {
            path: path.to_owned(),
            message: with_advice(&error, text),
        })?;
        let folder = data.or(path.parent()).unwrap_or(Path::new(""));
        check(file, text, folder).map_err(|reason| SessionError::Invalid { path: path.to_owned(), reason })
    }

    /// The phones' names in order.
    pub fn phone_names(&self) -> Vec<String> {
        self.phones.iter().map(|phone| phone.name.clone()).collect()
    }
}

/// The parser's message, with advice on what to write instead.
fn with_advice(error: &toml::de::Error, text: &str) -> String {
    let message = error.to_string().trim_end().to_owned();
    match advice::advice(error, text) {
        Some(advice) => format!("{message}\n{advice}"),
        None => message,
    }
}

fn check(file: text::SessionFile, text: &str, folder: &Path) -> Result<Session, String> {
    check_name(&file.group).map_err(|error| format!("group: {error}"))?;
    check_phone_names(&file.phone)?;
    let names: Vec<&str> = file.phone.iter().map(|phone| phone.name.as_str()).collect();
    let mut constraints = Vec::new();
    for (index, rule) in file.constraint.iter().enumerate() {
        let expanded =
            rules::expand(rule, &names).map_err(|e| format!("[[constraint]] number {}: {e}", index + 1))?;
        constraints.extend(expanded);
    }
    if file.evaluation.truth_quality.is_empty() {
        return Err("[evaluation] truth_quality is empty: no row of a truth would count".to_owned());
    }
    let settings = Settings::new(&file, text, folder)?;
    let at = |path: PathBuf| folder.join(path);
    let all = |paths: Vec<PathBuf>| paths.into_iter().map(at).collect();
    let phone = |phone: text::PhoneEntry| {
        let date = phone.date.as_deref().map(str::parse::<GpsTime>).transpose();
        Ok(SessionPhone {
            date: date.map_err(|error| format!("date of phone '{}': {error}", phone.name))?,
            name: phone.name,
            observations: phone.observations.map(at),
            truth: phone.truth.map(at),
            recorded_corrections: phone.recorded_corrections,
            shift_weeks: phone.shift_weeks.or(settings.log.shift_weeks),
            exclude: phone.exclude,
        })
    };
    Ok(Session {
        group: file.group,
        products: ProductFiles {
            sp3: all(file.products.sp3),
            clock: all(file.products.clock),
            bias: all(file.products.bias),
            ionex: all(file.products.ionex),
            navigation: all(file.products.navigation),
        },
        phones: file.phone.into_iter().map(phone).collect::<Result<_, String>>()?,
        constraints,
        truth_quality: file.evaluation.truth_quality,
        settings,
    })
}

fn corrections(
    table: &CorrectionKeys,
    estimator: &Estimator,
    preset: Preset,
    folder: &Path,
) -> Result<Corrections, String> {
    let sources = table.sources.iter().flatten();
    let corrections = Corrections {
        sources: sources.map(|path| CorrectionSource::File(folder.join(path))).collect(),
        base_position: table.base_position_m.map(|[x, y, z]| Ecef::new(x, y, z)),
        options: estimator.differential(),
    };
    // All keys may stand in a file with their usual values.
    let usual_age_s = Estimator::preset(preset).correction.maximum_age_s;
    let stray = table.base_position_m.is_some() || estimator.correction.maximum_age_s != usual_age_s;
    if stray && corrections.sources.is_empty() {
        return Err("[correction] base_position_m and maximum_age_s need sources".to_owned());
    }
    Ok(corrections)
}

fn check_phone_names(phones: &[text::PhoneEntry]) -> Result<(), String> {
    if phones.is_empty() {
        return Err("no phone: add at least one [[phone]]".to_owned());
    }
    let mut seen = BTreeSet::new();
    for (index, phone) in phones.iter().enumerate() {
        check_name(&phone.name).map_err(|error| format!("[[phone]] number {}: {error}", index + 1))?;
        if !seen.insert(&phone.name) {
            return Err(format!("phone '{}' is there twice: names are unique within a group", phone.name));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
