//! Observation files, line by line.

mod body;

use std::collections::VecDeque;

use super::hatanaka::{Form, Hatanaka};
use super::header::{HeaderBuilder, ObservationHeader};
use super::observation_record::Layouts;
use super::pending::{PendingEpoch, PendingEvent, is_comment};
use super::stream::{Line, LineDecoder, Stream, kept};
use super::{RinexError, label};
use crate::formats::decode::Record;
use crate::formats::lines::each_line;
use crate::formats::text::{is_blank, lines, shorten, trim_end, without_mark};
use crate::formats::time_order::TimeOrder;
use crate::skips::{Reason, Skips};

/// Room set aside for an epoch's observations is at most this: one that lies about its size must not cost the others.
const MOST_ROOM: usize = 512;

/// Decodes an observation file one line at a time. It owns no input, so a file, a growing file and a socket
/// are read alike.
///
/// ```
/// use cofix_common::formats::rinex::ObservationDecoder;
/// use cofix_common::formats::decode::Record;
/// let mut decoder = ObservationDecoder::default();
/// # let text = b"     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE\n";
/// for (number, line) in (1..).zip(text.split(|b| *b == b'\n')) {
///     decoder.line(number, line, &mut |record| {
///         if let Record::Epoch(epoch) = record {
///             println!("{} with {} observations", epoch.time_gps, epoch.observations.len());
///         }
///     })?;
/// }
/// # Ok::<(), cofix_common::formats::rinex::RinexError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct ObservationDecoder {
    builder: HeaderBuilder,
    layouts: Layouts,
    state: State,
    order: TimeOrder,
    skips: Skips,
    /// Observations in the epoch before: how much room the next one will need.
    usual_size: usize,
    /// Compact RINEX is turned into RINEX first; of the lines of one, `restored` holds those of the other.
    hatanaka: Option<Hatanaka>,
    restored: Vec<u8>,
    stream: Stream,
}

/// The expected next line.
#[derive(Clone, Debug, Default)]
enum State {
    #[default]
    Header,
    /// An epoch line.
    Between,
    /// A satellite of the epoch, or of the record of cycle slips.
    Epoch(PendingEpoch),
    /// A line of the event.
    Event(PendingEvent),
    /// At most this many lines of an epoch that is not used.
    Skip(usize),
    /// Anything up to the next epoch line.
    Lost,
}

/// Takes the records that a line completes.
type Take<'a> = &'a mut dyn FnMut(Record);

impl ObservationDecoder {
    /// Takes a line (with or without its line end) and hands over the epochs and events that it completes.
    /// A record is complete with its last announced line, or, cut short, with the next epoch line.
    ///
    /// # Errors
    /// Only in the header: when it is not that of an observation file, or cannot be used.
    pub fn line(&mut self, number: u64, line: &[u8], take: Take<'_>) -> Result<(), RinexError> {
        let line = without_mark(trim_end(line));
        if begins_file(line) && !matches!(self.state, State::Header | State::Event(_)) {
            self.begin_again(number, line, take);
        }
        let is_first = matches!(self.state, State::Header) && self.builder.lines() == 0;
        if is_first && (is_blank(line) || self.compact_header(line)?) {
            return Ok(());
        }
        if self.hatanaka.is_none() || matches!(self.state, State::Header) {
            return self.plain_line(number, line, take);
        }
        self.compact_line(number, line, take)
    }

    /// A file that is joined to another has a header of its own, which holds from there on.
    fn begin_again(&mut self, number: u64, line: &[u8], take: Take<'_>) {
        self.cut_short(take);
        self.skips.add(Reason::AnotherHeaderHolds, || format!("line {number}: '{}'", shorten(line)));
        self.builder = std::mem::take(&mut self.builder).again();
        self.hatanaka = None;
        self.state = State::Header;
    }

    /// The two lines that Compact RINEX puts before the header.
    fn compact_header(&mut self, line: &[u8]) -> Result<bool, RinexError> {
        let label = label(line);
        if self.hatanaka.is_some() && label.starts_with(b"CRINEX PROG") {
            return Ok(true);
        }
        if !label.starts_with(b"CRINEX VERS") {
            return Ok(false);
        }
        let form = Form::of(line).ok_or_else(|| RinexError::CompactVersion { found: shorten(line) })?;
        self.hatanaka = Some(Hatanaka::new(form));
        Ok(true)
    }

    fn compact_line(&mut self, number: u64, line: &[u8], take: Take<'_>) -> Result<(), RinexError> {
        let mut restored = std::mem::take(&mut self.restored);
        restored.clear();
        if let Some(hatanaka) = &mut self.hatanaka {
            let builder = &self.builder;
            hatanaka.line((number, line), |id| builder.types_of(id), &mut restored, &mut self.skips);
        }
        for (_, line) in lines(&restored) {
            self.plain_line(number, line, take)?;
        }
        self.restored = restored;
        Ok(())
    }

