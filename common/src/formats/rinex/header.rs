//! Header of an observation file.

mod lists;

use std::collections::BTreeMap;

use super::equipment::Equipment;
use super::types::ObservationType;
use super::types_2::TypeList;
use super::version::Version;
use super::{RinexError, label, leap_seconds};
use crate::formats::decimal::{calendar, real, year};
use crate::formats::text::{columns, shorten, text};
use crate::formats::time_system::TimeSystem;
use crate::frames::Ecef;
use crate::gnss::{Constellation, SatelliteId};
use crate::skips::Reason;
use crate::time::{GpsTime, corrected_leap_seconds, leap_seconds_by};

/// Header of an observation file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObservationHeader {
    /// Version times 100: 304 for RINEX 3.04.
    pub version: u16,
    /// Marker name, as written.
    pub marker_name: String,
    /// Receiver (phone), antenna and people, as written.
    pub equipment: Equipment,
    /// Approximate position, `None` when absent or zero.
    pub approximate_position: Option<Ecef>,
    /// Interval between epochs, s, where stated.
    pub interval_s: Option<f64>,
    /// Time of the first observation, GPS time.
    pub first_observation: Option<GpsTime>,
    /// Seconds that GPS time is ahead of UTC, where stated.
    pub leap_seconds: Option<i64>,
    /// The time system as written (GPS, GAL, BDT, …); empty when not stated: then the time of
    /// the file's one system, GPS time for a mixed file.
    pub time_system: String,
    /// Columns per system, in file order, with the codes as the file writes them. Their meaning depends on the version.
    pub observation_types: BTreeMap<Constellation, Vec<ObservationType>>,
    /// GLONASS frequency channels by slot.
    pub glonass_channels: BTreeMap<u8, i8>,
}

impl ObservationHeader {
    /// GLONASS frequency channel of a satellite, where the header gives it; `None` for other systems.
    pub fn glonass_channel(&self, satellite: SatelliteId) -> Option<i8> {
        match satellite.constellation {
            Constellation::Glonass => self.glonass_channels.get(&satellite.number).copied(),
            _ => None,
        }
    }
}

/// Collects header lines.
#[derive(Clone, Debug, Default)]
pub(super) struct HeaderBuilder {
    header: ObservationHeader,
    /// The first header of the file, when it was complete.
    first: Option<Box<ObservationHeader>>,
    version: Version,
    types_2: TypeList,
    time_system: TimeSystem,
    lines: u64,
    /// System and number of types still to come on continuation lines.
    continued: Option<(Constellation, usize)>,
    scaled: Option<Scaled>,
    first_observation_own: Option<GpsTime>,
    /// Remarks on the header: reason and facts.
    remarks: Vec<(Reason, String)>,
}

/// A scale factor whose list of types is not complete yet.
#[derive(Clone, Copy, Debug)]
struct Scaled {
    constellation: Constellation,
    factor: f64,
    remaining: usize,
}

const TYPES_LABEL: &str = "SYS / # / OBS TYPES";
const TYPES_2_LABEL: &str = "# / TYPES OF OBSERV";
const SCALE_LABEL: &str = "SYS / SCALE FACTOR";

impl HeaderBuilder {
    /// Lines taken so far.
    pub(super) const fn lines(&self) -> u64 {
        self.lines
    }

    /// Takes out the remarks on the header: reason and facts.
    pub(super) fn take_remarks(&mut self) -> Vec<(Reason, String)> {
        std::mem::take(&mut self.remarks)
    }

    /// At the beginning of another header. GLONASS keeps its channels.
    pub(super) fn again(self) -> Self {
        let glonass_channels = self.header.glonass_channels;
        let header = ObservationHeader { glonass_channels, ..ObservationHeader::default() };
        Self { header, first: self.first, ..Self::default() }
    }

    /// The first header of the file, when it was complete.
    pub(super) const fn first(&self) -> Option<&ObservationHeader> {
        match &self.first {
            Some(first) => Some(first),
            None => None,
        }
    }

    /// Beginning of the file by the header.
    pub(super) const fn stated_beginning(&self) -> Option<GpsTime> {
        self.header.first_observation
    }

    /// The header so far.
    pub(super) const fn header(&self) -> &ObservationHeader {
        &self.header
    }

    /// The header.
    pub(super) fn into_header(self) -> ObservationHeader {
        self.header
    }

    /// Whether it is a RINEX 2 file.
    pub(super) const fn is_2(&self) -> bool {
        self.version.is_2()
    }

    /// Number of observation types of a RINEX 2 file.
    pub(super) const fn types_2(&self) -> usize {
        self.types_2.len()
    }

    /// Number of observation types of a satellite, by its identifier.
    pub(super) fn types_of(&self, [letter, ..]: [u8; 3]) -> usize {
        if self.is_2() {
            return self.types_2();
        }
        let constellation = Constellation::from_letter(letter.to_ascii_uppercase() as char);
        constellation.and_then(|c| self.header.observation_types.get(&c)).map_or(0, Vec::len)
    }

