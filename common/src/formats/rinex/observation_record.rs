//! One satellite's line of an observation file.

use std::ops::RangeInclusive;

use super::ObservationType;
use super::header::ObservationHeader;
use super::meaning::{Meaning, Remark, meaning};
use super::types::ObservationKind;
use crate::formats::decimal::{Thousandths, thousandths};
use crate::formats::text::{columns, shorten};
use crate::gnss::{
    CN0_BOUNDS_DBHZ, LossOfLock, MAX_DOPPLER_HZ, Misnamed, Observation, PSEUDORANGE_BOUNDS_M, SatelliteId,
    SignalCode,
};
use crate::skips::{Reason, Skips};

const SYSTEMS: usize = 7;
/// BeiDou has a layout for each of its generations: the other one comes after those of the systems.
const LAYOUTS: usize = SYSTEMS + 1;

/// A column: index of its signal, its quantity, and the divisor of its thousandths.
#[derive(Clone, Copy, Debug)]
struct Column {
    signal: usize,
    kind: ObservationKind,
    divisor: f64,
}

/// A signal of a system's columns.
#[derive(Clone, Copy, Debug)]
struct Signal {
    code: SignalCode,
    /// Why its observations are not used.
    refused: Option<Reason>,
}

/// Columns of the satellites of one system (and generation), settled once per header.
#[derive(Clone, Debug, Default)]
struct Layout {
    /// Whether codes name signals, as they do since RINEX 3, and not bands.
    names_signals: bool,
    signals: Vec<Signal>,
    columns: Vec<Column>,
}

/// Columns of all systems.
#[derive(Clone, Debug, Default)]
pub(super) struct Layouts {
    layouts: [Layout; LAYOUTS],
    /// Codes that are read as another signal's than in the file's version, with the reason.
    taken: Vec<(Reason, String)>,
}

/// Satellites and misnamed signals of an epoch so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Seen {
    satellites: [u128; SYSTEMS],
    pub(super) misnamed: Misnamed,
}

impl Seen {
    /// Marks a satellite; false when it was marked before.
    fn mark(&mut self, satellite: SatelliteId) -> bool {
        let bit = 1_u128 << (satellite.number & 127);
        let Some(marks) = self.satellites.get_mut(satellite.constellation as usize) else { return false };
        let fresh = *marks & bit == 0;
        *marks |= bit;
        fresh
    }
}

impl Layout {
    /// For satellites like `satellite`.
    fn new(types: &[ObservationType], satellite: SatelliteId, version: u16) -> Self {
        let mut layout = Self { names_signals: version >= 300, ..Self::default() };
        for observed in types {
            let Meaning { signal: code, remark } = meaning(observed, satellite.constellation, version, types);
            let refused = match remark {
                Remark::Refused(reason) => Some(reason),
                _ if observed.kind == ObservationKind::Other => None,
                _ => satellite.cannot_send(code),
            };
            let known = layout.signals.iter().position(|signal| signal.code == code);
            let index = known.unwrap_or(layout.signals.len());
            match layout.signals.get_mut(index) {
                Some(signal) => signal.refused = signal.refused.or(refused),
                None => layout.signals.push(Signal { code, refused }),
            }
            layout.columns.push(Column {
                signal: index,
                kind: observed.kind,
                divisor: 1000.0 * observed.scale,
            });
        }
        layout
    }
}

impl Layouts {
    /// Layouts of a header's observation types.
    pub(super) fn new(header: &ObservationHeader) -> Self {
        let mut layouts = Self::default();
        for (constellation, types) in &header.observation_types {
            // Any number of a generation will do.
            for satellite in [1, u8::MAX].map(|number| SatelliteId::new(*constellation, number)) {
                if let Some(slot) = layouts.layouts.get_mut(index_of(satellite)) {
                    *slot = Layout::new(types, satellite, header.version);
                }
            }
            for observed in types {
                let Meaning { signal, remark } = meaning(observed, *constellation, header.version, types);
                if let Remark::Taken(reason) = remark {
                    let (letter, written) = (constellation.letter(), observed.signal);
                    let description = format!("{letter} {:?} {written} is {signal}", observed.kind);
                    layouts.taken.push((reason, description));
                }
            }
        }
        layouts
    }

