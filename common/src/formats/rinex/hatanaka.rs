//! Compact RINEX 1 and 3 (Hatanaka 2008, Bulletin of the Geographical Survey Institute 55, 21-30) back to RINEX.
//!
//! The header is plain. An epoch has a line of its own text, a line for the receiver clock, and one per satellite.
//! Epoch lines and indicators are differences of text: a blank repeats the character of the epoch before, `&` stands
//! for a blank. Values are integers, differenced in time up to an order that their first one states (`3&21111612436`).
//! An epoch line that begins with `&` (version 1) or `>` (version 3) starts everything anew; after damage we wait for it.
//! Events begin like that, too; their lines are plain, and the epoch after them starts anew.

use std::collections::BTreeMap;

use super::differences::{Arc, change_text};
use super::pending::is_comment;
use super::{epoch_2, epoch_3};
use crate::formats::decimal::integer;
use crate::formats::text::{columns, shorten};
use crate::skips::{Reason, Skips};

/// Satellites in one RINEX 2 epoch line.
const LISTED_PER_LINE: usize = 12;
/// Columns before a RINEX 2 epoch's list of satellites.
const BEFORE_LIST_2: usize = 32;
/// Values in one RINEX 2 line.
const VALUES_PER_LINE_2: usize = 5;

/// Turns lines of Compact RINEX into lines of RINEX.
#[derive(Clone, Debug)]
pub(super) struct Hatanaka {
    form: Form,
    expected: Expected,
    /// The epoch line, all satellites in it; empty before the first.
    epoch: Vec<u8>,
    satellites: Vec<[u8; 3]>,
    /// Arcs of the epoch before, and those of this one.
    before: BTreeMap<[u8; 3], Track>,
    now: BTreeMap<[u8; 3], Track>,
}

/// The two formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// Compact RINEX 1, of RINEX 2.
    One,
    /// Compact RINEX 3, of RINEX 3 and 4.
    Three,
}

#[derive(Clone, Copy, Debug)]
enum Expected {
    Epoch,
    Clock,
    Satellite(usize),
    /// This many lines of an event, which are plain.
    Event(usize),
    /// An epoch line that starts anew.
    Restart,
}

/// Differences of one satellite.
#[derive(Clone, Debug, Default)]
struct Track {
    arcs: Vec<Arc>,
    /// Two indicators for each value.
    indicators: Vec<u8>,
}

impl Form {
    /// Of the version in the first line.
    pub(super) fn of(first_line: &[u8]) -> Option<Self> {
        match columns(first_line, 0, 2) {
            b"1." => Some(Self::One),
            b"3." => Some(Self::Three),
            _ => None,
        }
    }

    /// First character of an epoch line that starts anew.
    const fn restart(self) -> u8 {
        match self {
            Self::One => b'&',
            Self::Three => b'>',
        }
    }

    /// Columns of the event flag and of the list of satellites.
    const fn places(self) -> (usize, usize) {
        match self {
            Self::One => (28, BEFORE_LIST_2),
            Self::Three => (31, 41),
        }
    }
}

impl Hatanaka {
    /// At the beginning of the epochs.
    pub(super) const fn new(form: Form) -> Self {
        Self {
            form,
            expected: Expected::Epoch,
            epoch: Vec::new(),
            satellites: Vec::new(),
            before: BTreeMap::new(),
            now: BTreeMap::new(),
        }
    }

    /// Takes a line after the header and appends the lines of RINEX that it stands for to `out`, with their ends. `types` gives
    /// the number of observation types of a satellite.
    pub(super) fn line(
        &mut self,
        (number, line): (u64, &[u8]),
        types: impl Fn([u8; 3]) -> usize,
        out: &mut Vec<u8>,
        skips: &mut Skips,
    ) {
        let restarts = line.first() == Some(&self.form.restart());
        match self.expected {
            Expected::Event(remaining) if !restarts || is_comment(line) => {
                push_line(out, line);
                self.expected = if remaining > 1 { Expected::Event(remaining - 1) } else { Expected::Epoch };
            }
            // Version 3 reserves lines that begin with this.
            Expected::Epoch if self.form == Form::Three && line.first() == Some(&b'&') => {
                skips.add(Reason::HatanakaEscapeLine, || format!("line {number}: '{}'", shorten(line)));
            }
            _ if restarts || matches!(self.expected, Expected::Epoch) => {
                if !self.epoch(line, types, out) {
                    skips.add(Reason::HatanakaEpochLineUnreadable, || {
                        format!("line {number}: '{}'", shorten(line))
                    });
                    self.epoch.clear();
                    self.expected = Expected::Restart;
                }
            }
            // The receiver clock's offset is not used.
            Expected::Clock => {
                self.put_epoch(out);
                self.expected = self.satellite_after(None);
            }
            Expected::Satellite(index) => {
                if let Some(id) = self.satellites.get(index).copied() {
                    self.satellite((number, line), id, types(id), out, skips);
                }
                self.expected = self.satellite_after(Some(index));
            }
            Expected::Epoch | Expected::Event(_) | Expected::Restart => {
                skips.add(Reason::HatanakaLineNotRestored, || format!("line {number}: '{}'", shorten(line)));
            }
        }
    }

    fn satellite_after(&mut self, index: Option<usize>) -> Expected {
        let next = index.map_or(0, |i| i + 1);
        if next < self.satellites.len() {
            return Expected::Satellite(next);
        }
        self.before = std::mem::take(&mut self.now);
        Expected::Epoch
    }

