//! Observation files.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::{labelled, program_line};
use crate::formats::rinex::Equipment;
use crate::frames::Ecef;
use crate::gnss::{
    Constellation, EpochFlag, Event, LossOfLock, Observation, ObservationEpoch, SatelliteId, SignalCode,
};
use crate::skips::{Reason, Skips};
use crate::time::{Calendar, GpsTime};

/// The version that files are written in where its codes suffice.
const WIDELY_READ: u16 = 305;
/// Types on a line of SYS / # / OBS TYPES.
const TYPES_ON_LINE: usize = 13;
/// Satellites on a line of GLONASS SLOT / FRQ #.
const SLOTS_ON_LINE: usize = 8;
/// Times are printed to this many nanoseconds.
const TIME_STEP_NS: i64 = 100;

/// A column's kind, in the order of writing: RINEX letter and value.
type Column = (char, fn(&Observation) -> Option<f64>);
const COLUMNS: [Column; 4] = [
    ('C', |o| o.pseudorange_m),
    ('L', |o| o.carrier_phase_cycles),
    ('D', |o| o.doppler_hz),
    ('S', |o| o.cn0_dbhz),
];
pub(super) const PHASE: char = 'L';

/// Columns that a file needs: RINEX names them before the first epoch, so all epochs must have been seen once.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObservationLayout {
    /// Per signal, which of [`COLUMNS`] have any value.
    signals: BTreeMap<(Constellation, SignalCode), [bool; 4]>,
    span: Option<(GpsTime, GpsTime)>,
}

/// Contents of a header beside its columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingInfo {
    /// Marker name.
    pub marker_name: String,
    /// Receiver, antenna and people.
    pub equipment: Equipment,
    /// Date and time of writing, for example `20200813 141902 UTC`.
    pub created: String,
    /// Approximate position.
    pub approximate_position: Option<Ecef>,
    /// Interval between epochs, s.
    pub interval_s: Option<f64>,
    /// GLONASS frequency channels by slot.
    pub glonass_channels: BTreeMap<u8, i8>,
    /// Seconds that GPS time is ahead of UTC.
    pub leap_seconds: Option<i64>,
}

impl ObservationLayout {
    /// Makes room for an epoch.
    pub fn include(&mut self, epoch: &ObservationEpoch) {
        let (first, last) = self.span.unwrap_or((epoch.time_gps, epoch.time_gps));
        self.span = Some((first.min(epoch.time_gps), last.max(epoch.time_gps)));
        for observation in epoch.observations.iter().filter(|o| can_be(o.satellite, o.signal)) {
            let key = (observation.satellite.constellation, observation.signal);
            let used = self.signals.entry(key).or_default();
            for (used, (_, value)) in used.iter_mut().zip(COLUMNS) {
                *used |= value(observation).is_some();
            }
            // The indicators stand in the column of the phase, even where it is blank.
            let [_, phase, ..] = used;
            *phase |= observation.loss_of_lock != LossOfLock::default();
        }
    }

    /// Makes room for an event: slips stand in the columns of the phases.
    pub fn include_event(&mut self, event: &Event) {
        for slip in event.slips.iter().filter(|slip| can_be(slip.satellite, slip.signal)) {
            let key = (slip.satellite.constellation, slip.signal);
            let [_, phase, ..] = self.signals.entry(key).or_default();
            *phase = true;
        }
    }

    /// Columns of a system: signal and kind.
    pub(super) fn columns(&self, system: Constellation) -> impl Iterator<Item = (SignalCode, Column)> + '_ {
        self.signals.iter().filter(move |((other, _), _)| *other == system).flat_map(|((_, signal), used)| {
            COLUMNS.into_iter().zip(used).filter(|(_, used)| **used).map(|(column, _)| (*signal, column))
        })
    }

    /// 3.05, which all programs read, unless a code came later.
    fn version(&self) -> &'static str {
        let newest = self.signals.keys().filter_map(|(system, signal)| signal.since(*system)).max();
        if newest.is_some_and(|since| since > WIDELY_READ) { "4.02" } else { "3.05" }
    }

    fn systems(&self) -> Vec<Constellation> {
        let mut systems: Vec<_> = self.signals.keys().map(|(system, _)| *system).collect();
        systems.dedup();
        systems
    }
}

/// Writes an observation file.
#[derive(Clone, Debug)]
pub struct ObservationWriter {
    pub(super) layout: ObservationLayout,
    pub(super) skips: Skips,
}

impl ObservationWriter {
    /// A writer of files with the given columns.
    pub fn new(layout: ObservationLayout) -> Self {
        Self { layout, skips: Skips::default() }
    }

    /// Records and values that could not be written, by reason.
    pub const fn skips(&self) -> &Skips {
        &self.skips
    }

