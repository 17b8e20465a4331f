//! One line of JSON to one epoch.

use serde::Deserialize;
use serde_json::Value;

use super::names;
use crate::formats::lost_locks::SignalKey;
use crate::gnss::{
    CN0_BOUNDS_DBHZ, LossOfLock, MAX_DOPPLER_HZ, MAX_PHASE_CYCLES, Observation, PSEUDORANGE_BOUNDS_M,
    SatelliteId, SignalCode,
};
use crate::skips::{Reason, Skips};
use crate::time::{Calendar, GpsTime};

/// An epoch's observations, in the order of the line.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Epoch {
    pub(super) time_gps: GpsTime,
    pub(super) observations: Vec<Observation>,
    /// Signals whose phase was lost without a phase at this epoch.
    pub(super) lost: Vec<SignalKey>,
}

#[derive(Deserialize)]
struct Line {
    obsd_t: Observed,
}

#[derive(Deserialize)]
struct Observed {
    d: Vec<Value>,
    t: Time,
}

#[derive(Deserialize)]
struct Time {
    year: f64,
    month: f64,
    day: f64,
    hour: f64,
    minute: f64,
    sec: f64,
}

impl Time {
    fn gps(&self) -> Option<GpsTime> {
        GpsTime::from_calendar(Calendar {
            year: i32::from(whole::<u16>(self.year)?),
            month: whole(self.month)?,
            day: whole(self.day)?,
            hour: whole(self.hour)?,
            minute: whole(self.minute)?,
            second: self.sec,
        })
    }
}

/// A number that is whole; tools that pass through floating point write `10.0`.
fn whole<T: TryFrom<u64>>(value: f64) -> Option<T> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole and in range
    (value.fract() == 0.0 && (0.0..=9_999.0).contains(&value)).then(|| T::try_from(value as u64).ok())?
}

/// Reason why a line or an entry gives no observation.
struct Fault {
    reason: Reason,
    detail: String,
}

/// Reads a line; `None`, counted, when it holds no epoch.
pub(super) fn read(number: u64, line: &[u8], skips: &mut Skips) -> Option<Epoch> {
    let observed = match serde_json::from_slice::<Line>(line) {
        Ok(Line { obsd_t }) => obsd_t,
        Err(error) => {
            let reason =
                if error.is_data() { Reason::LineLacksObservationsOrTime } else { Reason::LineNotJson };
            skips.add(reason, || format!("line {number}: {error}"));
            return None;
        }
    };
    let Some(time_gps) = observed.t.gps() else {
        let Time { year, month, day, hour, minute, sec } = observed.t;
        skips.add(Reason::EpochTimeInvalid, || {
            format!("line {number}: {year}-{month}-{day} {hour}:{minute}:{sec}")
        });
        return None;
    };
    let mut epoch = Epoch { time_gps, observations: Vec::with_capacity(observed.d.len()), lost: Vec::new() };
    for entry in &observed.d {
        let mut entry = Entry { fields: entry, number, name: String::new(), skips };
        if let Err(fault) = entry.read(&mut epoch) {
            skips.add(fault.reason, || format!("line {number}: {}", fault.detail));
        }
    }
    Some(epoch)
}

/// One signal of one satellite.
struct Entry<'a> {
    fields: &'a Value,
    number: u64,
    /// Satellite and signal, once they are known.
    name: String,
    skips: &'a mut Skips,
}

