//! Options of the decoder: masks, and the reading of the clock.

use serde::{Deserialize, Serialize};

use crate::formats::android::state;
use crate::gnss::Constellation;

/// The `FullBiasNanos` and `BiasNanos` that turn the phone's clock into GPS time.
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
    /// Limits outside which measurements are not used.
    pub masks: Masks,
    /// Weeks to add to the phone's time, for a phone whose week is wrong: 1,024 where it was not rolled over.
    pub shift_weeks: i64,
    /// Give carrier phases also where the phone does not call them valid (bit 0 of `AccumulatedDeltaRangeState`).
    pub keep_invalid_phase: bool,
}

/// Measurements outside these limits are not used; each mask counts the measurements that it leaves out.
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

/// A state that gives the time of transmission modulo a period, which the phone's own time resolves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModularTime {
    /// Any of these bits says so; none if 0.
    pub bits: u32,
    /// The period, ms.
    pub period_ms: u32,
}

/// State bits that a measurement must and must not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StateRule {
    /// At least one of these must be set: the code is tracked.
    pub tracked: u32,
    /// At least one of these must be set: the time of transmission is complete.
    pub timed: u32,
    /// Or else one of these: the time is known modulo a period. The longer period comes first.
    pub modular: [ModularTime; 2],
    /// None of these may be set where the time is not complete.
    pub forbidden: u32,
}

/// The part of the time of transmission that state bits vouch for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KnownTime {
    /// All of it; or it is believed without any bit (see [`StateRules::untimed`]).
    Complete,
    /// The time modulo a period, ms.
    Modulo(u32),
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
    /// The part of the time of transmission that is known where the code is tracked; `None` if the measurement cannot be used.
    ///
    /// A phone may call a code's milliseconds ambiguous that it has put right by the time of week (L5 beside L1 on chips of
    /// 2018): a complete time is believed all the same.
    pub fn known_time(self, state: u32) -> Option<KnownTime> {
        if state & self.tracked == 0 {
            return None;
        }
        // That the code is tracked says nothing about the time, even where it is let pass for it.
        if state & self.timed & !self.tracked != 0 {
            return Some(KnownTime::Complete);
        }
        if state & self.forbidden != 0 {
            return None;
        }
        let modular = self.modular.iter().find(|modular| state & modular.bits != 0);
        let modulo = modular.map(|modular| KnownTime::Modulo(modular.period_ms));
        modulo.or((state & self.timed != 0).then_some(KnownTime::Complete))
    }

    /// Whether state bits pass: the code is tracked, and enough of the time of transmission known.
    pub fn passes(self, state: u32) -> bool {
        self.known_time(state).is_some()
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
        use state::{
            BDS_D2_SUBFRAME_SYNC, GAL_E1B_PAGE_SYNC, GAL_E1C_2ND_CODE_LOCK, GLO_STRING_SYNC, SBAS_SYNC,
            SUBFRAME_SYNC,
        };
        let modulo = |bits, period_ms| ModularTime { bits, period_ms };
        let none = ModularTime::default();
        let week = StateRule {
            tracked: state::CODE_LOCK,
            timed: state::TOW_DECODED | state::TOW_KNOWN,
            modular: [modulo(SUBFRAME_SYNC, 6_000), none],
            forbidden: state::MSEC_AMBIGUOUS,
        };
        Self {
            gps: week,
            glonass: StateRule {
                timed: state::GLO_TOD_DECODED | state::GLO_TOD_KNOWN,
                modular: [modulo(GLO_STRING_SYNC, 2_000), none],
                ..week
            },
            galileo: StateRule {
                tracked: state::CODE_LOCK | state::GAL_E1BC_CODE_LOCK,
                modular: [modulo(GAL_E1B_PAGE_SYNC, 2_000), modulo(GAL_E1C_2ND_CODE_LOCK, 100)],
                ..week
            },
            beidou: StateRule {
                modular: [modulo(SUBFRAME_SYNC, 6_000), modulo(BDS_D2_SUBFRAME_SYNC, 600)],
                ..week
            },
            qzss: week,
            navic: week,
            sbas: StateRule { modular: [modulo(SBAS_SYNC, 1_000), none], ..week },
        }
    }
}