    /// Letter of the system that satellites without a letter belong to (RINEX 2).
    pub(super) fn default_letter(&self) -> u8 {
        match self.version.system {
            Some(Constellation::Glonass) => b'R',
            _ => b'G',
        }
    }

    /// Takes a line; true when it was END OF HEADER.
    pub(super) fn line(&mut self, number: u64, line: &[u8]) -> Result<bool, RinexError> {
        self.lines += 1;
        let label = label(line);
        if self.lines == 1 {
            self.version = Version::read(number, line, b"O", "observation")?;
            self.header.version = self.version.number;
            return Ok(false);
        }
        self.record(line, &label).map_err(|label| RinexError::HeaderLine {
            line: number,
            label,
            text: shorten(line),
        })?;
        Ok(label == b"END OF HEADER")
    }

    /// Takes a line of an event. The time system is the file's and does not change.
    pub(super) fn line_between_epochs(&mut self, number: u64, line: &[u8]) -> Result<(), RinexError> {
        if label(line) == b"TIME OF FIRST OBS" {
            return Ok(());
        }
        self.line(number, line).map(|_| ())
    }

    /// Takes a line of any label; the error is the label of a needed line that cannot be read.
    fn record(&mut self, line: &[u8], label: &[u8]) -> Result<(), &'static str> {
        match label {
            b"MARKER NAME" => self.header.marker_name = text(columns(line, 0, 60)),
            b"APPROX POSITION XYZ" => self.header.approximate_position = position(line),
            b"INTERVAL" => self.header.interval_s = real(columns(line, 0, 10)).filter(|s| *s > 0.0),
            b"LEAP SECONDS" => self.header.leap_seconds = leap_seconds::header_line(line),
            b"SYS / # / OBS TYPES" => self.observation_types(line).ok_or(TYPES_LABEL)?,
            b"SYS / SCALE FACTOR" => self.scale_factor(line).ok_or(SCALE_LABEL)?,
            b"TIME OF FIRST OBS" => {
                self.first_observation_own = calendar_of_header(line);
                // Some writers are a column off.
                self.header.time_system = text(columns(line, 46, 60));
                // Only the time system is needed.
                if self.first_observation_own.is_none() {
                    let reason = Reason::HeaderFirstTimeUnreadable;
                    self.remarks.push((reason, shorten(line)));
                }
            }
            b"# / TYPES OF OBSERV" => self.observation_types_2(line).ok_or(TYPES_2_LABEL)?,
            b"GLONASS SLOT / FRQ #" => self.glonass_slots(line),
            _ => self.header.equipment.header_line(label, line),
        }
        Ok(())
    }

    /// Checks that there are observation types, and settles the time system.
    pub(super) fn complete(&mut self) -> Result<(), RinexError> {
        if self.header.observation_types.values().all(Vec::is_empty) {
            return Err(RinexError::NoObservationTypes);
        }
        let system = match (self.header.time_system.as_str(), self.version.system) {
            ("", Some(Constellation::Glonass)) => "GLO",
            ("", Some(Constellation::Beidou)) => "BDT",
            (stated, _) => stated,
        };
        self.time_system = match system {
            "" => TimeSystem::Gps,
            other => TimeSystem::of(other.as_bytes())
                .ok_or_else(|| RinexError::TimeSystem { found: other.to_owned() })?,
        };
        self.check_leap_seconds();
        self.header.first_observation = self.first_observation_own.map(|time| self.to_gps(time));
        self.first.get_or_insert_with(|| Box::new(self.header.clone()));
        Ok(())
    }

    /// Leap seconds that cannot be those of the first observation are named and not believed.
    fn check_leap_seconds(&mut self) {
        let (Some(stated), Some(first)) = (self.header.leap_seconds, self.first_observation_own) else {
            return;
        };
        if let Some(known) = corrected_leap_seconds(stated, first) {
            let facts = format!("{stated} s, but {known} s held at {first}");
            self.remarks.push((Reason::HeaderLeapSecondsWrong, facts));
            self.header.leap_seconds = Some(known);
        }
    }

    /// A time of the file in GPS time.
    pub(super) fn to_gps(&self, own: GpsTime) -> GpsTime {
        match self.time_system {
            TimeSystem::Utc => own + leap_seconds_by(self.header.leap_seconds, own) as f64,
            system => system.to_gps(own),
        }
    }
}

fn position(line: &[u8]) -> Option<Ecef> {
    let at = |k: usize| real(columns(line, 14 * k, 14 * k + 14));
    let position = Ecef::new(at(0)?, at(1)?, at(2)?);
    (position.0.norm() > 0.0).then_some(position)
}

fn calendar_of_header(line: &[u8]) -> Option<GpsTime> {
    let [first, month, day, hour, minute] = [0, 6, 12, 18, 24].map(|from| columns(line, from, from + 6));
    GpsTime::from_calendar(calendar(year(first), [month, day, hour, minute, columns(line, 30, 43)])?)
}
