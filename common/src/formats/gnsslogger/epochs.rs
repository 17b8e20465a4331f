//! Lines to epochs.

use std::collections::{BTreeMap, VecDeque};

use super::beyond::{Beyond, EpochBeyond};
use super::clock::{EpochClock, PLAUSIBLE_NS, WEEK_NS, describe_clock};
use super::measure::{Measured, Refusal, add_carrier, measure};
use super::names::named;
use super::options::Options;
use super::raw::{ClockFields, RawLine};
use crate::formats::android::{Signal, channel_only};
use crate::formats::decode::Record;
use crate::formats::lost_locks::{LostLocks, SignalKey};
use crate::formats::time_order::{TimeOrder, follows};
use crate::gnss::{EpochFlag, Observation, ObservationEpoch, SatelliteId};
use crate::measurement::RecordedEpoch;
use crate::skips::{Reason, Skips};
use crate::time::{GpsTime, leap_seconds_of};

/// Collects the observations of lines that share `TimeNanos` into epochs in time order.
#[derive(Clone, Debug, Default)]
pub(super) struct Epochs {
    current: Option<Current>,
    /// `TimeNanos` of the last line, and whether that epoch has any observation.
    last_line: Option<LastLine>,
    /// Epochs that are complete.
    order: TimeOrder,
    /// A line far ahead, the first of its epoch, that waits for a second line.
    suspect: Option<Timed>,
    glonass_channels: BTreeMap<u8, i8>,
    locks: LostLocks,
    /// States of satellites and observations without a slot.
    beyond: Beyond,
    usual_size: usize,
}

#[derive(Clone, Debug)]
struct Current {
    /// The first line.
    number: u64,
    clock: EpochClock,
    epoch: ObservationEpoch,
    beyond: EpochBeyond,
}

/// The measurement of a line and its time.
#[derive(Clone, Debug)]
struct Timed {
    number: u64,
    clock: EpochClock,
    measured: Measured,
}

impl Timed {
    fn time(&self) -> GpsTime {
        self.clock.time.gps()
    }

    fn describe(&self) -> String {
        format!("line {}: {}", self.number, self.time())
    }

