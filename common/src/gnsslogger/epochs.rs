//! Lines to epochs.

use std::collections::{BTreeMap, VecDeque};

use super::clock::EpochClock;
use super::leap::trusted_leap_seconds;
use super::measure::{Measured, add_carrier, measure};
use super::options::Options;
use super::raw::RawLine;
use super::signal::satellite;
use crate::decode::Record;
use crate::gnss::{EpochFlag, ObservationEpoch};
use crate::skips::Skips;
use crate::time::GpsTime;

/// A longer step forward than this (s) is believed only when the next line confirms it.
const MAX_STEP_S: f64 = 86_400.0;
/// Phones log raw measurements since 2016; the clocks of these years are believed (2010 to 2100), as GPS nanoseconds.
const PLAUSIBLE_NS: std::ops::Range<i64> = 946_684_800_000_000_000..3_787_000_000_000_000_000;

/// Collects the observations of lines that share `TimeNanos` into epochs in time order.
#[derive(Clone, Debug, Default)]
pub(super) struct Epochs {
    current: Option<Current>,
    /// `TimeNanos` of the last line, and whether that epoch has any observation.
    last_line: Option<LastLine>,
    /// A time far ahead that waits for a second line.
    suspect: Option<GpsTime>,
    glonass_channels: BTreeMap<u8, i8>,
    usual_size: usize,
}

#[derive(Clone, Debug)]
struct Current {
    clock: EpochClock,
    epoch: ObservationEpoch,
}

#[derive(Clone, Copy, Debug)]
struct LastLine {
    time_ns: i64,
    number: u64,
    used: bool,
}

impl Epochs {
    /// Takes a line; an epoch that it ends goes to `records`.
    pub(super) fn line(
        &mut self,
        (number, line): (u64, &RawLine),
        options: &Options,
        skips: &mut Skips,
        records: &mut VecDeque<Record>,
    ) {
        self.count_unused(Some((number, line.clock.time_ns)), skips);
        let satellite = match satellite(line.constellation_type, line.svid) {
            Ok(satellite) => satellite,
            Err(reason) => {
                let (system, svid) = (line.constellation_type, line.svid);
                return skips
                    .add(reason, || format!("line {number}: ConstellationType {system}, Svid {svid}"));
            }
        };
        let Some(clock) = self.clock(line, options) else {
            let clock = line.clock;
            return skips.add("clock outside the years 2010 to 2100", || {
                format!("line {number}: TimeNanos {}, FullBiasNanos {}", clock.time_ns, clock.full_bias_ns)
            });
        };
        let leap_seconds = trusted_leap_seconds(clock.time.gps(), line.clock.leap_seconds);
        let mut measured = match measure(line, satellite, clock.time, leap_seconds, options) {
            Ok(measured) => measured,
            Err(refusal) => {
                return skips.add(refusal.reason, || {
                    format!("line {number}: {satellite}, {} {}", refusal.value, refusal.quantity)
                });
            }
        };
        if let Some(letter) = measured.odd_code_type {
            skips.add("CodeType of no signal on its band (the usual one assumed; used)", || {
                format!(
                    "line {number}: {satellite}, {} taken as {}",
                    letter as char, measured.observation.signal
                )
            });
        }
        if let Err(refusal) = add_carrier(line, &mut measured, options) {
            skips.add(refusal.reason, || {
                format!("line {number}: {satellite}, {} {}", refusal.value, refusal.quantity)
            });
        }
        self.place((number, clock), measured, skips, records);
    }

    /// The stream has ended.
    pub(super) fn finish(&mut self, skips: &mut Skips, records: &mut VecDeque<Record>) {
        self.count_unused(None, skips);
        self.last_line = None;
        self.complete(records);
    }

    /// Time of the last epoch.
    pub(super) fn time(&self) -> Option<GpsTime> {
        self.current.as_ref().map(|current| current.epoch.time_gps)
    }

    /// Frequency channels by slot, as far as carrier frequencies told them.
    pub(super) const fn glonass_channels(&self) -> &BTreeMap<u8, i8> {
        &self.glonass_channels
    }

