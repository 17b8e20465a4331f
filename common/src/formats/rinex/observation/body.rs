//! The lines after the header: epochs and events with their lines.

use super::{MOST_ROOM, ObservationDecoder, State, Take};
use crate::formats::decimal::integer;
use crate::formats::decode::Record;
use crate::formats::rinex::epoch_2::{self, Listed};
use crate::formats::rinex::epoch_3;
use crate::formats::rinex::observation_record::Layouts;
use crate::formats::rinex::pending::{Content, PendingEpoch, PendingEvent, event_time};
use crate::formats::text::{columns, shorten};
use crate::gnss::{EpochFlag, EventKind};
use crate::skips::Reason;

impl ObservationDecoder {
    /// Gives the unfinished epoch or event that an epoch line ends.
    pub(super) fn cut_short(&mut self, take: Take<'_>) {
        match std::mem::replace(&mut self.state, State::Between) {
            State::Epoch(pending) => {
                self.skips.add(Reason::EpochLacksSatellites, || pending.shortage());
                self.give(pending, take);
            }
            State::Event(pending) => {
                self.skips.add(Reason::EventLacksLines, || pending.shortage());
                self.order.other(pending.done(), take);
            }
            State::Header | State::Between | State::Skip(_) | State::Lost => {}
        }
    }

    /// In an event of RINEX 2, whose lines are text of any shape, only a line with a time is taken for the next epoch's.
    pub(super) fn is_epoch_line(&self, line: &[u8], in_event: bool) -> bool {
        if self.builder.is_2() {
            return epoch_2::is_epoch_line(line) && !(in_event && epoch_2::epoch_time(line).is_none());
        }
        line.first() == Some(&b'>')
    }

    pub(super) fn record(&mut self, number: u64, line: &[u8], take: Take<'_>) {
        match &mut self.state {
            State::Epoch(pending) => {
                let default = self.builder.default_letter();
                if !pending.take((number, line), &self.layouts, default, &mut self.skips) {
                    return;
                }
                if let State::Epoch(done) = std::mem::replace(&mut self.state, State::Between) {
                    self.give(done, take);
                }
            }
            State::Event(pending) => {
                let is_last = pending.take(number, line, &mut self.skips);
                self.header_line(number, line);
                if is_last && let State::Event(done) = std::mem::replace(&mut self.state, State::Between) {
                    self.order.other(done.done(), take);
                }
            }
            State::Skip(remaining) => {
                *remaining -= 1;
                if *remaining == 0 {
                    self.state = State::Between;
                }
            }
            State::Between if line.iter().any(|b| *b != b' ') => {
                self.skips.add(Reason::LineOutsideAnyEpoch, || format!("line {number}: '{}'", shorten(line)));
            }
            State::Between | State::Header | State::Lost => {}
        }
    }

    /// A header line of an event: new observation types hold from here on.
    fn header_line(&mut self, number: u64, line: &[u8]) {
        if let Err(error) = self.builder.line_between_epochs(number, line) {
            self.skips.add(Reason::HeaderLineBetweenEpochsUnreadable, || error.to_string());
        }
        self.lay_out();
    }

    /// Settles the columns by the header as it is now.
    pub(super) fn lay_out(&mut self) {
        let layouts = Layouts::new(self.builder.header());
        layouts.count_taken(&self.layouts, &mut self.skips);
        self.layouts = layouts;
    }

    pub(super) fn begin(&mut self, number: u64, line: &[u8], take: Take<'_>) -> State {
        let at = if self.builder.is_2() { 28 } else { 31 - epoch_3::columns_missing(line) };
        let flag = columns(line, at, at + 1);
        let count = integer(columns(line, at + 1, at + 4)).and_then(|n| usize::try_from(n).ok());
        let kind = flag.first().and_then(|digit| EventKind::from_flag(*digit));
        match (flag, kind, count) {
            (b"0", _, Some(count)) => self.epoch(number, line, count, EpochFlag::Ok),
            (b"1", _, Some(count)) => self.epoch(number, line, count, EpochFlag::PowerFailure),
            (_, Some(kind), Some(count)) => self.event((number, line), kind, count, take),
            _ => {
                self.skips.add(Reason::EpochLineUnreadable, || format!("line {number}: '{}'", shorten(line)));
                State::Lost
            }
        }
    }

    fn event(
        &mut self,
        (number, line): (u64, &[u8]),
        kind: EventKind,
        count: usize,
        take: Take<'_>,
    ) -> State {
        let name = || format!("line {number}: '{}'", shorten(line));
        let time_gps = event_time(line, self.builder.is_2()).unwrap_or_else(|()| {
            self.skips.add(Reason::TimeEventUnreadable, name);
            None
        });
        let time_gps = time_gps.map(|own| self.builder.to_gps(own));
        if kind == EventKind::External && time_gps.is_none() {
            self.skips.add(Reason::ExternalEventWithoutTime, name);
            return skip(count);
        }
        if kind == EventKind::CycleSlips && count > 0 {
            let listed = self.listed(line, count);
            let content = Content::Slips(time_gps);
            return State::Epoch(PendingEpoch::new(content, (number, count), listed, 0));
        }
        let event = PendingEvent::new(kind, time_gps, (number, count));
        if event.is_complete() {
            self.order.other(event.done(), take);
            return State::Between;
        }
        State::Event(event)
    }

    fn epoch(&mut self, number: u64, line: &[u8], announced: usize, flag: EpochFlag) -> State {
        let own = if self.builder.is_2() { epoch_2::epoch_time(line) } else { epoch_3::epoch_time(line) };
        let Some(time_gps) = own.map(|t| self.builder.to_gps(t)) else {
            self.skips.add(Reason::EpochLineUnreadable, || format!("line {number}: '{}'", shorten(line)));
            return State::Lost;
        };
        if announced == 0 {
            self.skips.add(Reason::EpochWithoutSatellites, || format!("line {number}: {time_gps}"));
            return State::Between;
        }
        if let Some((reason, before)) = self.order.refuses(time_gps) {
            self.skips.add(reason, || format!("line {number}: {time_gps} after {before}"));
            return skip(self.lines_of_epoch(announced));
        }
        let room = self.usual_size.clamp(16, MOST_ROOM);
        let content = Content::Observations(time_gps, flag);
        let listed = self.listed(line, announced);
        State::Epoch(PendingEpoch::new(content, (number, announced), listed, room))
    }

    /// Hands over an epoch or a record of slips, unless it has to wait for the next epoch.
    fn give(&mut self, pending: PendingEpoch, take: Take<'_>) {
        let line = pending.line;
        match pending.done(&mut self.skips) {
            Record::Epoch(epoch) => {
                self.usual_size = epoch.observations.len();
                let stated = self.builder.stated_beginning();
                self.order.epoch((line, epoch), stated, &mut self.skips, take);
            }
            record => self.order.other(record, take),
        }
    }

    /// RINEX 2 lists the satellites in the epoch line.
    fn listed(&self, line: &[u8], announced: usize) -> Option<Listed> {
        let (types, default) = (self.builder.types_2(), self.builder.default_letter());
        self.builder.is_2().then(|| Listed::new(line, announced, types, default))
    }

    /// Lines after the epoch line of that many satellites.
    fn lines_of_epoch(&self, satellites: usize) -> usize {
        if self.builder.is_2() {
            epoch_2::lines_of_epoch(satellites, self.builder.types_2())
        } else {
            satellites
        }
    }
}

const fn skip(remaining: usize) -> State {
    if remaining == 0 { State::Between } else { State::Skip(remaining) }
}
