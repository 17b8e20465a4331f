//! The tables of pseudoranges with corrections.

use std::collections::{BTreeMap, VecDeque};

use super::columns::{Columns, fields};
use super::losses::Losses;
use super::row::{self, Row};
use super::times::{self, Shift};
use crate::formats::decode::{Decoder, Record, WrongStream};
use crate::formats::gnsslogger::Masks;
use crate::formats::lines::LineAssembly;
use crate::formats::stream::ObservationStream;
use crate::formats::text::{is_blank, without_mark};
use crate::formats::time_order::{DAY_S, LONG_STEP_S, Verdict};
use crate::gnss::Observation;
use crate::measurement::{ChannelObservation, RecordedEpoch, RecordedObservation};
use crate::skips::{Reason, Skips};
use crate::time::{GpsTime, SECONDS_PER_WEEK};

/// An epoch is complete when a row this much later comes, s: rows need not be in order of time within this span.
const REORDER_S: f64 = 60.0;
/// Most epochs that wait; a minute at 10 Hz has 600.
const MAX_OPEN: usize = 2_000;
/// Times of one epoch, some of which went through a double, differ by less than this, s.
const SAME_TIME_S: f64 = 1e-6;
/// Arrivals of one epoch differ by less than this, s: they are all the same but for rounding.
const SAME_ARRIVAL_S: f64 = 0.000_5;
/// Arrivals of rows whose epochs are written alike differ by less than this, s: each is at most a millisecond from it
/// ([`times`]).
const WRITTEN_ALIKE_S: f64 = 0.002_1;

/// A whole table.
#[derive(Clone, Debug, PartialEq)]
pub struct DerivedFile {
    /// Epochs, in time order.
    pub epochs: Vec<RecordedEpoch>,
    /// Counts of skipped rows.
    pub skips: Skips,
}

impl DerivedFile {
    /// Reads a whole table.
    ///
    /// # Errors
    /// When the first line is not the header of such a table; the message names the missing columns.
    pub fn parse(bytes: &[u8]) -> Result<Self, WrongStream> {
        let mut decoder = DerivedDecoder::default();
        decoder.feed(bytes)?;
        decoder.finish()?;
        Ok(Self { epochs: decoder.ready.into(), skips: decoder.skips })
    }
}

/// Decodes a table as a stream. As a [`Decoder`] it gives the raw observations; as an [`ObservationStream`] it
/// also gives the corrections.
#[derive(Clone, Debug, Default)]
pub struct DerivedDecoder {
    lines: LineAssembly,
    state: Table,
    ready: VecDeque<RecordedEpoch>,
    last: Option<RecordedEpoch>,
    /// Addition to times, s.
    shift_s: f64,
    skips: Skips,
}

/// The table so far.
#[derive(Clone, Debug, Default)]
struct Table {
    /// Limits for tables that keep the columns of the phone's log.
    masks: Masks,
    /// Once the header was read.
    columns: Option<Result<Columns, WrongStream>>,
    /// Epochs to which rows may still come, by their receive times.
    open: BTreeMap<GpsTime, Open>,
    /// The latest time that is believed.
    latest: Option<GpsTime>,
    /// A time far ahead that waits for a later one.
    suspect: Option<GpsTime>,
    /// Up to here epochs were given out.
    closed: Option<GpsTime>,
    /// A row whose epoch is off by no whole number of seconds, which waits for another one with the same arrival.
    irregular: Option<(u64, Row)>,
    losses: Losses,
}

/// An epoch to which rows may still come.
#[derive(Clone, Debug)]
struct Open {
    /// The epoch as the first row has it, whole seconds corrected; the arrival where that is no time of the row's.
    written_gps: GpsTime,
    epoch: RecordedEpoch,
}

impl DerivedDecoder {
    /// A decoder with these masks, which apply to tables that keep the columns of the phone's log (since 2022).
    pub fn new(masks: Masks) -> Self {
        Self { state: Table { masks, ..Table::default() }, ..Self::default() }
    }

    /// The same for a table whose week is wrong: `weeks` are added to its times.
    #[must_use]
    pub fn with_shift(self, weeks: i64) -> Self {
        Self { shift_s: weeks as f64 * SECONDS_PER_WEEK, ..self }
    }
}

