//! Text logs of Google's GnssLogger app, all versions from 2016 on.
//!
//! Lines are comma-separated and begin with their kind: `Raw` (one signal of one epoch), `Fix` (the phone's own position),
//! `Nav` (a piece of a navigation message), `Status` and sensor lines, which are not used. Columns are found by the names in
//! the `# Raw,…` header line.
//!
//! Pseudorange: [`pseudorange`](self) = c·(t_rx − t_tx) with t_rx by the phone's clock fields, in whole nanoseconds. Masks
//! ([`Masks`]) and everything else that costs a measurement are counted by name.

mod clock;
mod columns;
mod epochs;
mod fields;
mod fix;
mod leap;
mod lines;
mod measure;
mod nav;
mod options;
mod pseudorange;
mod raw;
mod signal;

use std::collections::{BTreeMap, VecDeque};

use columns::{FIX_COLUMNS, Layout, RAW_COLUMNS};
use epochs::Epochs;
use fields::Fields;
pub use fix::{Fix, FixProvider};
use lines::{Framed, Lines};
use nav::NavLines;
pub use options::{BiasReference, Masks, Options, StateRule, StateRules, state};

use crate::atmosphere::KlobucharCoefficients;
use crate::decode::{Decoder, Record, WrongStream};
use crate::rinex::shorten;
use crate::skips::Skips;
use crate::time::GpsTime;

/// A log is recognised within this many lines.
const LINES_TO_RECOGNISE: u64 = 100;

/// Kinds of lines that the app writes and that have no use here.
const UNUSED_KINDS: [&[u8]; 20] = [
    b"Status",
    b"Agc",
    b"Accel",
    b"UncalAccel",
    b"Gyro",
    b"UncalGyro",
    b"Mag",
    b"UncalMag",
    b"OrientationDeg",
    b"NMEA",
    b"Pressure",
    b"Baro",
    b"GameRotationVector",
    b"StepDetector",
    b"StepCounter",
    b"Light",
    b"Proximity",
    b"Temperature",
    b"Humidity",
    b"ScanResult",
];

/// Decodes a GnssLogger text log. Bytes go in in any portions, records come out in the order of the lines.
///
/// An epoch is complete when a line of the next one has come, or with [`Decoder::finish`]. A last line without its line end
/// is not used: it may be cut.
#[derive(Clone, Debug)]
pub struct GnssLoggerDecoder {
    options: Options,
    lines: Lines,
    line_number: u64,
    state: Recognition,
    raw: Columns<RAW_COLUMNS>,
    fix: Columns<FIX_COLUMNS>,
    epochs: Epochs,
    nav: NavLines,
    fixes: Vec<Fix>,
    records: VecDeque<Record>,
    skips: Skips,
}

/// Whether it is such a log.
#[derive(Clone, Debug, PartialEq)]
enum Recognition {
    Open { first: Option<String> },
    Log,
    Wrong(WrongStream),
}

/// The columns of a kind of line, and how many fields its lines have.
#[derive(Clone, Debug)]
struct Columns<const N: usize> {
    layout: Layout<N>,
    from_header: bool,
    fields: usize,
    /// A different number of fields that waits for a second line.
    suspect: Option<usize>,
}

impl<const N: usize> Columns<N> {
    fn new(layout: Layout<N>, from_header: bool) -> Self {
        Self { fields: layout.fields(), layout, from_header, suspect: None }
    }

    /// The used fields of a line, when it has as many fields as the header. Where the lines agree with each other but not
    /// with the header, the second one is believed. Otherwise the number that was found.
    fn split<'a>(&mut self, line: &'a [u8]) -> Result<[&'a [u8]; N], usize> {
        let (values, count) = self.layout.split(line);
        if count != self.fields {
            if self.suspect != Some(count) {
                self.suspect = Some(count);
                return Err(count);
            }
            self.fields = count;
        }
        self.suspect = None;
        Ok(values)
    }
}

