//! Observation files, line by line.

use super::epoch_2::{self, Listed};
use super::epoch_3;
use super::hatanaka::{Form, Hatanaka};
use super::header::{HeaderBuilder, ObservationHeader};
use super::line_assembly::Line;
use super::observation_record::{Layouts, Seen};
use super::order::Order;
use super::stream::Stream;
use super::{RinexError, columns, decompress, integer, lines, shorten, trim_end};
use crate::gnss::{EpochFlag, ObservationEpoch};
use crate::skips::Skips;

/// Room set aside for an epoch's observations is at most this: one that lies about its size must not cost the others.
const MOST_ROOM: usize = 512;

/// Decodes an observation file one line at a time. It owns no input, so a file, a growing file and a socket
/// are read alike.
///
/// ```
/// use cofix_common::rinex::ObservationDecoder;
/// let mut decoder = ObservationDecoder::default();
/// # let text = b"     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE\n";
/// for (number, line) in (1..).zip(text.split(|b| *b == b'\n')) {
///     if let Some(epoch) = decoder.line(number, line)? {
///         println!("{} with {} observations", epoch.time_gps, epoch.observations.len());
///     }
/// }
/// # Ok::<(), cofix_common::rinex::RinexError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct ObservationDecoder {
    builder: HeaderBuilder,
    layouts: Layouts,
    state: State,
    order: Order,
    skips: Skips,
    /// Observations in the epoch before: how much room the next one will need.
    usual_size: usize,
    /// Compact RINEX is turned into RINEX first; of the lines of one, `restored` holds those of the other.
    hatanaka: Option<Hatanaka>,
    restored: Vec<u8>,
    pub(super) stream: Stream,
}

/// What the next line is expected to be.
#[derive(Clone, Debug, Default)]
enum State {
    #[default]
    Header,
    /// An epoch line.
    Between,
    /// A satellite of the epoch.
    Epoch(Pending),
    /// Records of an event, or of an epoch that is not wanted; up to `remaining` of them.
    Skip { remaining: usize, header_lines: bool },
    /// Anything up to the next epoch line.
    Lost,
}

/// An epoch whose satellites are still coming.
#[derive(Clone, Debug)]
struct Pending {
    epoch: ObservationEpoch,
    line: u64,
    announced: usize,
    remaining: usize,
    seen: Seen,
    /// RINEX 2: the satellites' list.
    listed: Option<Box<Listed>>,
}

/// A whole observation file.
#[derive(Clone, Debug, PartialEq)]
pub struct ObservationFile {
    /// The header.
    pub header: ObservationHeader,
    /// Epochs, in time order.
    pub epochs: Vec<ObservationEpoch>,
    /// What was skipped.
    pub skips: Skips,
}

impl ObservationFile {
    /// Reads a whole file, plain or compressed (.gz, .Z).
    ///
    /// # Errors
    /// When the compression is damaged or the header cannot be used; damage further on is counted in
    /// [`ObservationFile::skips`].
    pub fn parse(bytes: &[u8]) -> Result<Self, RinexError> {
        let bytes = decompress(bytes)?;
        let mut decoder = ObservationDecoder::default();
        let mut epochs = Vec::new();
        decoder.whole(&bytes, |epoch| epochs.push(epoch))?;
        decoder.finish()?;
        Ok(Self { header: decoder.builder.header().clone(), epochs, skips: decoder.skips })
    }
}

impl ObservationDecoder {
    /// Takes a line (with or without its line end) and gives the epoch that it completes, if any. An epoch is
    /// complete with its last announced satellite; one that is cut short by the next epoch line is given then.
    ///
    /// # Errors
    /// Only in the header: when it is not that of an observation file, or cannot be used.
    pub fn line(&mut self, number: u64, line: &[u8]) -> Result<Option<ObservationEpoch>, RinexError> {
        let line = trim_end(line);
        if matches!(self.state, State::Header) && self.builder.lines() == 0 && self.compact_header(line)? {
            return Ok(None);
        }
        if self.hatanaka.is_none() || matches!(self.state, State::Header) {
            return self.plain_line(number, line);
        }
        self.compact_line(number, line)
    }