    fn plain_line(&mut self, number: u64, line: &[u8], take: Take<'_>) -> Result<(), RinexError> {
        if matches!(self.state, State::Header) {
            return self.line_of_header(number, line);
        }
        let in_event = matches!(self.state, State::Event(_));
        if is_comment(line) {
            // A comment may quote anything, but it belongs to an event.
            if in_event {
                self.record(number, line, take);
            } else {
                self.skips
                    .add(Reason::CommentOutsideAnyEvent, || format!("line {number}: '{}'", shorten(line)));
            }
        } else if self.is_epoch_line(line, in_event) {
            self.cut_short(take);
            self.state = self.begin(number, line, take);
        } else {
            self.record(number, line, take);
        }
        Ok(())
    }

    /// An error in the first header is an error of the file; one in a further header costs the records that follow.
    fn line_of_header(&mut self, number: u64, line: &[u8]) -> Result<(), RinexError> {
        match self.take_line_of_header(number, line) {
            Err(error) if self.builder.first().is_some() => {
                self.skips.add(Reason::AnotherHeaderUnusable, || error.to_string());
                self.state = State::Lost;
                Ok(())
            }
            result => result,
        }
    }

    fn take_line_of_header(&mut self, number: u64, line: &[u8]) -> Result<(), RinexError> {
        if self.builder.line(number, line)? {
            self.builder.complete()?;
            for (reason, text) in self.builder.take_remarks() {
                self.skips.add(reason, || text);
            }
            self.lay_out();
            self.state = State::Between;
        }
        Ok(())
    }

    /// Says that the input has ended, and hands over an epoch that waited for the next one. An epoch or event that is not complete
    /// is dropped and counted, because its last line may be cut.
    ///
    /// # Errors
    /// When the header was not complete.
    pub fn finish(&mut self, take: Take<'_>) -> Result<(), RinexError> {
        match std::mem::replace(&mut self.state, State::Between) {
            State::Header if self.builder.first().is_some() => {
                self.skips.add(Reason::AnotherHeaderCutOff, || format!("{} lines", self.builder.lines()));
            }
            State::Header => {
                self.state = State::Header;
                return Err(RinexError::HeaderIncomplete { lines: self.builder.lines() });
            }
            State::Epoch(pending) => self.skips.add(Reason::LastEpochCutOff, || pending.shortage()),
            State::Event(pending) => self.skips.add(Reason::LastEventCutOff, || pending.shortage()),
            State::Between | State::Skip(_) | State::Lost => {}
        }
        self.order.finish(self.builder.stated_beginning(), &mut self.skips, take);
        Ok(())
    }

    /// Header and skips.
    pub(super) fn into_parts(self) -> (ObservationHeader, Skips) {
        (self.builder.into_header(), self.skips)
    }

    /// The header as the file began, once complete.
    pub const fn first_header(&self) -> Option<&ObservationHeader> {
        self.builder.first()
    }

    /// The header with the changes by events, once complete.
    pub const fn header(&self) -> Option<&ObservationHeader> {
        match self.state {
            State::Header => None,
            _ => Some(self.builder.header()),
        }
    }

    /// Counts of skipped records so far.
    pub const fn skips(&self) -> &Skips {
        &self.skips
    }
}

impl ObservationDecoder {
    /// Decodes a whole file.
    pub(super) fn whole(&mut self, bytes: &[u8], take: &mut dyn FnMut(Record)) -> Result<(), RinexError> {
        each_line(bytes, |line| self.take(line, take))
    }

    fn take(&mut self, line: Line<'_>, take: &mut dyn FnMut(Record)) -> Result<(), RinexError> {
        let text = kept(line, &mut self.skips);
        self.line(line.number, text, take)
    }
}

impl LineDecoder for ObservationDecoder {
    fn stream(&mut self) -> &mut Stream {
        &mut self.stream
    }

    fn skips(&self) -> &Skips {
        Self::skips(self)
    }

    fn take_line(&mut self, line: Line<'_>, ready: &mut VecDeque<Record>) -> Result<(), RinexError> {
        self.take(line, &mut |record| ready.push_back(record))
    }

    fn end_of_lines(&mut self, ready: &mut VecDeque<Record>) -> Result<(), RinexError> {
        Self::finish(self, &mut |record| ready.push_back(record))
    }
}

/// Whether a line is the first of a file.
fn begins_file(line: &[u8]) -> bool {
    let label = line.get(60..).unwrap_or_default();
    label.starts_with(b"RINEX VERSION / TYPE") || label.starts_with(b"CRINEX VERS ")
}