    /// The signal, if the line says that its lock was lost.
    fn lost_signal(&self) -> Option<SignalKey> {
        let observation = &self.measured.observation;
        self.measured.is_lost.then_some((observation.satellite, observation.signal))
    }
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
        let Some((satellite, signal)) = named((number, line), skips) else { return };
        // A line without a slot is counted already.
        let mut counted_already = Skips::default();
        let is_counted = channel_only(line.constellation_type, line.svid).is_some();
        let refusals = if is_counted { &mut counted_already } else { &mut *skips };
        match self.measured((number, line), (satellite, signal), options, refusals) {
            Some(timed) => self.place(timed, skips, records),
            None => self.lost(line.range_state.is_lock_lost().then_some((satellite, signal.code))),
        }
    }

    /// Notes a loss of lock by a line that gives no observation; the signal's next phase is marked.
    pub(super) fn lost(&mut self, signal: Option<SignalKey>) {
        if let Some(signal) = signal {
            self.locks.observe(signal, true, false);
        }
    }

    /// The measurement of a line and its time; `None` (counted) if it is not used.
    fn measured(
        &self,
        (number, line): (u64, &RawLine),
        (satellite, signal): (SatelliteId, Signal),
        options: &Options,
        skips: &mut Skips,
    ) -> Option<Timed> {
        let Some(clock) = self.clock(line, options) else {
            skips.add(Reason::ClockOutside2010To2100, || {
                format!("line {number}: {}", describe_clock(line.clock))
            });
            return None;
        };
        let mut refused = |refusal: Refusal| {
            skips.add(refusal.reason, || {
                format!("line {number}: {satellite}, {} {}", refusal.value, refusal.quantity)
            });
        };
        let leap_seconds = leap_seconds_of(line.clock.leap_seconds, clock.time.gps());
        let measured = measure(line, (satellite, signal), clock.time, leap_seconds, options);
        let mut measured = measured.map_err(&mut refused).ok()?;
        if let Err(refusal) = add_carrier(line, &mut measured, options) {
            refused(refusal);
        }
        if let Some(letter) = signal.odd_code_type {
            skips.add(Reason::CodeTypeOfNoSignal, || {
                format!("line {number}: {satellite}, {} taken as {}", letter as char, signal.code)
            });
        }
        Some(Timed { number, clock, measured })
    }

    /// The stream has ended.
    pub(super) fn finish(&mut self, skips: &mut Skips, records: &mut VecDeque<Record>) {
        self.count_unused(None, skips);
        self.last_line = None;
        self.drop_suspect(skips);
        self.complete(skips, records);
        self.order.finish(None, skips, &mut |record| records.push_back(record));
    }

    /// Further statements of the lines of an epoch that is given out, if there are any. This epoch and earlier ones are forgotten.
    pub(super) fn recorded(&mut self, epoch: &ObservationEpoch) -> Option<RecordedEpoch> {
        self.beyond.take(epoch, &self.glonass_channels)
    }

    /// Time of the last epoch.
    pub(super) fn time(&self) -> Option<GpsTime> {
        self.current.as_ref().map(|current| current.epoch.time_gps)
    }

    /// Frequency channels by slot, as far as carrier frequencies told them.
    pub(super) const fn glonass_channels(&self) -> &BTreeMap<u8, i8> {
        &self.glonass_channels
    }

    /// Counts the epoch before the line of this time, if none of its lines could be used.
    fn count_unused(&mut self, next: Option<(u64, i64)>, skips: &mut Skips) {
        let same = |last: LastLine| next.is_some_and(|(_, time_ns)| time_ns == last.time_ns);
        if self.last_line.is_some_and(same) {
            return;
        }
        if let Some(last) = self.last_line.filter(|last| !last.used) {
            skips.add(Reason::EpochWithoutMeasurement, || {
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
        let shift_ns = options.shift_weeks.checked_mul(WEEK_NS)?;
        let full_bias_ns = line.clock.full_bias_ns.checked_sub(shift_ns)?;
        let fields = ClockFields { full_bias_ns, ..line.clock };
        let clock = EpochClock::new(fields, before, options.bias_reference)?;
        PLAUSIBLE_NS.contains(&clock.time.whole_ns).then_some(clock)
    }

    fn place(&mut self, line: Timed, skips: &mut Skips, records: &mut VecDeque<Record>) {
        if let Some(last) = self.last_line.as_mut().filter(|_| line.measured.channel_only.is_none()) {
            last.used = true;
        }
        if !self.is_open(&line) {
            let time = line.time();
            if let Some((reason, before)) = self.refuses(time) {
                self.lost(line.lost_signal());
                return skips.add(reason, || format!("{} after {before}", line.describe()));
            }
            if self.suspect.as_ref().is_some_and(|suspect| follows(suspect.time(), time)) {
                self.place_suspect(skips, records);
            } else if !self.goes_on(time) {
                self.drop_suspect(skips);
                self.suspect = Some(line);
                return;
            }
            self.drop_suspect(skips);
            if !self.is_open(&line) {
                self.begin(&line, skips, records);
            }
        }
        self.push(line, skips);
    }

    fn is_open(&self, line: &Timed) -> bool {
        self.current.as_ref().is_some_and(|c| c.clock.fields.time_ns == line.clock.fields.time_ns)
    }

    fn place_suspect(&mut self, skips: &mut Skips, records: &mut VecDeque<Record>) {
        if let Some(first) = self.suspect.take() {
            self.begin(&first, skips, records);
            self.push(first, skips);
        }
    }

    fn drop_suspect(&mut self, skips: &mut Skips) {
        if let Some(line) = self.suspect.take() {
            self.lost(line.lost_signal());
            skips.add(Reason::LineTimeFar, || line.describe());
        }
    }

    /// Opens a new epoch.
    fn begin(&mut self, line: &Timed, skips: &mut Skips, records: &mut VecDeque<Record>) {
        self.complete(skips, records);
        if line.clock.discontinuous {
            self.locks.lose_all();
        }
        let observations = Vec::with_capacity(self.usual_size.max(16));
        let epoch = ObservationEpoch { time_gps: line.time(), flag: EpochFlag::Ok, observations };
        let beyond = EpochBeyond::default();
        self.current = Some(Current { number: line.number, clock: line.clock, epoch, beyond });
    }

    fn push(&mut self, Timed { number, measured, .. }: Timed, skips: &mut Skips) {
        let Some(current) = &mut self.current else { return };
        let mut observation = measured.observation;
        let (satellite, signal) = (observation.satellite, observation.signal);
        let seen = &mut current.epoch.observations;
        let same = |o: &Observation| o.satellite == satellite && o.signal == signal;
        if seen.iter().any(same) || current.beyond.by_channel().any(same) {
            if measured.is_lost {
                self.locks.observe((satellite, signal), true, false);
            }
            return skips.add(Reason::SignalRepeated, || {
                format!("line {number}: {satellite} {signal} at {}", current.epoch.time_gps)
            });
        }
        let has_phase = observation.carrier_phase_cycles.is_some();
        let is_lost = measured.is_lost || current.clock.discontinuous;
        observation.loss_of_lock.cycle_slip = self.locks.observe((satellite, signal), is_lost, has_phase);
        if let Some(channel) = measured.channel_only {
            return current.beyond.add_by_channel(channel, observation);
        }
        current.beyond.add_given(seen.len(), measured.given);
        seen.push(observation);
        if let Some(channel) = measured.glonass_channel {
            self.glonass_channels.insert(satellite.number, channel);
        }
    }

    /// Why a time cannot be that of a new epoch, and against which time.
    fn refuses(&self, time: GpsTime) -> Option<(Reason, GpsTime)> {
        let open =
            self.time().filter(|open| time == *open || time < *open && self.order.goes_on(*open, None));
        let before = open.or_else(|| self.order.refuses(time).map(|(_, before)| before))?;
        let reason = if time == before { Reason::LineRepeatsTime } else { Reason::LineStepsBack };
        Some((reason, before))
    }

    /// Whether a time is soon after the open epoch or the last one before it.
    fn goes_on(&self, time: GpsTime) -> bool {
        self.time().is_some_and(|open| follows(open, time)) || self.order.goes_on(time, None)
    }

    /// Gives the open epoch, unless it has to wait for the next one. It stays as the reference for what follows, without its
    /// observations.
    fn complete(&mut self, skips: &mut Skips, records: &mut VecDeque<Record>) {
        let Some(current) = &mut self.current else { return };
        let observations = std::mem::take(&mut current.epoch.observations);
        if observations.is_empty() {
            return;
        }
        self.usual_size = observations.len();
        self.beyond.add(current.epoch.time_gps, std::mem::take(&mut current.beyond));
        let epoch = ObservationEpoch { observations, ..current.epoch.clone() };
        self.order.epoch((current.number, epoch), None, skips, &mut |record| records.push_back(record));
    }
}