impl Table {
    fn line(&mut self, number: u64, line: &[u8], skips: &mut Skips) {
        if is_blank(without_mark(line)) {
            return;
        }
        let fields = fields(line);
        match &self.columns {
            None => self.columns = Some(Columns::find(&fields).map_err(|reason| WrongStream { reason })),
            Some(Ok(columns)) => match row::read(columns, &self.masks, &fields) {
                Ok(row) if matches!(row.shift, Shift::Irregular(_)) => self.irregular(number, row, skips),
                Ok(row) => self.row(number, row, skips),
                Err(fault) => {
                    if let Some((signal, time)) = row::lost_signal(columns, &fields) {
                        self.losses.note(signal, time, self.latest);
                    }
                    skips.add(fault.reason, || format!("line {number}: {}", fault.detail));
                }
            },
            Some(Err(_)) => {}
        }
    }

    fn check_kind(&self) -> Result<(), WrongStream> {
        match &self.columns {
            Some(Err(wrong)) => Err(wrong.clone()),
            _ => Ok(()),
        }
    }

    /// Takes a row whose arrival is its epoch, once another row confirms it.
    fn irregular(&mut self, number: u64, row: Row, skips: &mut Skips) {
        let arrival = row.received_gps;
        let is_same = |time: GpsTime| (arrival - time).abs() < SAME_ARRIVAL_S;
        let pending = self.irregular.take_if(|(_, other)| is_same(other.received_gps));
        if pending.is_none() && self.open_for(&row).is_none() {
            self.drop_irregular(skips);
            self.irregular = Some((number, row));
            return;
        }
        for (number, row) in pending.into_iter().chain([(number, row)]) {
            self.row(number, row, skips);
        }
    }

    /// The receive time of the open epoch to which a row belongs: one that is written alike, or one with the same arrival, as
    /// rows that are written alike and rows whose arrival counts stand beside one another.
    fn open_for(&self, row: &Row) -> Option<GpsTime> {
        let received = row.received_gps;
        let near = self.open.range(received - WRITTEN_ALIKE_S..=received + WRITTEN_ALIKE_S);
        let is_written = |open: &Open| (open.written_gps - row.time_gps).abs() <= SAME_TIME_S;
        let by_writing = near.clone().find(|(_, open)| is_written(open));
        let by_arrival = || near.clone().find(|(time, _)| (received - **time).abs() < SAME_ARRIVAL_S);
        by_writing.or_else(by_arrival).map(|(time, _)| *time)
    }

    /// Leaves out the row that waits for another one with the same arrival.
    fn drop_irregular(&mut self, skips: &mut Skips) {
        if let Some((number, row)) = self.irregular.take()
            && let Shift::Irregular(late_s) = row.shift
        {
            let fault = times::contradiction(row.received_gps + late_s, late_s);
            skips.add(fault.reason, || format!("line {number}: {}", fault.detail));
        }
    }

    fn row(&mut self, number: u64, row: Row, skips: &mut Skips) {
        let time_gps = self.open_for(&row).unwrap_or(row.received_gps);
        let Row { time_gps: written_gps, received_gps: _, shift, recorded, channel_only, lack } = row;
        let (satellite, signal) = (recorded.observation.satellite, recorded.observation.signal);
        let is_lost = recorded.observation.loss_of_lock.cycle_slip;
        if !self.is_in_time(time_gps, skips) {
            self.losses.note_if(is_lost, (satellite, signal), Some(time_gps), self.latest);
            return skips.add(Reason::RowOutOfOrder, || format!("line {number}: {satellite} at {time_gps}"));
        }
        let shifted = match shift {
            Shift::Whole(shift_s) => (shift_s, Reason::EpochCorrectedByWholeSeconds),
            Shift::Irregular(shift_s) => (shift_s, Reason::EpochCorrectedByArrival),
        };
        let (shift_s, reason) = shifted;
        if shift_s != 0.0 {
            skips.add(reason, || format!("line {number}: {time_gps} was written {shift_s:.3} s later"));
        }
        let Open { epoch, .. } = self.open.entry(time_gps).or_insert_with(|| Open {
            written_gps,
            epoch: RecordedEpoch { time_gps, observations: Vec::new(), by_channel: Vec::new() },
        });
        let same = |known: &Observation| (known.satellite, known.signal) == (satellite, signal);
        let by_slot = epoch.observations.iter().map(|known| &known.observation);
        if by_slot.chain(epoch.by_channel.iter().map(|known| &known.observation)).any(same) {
            self.losses.note_if(is_lost, (satellite, signal), Some(time_gps), self.latest);
            return skips
                .add(Reason::SignalTwice, || format!("line {number}: {satellite} {signal} at {time_gps}"));
        }
        if let Some(channel) = channel_only {
            skips.add(Reason::GlonassSatelliteByChannelOnly, || format!("line {number}: channel {channel}"));
            let observation = recorded.observation;
            return epoch.by_channel.push(ChannelObservation { channel, observation });
        }
        if let Some(lack) = lack {
            skips.add(Reason::NoCorrectionsInRow, || format!("line {number}: {satellite}: {lack}"));
        }
        epoch.observations.push(recorded);
    }