    /// The header, with END OF HEADER.
    pub fn header(&self, info: &RecordingInfo) -> String {
        let clipped = |text: &str, width: usize| text.chars().take(width).collect::<String>();
        let version = format!("{:>9}{:11}{:<20}{:<20}", self.layout.version(), "", "OBSERVATION DATA", "M");
        let mut text = labelled(&version, "RINEX VERSION / TYPE");
        text += &program_line(&info.created);
        text += &labelled(&clipped(&info.marker_name, 60), "MARKER NAME");
        text += &equipment(&info.equipment);
        // Without one the line is left out, as of a moving platform: zeros would read as the Earth's centre.
        if let Some(Ecef(position)) = info.approximate_position {
            text += &labelled(&three(position.into()), "APPROX POSITION XYZ");
        }
        text +=
            &labelled(&three(info.equipment.antenna_delta_hen_m.unwrap_or_default()), "ANTENNA: DELTA H/E/N");
        text += &self.types();
        if let Some(interval_s) = info.interval_s {
            text += &labelled(&format!("{interval_s:10.3}"), "INTERVAL");
        }
        if let Some((first, last)) = self.layout.span {
            text += &labelled(&header_time(first), "TIME OF FIRST OBS");
            text += &labelled(&header_time(last), "TIME OF LAST OBS");
        }
        text += &self.phase_shifts();
        if self.layout.systems().contains(&Constellation::Glonass) {
            text += &glonass_slots(&info.glonass_channels);
            // Blank: the biases between code and phase are not known.
            text += &labelled("", "GLONASS COD/PHS/BIS");
        }
        if let Some(leap_seconds) = info.leap_seconds {
            text += &labelled(&format!("{leap_seconds:6}"), "LEAP SECONDS");
        }
        text + &labelled("", "END OF HEADER")
    }

    fn types(&self) -> String {
        let mut text = String::new();
        for system in self.layout.systems() {
            let codes: Vec<String> = self
                .layout
                .columns(system)
                .map(|(signal, (letter, _))| format!(" {letter}{signal:<2}"))
                .collect();
            for (index, codes_on_line) in codes.chunks(TYPES_ON_LINE).enumerate() {
                let start = match index {
                    0 => format!("{}  {:3}", system.letter(), codes.len()),
                    _ => " ".repeat(6),
                };
                text += &labelled(&(start + &codes_on_line.concat()), "SYS / # / OBS TYPES");
            }
        }
        text
    }

    /// Blank: nothing is known about shifts between the phases of a band.
    fn phase_shifts(&self) -> String {
        let with_phase =
            |system: &Constellation| self.layout.columns(*system).any(|(_, (letter, _))| letter == PHASE);
        let systems = self.layout.systems().into_iter().filter(with_phase);
        systems.map(|system| labelled(&system.letter().to_string(), "SYS / PHASE SHIFT")).collect()
    }

    /// An epoch: its line and one per satellite. Signals that satellites cannot send are left out: no reader would take them.
    pub fn epoch(&mut self, epoch: &ObservationEpoch) -> String {
        for Observation { satellite, signal, .. } in &epoch.observations {
            if let Some(reason) = satellite.cannot_send(*signal) {
                self.skips.add(reason, || format!("{satellite} {signal} at {}", epoch.time_gps));
            }
        }
        let possible = epoch.observations.iter().filter(|o| can_be(o.satellite, o.signal));
        let satellites = distinct(possible.map(|o| o.satellite));
        let flag = match epoch.flag {
            EpochFlag::Ok => 0,
            EpochFlag::PowerFailure => 1,
        };
        let mut text = epoch_line(Some(epoch.time_gps), flag, satellites.len());
        for satellite in satellites {
            text += &self.satellite(epoch, satellite);
        }
        text
    }

    fn satellite(&mut self, epoch: &ObservationEpoch, satellite: SatelliteId) -> String {
        let mut line = satellite.to_string();
        let Self { layout, skips } = self;
        for (signal, (letter, value)) in layout.columns(satellite.constellation) {
            let mut of_signal =
                epoch.observations.iter().filter(|o| (o.satellite, o.signal) == (satellite, signal));
            let Some(observation) = of_signal.next().filter(|_| can_be(satellite, signal)) else {
                line += &" ".repeat(16);
                continue;
            };
            let name = || format!("{satellite} {letter}{signal} at {}", epoch.time_gps);
            let digits =
                value(observation).map_or_else(|| " ".repeat(14), |value| digits(value, name, skips));
            let lock = if letter == PHASE { lock_digit(observation.loss_of_lock) } else { ' ' };
            let is_strength = letter == PHASE || letter == 'C';
            let strength =
                if is_strength && !digits.trim().is_empty() { strength_digit(observation) } else { ' ' };
            // Writing to a string cannot fail.
            let _ = write!(line, "{digits}{lock}{strength}");
        }
        line.truncate(line.trim_end().len());
        line + "\n"
    }
}