    /// Counts the epoch that the line of this time leaves behind, if none of its lines could be used.
    fn count_unused(&mut self, next: Option<(u64, i64)>, skips: &mut Skips) {
        let same = |last: LastLine| next.is_some_and(|(_, time_ns)| time_ns == last.time_ns);
        if self.last_line.is_some_and(same) {
            return;
        }
        if let Some(last) = self.last_line.filter(|last| !last.used) {
            skips.add("epoch without a usable measurement", || {
                format!("line {}: TimeNanos {}", last.number, last.time_ns)
            });
        }
        self.last_line = next.map(|(number, time_ns)| LastLine { time_ns, number, used: false });
    }

    /// The clock for a line: that of its epoch when it is open, else a new one, not in force yet.
    fn clock(&self, line: &RawLine, options: &Options) -> Option<EpochClock> {
        let before = self.current.as_ref().map(|current| &current.clock);
        if let Some(clock) = before.filter(|clock| clock.fields.time_ns == line.clock.time_ns) {
            return Some(*clock);
        }
        let clock = EpochClock::new(line.clock, before, options.bias_reference)?;
        PLAUSIBLE_NS.contains(&clock.time.whole_ns).then_some(clock)
    }

    fn place(
        &mut self,
        (number, clock): (u64, EpochClock),
        measured: Measured,
        skips: &mut Skips,
        records: &mut VecDeque<Record>,
    ) {
        let time_gps = clock.time.gps();
        let open = self.current.as_ref().is_some_and(|c| c.clock.fields.time_ns == clock.fields.time_ns);
        if !open {
            if let Err((reason, before)) = self.check_order(time_gps) {
                return skips.add(reason, || format!("line {number}: {time_gps} after {before}"));
            }
            self.complete(records);
            let observations = Vec::with_capacity(self.usual_size.max(16));
            let epoch = ObservationEpoch { time_gps, flag: EpochFlag::Ok, observations };
            self.current = Some(Current { clock, epoch });
        }
        if let Some(last) = &mut self.last_line {
            last.used = true;
        }
        self.push(number, measured, skips);
    }

    fn push(&mut self, number: u64, measured: Measured, skips: &mut Skips) {
        let Some(current) = &mut self.current else { return };
        let mut observation = measured.observation;
        let (satellite, signal) = (observation.satellite, observation.signal);
        let seen = &mut current.epoch.observations;
        if seen.iter().any(|o| o.satellite == satellite && o.signal == signal) {
            return skips.add("signal repeated in its epoch", || {
                format!("line {number}: {satellite} {signal} at {}", current.epoch.time_gps)
            });
        }
        if current.clock.discontinuous && observation.carrier_phase_cycles.is_some() {
            observation.loss_of_lock.cycle_slip = true;
        }
        seen.push(observation);
        if let Some(channel) = measured.glonass_channel {
            self.glonass_channels.insert(satellite.number, channel);
        }
    }

    /// Accepts the time of a new epoch, or says why not and against which time.
    fn check_order(&mut self, time: GpsTime) -> Result<(), (&'static str, GpsTime)> {
        let Some(last) = self.time() else { return Ok(()) };
        if time == last {
            return Err(("line repeats the time of an earlier epoch", last));
        }
        if time < last {
            return Err(("line steps back in time", last));
        }
        let confirmed = self.suspect.is_some_and(|s| (0.0..=MAX_STEP_S).contains(&(time - s)));
        if time - last > MAX_STEP_S && !confirmed {
            self.suspect = Some(time);
            return Err(("line jumps by more than a day", last));
        }
        self.suspect = None;
        Ok(())
    }

    /// Gives the open epoch. It stays as the reference for what follows, without its observations.
    fn complete(&mut self, records: &mut VecDeque<Record>) {
        let Some(current) = &mut self.current else { return };
        let observations = std::mem::take(&mut current.epoch.observations);
        if observations.is_empty() {
            return;
        }
        self.usual_size = observations.len();
        records.push_back(Record::Epoch(ObservationEpoch { observations, ..current.epoch.clone() }));
    }
}
