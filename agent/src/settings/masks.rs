//! Masks by their names on the command line and in session files. Options that are left out have their defaults.

use std::ops::RangeInclusive;

use clap::{Args, ValueEnum};
use cofix_common::formats::gnsslogger::{self, BiasReference};
use cofix_common::measurement::{CorrectionOptions, Exclusion};
use cofix_common::settings::{Entry, Preset};
use serde::{Deserialize, Serialize};
use toml::Value;

/// Four times 1,024 weeks: a recording is not shifted by more.
const MOST_SHIFT_WEEKS: i64 = 4_096;

/// What is not used, of any format.
#[derive(Args, Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[command(next_help_heading = "Masks")]
pub struct Masks {
    /// Satellites lower than this are not used [degrees; default 7.5]
    #[arg(long = "elevation-mask", value_name = "DEGREES")]
    pub elevation_deg: Option<f64>,
    /// Signals weaker than this are not used [dB-Hz; default 15]
    #[arg(long = "cn0-mask", value_name = "DBHZ")]
    pub cn0_dbhz: Option<f64>,
    /// Not used are: a constellation (E), a satellite (G05), a signal or a band of either (C:1C, E12:5X, G:5) or of all
    /// constellations (5X, 5); may be repeated, or be a list with commas
    #[arg(long, value_name = "WHAT", value_delimiter = ',')]
    pub exclude: Vec<Exclusion>,
}

/// How GnssLogger text, and challenge tables that keep its columns, are read, and what of them is not used.
#[derive(Args, Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[command(next_help_heading = "GnssLogger text, and challenge tables with its columns")]
pub struct LogOptions {
    /// Largest ReceivedSvTimeUncertaintyNanos [ns; default 500]
    #[arg(long, value_name = "NS")]
    pub received_time_uncertainty_ns: Option<f64>,
    /// Largest BiasUncertaintyNanos [ns; default 1e7]
    #[arg(long, value_name = "NS")]
    pub bias_uncertainty_ns: Option<f64>,
    /// Largest PseudorangeRateUncertaintyMetersPerSecond; above it the code is used without the rate [m/s; default 10]
    #[arg(long, value_name = "MPS")]
    pub rate_uncertainty_mps: Option<f64>,
    /// Use signals whose MultipathIndicator is 1 (detected) too
    #[arg(long)]
    pub keep_multipath: bool,
    /// Use times of transmission for which no state bit vouches too, where the pseudorange is plausible
    #[arg(long)]
    pub keep_untimed: bool,
    /// Give carrier phases too that the phone does not call valid
    #[arg(long)]
    pub keep_invalid_phase: bool,
    /// Weeks to add to the times of a recording, of RINEX and challenge tables too, whose week is wrong [1024 for one that was not
    /// rolled over]
    #[arg(long, value_name = "WEEKS", allow_negative_numbers = true)]
    pub shift_weeks: Option<i64>,
    /// Which FullBiasNanos turns the phone's clock into GPS time [default: each-epoch]
    #[arg(long, value_name = "WHICH")]
    pub bias_reference: Option<Bias>,
}

/// [`BiasReference`] by name.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Bias {
    /// That of each epoch
    EachEpoch,
    /// That of the first epoch, until the count of clock discontinuities changes
    FirstEpoch,
}

/// Invalid mask.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the mask of {name} is {value}; it must lie between {} and {}", limits.start(), limits.end())]
pub struct MaskError {
    /// The key in files.
    pub key: &'static str,
    name: &'static str,
    value: f64,
    limits: RangeInclusive<f64>,
}

impl Masks {
    /// These options, and those of `file` where they are left out.
    #[must_use]
    pub fn or(self, file: Self) -> Self {
        Self {
            elevation_deg: self.elevation_deg.or(file.elevation_deg),
            cn0_dbhz: self.cn0_dbhz.or(file.cn0_dbhz),
            exclude: if self.exclude.is_empty() { file.exclude } else { self.exclude },
        }
    }

    /// The options of corrections with these masks.
    ///
    /// # Errors
    /// Invalid mask.
    pub fn apply(&self, mut options: CorrectionOptions) -> Result<CorrectionOptions, MaskError> {
        let elevation_deg =
            checked("elevation_deg", "the elevation [degrees]", self.elevation_deg, 0.0..=90.0)?;
        options.elevation_mask_rad = elevation_deg.map_or(options.elevation_mask_rad, f64::to_radians);
        options.minimum_cn0_dbhz = self.cn0_dbhz()?.unwrap_or(options.minimum_cn0_dbhz);
        options.exclude.extend(&self.exclude);
        Ok(options)
    }