impl Default for GnssLoggerDecoder {
    fn default() -> Self {
        Self::new(Options::default())
    }
}

impl GnssLoggerDecoder {
    /// A decoder at the beginning of a log.
    pub fn new(options: Options) -> Self {
        Self {
            options,
            lines: Lines::default(),
            line_number: 0,
            state: Recognition::Open { first: None },
            raw: Columns::new(Layout::raw_standard(), false),
            fix: Columns::new(Layout::fix_standard(), false),
            epochs: Epochs::default(),
            nav: NavLines::default(),
            fixes: Vec::new(),
            records: VecDeque::new(),
            skips: Skips::default(),
        }
    }

    /// The phone's own positions so far, in the order of the lines.
    pub fn fixes(&self) -> &[Fix] {
        &self.fixes
    }

    /// Takes the positions out, so that a long recording need not keep them.
    pub fn take_fixes(&mut self) -> Vec<Fix> {
        std::mem::take(&mut self.fixes)
    }

    /// GLONASS frequency channels by slot number, as the carrier frequencies tell them.
    pub const fn glonass_channels(&self) -> &BTreeMap<u8, i8> {
        self.epochs.glonass_channels()
    }

    /// Klobuchar coefficients of the log's own `Nav` lines, the latest.
    pub const fn klobuchar(&self) -> Option<KlobucharCoefficients> {
        self.nav.klobuchar()
    }

    /// Seconds that GPS time is ahead of UTC by the log's own `Nav` lines.
    pub const fn leap_seconds(&self) -> Option<i64> {
        self.nav.leap_seconds()
    }

    /// Time of the epoch that the lines have come to.
    pub fn time(&self) -> Option<GpsTime> {
        self.epochs.time()
    }

    fn take(&mut self, framed: Framed<'_>) {
        self.line_number += 1;
        let number = self.line_number;
        match framed {
            Framed::Line(line) => self.line(line),
            Framed::TooLong => {
                self.recognise(false, b"(a line of more than 64 KiB)");
                self.skips.add("line too long", || format!("line {number}: more than 65536 bytes"));
            }
        }
    }

    fn line(&mut self, line: &[u8]) {
        let line = line.trim_ascii();
        let number = self.line_number;
        if line.is_empty() {
            return;
        }
        if let Some(comment) = line.strip_prefix(b"#") {
            return self.comment(comment.trim_ascii());
        }
        let kind = line.split(|byte| *byte == b',').next().unwrap_or_default();
        match kind {
            b"Raw" => self.raw_line(line),
            b"Fix" => self.fix_line(line),
            b"Nav" => self.nav_line(line),
            b"Status" => self.skips.add("Status lines (not used)", || format!("line {number}")),
            kind if UNUSED_KINDS.contains(&kind) => {
                self.recognise(true, line);
                self.skips
                    .add("sensor and gain lines (not used)", || format!("line {number}: {}", shorten(kind)));
            }
            _ => {
                self.recognise(false, line);
                self.skips.add("line of unknown kind", || format!("line {number}: '{}'", shorten(line)));
            }
        }
    }

    /// A comment may be the header of a kind of lines.
    fn comment(&mut self, comment: &[u8]) {
        let number = self.line_number;
        let text = String::from_utf8_lossy(comment);
        let missing = |skips: &mut Skips, column: &str| {
            skips.add("header line without a needed column", || format!("line {number}: no column {column}"));
        };
        if text.starts_with("Raw,") {
            match Layout::raw(&text) {
                Ok(layout) => self.raw = Columns::new(layout, true),
                Err(column) => missing(&mut self.skips, column),
            }
        } else if text.starts_with("Fix,") {
            match Layout::fix(&text) {
                Ok(layout) => self.fix = Columns::new(layout, true),
                Err(column) => missing(&mut self.skips, column),
            }
        } else if !text.starts_with("Nav,") {
            return;
        }
        self.recognise(true, comment);
    }

