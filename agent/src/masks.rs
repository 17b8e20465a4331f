//! Masks as the command line and session files name them.

use std::ops::RangeInclusive;

use clap::{Args, ValueEnum};
use cofix_common::gnsslogger::{self, BiasReference};
use cofix_common::measurement::CorrectionOptions;
use serde::{Deserialize, Serialize};

/// What is not used of a recording. What is left open has its default.
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
    /// GnssLogger text: largest ReceivedSvTimeUncertaintyNanos [ns; default 500]
    #[arg(long, value_name = "NS")]
    pub received_time_uncertainty_ns: Option<f64>,
    /// GnssLogger text: largest BiasUncertaintyNanos [ns; default 1e7]
    #[arg(long, value_name = "NS")]
    pub bias_uncertainty_ns: Option<f64>,
    /// GnssLogger text: largest PseudorangeRateUncertaintyMetersPerSecond; above it the code is used without the rate [m/s;
    /// default 10]
    #[arg(long, value_name = "MPS")]
    pub rate_uncertainty_mps: Option<f64>,
    /// GnssLogger text: use signals whose MultipathIndicator is 1 (detected) too
    #[arg(long)]
    pub keep_multipath: bool,
    /// GnssLogger text: use time of week without its state bits too, where the pseudorange is plausible
    #[arg(long)]
    pub keep_untimed: bool,
    /// GnssLogger text: give carrier phases too that the phone does not call valid
    #[arg(long)]
    pub keep_invalid_phase: bool,
    /// GnssLogger text: which FullBiasNanos turns the phone's clock into GPS time [default: each-epoch]
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

/// A mask that makes no sense.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the mask {name} is {value}; it must lie between {} and {}", limits.start(), limits.end())]
pub struct MaskError {
    name: &'static str,
    value: f64,
    limits: RangeInclusive<f64>,
}

impl Masks {
    /// Whether every value makes sense.
    ///
    /// # Errors
    /// The first that does not.
    pub fn check(&self) -> Result<(), MaskError> {
        let uncertainty = 0.0..=f64::MAX;
        for (name, value, limits) in [
            ("of the elevation [degrees]", self.elevation_deg, 0.0..=90.0),
            ("of C/N0 [dB-Hz]", self.cn0_dbhz, 0.0..=80.0),
            (
                "of the received time's uncertainty [ns]",
                self.received_time_uncertainty_ns,
                uncertainty.clone(),
            ),
            ("of the bias uncertainty [ns]", self.bias_uncertainty_ns, uncertainty.clone()),
            ("of the rate's uncertainty [m/s]", self.rate_uncertainty_mps, uncertainty),
        ] {
            if let Some(value) = value.filter(|value| !limits.contains(value)) {
                return Err(MaskError { name, value, limits });
            }
        }
        Ok(())
    }

    /// The masks of corrections.
    pub fn correction(&self, mut options: CorrectionOptions) -> CorrectionOptions {
        if let Some(degrees) = self.elevation_deg {
            options.elevation_mask_rad = degrees.to_radians();
        }
        if let Some(cn0_dbhz) = self.cn0_dbhz {
            options.minimum_cn0_dbhz = cn0_dbhz;
        }
        options
    }

    /// How GnssLogger text is read.
    pub fn log(&self) -> gnsslogger::Options {
        let mut options = gnsslogger::Options::default();
        let masks = &mut options.masks;
        let set = |place: &mut f64, value: Option<f64>| *place = value.unwrap_or(*place);
        set(&mut masks.min_cn0_dbhz, self.cn0_dbhz);
        set(&mut masks.max_received_time_uncertainty_ns, self.received_time_uncertainty_ns);
        set(&mut masks.max_bias_uncertainty_ns, self.bias_uncertainty_ns);
        set(&mut masks.max_rate_uncertainty_mps, self.rate_uncertainty_mps);
        masks.reject_multipath = !self.keep_multipath;
        if self.keep_untimed {
            masks.states = masks.states.untimed();
        }
        options.keep_invalid_phase = self.keep_invalid_phase;
        options.bias_reference = match self.bias_reference {
            None | Some(Bias::EachEpoch) => BiasReference::EachEpoch,
            Some(Bias::FirstEpoch) => BiasReference::FirstEpoch,
        };
        options
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_open_is_as_by_default() {
        let open = Masks::default();
        assert_eq!(open.log(), gnsslogger::Options::default());
        assert_eq!(open.correction(CorrectionOptions::default()), CorrectionOptions::default());
        assert_eq!(open.check(), Ok(()));
    }

    #[test]
    fn what_is_given_is_used() {
        let masks = Masks {
            elevation_deg: Some(10.0),
            cn0_dbhz: Some(20.0),
            received_time_uncertainty_ns: Some(100.0),
            bias_uncertainty_ns: Some(40.0),
            rate_uncertainty_mps: Some(1.0),
            keep_multipath: true,
            keep_untimed: true,
            keep_invalid_phase: true,
            bias_reference: Some(Bias::FirstEpoch),
        };
        let correction = masks.correction(CorrectionOptions::default());
        assert!((correction.elevation_mask_rad - 10_f64.to_radians()).abs() < 1e-15);
        assert!((correction.minimum_cn0_dbhz - 20.0).abs() < 1e-15);
        let log = masks.log();
        let limits = [
            log.masks.min_cn0_dbhz,
            log.masks.max_received_time_uncertainty_ns,
            log.masks.max_bias_uncertainty_ns,
            log.masks.max_rate_uncertainty_mps,
        ];
        assert!(limits.iter().zip([20.0, 100.0, 40.0, 1.0]).all(|(got, asked)| (got - asked).abs() < 1e-12));
        assert!(!log.masks.reject_multipath && log.keep_invalid_phase);
        assert_eq!(log.bias_reference, BiasReference::FirstEpoch);
        assert_ne!(log.masks.states, gnsslogger::Masks::default().states);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        for masks in [
            Masks { elevation_deg: Some(91.0), ..Masks::default() },
            Masks { cn0_dbhz: Some(f64::NAN), ..Masks::default() },
            Masks { bias_uncertainty_ns: Some(-1.0), ..Masks::default() },
        ] {
            assert!(masks.check().unwrap_err().to_string().contains("must lie between"));
        }
    }
}
