//! The decoder: lines to records.

use std::collections::{BTreeMap, VecDeque};

use super::columns::{FIX, FIX_COLUMNS, RAW, RAW_COLUMNS, STATUS, STATUS_COLUMNS};
use super::device::Device;
use super::epochs::Epochs;
use super::fields::Fields;
use super::fix::{self, Fix};
use super::logcat::Logged;
use super::nav::NavLines;
use super::options::Options;
use super::raw;
use super::recognition::{Recognition, is_own_line};
use super::stated;
use super::status::{self, Reports, SignalStatus};
use super::table::Columns;
use crate::atmosphere::KlobucharCoefficients;
use crate::formats::decode::{Decoder, Record, WrongStream};
use crate::formats::lines::{Line, LineAssembly};
use crate::formats::phone::PhoneTally;
use crate::formats::rinex::Equipment;
use crate::formats::stream::ObservationStream;
use crate::formats::text::{shorten, without_mark};
use crate::frames::Ecef;
use crate::measurement::RecordedEpoch;
use crate::orbit::IonosphereTerms;
use crate::skips::{Reason, Skips};

/// Kinds of lines that the app writes and the decoder does not use.
const UNUSED_KINDS: [&[u8]; 19] = [
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
///
/// ```
/// use cofix_common::formats::decode::{Decoder, Record};
/// use cofix_common::formats::gnsslogger::GnssLoggerDecoder;
/// # let portions: [&[u8]; 1] = [b"# Fix,Provider,Latitude,Longitude,Altitude,Speed,Accuracy,(UTC)TimeInMs\n"];
/// let mut decoder = GnssLoggerDecoder::default();
/// for portion in portions {
///     decoder.feed(portion)?;
///     while let Some(record) = decoder.next_record() {
///         if let Record::Epoch(epoch) = record {
///             println!("{}: {} signals", epoch.time_gps, epoch.observations.len());
///         }
///     }
/// }
/// decoder.finish()?; // the last epoch
/// println!("{}", decoder.skips());
/// # Ok::<(), cofix_common::formats::decode::WrongStream>(())
/// ```
#[derive(Clone, Debug)]
pub struct GnssLoggerDecoder {
    options: Options,
    lines: LineAssembly,
    line_number: u64,
    device: Option<Device>,
    /// The first position by the best provider.
    own_fix: Option<Fix>,
    state: Recognition,
    raw: Columns<RAW_COLUMNS>,
    fix: Columns<FIX_COLUMNS>,
    status: Columns<STATUS_COLUMNS>,
    epochs: Epochs,
    nav: NavLines,
    fixes: Vec<Fix>,
    reports: Reports,
    statuses: Vec<SignalStatus>,
    /// Klobuchar's coefficients of GPS by `Raw` lines, the first.
    klobuchar: Option<KlobucharCoefficients>,
    records: VecDeque<Record>,
    last: Option<RecordedEpoch>,
    skips: Skips,
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
            lines: LineAssembly::default(),
            line_number: 0,
            device: None,
            own_fix: None,
            state: Recognition::Open { first: None },
            raw: Columns::new(RAW.standard(), false),
            fix: Columns::new(FIX.standard(), false),
            status: Columns::new(STATUS.standard(), false),
            epochs: Epochs::default(),
            nav: NavLines::default(),
            fixes: Vec::new(),
            reports: Reports::default(),
            statuses: Vec::new(),
            klobuchar: None,
            records: VecDeque::new(),
            last: None,
            skips: Skips::default(),
        }
    }

    /// Takes the phone's own positions since the last call out, in the order of the lines.
    pub fn take_fixes(&mut self) -> Vec<Fix> {
        std::mem::take(&mut self.fixes)
    }

    /// Takes the states of signals since the last call out, in the order of the lines.
    pub fn take_statuses(&mut self) -> Vec<SignalStatus> {
        std::mem::take(&mut self.statuses)
    }

    fn take(&mut self, line: Line<'_>) -> Result<(), WrongStream> {
        self.line_number = line.number;
        match line.counted(&mut self.skips) {
            Some(text) => self.line(text),
            None => self.state.line(false, line.number, b"(a line of more than 64 KiB)"),
        }
        self.state.check()
    }

    fn line(&mut self, line: &[u8]) {
        let line = without_mark(line.trim_ascii()).trim_ascii();
        let number = self.line_number;
        if line.is_empty() {
            return;
        }
        let line = match Logged::of(line) {
            Some(logged) if is_own_line(logged.message) => logged.message,
            Some(logged) => return self.other_of_system_log(logged, line),
            None => line,
        };
        if let Some(comment) = line.strip_prefix(b"#") {
            return self.comment(comment.trim_ascii());
        }
        let kind = line.split(|byte| *byte == b',').next().unwrap_or_default();
        match kind {
            b"Raw" => self.raw_line(line),
            b"Fix" => self.fix_line(line),
            b"Nav" => self.nav_line(line),
            b"Status" => self.status_line(line),
            kind if UNUSED_KINDS.contains(&kind) => {
                self.state.line(true, self.line_number, line);
                self.skips.add(Reason::SensorLines, || format!("line {number}: {}", shorten(kind)));
            }
            _ => {
                self.state.line(false, self.line_number, line);
                self.skips.add(Reason::LineOfUnknownKind, || format!("line {number}: '{}'", shorten(line)));
            }
        }
    }

    /// A line of the system log that is none of a log of measurements.
    fn other_of_system_log(&mut self, logged: Logged<'_>, line: &[u8]) {
        let number = self.line_number;
        self.state.line(logged.is_of_gpstest(), number, line);
        let reason = if logged.is_without_clock() {
            Reason::SystemLogMeasurementWithoutClock
        } else {
            Reason::SystemLogLine
        };
        self.skips.add(reason, || format!("line {number}: '{}'", shorten(line)));
    }

    /// A comment may be the header of a kind of lines.
    fn comment(&mut self, comment: &[u8]) {
        let number = self.line_number;
        let text = String::from_utf8_lossy(comment);
        if self.device.is_none() {
            self.device = Device::of(&text);
        }
        let taken = match text.split(',').next().filter(|kind| kind.len() < text.len()) {
            Some("Raw") => RAW.of_header(&text).map(|layout| self.raw = Columns::new(layout, true)),
            Some("Fix") => FIX.of_header(&text).map(|layout| self.fix = Columns::new(layout, true)),
            Some("Status") => STATUS.of_header(&text).map(|layout| self.status = Columns::new(layout, true)),
            Some("Nav") => Ok(()),
            _ => return,
        };
        if let Err(column) = taken {
            self.skips.add(Reason::HeaderLineWithoutColumn, || format!("line {number}: no column {column}"));
        }
        self.state.line(true, number, comment);
    }

    fn raw_line(&mut self, line: &[u8]) {
        let number = self.line_number;
        self.state.line(true, number, line);
        if !self.raw.from_header {
            self.skips.add(Reason::RawLineWithoutHeader, || format!("line {number}"));
        }
        let mut read = Fields { kind: "Raw line", line: number, skips: &mut self.skips };
        let Some(fields) = self.raw.fields_of(line, &mut read) else { return };
        let Some(raw) = raw::parse(&fields, &mut read) else {
            return self.epochs.lost(raw::lost_signal(&fields));
        };
        if self.klobuchar.is_none() && raw.is_gps() {
            self.klobuchar = stated::klobuchar(&fields);
            if self.klobuchar.is_some() {
                self.skips.add(Reason::KlobucharTermsOfRawLines, || format!("line {number}"));
            }
        }
        self.epochs.line((number, &raw), &self.options, &mut self.skips, &mut self.records);
        self.nav.catch_up(&self.epochs, &mut self.skips, &mut self.records);
    }

    fn fix_line(&mut self, line: &[u8]) {
        self.state.line(true, self.line_number, line);
        let mut read = Fields { kind: "Fix line", line: self.line_number, skips: &mut self.skips };
        let Some(fields) = self.fix.fields_of(line, &mut read) else { return };
        let Some(fix) = fix::parse(&fields, &mut read) else { return };
        if self.own_fix.is_none_or(|own| fix.provider < own.provider) {
            self.own_fix = Some(fix);
        }
        self.fixes.push(fix);
    }

    fn status_line(&mut self, line: &[u8]) {
        self.state.line(true, self.line_number, line);
        let mut read = Fields { kind: "Status line", line: self.line_number, skips: &mut self.skips };
        let Some(fields) = self.status.fields_of(line, &mut read) else { return };
        self.statuses.extend(status::parse(&fields, self.epochs.time(), &mut self.reports, &mut read));
    }

    fn nav_line(&mut self, line: &[u8]) {
        self.state.line(true, self.line_number, line);
        self.nav.line((self.line_number, line), &self.epochs, &mut self.skips, &mut self.records);
    }
}