    /// Takes an epoch line; false if it cannot be read.
    fn epoch(&mut self, line: &[u8], types: impl Fn([u8; 3]) -> usize, out: &mut Vec<u8>) -> bool {
        let restarts = line.first() == Some(&self.form.restart());
        let mut text = if restarts { line.to_vec() } else { self.epoch.clone() };
        if !restarts {
            change_text(&mut text, line);
        } else if let (Form::One, Some(first)) = (self.form, text.first_mut()) {
            *first = b' ';
        }
        let missing = if self.form == Form::Three { epoch_3::columns_missing(&text) } else { 0 };
        let (flag_at, list_at) = self.form.places();
        let (flag_at, list_at) = (flag_at - missing, list_at - missing);
        let flag = columns(&text, flag_at, flag_at + 1).first().copied();
        let count = integer(columns(&text, flag_at + 1, flag_at + 4)).and_then(|n| usize::try_from(n).ok());
        let timed = match self.form {
            Form::One => epoch_2::epoch_time(&text).is_some(),
            Form::Three => text.first() == Some(&b'>') && epoch_3::epoch_time(&text).is_some(),
        };
        match (flag, count) {
            (Some(b'0' | b'1'), Some(count)) if timed && (restarts || !self.epoch.is_empty()) => {
                if restarts {
                    self.before.clear();
                }
                self.now.clear();
                let list = text.get(list_at..).unwrap_or_default();
                self.satellites = (0..count).map(|index| identifier(list, 3 * index)).collect();
                self.epoch = text;
                self.expected = Expected::Clock;
            }
            (Some(flag @ b'2'..=b'6'), Some(count)) if restarts => {
                push_line(out, &text);
                self.epoch.clear();
                // Records of cycle slips have lines like an epoch's, which in RINEX 2 are more than the satellites.
                let count = match (flag, self.form) {
                    (b'6', Form::One) => epoch_2::lines_of_epoch(count, types([b' '; 3])),
                    _ => count,
                };
                self.expected = if count > 0 { Expected::Event(count) } else { Expected::Epoch };
            }
            _ => return false,
        }
        true
    }

    /// The epoch line as RINEX has it.
    fn put_epoch(&self, out: &mut Vec<u8>) {
        if self.form == Form::Three {
            return push_line(out, columns(&self.epoch, 0, 35));
        }
        out.extend_from_slice(columns(&self.epoch, 0, BEFORE_LIST_2));
        for (index, id) in self.satellites.iter().enumerate() {
            if index > 0 && index % LISTED_PER_LINE == 0 {
                out.push(b'\n');
                out.extend_from_slice(&[b' '; BEFORE_LIST_2]);
            }
            out.extend_from_slice(id);
        }
        out.push(b'\n');
    }

    fn satellite(
        &mut self,
        (number, line): (u64, &[u8]),
        id: [u8; 3],
        types: usize,
        out: &mut Vec<u8>,
        skips: &mut Skips,
    ) {
        let mut track = self.before.remove(&id).unwrap_or_default();
        track.arcs.resize(types, Arc::default());
        track.indicators.resize(2 * types, b' ');
        let mut rest = line;
        let mut values = Vec::with_capacity(types);
        for arc in &mut track.arcs {
            let end = rest.iter().position(|b| *b == b' ').unwrap_or(rest.len());
            let field = rest.get(..end).unwrap_or_default();
            rest = rest.get(end + 1..).unwrap_or_default();
            values.push(arc.restore(field).unwrap_or_else(|reason| {
                let id = String::from_utf8_lossy(&id).into_owned();
                skips.add(reason, || format!("line {number}: {id}: '{}'", shorten(field)));
                None
            }));
        }
        change_text(&mut track.indicators, rest);
        track.indicators.resize(2 * types, b' ');
        // In version 1 a missing value has no indicators; in version 3 they are on their own.
        if self.form == Form::One {
            let missing = values.iter().zip(track.indicators.chunks_mut(2)).filter(|(v, _)| v.is_none());
            missing.for_each(|(_, indicators)| indicators.fill(b' '));
        }
        if self.form == Form::Three {
            out.extend_from_slice(&id);
        }
        let per_line = if self.form == Form::One { VALUES_PER_LINE_2 } else { usize::MAX };
        for (index, (value, indicators)) in values.iter().zip(track.indicators.chunks(2)).enumerate() {
            if index > 0 && index % per_line == 0 {
                out.push(b'\n');
            }
            put_value(out, *value);
            out.extend_from_slice(indicators);
        }
        out.push(b'\n');
        self.now.insert(id, track);
    }
}

fn identifier(list: &[u8], from: usize) -> [u8; 3] {
    columns(list, from, from + 3).first_chunk().copied().unwrap_or([b' '; 3])
}

fn push_line(out: &mut Vec<u8>, line: &[u8]) {
    out.extend_from_slice(line);
    out.push(b'\n');
}

/// Writes thousandths as F14.3.
fn put_value(out: &mut Vec<u8>, value: Option<i64>) {
    let Some(value) = value else { return out.extend_from_slice(&[b' '; 14]) };
    let sign = if value < 0 { "-" } else { "" };
    let (whole, thousandths) = (value.unsigned_abs() / 1000, value.unsigned_abs() % 1000);
    let digits = format!("{sign}{whole}.{thousandths:03}");
    out.extend(std::iter::repeat_n(b' ', 14_usize.saturating_sub(digits.len())));
    out.extend_from_slice(digits.as_bytes());
}