impl Entry<'_> {
    fn read(&mut self, epoch: &mut Epoch) -> Result<(), Fault> {
        let (satellite, signal) = self.names()?;
        if epoch.observations.iter().any(|o| (o.satellite, o.signal) == (satellite, signal)) {
            return Err(Fault { reason: Reason::SignalRepeated, detail: self.name.clone() });
        }
        let pseudorange_m =
            self.value("p", Reason::PseudorangeOutOfRange, |p| PSEUDORANGE_BOUNDS_M.contains(&p));
        let carrier_phase_cycles = self.value("l", Reason::PhaseOutOfRange, |l| l.abs() <= MAX_PHASE_CYCLES);
        let doppler_hz = self.value("d", Reason::DopplerOutOfRange, |d| d.abs() <= MAX_DOPPLER_HZ);
        let cn0_dbhz = self.value("snr", Reason::Cn0OutOfRange, |snr| CN0_BOUNDS_DBHZ.contains(&snr));
        let loss_of_lock = self.loss_of_lock();
        if carrier_phase_cycles.is_none() && loss_of_lock.cycle_slip {
            epoch.lost.push((satellite, signal));
        }
        let observation = Observation {
            satellite,
            signal,
            pseudorange_m,
            carrier_phase_cycles,
            doppler_hz,
            cn0_dbhz,
            loss_of_lock: if carrier_phase_cycles.is_some() { loss_of_lock } else { LossOfLock::default() },
        };
        let values = [pseudorange_m, carrier_phase_cycles, doppler_hz, cn0_dbhz];
        if values.iter().all(Option::is_none) {
            return Err(Fault { reason: Reason::SignalWithoutValue, detail: self.name.clone() });
        }
        epoch.observations.push(observation);
        Ok(())
    }

    fn names(&mut self) -> Result<(SatelliteId, SignalCode), Fault> {
        let index = self.fields.get("prn");
        let satellite =
            index.and_then(Value::as_f64).and_then(whole).and_then(names::satellite).ok_or_else(|| {
                Fault { reason: Reason::SatelliteIndexOfNoSatellite, detail: shown("prn", index) }
            })?;
        let code = self.fields.get("type");
        let signal =
            code.and_then(Value::as_str).and_then(|code| names::signal(satellite.constellation, code));
        let signal = signal.ok_or_else(|| Fault {
            reason: Reason::ObservationCodeOfNoSignal,
            detail: format!("{satellite}, {}", shown("type", code)),
        })?;
        self.name = format!("{satellite} {signal}");
        Ok((satellite, signal))
    }

    /// A value within its limits; zero and null stand for none.
    fn value(&mut self, key: &str, beyond: Reason, is_possible: impl Fn(f64) -> bool) -> Option<f64> {
        let found = self.fields.get(key);
        let (reason, is_none) = match found.and_then(Value::as_f64) {
            Some(0.0) => return None,
            Some(value) if is_possible(value) => return Some(value),
            Some(_) => (beyond, false),
            None => (Reason::ValueMissing, found.is_some_and(Value::is_null)),
        };
        if !is_none {
            let (number, name) = (self.number, &self.name);
            self.skips.add(reason, || format!("line {number}: {name}, {}", shown(key, found)));
        }
        None
    }

    /// The bits of the loss-of-lock indicator; no bits when it is missing. An indicator that is not 0 to 7 counts as a lost lock.
    fn loss_of_lock(&mut self) -> LossOfLock {
        let found = self.fields.get("lli").filter(|value| !value.is_null());
        match found.map(|value| value.as_f64().and_then(whole::<u8>).filter(|bits| *bits <= 7)) {
            None => LossOfLock::default(),
            Some(Some(bits)) => {
                LossOfLock { cycle_slip: bits & 1 != 0, half_cycle: bits & 2 != 0, noisier: bits & 4 != 0 }
            }
            Some(None) => {
                let (number, name) = (self.number, &self.name);
                self.skips.add(Reason::LossOfLockIndicatorOutOfRange, || {
                    format!("line {number}: {name}, {}", shown("lli", found))
                });
                LossOfLock { cycle_slip: true, ..LossOfLock::default() }
            }
        }
    }
}

/// A key and its value, shortened.
fn shown(key: &str, value: Option<&Value>) -> String {
    let text = value.map_or_else(|| "missing".to_owned(), Value::to_string);
    format!("{key} {}", text.chars().take(40).collect::<String>())
}