impl Decoder for GnssLoggerDecoder {
    fn feed(&mut self, bytes: &[u8]) -> Result<(), WrongStream> {
        self.state.check()?;
        let mut lines = std::mem::take(&mut self.lines);
        let result = lines.feed(bytes, |line| self.take(line));
        self.lines = lines;
        result
    }

    fn finish(&mut self) -> Result<(), WrongStream> {
        self.state.check()?;
        self.lines.finish(|Line { number, text }| {
            let cut = shorten(text.unwrap_or_default());
            self.skips.add(Reason::LastLineCutOff, || format!("line {number}: '{cut}'"));
            Ok(())
        })?;
        self.epochs.finish(&mut self.skips, &mut self.records);
        self.nav.finish(&mut self.skips);
        self.state.check_end(self.line_number)
    }

    fn next_record(&mut self) -> Option<Record> {
        let record = self.records.pop_front()?;
        self.last = match &record {
            Record::Epoch(epoch) => self.epochs.recorded(epoch),
            _ => None,
        };
        Some(record)
    }

    fn skips(&self) -> &Skips {
        &self.skips
    }
}

impl ObservationStream for GnssLoggerDecoder {
    /// Those of the log's own `Nav` lines, the latest; of GPS those of its `Raw` lines, where no `Nav` line has any.
    fn ionosphere(&self) -> IonosphereTerms {
        let terms = self.nav.ionosphere();
        IonosphereTerms { gps: terms.gps.or(self.klobuchar), ..terms }
    }

    fn recorded_epoch(&self) -> Option<&RecordedEpoch> {
        self.last.as_ref()
    }

    fn leap_seconds(&self) -> Option<i64> {
        self.nav.leap_seconds()
    }

    /// As carrier frequencies tell them.
    fn glonass_channels(&self) -> BTreeMap<u8, i8> {
        self.epochs.glonass_channels().clone()
    }

    /// The phone's first own position, of the best provider that the log has up to now: the GNSS chip's, else the fused one, else
    /// another.
    fn approximate_position(&self) -> Option<Ecef> {
        self.own_fix.as_ref().map(Fix::position)
    }

    fn equipment(&self) -> Equipment {
        self.device.as_ref().map_or_else(Equipment::default, |device| Equipment {
            receiver_type: device.name(),
            receiver_version: device.software(),
            ..Equipment::default()
        })
    }

    fn tell_phone(&mut self, tally: &mut PhoneTally) {
        tally.take(self.take_fixes(), self.take_statuses());
    }

    fn shifts_weeks_itself(&self) -> bool {
        true
    }
}