    fn cn0_dbhz(&self) -> Result<Option<f64>, MaskError> {
        checked("cn0_dbhz", "C/N0 [dB-Hz]", self.cn0_dbhz, 0.0..=80.0)
    }
}

impl LogOptions {
    /// These options, and those of `file` where they are left out.
    #[must_use]
    pub fn or(self, file: &Self) -> Self {
        Self {
            received_time_uncertainty_ns: self
                .received_time_uncertainty_ns
                .or(file.received_time_uncertainty_ns),
            bias_uncertainty_ns: self.bias_uncertainty_ns.or(file.bias_uncertainty_ns),
            rate_uncertainty_mps: self.rate_uncertainty_mps.or(file.rate_uncertainty_mps),
            keep_multipath: self.keep_multipath || file.keep_multipath,
            keep_untimed: self.keep_untimed || file.keep_untimed,
            keep_invalid_phase: self.keep_invalid_phase || file.keep_invalid_phase,
            shift_weeks: self.shift_weeks.or(file.shift_weeks),
            bias_reference: self.bias_reference.or(file.bias_reference),
        }
    }

    /// The options of reading text; of `masks`, that of C/N0 counts.
    ///
    /// # Errors
    /// Invalid mask.
    pub fn with(&self, masks: &Masks) -> Result<gnsslogger::Options, MaskError> {
        let limit = MOST_SHIFT_WEEKS as f64;
        let weeks = self.shift_weeks.map(|weeks| weeks as f64);
        checked("shift_weeks", "weeks to shift", weeks, -limit..=limit)?;
        let mut options = gnsslogger::Options {
            shift_weeks: self.shift_weeks.unwrap_or(0),
            keep_invalid_phase: self.keep_invalid_phase,
            bias_reference: match self.bias_reference {
                None | Some(Bias::EachEpoch) => BiasReference::EachEpoch,
                Some(Bias::FirstEpoch) => BiasReference::FirstEpoch,
            },
            ..gnsslogger::Options::default()
        };
        let log = &mut options.masks;
        let set = |place: &mut f64, key, name, value| -> Result<(), MaskError> {
            *place = checked(key, name, value, 0.0..=f64::INFINITY)?.unwrap_or(*place);
            Ok(())
        };
        set(
            &mut log.max_received_time_uncertainty_ns,
            "received_time_uncertainty_ns",
            "the received time's uncertainty [ns]",
            self.received_time_uncertainty_ns,
        )?;
        set(
            &mut log.max_bias_uncertainty_ns,
            "bias_uncertainty_ns",
            "the bias uncertainty [ns]",
            self.bias_uncertainty_ns,
        )?;
        set(
            &mut log.max_rate_uncertainty_mps,
            "rate_uncertainty_mps",
            "the rate's uncertainty [m/s]",
            self.rate_uncertainty_mps,
        )?;
        log.min_cn0_dbhz = masks.cn0_dbhz()?.unwrap_or(log.min_cn0_dbhz);
        log.reject_multipath = !self.keep_multipath;
        if self.keep_untimed {
            log.states = log.states.untimed();
        }
        Ok(options)
    }
}

