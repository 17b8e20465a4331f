//! The tables of pseudoranges with corrections.

use std::collections::{BTreeMap, VecDeque};

use super::columns::Columns;
use super::line::{Lines, fields};
use super::row::{self, Row};
use crate::decode::{Decoder, Record, WrongStream};
use crate::gnss::{EpochFlag, Observation, ObservationEpoch};
use crate::gnsslogger::Masks;
use crate::measurement::{Corrector, GivenCorrections, PreparedObservation};
use crate::skips::Skips;
use crate::text::{is_blank, without_mark};
use crate::time::GpsTime;
use crate::time_order::{DAY_S, LONG_STEP_S};

/// An epoch is complete when a row this much later comes, s: rows need not be in order of time within this span.
const REORDER_S: f64 = 60.0;
/// So many epochs wait at most; of a minute at 10 Hz there are 600.
const MAX_OPEN: usize = 2_000;

/// One satellite's signal at one epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct DerivedObservation {
    /// The raw observation.
    pub observation: Observation,
    /// Carrier frequency, Hz, where it is known.
    pub frequency_hz: Option<f64>,
    /// Satellite state and corrections as the table gives them; `None` where they are missing.
    pub given: Option<GivenCorrections>,
}

/// The rows of one epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct DerivedEpoch {
    /// Receive time by the phone's clock, GPS time. The tables of 2021 cut it to a millisecond; the first row's transmission and
    /// pseudorange tell the rest.
    pub time_gps: GpsTime,
    /// One per satellite and signal, in file order.
    pub observations: Vec<DerivedObservation>,
}

impl DerivedEpoch {
    /// The raw observations, to be corrected with other products.
    pub fn to_observations(&self) -> ObservationEpoch {
        ObservationEpoch {
            time_gps: self.time_gps,
            flag: EpochFlag::Ok,
            observations: self.observations.iter().map(|derived| derived.observation).collect(),
        }
    }

    /// Whether any of the observations has corrections of its own.
    pub fn has_corrections(&self) -> bool {
        self.observations.iter().any(|derived| derived.given.is_some())
    }

    /// The observations with the table's own satellite states and corrections, in place of [`Corrector::prepare`];
    /// [`Corrector::finish`] then sees them from a position. Observations to which the table gives none are prepared with
    /// the corrector's products.
    pub fn prepare(&self, corrector: &mut Corrector) -> Vec<PreparedObservation> {
        let mut others = ObservationEpoch { observations: Vec::new(), ..self.to_observations() };
        let mut given = Vec::with_capacity(self.observations.len());
        for DerivedObservation { observation, frequency_hz, given: corrections } in &self.observations {
            match corrections {
                Some(corrections) => {
                    given.extend(corrector.prepare_given(
                        observation,
                        *frequency_hz,
                        self.time_gps,
                        corrections,
                    ));
                }
                None => others.observations.push(*observation),
            }
        }
        let mut prepared = corrector.pairs(given);
        prepared.extend(corrector.prepare(&others));
        prepared
    }

    /// The observations with the corrector's products. Of the table only the phone's own uncertainties are taken, for want of
    /// C/N0.
    pub fn prepare_with_products(&self, corrector: &mut Corrector) -> Vec<PreparedObservation> {
        let code_sigma_m = |index: usize| self.observations.get(index)?.given?.code_sigma_m;
        corrector.prepare_weighted(&self.to_observations(), code_sigma_m)
    }
}

/// A whole table.
#[derive(Clone, Debug, PartialEq)]
pub struct DerivedFile {
    /// Epochs, in time order.
    pub epochs: Vec<DerivedEpoch>,
    /// What was skipped.
    pub skips: Skips,
}

impl DerivedFile {
    /// Reads a whole table.
    ///
    /// # Errors
    /// When the first line is not the header of such a table; it says which columns are missing.
    pub fn parse(bytes: &[u8]) -> Result<Self, WrongStream> {
        let mut decoder = DerivedDecoder::default();
        decoder.feed(bytes)?;
        decoder.finish()?;
        Ok(Self { epochs: decoder.ready.into(), skips: decoder.skips })
    }
}

/// Decodes a table as a stream. As a [`Decoder`] it gives the raw observations; [`DerivedDecoder::next_epoch`] gives them with
/// their corrections.
#[derive(Clone, Debug, Default)]
pub struct DerivedDecoder {
    lines: Lines,
    state: Table,
    ready: VecDeque<DerivedEpoch>,
    last: Option<DerivedEpoch>,
    skips: Skips,
}

/// The table so far.
#[derive(Clone, Debug, Default)]
struct Table {
    /// What is not used of tables that keep the columns of the phone's log.
    masks: Masks,
    /// Once the header was read.
    columns: Option<Result<Columns, WrongStream>>,
    /// Epochs to which rows may still come.
    open: BTreeMap<GpsTime, DerivedEpoch>,
    /// The latest time that is believed.
    latest: Option<GpsTime>,
    /// A time far ahead that waits for a later one.
    suspect: Option<GpsTime>,
    /// Up to here epochs were given out.
    closed: Option<GpsTime>,
}