    fn raw_line(&mut self, line: &[u8]) {
        self.recognise(true, line);
        let number = self.line_number;
        if !self.raw.from_header {
            self.skips.add("Raw line without a header (columns of 2016 assumed; used)", || {
                format!("line {number}")
            });
        }
        let fields = match self.raw.split(line) {
            Ok(fields) => fields,
            Err(count) => {
                return self.odd_count("Raw line with another number of fields", count, self.raw.fields);
            }
        };
        let mut read = Fields { kind: "Raw", line: number, skips: &mut self.skips };
        let Some(raw) = raw::parse(&fields, &mut read) else { return };
        self.epochs.line((number, &raw), &self.options, &mut self.skips, &mut self.records);
        if let Some(time) = self.epochs.time() {
            self.nav.catch_up(time, &mut self.skips, &mut self.records);
        }
    }

    fn fix_line(&mut self, line: &[u8]) {
        self.recognise(true, line);
        let fields = match self.fix.split(line) {
            Ok(fields) => fields,
            Err(count) => {
                return self.odd_count("Fix line with another number of fields", count, self.fix.fields);
            }
        };
        let mut read = Fields { kind: "Fix", line: self.line_number, skips: &mut self.skips };
        self.fixes.extend(fix::parse(&fields, &mut read));
    }

    fn nav_line(&mut self, line: &[u8]) {
        self.recognise(true, line);
        let time = self.epochs.time();
        self.nav.line((self.line_number, line), time, &mut self.skips, &mut self.records);
    }

    fn odd_count(&mut self, reason: &str, found: usize, expected: usize) {
        let number = self.line_number;
        self.skips.add(reason, || format!("line {number}: {found} fields, {expected} expected"));
    }

    /// Notes whether a line is one of such a log, until it is clear.
    fn recognise(&mut self, known: bool, line: &[u8]) {
        let Recognition::Open { first } = &mut self.state else { return };
        if known {
            self.state = Recognition::Log;
            return;
        }
        let first = first.get_or_insert_with(|| shorten(line)).clone();
        if self.line_number >= LINES_TO_RECOGNISE {
            self.state = Recognition::Wrong(wrong(&first, self.line_number));
        }
    }
}

impl Decoder for GnssLoggerDecoder {
    fn feed(&mut self, bytes: &[u8]) -> Result<(), WrongStream> {
        let mut lines = std::mem::take(&mut self.lines);
        let mut rest = bytes;
        while let Some(framed) = lines.next(&mut rest) {
            if matches!(self.state, Recognition::Wrong(_)) {
                break;
            }
            self.take(framed);
        }
        self.lines = lines;
        match &self.state {
            Recognition::Wrong(error) => Err(error.clone()),
            Recognition::Open { .. } | Recognition::Log => Ok(()),
        }
    }

    fn finish(&mut self) -> Result<(), WrongStream> {
        if let Recognition::Wrong(error) = &self.state {
            return Err(error.clone());
        }
        if let Some(cut) = self.lines.finish() {
            let number = self.line_number + 1;
            self.skips.add("last line is cut off", || format!("line {number}: '{}'", shorten(&cut)));
        }
        self.epochs.finish(&mut self.skips, &mut self.records);
        self.nav.finish(&mut self.skips);
        match &self.state {
            Recognition::Open { first } => {
                Err(wrong(first.as_deref().unwrap_or("(no line)"), self.line_number))
            }
            Recognition::Wrong(error) => Err(error.clone()),
            Recognition::Log => Ok(()),
        }
    }

    fn next_record(&mut self) -> Option<Record> {
        self.records.pop_front()
    }

    fn skips(&self) -> &Skips {
        &self.skips
    }
}

fn wrong(first: &str, lines: u64) -> WrongStream {
    WrongStream {
        reason: format!(
            "not a GnssLogger text log: none of the first {lines} lines begins with '# Raw,', 'Raw,', 'Fix,' or another \
             kind that the app writes; the first one reads '{first}'"
        ),
    }
}