/// The keys of the tables `[masks]` and `[log]` with the values that they have with a preset.
pub fn entries(preset: Preset) -> Vec<Entry> {
    let correction = preset.masked(CorrectionOptions::default());
    let log = gnsslogger::Masks::default();
    let masks = ("masks", "What is not used, of any format.");
    let logs = ("log", "How GnssLogger text, and challenge tables with its columns, are read.");
    let float = |value: f64| Value::Float(value);
    let switch = ("switch", "true or false");
    let rows: [(_, _, _, _, Value); 11] = [
        (
            masks,
            "elevation_deg",
            ("degrees", "0 to 90"),
            "Satellites lower than this are not used.",
            // Rounded against the last digits of the conversion.
            float((correction.elevation_mask_rad.to_degrees() * 1e9).round() / 1e9),
        ),
        (
            masks,
            "cn0_dbhz",
            ("dB-Hz", "0 to 80"),
            "Signals weaker than this are not used.",
            float(correction.minimum_cn0_dbhz),
        ),
        (
            masks,
            "exclude",
            (
                "list",
                "constellations, satellites or signals: \"E\", \"G05\", \"C:1C\", \"E12:5X\", \"G:5\" or \"5X\"",
            ),
            "What is not used in any epoch.",
            Value::Array(Vec::new()),
        ),
        (
            logs,
            "received_time_uncertainty_ns",
            ("ns", "0 to inf"),
            "Largest ReceivedSvTimeUncertaintyNanos of signals that are used.",
            float(log.max_received_time_uncertainty_ns),
        ),
        (
            logs,
            "bias_uncertainty_ns",
            ("ns", "0 to inf"),
            "Largest BiasUncertaintyNanos of epochs that are used.",
            float(log.max_bias_uncertainty_ns),
        ),
        (
            logs,
            "rate_uncertainty_mps",
            ("m/s", "0 to inf"),
            "Largest PseudorangeRateUncertaintyMetersPerSecond; above it the code is used without the rate.",
            float(log.max_rate_uncertainty_mps),
        ),
        (
            logs,
            "keep_multipath",
            switch,
            "Whether signals are used whose MultipathIndicator is 1 (detected).",
            Value::Boolean(!log.reject_multipath),
        ),
        (
            logs,
            "keep_untimed",
            switch,
            "Whether times of transmission are used for which no state bit vouches.",
            Value::Boolean(false),
        ),
        (
            logs,
            "keep_invalid_phase",
            switch,
            "Whether carrier phases are given that the phone does not call valid.",
            Value::Boolean(false),
        ),
        (
            logs,
            "shift_weeks",
            ("weeks", "-4096 to 4096, whole"),
            "Weeks that are added to all times, of RINEX and challenge tables too; 1024 for a week that was not rolled over.",
            Value::Integer(0),
        ),
        (
            logs,
            "bias_reference",
            ("word", "\"each-epoch\" or \"first-epoch\""),
            "Which FullBiasNanos turns the phone's clock into GPS time.",
            Value::String("each-epoch".to_owned()),
        ),
    ];
    let entry =
        |((table, about), key, (unit, range), meaning, value): ((&str, &str), _, (_, &str), &str, _)| Entry {
            table: table.to_owned(),
            about: about.to_owned(),
            key,
            meaning: meaning.to_owned(),
            unit,
            range: range.to_owned(),
            value: Some(value),
            is_within: true,
        };
    rows.into_iter().map(entry).collect()
}

fn checked(
    key: &'static str,
    name: &'static str,
    value: Option<f64>,
    limits: RangeInclusive<f64>,
) -> Result<Option<f64>, MaskError> {
    match value {
        Some(value) if !limits.contains(&value) => Err(MaskError { key, name, value, limits }),
        value => Ok(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_open_is_as_by_default() {
        let open = Masks::default();
        assert_eq!(LogOptions::default().with(&open), Ok(gnsslogger::Options::default()));
        assert_eq!(open.apply(CorrectionOptions::default()), Ok(CorrectionOptions::default()));
    }

    #[test]
    fn what_is_given_is_used() {
        let exclude = vec!["E".parse().unwrap(), "C:1C".parse().unwrap()];
        let masks = Masks { elevation_deg: Some(10.0), cn0_dbhz: Some(20.0), exclude: exclude.clone() };
        let correction = masks.apply(CorrectionOptions::default()).unwrap();
        assert!((correction.elevation_mask_rad - 10_f64.to_radians()).abs() < 1e-15);
        assert!((correction.minimum_cn0_dbhz - 20.0).abs() < 1e-15);
        assert_eq!(correction.exclude, exclude);
        let log = LogOptions {
            received_time_uncertainty_ns: Some(100.0),
            bias_uncertainty_ns: Some(40.0),
            rate_uncertainty_mps: Some(1.0),
            keep_multipath: true,
            keep_untimed: true,
            keep_invalid_phase: true,
            bias_reference: Some(Bias::FirstEpoch),
            shift_weeks: Some(1_024),
        };
        let log = log.with(&masks).unwrap();
        let limits = [
            log.masks.min_cn0_dbhz,
            log.masks.max_received_time_uncertainty_ns,
            log.masks.max_bias_uncertainty_ns,
            log.masks.max_rate_uncertainty_mps,
        ];
        assert!(limits.iter().zip([20.0, 100.0, 40.0, 1.0]).all(|(got, asked)| (got - asked).abs() < 1e-12));
        assert!(!log.masks.reject_multipath && log.keep_invalid_phase);
        assert_eq!((log.bias_reference, log.shift_weeks), (BiasReference::FirstEpoch, 1_024));
        assert_ne!(log.masks.states, gnsslogger::Masks::default().states);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        for masks in [
            Masks { elevation_deg: Some(91.0), ..Masks::default() },
            Masks { cn0_dbhz: Some(f64::NAN), ..Masks::default() },
        ] {
            let error = masks.apply(CorrectionOptions::default()).unwrap_err();
            assert!(error.to_string().contains("must lie between"), "{error}");
        }
        let log = LogOptions { bias_uncertainty_ns: Some(-1.0), ..LogOptions::default() };
        assert!(log.with(&Masks::default()).is_err());
        let log = LogOptions { shift_weeks: Some(-5_000), ..LogOptions::default() };
        assert!(log.with(&Masks::default()).is_err());
    }
}
