//! What is accepted of a log, and how its clock is read.

use serde::{Deserialize, Serialize};

use crate::gnss::Constellation;

/// Which `FullBiasNanos` and `BiasNanos` turn the phone's clock into GPS time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BiasReference {
    /// Those of each epoch: time tags stay near GPS time, pseudoranges step when the phone revises its clock (by tens of
    /// metres, alike for all satellites). RINEX files written by the app are made so.
    #[default]
    EachEpoch,
    /// Those of the first epoch, until the count of hardware clock discontinuities changes: tags and pseudoranges drift
    /// with the oscillator, as Doppler and phase do. Google's GPS measurement tools do this.
    FirstEpoch,
}

/// Options of the decoder.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Clock of the pseudoranges.
    pub bias_reference: BiasReference,
    /// What is not used.
    pub masks: Masks,
    /// Give carrier phases also where the phone does not call them valid (bit 0 of `AccumulatedDeltaRangeState`).
    pub keep_invalid_phase: bool,
}

/// Measurements outside these limits are not used; each mask counts what it takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Masks {
    /// Tracking states that give an unambiguous time of transmission.
    pub states: StateRules,
    /// Leave out signals whose `MultipathIndicator` is 1 (detected).
    pub reject_multipath: bool,
    /// Largest `BiasUncertaintyNanos`, ns. Google's GPS measurement tools: 10 ms. At 10 ms the satellites' positions are
    /// off by up to 9 m along the line of sight.
    pub max_bias_uncertainty_ns: f64,
    /// Largest `ReceivedSvTimeUncertaintyNanos`, ns.
    pub max_received_time_uncertainty_ns: f64,
    /// Smallest `Cn0DbHz`, dB-Hz.
    pub min_cn0_dbhz: f64,
    /// Shortest and longest pseudorange, m. GPS and Galileo are 20,000 to 30,000 km away, geostationary satellites
    /// 36,000 to 42,000 km.
    pub pseudorange_m: (f64, f64),
    /// Dopplers whose `PseudorangeRateUncertaintyMetersPerSecond` is larger are left out, m/s (the code stays).
    pub max_rate_uncertainty_mps: f64,
}

impl Default for Masks {
    fn default() -> Self {
        Self {
            states: StateRules::default(),
            reject_multipath: true,
            max_bias_uncertainty_ns: 1e7,
            max_received_time_uncertainty_ns: 500.0,
            min_cn0_dbhz: 15.0,
            pseudorange_m: (1e7, 5e7),
            max_rate_uncertainty_mps: 10.0,
        }
    }
}

impl Masks {
    /// No mask but those that a pseudorange cannot do without: state bits and range.
    pub fn none() -> Self {
        Self {
            reject_multipath: false,
            max_bias_uncertainty_ns: f64::INFINITY,
            max_received_time_uncertainty_ns: f64::INFINITY,
            min_cn0_dbhz: f64::NEG_INFINITY,
            max_rate_uncertainty_mps: f64::INFINITY,
            ..Self::default()
        }
    }
}

/// Bits of `GnssMeasurement.State` (Android API).
pub mod state {
    /// Code lock.
    pub const CODE_LOCK: u32 = 1;
    /// Time of week decoded from the signal.
    pub const TOW_DECODED: u32 = 1 << 3;
    /// The time is known only modulo some milliseconds.
    pub const MSEC_AMBIGUOUS: u32 = 1 << 4;
    /// GLONASS time of day decoded from the signal.
    pub const GLO_TOD_DECODED: u32 = 1 << 7;
    /// Lock on Galileo's E1B or E1C code.
    pub const GAL_E1BC_CODE_LOCK: u32 = 1 << 10;
    /// Lock on Galileo E1C's secondary code, which lasts 100 ms.
    pub const GAL_E1C_2ND_CODE_LOCK: u32 = 1 << 11;
    /// Time of week known by other means than this signal.
    pub const TOW_KNOWN: u32 = 1 << 14;
    /// GLONASS time of day known by other means than this signal.
    pub const GLO_TOD_KNOWN: u32 = 1 << 15;
}

/// State bits that a measurement must and must not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StateRule {
    /// At least one of these must be set: the code is tracked.
    pub tracked: u32,
    /// At least one of these must be set: the time of transmission is complete.
    pub timed: u32,
    /// Or one of these: the time is known modulo 100 ms, which the travel time of 65 to 100 ms resolves. Taken where none of
    /// `timed` but those of `tracked` is set.
    pub timed_100_ms: u32,
    /// None of these may be set.
    pub forbidden: u32,
}

/// The rule of each system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StateRules {
    /// GPS.
    pub gps: StateRule,
    /// GLONASS.
    pub glonass: StateRule,
    /// Galileo.
    pub galileo: StateRule,
    /// BeiDou.
    pub beidou: StateRule,
    /// QZSS.
    pub qzss: StateRule,
    /// NavIC.
    pub navic: StateRule,
    /// Satellite-based augmentation.
    pub sbas: StateRule,
}

impl StateRule {
    /// Whether state bits pass: the code is tracked, and the time of transmission known, if need be modulo 100 ms.
    pub const fn passes(self, state: u32) -> bool {
        state & self.tracked != 0
            && state & self.forbidden == 0
            && state & (self.timed | self.timed_100_ms) != 0
    }

    /// The code alone suffices: the time of transmission is believed without the bits that vouch for it.
    const fn untimed(self) -> Self {
        Self { timed: self.timed | self.tracked, ..self }
    }
}

impl StateRules {
    /// The rule of a system.
    pub const fn of(&self, constellation: Constellation) -> StateRule {
        match constellation {
            Constellation::Gps => self.gps,
            Constellation::Glonass => self.glonass,
            Constellation::Galileo => self.galileo,
            Constellation::Beidou => self.beidou,
            Constellation::Qzss => self.qzss,
            Constellation::Navic => self.navic,
            Constellation::Sbas => self.sbas,
        }
    }

    /// The same rules with times of transmission believed that no bit vouches for. A wrong one gives an implausible
    /// pseudorange, which its own mask takes, or RAIM.
    #[must_use]
    pub const fn untimed(self) -> Self {
        Self {
            gps: self.gps.untimed(),
            glonass: self.glonass.untimed(),
            galileo: self.galileo.untimed(),
            beidou: self.beidou.untimed(),
            qzss: self.qzss.untimed(),
            navic: self.navic.untimed(),
            sbas: self.sbas.untimed(),
        }
    }
}

impl Default for StateRules {
    fn default() -> Self {
        let week = StateRule {
            tracked: state::CODE_LOCK,
            timed: state::TOW_DECODED | state::TOW_KNOWN,
            timed_100_ms: 0,
            forbidden: state::MSEC_AMBIGUOUS,
        };
        Self {
            gps: week,
            glonass: StateRule { timed: state::GLO_TOD_DECODED | state::GLO_TOD_KNOWN, ..week },
            galileo: StateRule {
                tracked: state::CODE_LOCK | state::GAL_E1BC_CODE_LOCK,
                timed_100_ms: state::GAL_E1C_2ND_CODE_LOCK,
                ..week
            },
            beidou: week,
            qzss: week,
            navic: week,
            sbas: week,
        }
    }
}