    /// Counts the codes that are read as another signal's than in the file's version, unless `before` had the same.
    pub(super) fn count_taken(&self, before: &Self, skips: &mut Skips) {
        if self.taken != before.taken {
            for (reason, description) in &self.taken {
                skips.add(*reason, || description.clone());
            }
        }
    }

    /// Decodes a satellite's line and appends one observation per signal with any value.
    pub(super) fn decode(
        &self,
        (number, line): (u64, &[u8]),
        into: (&mut Seen, &mut Vec<Observation>),
        skips: &mut Skips,
    ) {
        let Some((id, values)) = line.split_first_chunk::<3>() else {
            skips.add(Reason::SatelliteLineTooShort, || format!("line {number}: '{}'", shorten(line)));
            return;
        };
        self.decode_values(number, *id, values, into, skips);
    }

    /// Decodes the values of a satellite that is named elsewhere.
    pub(super) fn decode_values(
        &self,
        number: u64,
        id: [u8; 3],
        values: &[u8],
        (seen, observations): (&mut Seen, &mut Vec<Observation>),
        skips: &mut Skips,
    ) {
        let Some(satellite) = SatelliteId::from_bytes(id) else {
            skips.add(Reason::UnknownSatellite, || format!("line {number}: '{}'", shorten(&id)));
            return;
        };
        let layout = self.layouts.get(index_of(satellite));
        let Some(layout) = layout.filter(|layout| !layout.columns.is_empty()) else {
            skips.add(Reason::SystemWithoutObservationTypes, || format!("line {number}: {satellite}"));
            return;
        };
        if !seen.mark(satellite) {
            skips.add(Reason::SatelliteTwice, || format!("line {number}: {satellite}"));
            return;
        }
        let base = observations.len();
        observations.extend(layout.signals.iter().map(|signal| empty(satellite, signal.code)));
        let mut record = Record { number, satellite, skips, misnamed: &mut seen.misnamed };
        if let Some(slots) = observations.get_mut(base..) {
            record.fill(layout, values, slots);
        }
        record.keep(layout, observations, base);
    }
}

/// The place of a satellite's layout.
const fn index_of(satellite: SatelliteId) -> usize {
    if satellite.is_beidou_3() { SYSTEMS } else { satellite.constellation as usize }
}

const fn empty(satellite: SatelliteId, signal: SignalCode) -> Observation {
    Observation {
        satellite,
        signal,
        pseudorange_m: None,
        carrier_phase_cycles: None,
        doppler_hz: None,
        cn0_dbhz: None,
        loss_of_lock: LossOfLock { cycle_slip: false, half_cycle: false, noisier: false },
    }
}

/// The line being decoded, for messages.
struct Record<'a> {
    number: u64,
    satellite: SatelliteId,
    skips: &'a mut Skips,
    misnamed: &'a mut Misnamed,
}