    /// The two lines that Compact RINEX puts before the header.
    fn compact_header(&mut self, line: &[u8]) -> Result<bool, RinexError> {
        let label = columns(line, 60, 80).trim_ascii();
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

    fn compact_line(&mut self, number: u64, line: &[u8]) -> Result<Option<ObservationEpoch>, RinexError> {
        let mut restored = std::mem::take(&mut self.restored);
        restored.clear();
        if let Some(hatanaka) = &mut self.hatanaka {
            let builder = &self.builder;
            hatanaka.line((number, line), |id| builder.types_of(id), &mut restored, &mut self.skips);
        }
        let mut complete = None;
        for (_, line) in lines(&restored) {
            complete = complete.or(self.plain_line(number, line)?);
        }
        self.restored = restored;
        Ok(complete)
    }

    fn plain_line(&mut self, number: u64, line: &[u8]) -> Result<Option<ObservationEpoch>, RinexError> {
        if matches!(self.state, State::Header) {
            if self.builder.line(number, line)? {
                self.builder.complete()?;
                if let Some(text) = self.builder.unread_time() {
                    self.skips
                        .add("header's time of the first observation cannot be read, not used", || text);
                }
                self.layouts = Layouts::new(self.builder.header());
                self.state = State::Between;
            }
            return Ok(None);
        }
        if self.is_epoch_line(line) {
            let short = self.cut_short();
            self.state = self.begin(number, line);
            return Ok(short);
        }
        Ok(self.record(number, line))
    }

    /// Says that the input has ended. An epoch that is not complete is dropped and counted, because its last
    /// line may be cut.
    ///
    /// # Errors
    /// When the header was not complete.
    pub fn finish(&mut self) -> Result<(), RinexError> {
        match std::mem::replace(&mut self.state, State::Between) {
            State::Header => {
                self.state = State::Header;
                return Err(RinexError::HeaderIncomplete { lines: self.builder.lines() });
            }
            State::Epoch(pending) => self.skips.add("last epoch is cut off", || pending.shortage()),
            State::Between | State::Skip { .. } | State::Lost => {}
        }
        Ok(())
    }

    /// The header, once complete.
    pub const fn header(&self) -> Option<&ObservationHeader> {
        match self.state {
            State::Header => None,
            _ => Some(self.builder.header()),
        }
    }

    /// What has been skipped so far.
    pub const fn skips(&self) -> &Skips {
        &self.skips
    }

    /// A line's text; one that was too long is counted.
    pub(super) fn kept<'a>(&mut self, line: Line<'a>) -> &'a [u8] {
        line.kept(&mut self.skips)
    }

    /// The unfinished epoch that an epoch line ends.
    fn cut_short(&mut self) -> Option<ObservationEpoch> {
        let State::Epoch(pending) = std::mem::take(&mut self.state) else { return None };
        self.skips.add("epoch has fewer satellites than announced", || pending.shortage());
        Some(pending.epoch)
    }

    fn is_epoch_line(&self, line: &[u8]) -> bool {
        if !self.builder.is_2() {
            return line.first() == Some(&b'>');
        }
        // The lines of an event of RINEX 2 are text of any shape; their count is all there is to go by.
        !matches!(self.state, State::Skip { header_lines: true, .. }) && epoch_2::is_epoch_line(line)
    }

    fn record(&mut self, number: u64, line: &[u8]) -> Option<ObservationEpoch> {
        match &mut self.state {
            State::Epoch(pending) => {
                let into = (&mut pending.seen, &mut pending.epoch.observations);
                match &mut pending.listed {
                    None => self.layouts.decode((number, line), into, &mut self.skips),
                    Some(listed) => {
                        if !listed.line(line, self.builder.default_letter()) {
                            return None;
                        }
                        let (id, values) = listed.satellite();
                        self.layouts.decode_values(number, id, values, into, &mut self.skips);
                    }
                }
                pending.remaining -= 1;
                if pending.remaining > 0 {
                    return None;
                }
                let State::Epoch(done) = std::mem::replace(&mut self.state, State::Between) else {
                    return None;
                };
                self.usual_size = done.epoch.observations.len();
                return Some(done.epoch);
            }
            State::Skip { remaining, header_lines } => {
                *remaining -= 1;
                let (ended, header_lines) = (*remaining == 0, *header_lines);
                if header_lines {
                    self.header_line(number, line);
                }
                if ended {
                    self.state = State::Between;
                }
            }
            State::Between if line.iter().any(|b| *b != b' ') => {
                self.skips.add("line outside any epoch", || format!("line {number}: '{}'", shorten(line)));
            }
            State::Between | State::Header | State::Lost => {}
        }
        None
    }

    /// A header line between epochs (event 4): new observation types hold from here on.
    fn header_line(&mut self, number: u64, line: &[u8]) {
        if let Err(error) = self.builder.line(number, line) {
            self.skips.add("header line between epochs cannot be read", || error.to_string());
        }
        self.layouts = Layouts::new(self.builder.header());
    }

    fn begin(&mut self, number: u64, line: &[u8]) -> State {
        let at = if self.builder.is_2() { 28 } else { 31 };
        let flag = columns(line, at, at + 1);
        let count = integer(columns(line, at + 1, at + 4)).and_then(|n| usize::try_from(n).ok());
        let (Some(flag @ b'0'..=b'6'), Some(count)) = (flag.first(), count) else {
            self.skips.add("epoch line cannot be read", || format!("line {number}: '{}'", shorten(line)));
            return State::Lost;
        };
        match flag {
            b'0' => self.epoch(number, line, count, EpochFlag::Ok),
            b'1' => self.epoch(number, line, count, EpochFlag::PowerFailure),
            b'6' => {
                self.skips.add("cycle slip records", || format!("line {number}: {count} satellites"));
                skip(self.lines_of_epoch(count), false)
            }
            event => {
                self.skips.add("event records", || {
                    format!("line {number}: event {} with {count} lines", *event as char)
                });
                // RINEX 2 lists header lines after other events, too.
                skip(count, *event == b'4' || self.builder.is_2())
            }
        }
    }

    fn epoch(&mut self, number: u64, line: &[u8], announced: usize, flag: EpochFlag) -> State {
        let own = if self.builder.is_2() { epoch_2::epoch_time(line) } else { epoch_3::epoch_time(line) };
        let Some(time_gps) = own.map(|t| self.builder.to_gps(t)) else {
            self.skips.add("epoch line cannot be read", || format!("line {number}: '{}'", shorten(line)));
            return State::Lost;
        };
        if announced == 0 {
            self.skips.add("epoch without satellites", || format!("line {number}: {time_gps}"));
            return State::Between;
        }
        let first = self.builder.header().first_observation;
        if let Err((reason, before)) = self.order.check(time_gps, first) {
            self.skips.add(reason, || format!("line {number}: {time_gps} after {before}"));
            return skip(self.lines_of_epoch(announced), false);
        }
        let observations = Vec::with_capacity(self.usual_size.clamp(16, MOST_ROOM));
        let epoch = ObservationEpoch { time_gps, flag, observations };
        let types = self.builder.types_2();
        let listed = self
            .builder
            .is_2()
            .then(|| Box::new(Listed::new(line, announced, types, self.builder.default_letter())));
        let seen = Seen::default();
        State::Epoch(Pending { epoch, line: number, announced, remaining: announced, seen, listed })
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

impl Pending {
    fn shortage(&self) -> String {
        let got = self.announced - self.remaining;
        format!("line {}: {}: {got} of {} satellites", self.line, self.epoch.time_gps, self.announced)
    }
}

const fn skip(remaining: usize, header_lines: bool) -> State {
    if remaining == 0 { State::Between } else { State::Skip { remaining, header_lines } }
}