impl DerivedDecoder {
    /// A decoder that leaves out what these masks take, of tables that keep the columns of the phone's log (since 2022).
    pub fn new(masks: Masks) -> Self {
        Self { state: Table { masks, ..Table::default() }, ..Self::default() }
    }

    /// The next epoch with its corrections, in time order; `None` until more bytes come.
    pub fn next_epoch(&mut self) -> Option<DerivedEpoch> {
        self.ready.pop_front()
    }

    /// The epoch of the last record, with its corrections.
    pub const fn last_epoch(&self) -> Option<&DerivedEpoch> {
        self.last.as_ref()
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
                Ok(row) => self.row(number, row, skips),
                Err(fault) => skips.add(fault.reason, || format!("line {number}: {}", fault.detail)),
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

    fn row(&mut self, number: u64, row: Row, skips: &mut Skips) {
        let Row { time_gps, received_gps, shift_s, derived, lack } = row;
        let (satellite, signal) = (derived.observation.satellite, derived.observation.signal);
        if !self.is_in_time(time_gps, skips) {
            return skips
                .add("row out of the order of time", || format!("line {number}: {satellite} at {time_gps}"));
        }
        if shift_s != 0.0 {
            skips.add("epoch corrected by whole seconds, row used", || {
                format!("line {number}: {time_gps} was written {shift_s} s later")
            });
        }
        let epoch = self
            .open
            .entry(time_gps)
            .or_insert_with(|| DerivedEpoch { time_gps: received_gps, observations: Vec::new() });
        let same = |known: &DerivedObservation| {
            (known.observation.satellite, known.observation.signal) == (satellite, signal)
        };
        if epoch.observations.iter().any(same) {
            return skips.add("signal twice in one epoch", || {
                format!("line {number}: {satellite} {signal} at {time_gps}")
            });
        }
        if let Some(lack) = lack {
            skips.add("no corrections in the row, raw observation kept", || {
                format!("line {number}: {satellite}: {lack}")
            });
        }
        epoch.observations.push(derived);
    }

    /// Whether a row's epoch may still get rows. A time far ahead waits for a later one that goes on from there, and meanwhile completes
    /// no epoch; one that goes on from before shows that it was wrong.
    fn is_in_time(&mut self, time: GpsTime, skips: &mut Skips) -> bool {
        if self.closed.is_some_and(|closed| time <= closed) {
            return false;
        }
        let is_far = self.latest.is_some_and(|latest| time - latest > LONG_STEP_S);
        if is_far && self.suspect.is_none_or(|suspect| suspect >= time) {
            self.drop_suspect(|suspect| suspect > time, skips);
            self.suspect = Some(time);
            return true;
        }
        if is_far {
            self.latest = self.suspect.take();
            return self.is_in_time(time, skips);
        }
        // A row that is late says nothing about it.
        if self.latest < Some(time) {
            self.drop_suspect(|_| true, skips);
            self.latest = Some(time);
        }
        true
    }

    /// Leaves out the epoch that waits, if this is so of its time.
    fn drop_suspect(&mut self, wrong: impl Fn(GpsTime) -> bool, skips: &mut Skips) {
        if let Some(suspect) = self.suspect.take_if(|suspect| wrong(*suspect))
            && let Some(epoch) = self.open.remove(&suspect)
        {
            skips.add("epoch far from those around it, left out", || {
                format!("{suspect}, {} rows", epoch.observations.len())
            });
        }
    }

    /// Takes out the epochs that are complete; all of them at the end.
    fn complete(&mut self, ended: bool, ready: &mut VecDeque<DerivedEpoch>) {
        loop {
            let is_full = self.open.len() > MAX_OPEN;
            let Some(entry) = self.open.first_entry() else { return };
            let is_recent = self.latest.is_none_or(|latest| latest - *entry.key() <= REORDER_S);
            if !ended && is_recent && !is_full {
                break;
            }
            self.closed = Some(*entry.key());
            ready.push_back(entry.remove());
        }
    }
}

impl Decoder for DerivedDecoder {
    fn feed(&mut self, bytes: &[u8]) -> Result<(), WrongStream> {
        self.state.check_kind()?;
        let Self { lines, state, ready, skips, .. } = self;
        lines.feed(bytes, skips, |number, line, skips| {
            state.line(number, line, skips);
            state.complete(false, ready);
        });
        self.state.check_kind()
    }

    /// A last line without a line end may be cut short in its last number, and is dropped.
    fn finish(&mut self) -> Result<(), WrongStream> {
        self.state.check_kind()?;
        if self.state.columns.is_none() {
            return Err(WrongStream { reason: "not a challenge table: no header line".to_owned() });
        }
        if let Some((number, rest)) = self.lines.rest() {
            let length = rest.len();
            self.skips
                .add("last line is cut off", || format!("line {number}: {length} bytes without a line end"));
        }
        if let Some(latest) = self.state.latest {
            self.state.drop_suspect(|suspect| suspect - latest > DAY_S, &mut self.skips);
        }
        self.state.complete(true, &mut self.ready);
        Ok(())
    }

    fn next_record(&mut self) -> Option<Record> {
        self.last = self.next_epoch();
        self.last.as_ref().map(|epoch| Record::Epoch(epoch.to_observations()))
    }

    fn skips(&self) -> &Skips {
        &self.skips
    }
}