    /// Whether a row's epoch may still get rows. A time far ahead waits for a later one that goes on from there, and meanwhile completes
    /// no epoch; one that goes on from before shows that it was wrong.
    fn is_in_time(&mut self, time: GpsTime, skips: &mut Skips) -> bool {
        if self.closed.is_some_and(|closed| time - closed < SAME_ARRIVAL_S) {
            return false;
        }
        if self.latest >= Some(time) {
            return true;
        }
        let goes_on = self.latest.is_none_or(|latest| time - latest <= LONG_STEP_S);
        match self.suspect.map(|suspect| Verdict::on(suspect, time, goes_on)) {
            Some(Verdict::Confirmed) => {
                self.latest = self.suspect.take();
                return self.is_in_time(time, skips);
            }
            Some(Verdict::Wrong) => self.drop_suspect(skips),
            Some(Verdict::Same) | None => {}
        }
        *(if goes_on { &mut self.latest } else { &mut self.suspect }) = Some(time);
        true
    }

    /// Leaves out the epoch that waits.
    fn drop_suspect(&mut self, skips: &mut Skips) {
        if let Some(suspect) = self.suspect.take()
            && let Some(Open { epoch, .. }) = self.open.remove(&suspect)
        {
            for RecordedObservation { observation, .. } in &epoch.observations {
                let signal = (observation.satellite, observation.signal);
                self.losses.note_if(observation.loss_of_lock.cycle_slip, signal, None, self.latest);
            }
            skips.add(Reason::EpochFarFromThoseAround, || {
                format!("{suspect}, {} rows", epoch.observations.len())
            });
        }
    }

    /// Takes out the epochs that are complete; all epochs at the end.
    fn complete(&mut self, ended: bool, ready: &mut VecDeque<RecordedEpoch>) {
        loop {
            let is_full = self.open.len() > MAX_OPEN;
            let Some(entry) = self.open.first_entry() else { return };
            let is_recent = self.latest.is_none_or(|latest| latest - *entry.key() <= REORDER_S);
            if !ended && is_recent && !is_full {
                break;
            }
            let (time_gps, Open { mut epoch, .. }) = entry.remove_entry();
            self.closed = Some(time_gps);
            self.losses.mark(time_gps, &mut epoch);
            // Rows without a slot make no epoch.
            if !epoch.observations.is_empty() {
                ready.push_back(epoch);
            }
        }
    }
}

impl Decoder for DerivedDecoder {
    fn feed(&mut self, bytes: &[u8]) -> Result<(), WrongStream> {
        self.state.check_kind()?;
        let Self { lines, state, ready, skips, .. } = self;
        lines.feed(bytes, |line| {
            if let Some(text) = line.counted(skips) {
                state.line(line.number, text, skips);
                state.complete(false, ready);
            }
            state.check_kind()
        })
    }

    /// A last line without a line end may be cut short in its last number, and is dropped.
    fn finish(&mut self) -> Result<(), WrongStream> {
        self.state.check_kind()?;
        if self.state.columns.is_none() {
            return Err(WrongStream { reason: "not a challenge table: no header line".to_owned() });
        }
        self.lines.finish(|line| {
            if let Some(rest) = line.counted(&mut self.skips).filter(|rest| !is_blank(rest)) {
                self.skips.add(Reason::LastLineCutOff, || {
                    format!("line {}: {} bytes without a line end", line.number, rest.len())
                });
            }
            Ok(())
        })?;
        self.state.drop_irregular(&mut self.skips);
        if self.state.suspect.zip(self.state.latest).is_some_and(|(suspect, latest)| suspect - latest > DAY_S)
        {
            self.state.drop_suspect(&mut self.skips);
        }
        self.state.complete(true, &mut self.ready);
        Ok(())
    }

    fn next_record(&mut self) -> Option<Record> {
        let shifted =
            |epoch: RecordedEpoch| RecordedEpoch { time_gps: epoch.time_gps + self.shift_s, ..epoch };
        self.last = self.ready.pop_front().map(shifted);
        self.last.as_ref().map(|epoch| Record::Epoch(epoch.to_observations()))
    }

    fn skips(&self) -> &Skips {
        &self.skips
    }
}

impl ObservationStream for DerivedDecoder {
    fn recorded_epoch(&self) -> Option<&RecordedEpoch> {
        self.last.as_ref()
    }

    fn shifts_weeks_itself(&self) -> bool {
        true
    }
}