impl Record<'_> {
    fn fill(&mut self, layout: &Layout, values: &[u8], slots: &mut [Observation]) {
        for (column, field) in layout.columns.iter().zip(values.chunks(16)) {
            if column.kind == ObservationKind::Other {
                continue;
            }
            let Some(slot) = slots.get_mut(column.signal) else { continue };
            let content = match field.first_chunk::<14>() {
                Some(digits) => thousandths(digits),
                None if field.iter().all(|b| *b == b' ') => Thousandths::Blank,
                None => Thousandths::Bad,
            };
            match content {
                // RINEX: a missing observation is blank or zero.
                Thousandths::Blank | Thousandths::Value(0) => {}
                Thousandths::Value(value) => self.store(column, value as f64 / column.divisor, slot),
                Thousandths::Bad => self.bad(column, slot, Reason::ValueNotF14, &shorten(field)),
            }
            if column.kind == ObservationKind::CarrierPhase {
                self.loss_of_lock(field.get(14), slot);
            }
        }
        let extra = columns(values, 16 * layout.columns.len(), values.len());
        if extra.iter().any(|b| *b != b' ') {
            let (number, satellite) = (self.number, self.satellite);
            self.skips.add(Reason::TextAfterObservationTypes, || {
                format!("line {number}: {satellite}: '{}'", shorten(extra))
            });
        }
    }

    fn store(&mut self, column: &Column, value: f64, slot: &mut Observation) {
        let within = |bounds: RangeInclusive<f64>| bounds.contains(&value);
        match column.kind {
            ObservationKind::Pseudorange if within(PSEUDORANGE_BOUNDS_M) => {
                slot.pseudorange_m = Some(value);
            }
            ObservationKind::CarrierPhase => slot.carrier_phase_cycles = Some(value),
            ObservationKind::Doppler if value.abs() <= MAX_DOPPLER_HZ => slot.doppler_hz = Some(value),
            ObservationKind::SignalStrength if within(CN0_BOUNDS_DBHZ) => {
                slot.cn0_dbhz = Some(value);
            }
            ObservationKind::Pseudorange => {
                self.bad(column, slot, Reason::PseudorangeOutOfRange, &value.to_string());
            }
            ObservationKind::Doppler => {
                self.bad(column, slot, Reason::DopplerOutOfRange, &value.to_string());
            }
            ObservationKind::SignalStrength => {
                self.bad(column, slot, Reason::Cn0OutOfRange, &value.to_string());
            }
            ObservationKind::Other => {}
        }
    }

    /// Removes observations from `base` on that have no value or are refused, keeping the order.
    fn keep(&mut self, layout: &Layout, observations: &mut Vec<Observation>, base: usize) {
        let mut kept = base;
        for (index, signal) in (base..).zip(&layout.signals) {
            let Some(observation) = observations.get(index) else { break };
            let any = observation.pseudorange_m.is_some()
                || observation.carrier_phase_cycles.is_some()
                || observation.doppler_hz.is_some()
                || observation.cn0_dbhz.is_some();
            if !any {
                continue;
            }
            if let Some(reason) = signal.refused {
                let (number, satellite) = (self.number, self.satellite);
                self.skips.add(reason, || format!("line {number}: {satellite} {}", signal.code));
                if layout.names_signals {
                    self.misnamed.note(satellite, signal.code);
                }
                continue;
            }
            if kept != index {
                observations.swap(kept, index);
            }
            kept += 1;
        }
        observations.truncate(kept);
    }

    #[cold]
    fn bad(&mut self, column: &Column, slot: &Observation, reason: Reason, value: &str) {
        let (number, satellite, signal) = (self.number, self.satellite, slot.signal);
        let kind = column.kind;
        self.skips.add(reason, || format!("line {number}: {satellite} {signal} {kind:?} '{value}'"));
    }

    /// The bits of the loss-of-lock indicator. One that is no digit from 0 to 7 counts as a lost lock.
    fn loss_of_lock(&mut self, indicator: Option<&u8>, slot: &mut Observation) {
        match indicator {
            None | Some(b' ' | b'0') => {}
            Some(digit @ b'1'..=b'7') => {
                slot.loss_of_lock.cycle_slip = digit & 1 != 0;
                slot.loss_of_lock.half_cycle = digit & 2 != 0;
                slot.loss_of_lock.noisier = digit & 4 != 0;
            }
            Some(other) => {
                slot.loss_of_lock.cycle_slip = true;
                let (number, satellite, found) = (self.number, self.satellite, *other as char);
                self.skips.add(Reason::LossOfLockIndicatorOutOfRange, || {
                    format!("line {number}: {satellite}: '{}'", found.escape_default())
                });
            }
        }
    }
}
