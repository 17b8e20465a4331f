//! Spare logs as a stream.

use std::collections::VecDeque;

use super::epoch::{self, Epoch};
use crate::formats::decode::{Decoder, Record, WrongStream};
use crate::formats::lines::{Line, LineAssembly};
use crate::formats::lost_locks::LostLocks;
use crate::formats::stream::ObservationStream;
use crate::formats::text::{is_blank, shorten};
use crate::formats::time_order::TimeOrder;
use crate::gnss::{EpochFlag, ObservationEpoch};
use crate::skips::{Reason, Skips};

/// Beginning of the line before each epoch.
const STAMP: &[u8] = b"current_Start_Timestamp:";
/// The key of an epoch's observations.
const OBSERVED: &[u8] = b"\"obsd_t\"";
/// A log is recognised within this many lines.
const LINES_TO_RECOGNISE: u64 = 100;

/// Whether a line, without its line end, is one that only a spare log has.
pub fn is_spare_log_line(line: &[u8]) -> bool {
    let line = line.trim_ascii_start();
    let is_epoch = || line.starts_with(b"{") && line.windows(OBSERVED.len()).any(|part| part == OBSERVED);
    line.starts_with(STAMP) || is_epoch()
}

/// Decodes a spare log.
#[derive(Clone, Debug, Default)]
pub struct SpareLogDecoder {
    lines: LineAssembly,
    log: Log,
    records: VecDeque<Record>,
}

/// The log so far.
#[derive(Clone, Debug, Default)]
struct Log {
    number: u64,
    is_recognised: bool,
    /// The first line that cannot be of a spare log, while the log is not recognised.
    first: Option<String>,
    order: TimeOrder,
    locks: LostLocks,
    skips: Skips,
}

impl Log {
    fn take(&mut self, line: Line<'_>, records: &mut VecDeque<Record>) -> Result<(), WrongStream> {
        self.number = line.number;
        if let Some(text) = line.counted(&mut self.skips) {
            self.line(text, records);
        }
        self.check_kind(false)
    }

    fn line(&mut self, line: &[u8], records: &mut VecDeque<Record>) {
        let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line).trim_ascii();
        if line.is_empty() {
            return;
        }
        let number = self.number;
        self.is_recognised |= is_spare_log_line(line);
        if line.starts_with(STAMP) {
            return;
        }
        if line.starts_with(b"{") {
            if let Some(epoch) = epoch::read(number, line, &mut self.skips) {
                self.epoch(epoch, records);
            }
            return;
        }
        self.first.get_or_insert_with(|| shorten(line));
        self.skips.add(Reason::LineOfNoKnownKind, || format!("line {number}: '{}'", shorten(line)));
    }

    fn epoch(&mut self, mut epoch: Epoch, records: &mut VecDeque<Record>) {
        let (number, time_gps) = (self.number, epoch.time_gps);
        if let Some((reason, before)) = self.order.refuses(time_gps) {
            return self.skips.add(reason, || format!("line {number}: {time_gps} after {before}"));
        }
        for observation in &mut epoch.observations {
            let signal = (observation.satellite, observation.signal);
            let (slip, has_phase) =
                (&mut observation.loss_of_lock.cycle_slip, observation.carrier_phase_cycles.is_some());
            *slip = self.locks.observe(signal, *slip, has_phase);
        }
        for signal in epoch.lost {
            self.locks.observe(signal, true, false);
        }
        if epoch.observations.is_empty() {
            return self.skips.add(Reason::EpochWithoutMeasurement, || format!("line {number}: {time_gps}"));
        }
        let epoch = ObservationEpoch { time_gps, flag: EpochFlag::Ok, observations: epoch.observations };
        self.order.epoch((number, epoch), None, &mut self.skips, &mut |record| records.push_back(record));
    }

    /// An error when the lines so far, or, at the end, all lines show another kind of stream.
    fn check_kind(&self, ended: bool) -> Result<(), WrongStream> {
        if self.is_recognised || !(ended || self.number >= LINES_TO_RECOGNISE) {
            return Ok(());
        }
        let first = self.first.as_deref().unwrap_or("(no line)");
        Err(WrongStream {
            reason: format!(
                "not a spare log of the WHU-Smartphone dataset: none of the first {} lines begins with 'current_Start_Timestamp:' or holds \
                 \"obsd_t\"; the first one reads '{first}'",
                self.number
            ),
        })
    }
}

impl Decoder for SpareLogDecoder {
    fn feed(&mut self, bytes: &[u8]) -> Result<(), WrongStream> {
        let Self { lines, log, records } = self;
        log.check_kind(false)?;
        lines.feed(bytes, |line| log.take(line, records))
    }

    /// A last line without a line end is complete when it closes its brackets.
    fn finish(&mut self) -> Result<(), WrongStream> {
        let Self { lines, log, records } = self;
        lines.finish(|Line { number, text }| {
            let rest = text.unwrap_or_default();
            if serde_json::from_slice::<serde::de::IgnoredAny>(rest).is_ok() {
                log.number = number;
                log.line(rest, records);
            } else if rest.is_empty() || !is_blank(rest) {
                log.is_recognised |= is_spare_log_line(rest);
                log.first.get_or_insert_with(|| shorten(rest));
                log.skips.add(Reason::LastLineCutOff, || {
                    format!("line {number}: {} bytes without a line end", rest.len())
                });
            }
            Ok(())
        })?;
        log.check_kind(true)?;
        log.order.finish(None, &mut log.skips, &mut |record| records.push_back(record));
        Ok(())
    }

    fn next_record(&mut self) -> Option<Record> {
        self.records.pop_front()
    }

    fn skips(&self) -> &Skips {
        &self.log.skips
    }
}

impl ObservationStream for SpareLogDecoder {}
