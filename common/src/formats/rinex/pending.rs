//! Epochs and events whose lines are still coming.

use super::epoch_2::Listed;
use super::observation_record::{Layouts, Seen};
use super::{epoch_2, epoch_3};
use crate::formats::decode::Record;
use crate::formats::text::columns;
use crate::gnss::{CycleSlip, EpochFlag, Event, EventKind, Observation, ObservationEpoch};
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;

/// Columns of a header line, and so of an event's.
const EVENT_COLUMNS: usize = 80;

/// An epoch, or the record of cycle slips that has the same form.
#[derive(Clone, Debug)]
pub(super) struct PendingEpoch {
    pub(super) content: Content,
    /// The epoch line.
    pub(super) line: u64,
    announced: usize,
    remaining: usize,
    observations: Vec<Observation>,
    seen: Seen,
    /// RINEX 2: the satellites' list.
    listed: Option<Box<Listed>>,
}

/// Content of the satellites' lines.
#[derive(Clone, Copy, Debug)]
pub(super) enum Content {
    Observations(GpsTime, EpochFlag),
    /// Repaired slips in place of observations.
    Slips(Option<GpsTime>),
}

impl PendingEpoch {
    /// With room for `room` observations.
    pub(super) fn new(
        content: Content,
        (line, announced): (u64, usize),
        listed: Option<Listed>,
        room: usize,
    ) -> Self {
        Self {
            content,
            line,
            announced,
            remaining: announced,
            observations: Vec::with_capacity(room),
            seen: Seen::default(),
            listed: listed.map(Box::new),
        }
    }

    /// Takes a line; true when it was the last one. `default` is the letter of satellites without one.
    pub(super) fn take(
        &mut self,
        (number, line): (u64, &[u8]),
        layouts: &Layouts,
        default: u8,
        skips: &mut Skips,
    ) -> bool {
        let into = (&mut self.seen, &mut self.observations);
        match &mut self.listed {
            None => layouts.decode((number, line), into, skips),
            Some(listed) => {
                if !listed.line(line, default) {
                    return false;
                }
                let (id, values) = listed.satellite();
                layouts.decode_values(number, id, values, into, skips);
            }
        }
        self.remaining -= 1;
        self.remaining == 0
    }

    /// The record of the lines that have come.
    pub(super) fn done(self, skips: &mut Skips) -> Record {
        let time_gps = match self.content {
            Content::Observations(time_gps, flag) => {
                let mut observations = self.observations;
                self.seen.misnamed.leave_out(&mut observations, |o| {
                    skips.add(Reason::BeidouSignalOfBothGenerations, || {
                        format!("line {}: {} {}", self.line, o.satellite, o.signal)
                    });
                });
                return Record::Epoch(ObservationEpoch { time_gps, flag, observations });
            }
            Content::Slips(time_gps) => time_gps,
        };
        let slip = |o: &Observation| {
            if o.pseudorange_m.is_some() || o.doppler_hz.is_some() || o.cn0_dbhz.is_some() {
                skips.add(Reason::CycleSlipValueOfNoPhase, || {
                    format!("line {}: {} {}", self.line, o.satellite, o.signal)
                });
            }
            let Observation { satellite, signal, .. } = *o;
            o.carrier_phase_cycles.map(|slip_cycles| CycleSlip { satellite, signal, slip_cycles })
        };
        let slips = self.observations.iter().filter_map(slip).collect();
        let event = Event { kind: EventKind::CycleSlips, time_gps, lines: Vec::new(), slips };
        Record::Event(Box::new(event))
    }

    /// Line, time and number of satellites so far.
    pub(super) fn shortage(&self) -> String {
        let got = self.announced - self.remaining;
        let time = match self.content {
            Content::Observations(time_gps, _) => format!("{time_gps}: "),
            Content::Slips(_) => "cycle slips: ".to_owned(),
        };
        format!("line {}: {time}{got} of {} satellites", self.line, self.announced)
    }
}

/// An event with lines of text.
#[derive(Clone, Debug)]
pub(super) struct PendingEvent {
    event: Event,
    line: u64,
    announced: usize,
}

impl PendingEvent {
    pub(super) const fn new(
        kind: EventKind,
        time_gps: Option<GpsTime>,
        (line, announced): (u64, usize),
    ) -> Self {
        let event = Event { kind, time_gps, lines: Vec::new(), slips: Vec::new() };
        Self { event, line, announced }
    }

    /// Takes a line; true when it was the last one.
    pub(super) fn take(&mut self, number: u64, line: &[u8], skips: &mut Skips) -> bool {
        let text = printable(line);
        if text.chars().count() > EVENT_COLUMNS {
            skips.add(Reason::EventLineCut, || format!("line {number}"));
        }
        let kept: String = text.chars().take(EVENT_COLUMNS).collect();
        self.event.lines.push(kept.trim_end().to_owned());
        self.is_complete()
    }

    pub(super) fn is_complete(&self) -> bool {
        self.event.lines.len() >= self.announced
    }

    pub(super) fn done(self) -> Record {
        Record::Event(Box::new(self.event))
    }

    /// Line, kind and number of lines so far.
    pub(super) fn shortage(&self) -> String {
        let got = self.event.lines.len();
        format!("line {}: {}: {got} of {} lines", self.line, self.event.kind, self.announced)
    }
}

/// A line as text. Each byte that is no text becomes a question mark, so that columns stay where they are.
fn printable(line: &[u8]) -> String {
    let of_byte = |byte: &u8| if byte.is_ascii() { char::from(*byte) } else { '?' };
    let text = match std::str::from_utf8(line) {
        Ok(text) => text.to_owned(),
        Err(_) => line.iter().map(of_byte).collect(),
    };
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect::<String>().trim_end().to_owned()
}

/// Whether a line is a comment by its label. No epoch line and no values have letters there.
pub(super) fn is_comment(line: &[u8]) -> bool {
    line.get(60..67) == Some(b"COMMENT") && columns(line, 67, line.len()).trim_ascii().is_empty()
}

/// The time of an event's line in the file's time system: `Ok(None)` where it is left out.
///
/// # Errors
/// When it cannot be read.
pub(super) fn event_time(line: &[u8], is_2: bool) -> Result<Option<GpsTime>, ()> {
    let (from, to) = if is_2 { (0, 26) } else { (1, 29) };
    if columns(line, from, to).iter().all(|b| *b == b' ') {
        return Ok(None);
    }
    let time = if is_2 { epoch_2::epoch_time(line) } else { epoch_3::epoch_time(line) };
    time.map(Some).ok_or(())
}