/// Whether a file may have a signal of a satellite.
pub(super) fn can_be(satellite: SatelliteId, signal: SignalCode) -> bool {
    satellite.cannot_send(signal).is_none()
}

/// Three lengths, m.
fn three([a, b, c]: [f64; 3]) -> String {
    format!("{a:14.4}{b:14.4}{c:14.4}")
}

/// The lines of marker, people, receiver and antenna.
fn equipment(e: &Equipment) -> String {
    let columns = |parts: &[&str]| {
        parts.iter().fold(String::new(), |line, part| {
            let part: String = part.chars().take(20).collect();
            line + &format!("{part:<20}")
        })
    };
    let mut text = String::new();
    for (part, label) in [(&e.marker_number, "MARKER NUMBER"), (&e.marker_type, "MARKER TYPE")] {
        if !part.is_empty() {
            text += &labelled(&columns(&[part]), label);
        }
    }
    let agency: String = e.agency.chars().take(40).collect();
    text += &labelled(&(columns(&[&e.observer]) + &agency), "OBSERVER / AGENCY");
    let receiver = columns(&[&e.receiver_number, &e.receiver_type, &e.receiver_version]);
    text += &labelled(&receiver, "REC # / TYPE / VERS");
    text + &labelled(&columns(&[&e.antenna_number, &e.antenna_type]), "ANT # / TYPE")
}

/// A value as F14.3; blank and counted when it does not fit, or would read as missing.
pub(super) fn digits(value: f64, name: impl Fn() -> String, skips: &mut Skips) -> String {
    let text = format!("{value:14.3}");
    if !value.is_finite() || text.len() > 14 {
        skips.add(Reason::ValueBeyondF14, || format!("{}: {value}", name()));
    } else if text.bytes().any(|byte| (b'1'..=b'9').contains(&byte)) {
        return text;
    } else {
        skips.add(Reason::ValueRoundsZero, || format!("{}: {value}", name()));
    }
    " ".repeat(14)
}

/// Satellites in the order of their first appearance.
pub(super) fn distinct(all: impl Iterator<Item = SatelliteId>) -> Vec<SatelliteId> {
    let mut satellites: Vec<SatelliteId> = Vec::new();
    for satellite in all {
        if !satellites.contains(&satellite) {
            satellites.push(satellite);
        }
    }
    satellites
}

/// The line before an epoch's satellites, or an event's lines.
pub(super) fn epoch_line(time: Option<GpsTime>, flag: u8, count: usize) -> String {
    let time = time.map_or_else(String::new, |time| {
        let Calendar { year, month, day, hour, minute, second } = printed(time).calendar();
        format!("{year:04} {month:02} {day:02} {hour:02} {minute:02}{second:11.7}")
    });
    format!("> {time:27}  {flag}{count:3}\n")
}

const fn lock_digit(lock: LossOfLock) -> char {
    match lock.cycle_slip as u8 | (lock.half_cycle as u8) << 1 | (lock.noisier as u8) << 2 {
        0 => ' ',
        bits => (b'0' + bits) as char,
    }
}

/// Signal strength in steps of 6 dB-Hz, 1-9 (RINEX 3.05, table 7).
fn strength_digit(observation: &Observation) -> char {
    let step = observation.cn0_dbhz.map(|cn0| (cn0 / 6.0).floor().clamp(1.0, 9.0));
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 1 to 9
    step.filter(|step| step.is_finite()).map_or(' ', |step| char::from(b'0' + step as u8))
}

/// Rounded to the digits of the format, so that no second prints as 60.
const fn printed(time: GpsTime) -> GpsTime {
    let nanos = time.nanos().saturating_add(TIME_STEP_NS / 2);
    GpsTime::from_nanos(nanos - nanos.rem_euclid(TIME_STEP_NS))
}

fn header_time(time: GpsTime) -> String {
    let Calendar { year, month, day, hour, minute, second } = printed(time).calendar();
    format!("{year:6}{month:6}{day:6}{hour:6}{minute:6}{second:13.7}{:>8}", "GPS")
}

fn glonass_slots(channels: &BTreeMap<u8, i8>) -> String {
    let slots: Vec<String> =
        channels.iter().map(|(slot, channel)| format!("R{slot:02} {channel:2} ")).collect();
    if slots.is_empty() {
        return labelled("  0", "GLONASS SLOT / FRQ #");
    }
    let lines = slots.chunks(SLOTS_ON_LINE).enumerate().map(|(index, slots_on_line)| {
        let start = if index == 0 { format!("{:3} ", slots.len()) } else { " ".repeat(4) };
        labelled(&(start + &slots_on_line.concat()), "GLONASS SLOT / FRQ #")
    });
    lines.collect()
}
