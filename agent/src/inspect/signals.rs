//! Counts of each signal.

use std::collections::{BTreeMap, BTreeSet};

use cofix_common::gnss::{Constellation, Observation, SatelliteId, SignalCode};
use cofix_common::measurement::{CorrectionOptions, Exclusion};
use serde::Serialize;

use super::Mask;

/// Share of its phases with a loss of lock beyond which a signal is duty-cycled.
const DUTY_CYCLED: f64 = 0.5;
/// Fewest phases for which duty cycling is judged.
const ENOUGH_PHASES: u64 = 10;

/// Smallest, mean and largest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Smallest.
    pub minimum: f64,
    /// Mean.
    pub mean: f64,
    /// Largest.
    pub maximum: f64,
}

/// One constellation.
#[derive(Clone, Debug, Serialize)]
pub struct ConstellationReport {
    /// RINEX letter.
    pub system: char,
    /// Its satellites.
    pub satellites: Vec<String>,
    /// GLONASS: satellites without a frequency channel in the recording.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub without_channel: Vec<String>,
    /// Its signals.
    pub signals: Vec<SignalReport>,
}

/// One signal of a constellation.
#[derive(Clone, Debug, Serialize)]
pub struct SignalReport {
    /// RINEX band and attribute.
    pub signal: String,
    /// Satellites with it.
    pub satellites: usize,
    /// Observations: satellites times epochs.
    pub observations: u64,
    /// Of them without a pseudorange,
    pub missing_pseudorange: u64,
    /// carrier phase,
    pub missing_phase: u64,
    /// Doppler,
    pub missing_doppler: u64,
    /// C/N0.
    pub missing_cn0: u64,
    /// C/N0, dB-Hz.
    pub cn0_dbhz: Option<Spread>,
    /// Carrier phases with a loss of lock.
    pub slips: u64,
    /// Carrier phases with an unknown half cycle.
    pub half_cycles: u64,
}

/// Smallest, sum and largest of numbers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sum {
    count: u64,
    total: f64,
    bounds: Option<(f64, f64)>,
}

impl Sum {
    pub(super) fn add(&mut self, value: f64) {
        self.count += 1;
        self.total += value;
        let (low, high) = self.bounds.unwrap_or((value, value));
        self.bounds = Some((low.min(value), high.max(value)));
    }

    pub(super) fn spread(&self) -> Option<Spread> {
        let (minimum, maximum) = self.bounds?;
        Some(Spread { minimum, mean: self.total / self.count as f64, maximum })
    }
}

#[derive(Clone, Debug, Default)]
struct Signal {
    satellites: BTreeSet<SatelliteId>,
    observations: u64,
    missing: [u64; 4],
    cn0: Sum,
    slips: u64,
    half_cycles: u64,
}

impl Signal {
    fn add(&mut self, observation: &Observation) {
        self.satellites.insert(observation.satellite);
        self.observations += 1;
        let values = [
            observation.pseudorange_m,
            observation.carrier_phase_cycles,
            observation.doppler_hz,
            observation.cn0_dbhz,
        ];
        for (missing, value) in self.missing.iter_mut().zip(values) {
            *missing += u64::from(value.is_none());
        }
        if let Some(cn0) = observation.cn0_dbhz {
            self.cn0.add(cn0);
        }
        let has_phase = observation.carrier_phase_cycles.is_some();
        self.slips += u64::from(has_phase && observation.loss_of_lock.cycle_slip);
        self.half_cycles += u64::from(has_phase && observation.loss_of_lock.half_cycle);
    }

    fn is_duty_cycled(&self) -> bool {
        let [_, missing_phase, ..] = self.missing;
        let phases = self.observations - missing_phase;
        phases >= ENOUGH_PHASES && self.slips as f64 > DUTY_CYCLED * phases as f64
    }

    fn report(&self, signal: SignalCode) -> SignalReport {
        let [missing_pseudorange, missing_phase, missing_doppler, missing_cn0] = self.missing;
        SignalReport {
            signal: signal.to_string(),
            satellites: self.satellites.len(),
            observations: self.observations,
            missing_pseudorange,
            missing_phase,
            missing_doppler,
            missing_cn0,
            cn0_dbhz: self.cn0.spread(),
            slips: self.slips,
            half_cycles: self.half_cycles,
        }
    }
}

/// Collects signals.
#[derive(Clone, Debug, Default)]
pub(super) struct Signals {
    by_signal: BTreeMap<(Constellation, SignalCode), Signal>,
    minimum_cn0_dbhz: f64,
    weak: u64,
    /// Exclusions by name, and the number of their observations.
    excluded: Vec<(Exclusion, u64)>,
}

impl Signals {
    /// Empty, for counting the observations that these masks would leave out.
    pub(super) fn new(masks: &CorrectionOptions) -> Self {
        Self {
            minimum_cn0_dbhz: masks.minimum_cn0_dbhz,
            excluded: masks.exclude.iter().map(|exclusion| (*exclusion, 0)).collect(),
            ..Self::default()
        }
    }

    pub(super) fn add(&mut self, observations: &[Observation]) {
        for observation in observations {
            let key = (observation.satellite.constellation, observation.signal);
            self.by_signal.entry(key).or_default().add(observation);
            self.weak += u64::from(observation.cn0_dbhz.is_some_and(|cn0| cn0 < self.minimum_cn0_dbhz));
            for (exclusion, count) in &mut self.excluded {
                *count += u64::from(exclusion.names(observation));
            }
        }
    }

    /// Counts of observations that the agent's masks would leave out; an observation may count for several masks.
    pub(super) fn masks(&self) -> Vec<Mask> {
        let without_pseudorange =
            self.by_signal.values().map(|Signal { missing: [pseudorange, ..], .. }| *pseudorange).sum();
        let always = [
            Mask {
                name: format!("C/N0 below {} dB-Hz", self.minimum_cn0_dbhz),
                count: self.weak,
                names_nothing: false,
            },
            Mask { name: "no pseudorange".to_owned(), count: without_pseudorange, names_nothing: false },
        ];
        let by_name = self.excluded.iter().map(|(exclusion, count)| Mask {
            name: format!("exclude {exclusion}"),
            count: *count,
            names_nothing: *count == 0,
        });
        always.into_iter().chain(by_name).collect()
    }

    pub(super) fn duty_cycled(&self) -> Vec<String> {
        let cycled = self.by_signal.iter().filter(|(_, signal)| signal.is_duty_cycled());
        cycled.map(|((system, signal), _)| format!("{} {signal}", system.letter())).collect()
    }

    pub(super) fn report(&self, glonass_channels: &BTreeMap<u8, i8>) -> Vec<ConstellationReport> {
        let mut reports: BTreeMap<Constellation, (BTreeSet<SatelliteId>, Vec<SignalReport>)> =
            BTreeMap::new();
        for ((system, code), signal) in &self.by_signal {
            let (satellites, signals) = reports.entry(*system).or_default();
            satellites.extend(&signal.satellites);
            signals.push(signal.report(*code));
        }
        reports
            .into_iter()
            .map(|(system, (satellites, signals))| ConstellationReport {
                system: system.letter(),
                without_channel: satellites
                    .iter()
                    .filter(|s| system == Constellation::Glonass && !glonass_channels.contains_key(&s.number))
                    .map(ToString::to_string)
                    .collect(),
                satellites: satellites.iter().map(ToString::to_string).collect(),
                signals,
            })
            .collect()
    }
}
