//! One record of a navigation file: numbers to ephemeris, with plausibility limits.

use super::version::year_2;
use crate::formats::decimal::{calendar, integer, real, year};
use crate::formats::text::columns;
use crate::gnss::{Constellation, SatelliteId};
use crate::orbit::{
    Implausible, KeplerEphemeris, NavigationMessage, UNKNOWN_ACCURACY_M, check_reference_s, within,
};
use crate::skips::{Reason, Skips};
use crate::time::{
    BEIDOU_BEHIND_GPS_S, BEIDOU_WEEK_OFFSET, Calendar, GpsTime, SECONDS_PER_WEEK, WEEKS_PER_ROLLOVER,
};

/// No issue of data has a higher number.
const MAX_ISSUE: f64 = 65_535.0;
/// Larger group delays (s) cannot be broadcast; files write such numbers for "missing".
const MAX_GROUP_DELAY_S: f64 = 1e-6;
/// Clock terms in the first line, and four numbers in each of seven more.
const VALUES: usize = 31;
/// Columns before the numbers of a continuation line in RINEX 3 and 4.
const INDENT: usize = 4;

/// The numbers of a record, by their place in the file (RINEX 3.05, tables A6, A8, A12, A14).
#[derive(Clone, Debug)]
pub(super) struct Record {
    /// Line of its beginning.
    pub(super) line: u64,
    /// The satellite.
    pub(super) satellite: SatelliteId,
    epoch: Calendar,
    /// Columns before the numbers of a continuation line.
    indent: usize,
    values: [Option<f64>; VALUES],
    filled: usize,
}

/// Why a record gives no ephemeris.
#[derive(Clone, Debug)]
pub(super) struct Fault {
    /// Reason to count under.
    pub(super) reason: Reason,
    /// The value and the limit.
    pub(super) detail: String,
}

impl Fault {
    const fn impossible(detail: String) -> Self {
        Self { reason: Reason::RecordImpossible, detail }
    }
}

impl From<Implausible> for Fault {
    fn from(value: Implausible) -> Self {
        Self::impossible(value.to_string())
    }
}

impl Record {
    /// Begins with the line of satellite and epoch of RINEX 3 and 4.
    pub(super) fn begin(line: u64, text: &[u8]) -> Option<Self> {
        let satellite = SatelliteId::from_bytes(*text.first_chunk::<3>()?)?;
        let [month, day, hour, minute] = [9, 12, 15, 18].map(|from| columns(text, from, from + 2));
        let fields = [month, day, hour, minute, columns(text, 21, 23)];
        let epoch = calendar(year(columns(text, 4, 8)), fields)?;
        Some(Self::new((line, satellite), epoch, INDENT, columns(text, 23, 80)))
    }

    /// Begins with the line of satellite and epoch of RINEX 2 (tables A4, A11). Its files are of one system and number the
    /// satellites; where 2.12 has the system's letter in front, all is a column farther to the right.
    pub(super) fn begin_2(line: u64, text: &[u8], system: Constellation) -> Option<Self> {
        let lettered = text.first_chunk::<3>().filter(|id| id[0].is_ascii_alphabetic());
        let shift = usize::from(lettered.is_some());
        let satellite = match lettered {
            Some(id) => SatelliteId::from_bytes(*id)?,
            // SBAS satellites have their PRN less 100.
            None => {
                SatelliteId::new(system, integer(columns(text, 0, 2)).and_then(|n| u8::try_from(n).ok())?)
            }
        };
        let text = columns(text, shift, text.len());
        let [month, day, hour, minute] = [6, 9, 12, 15].map(|from| columns(text, from, from + 2));
        let fields = [month, day, hour, minute, columns(text, 17, 22)];
        let epoch = calendar(year_2(columns(text, 3, 5)), fields)?;
        let indent = 3 + shift;
        let known = (1..100).contains(&satellite.number);
        known.then(|| Self::new((line, satellite), epoch, indent, columns(text, 22, 79)))
    }

    /// Begins with a line that has the epoch alone (ionosphere records of RINEX 4). Satellite and epoch do not matter.
    pub(super) fn begin_without_satellite(line: u64, text: &[u8]) -> Self {
        let satellite = SatelliteId::new(Constellation::Gps, 0);
        Self::new((line, satellite), GpsTime::default().calendar(), INDENT, columns(text, 23, 80))
    }

    fn new((line, satellite): (u64, SatelliteId), epoch: Calendar, indent: usize, values: &[u8]) -> Self {
        let mut record = Self { line, satellite, epoch, indent, values: [None; VALUES], filled: 0 };
        record.append(values, 3);
        record
    }

    /// Takes a further line.
    pub(super) fn continuation(&mut self, line: &[u8]) {
        self.append(columns(line, self.indent, 80), 4);
    }

    /// A number by its place in the record; `None` where it is missing or unreadable.
    pub(super) fn value(&self, index: usize) -> Option<f64> {
        self.values.get(index).copied().flatten()
    }

    /// The epoch in the record's own time system, read as if it were GPS time.
    pub(super) fn own_epoch(&self) -> Result<GpsTime, Fault> {
        GpsTime::from_calendar(self.epoch).ok_or_else(|| Fault::impossible(format!("epoch {:?}", self.epoch)))
    }

    fn append(&mut self, text: &[u8], count: usize) {
        for k in 0..count {
            if let Some(value) = self.values.get_mut(self.filled.saturating_add(k)) {
                *value = real(columns(text, 19 * k, 19 * k + 19));
            }
        }
        self.filled = self.filled.saturating_add(count);
    }

    /// A number that must be there.
    pub(super) fn number(&self, index: usize, name: &'static str) -> Result<f64, Fault> {
        self.value(index).ok_or_else(|| Fault {
            reason: Reason::RecordUnreadable,
            detail: format!("{name} is missing or not a number"),
        })
    }

    /// A number that must be there and within bounds.
    fn between(&self, index: usize, name: &'static str, low: f64, high: f64) -> Result<f64, Fault> {
        let value = self.number(index, name)?;
        within(name, value, low..=high)?;
        Ok(value)
    }

    /// A group delay in seconds, NaN where it is missing.
    fn group_delay(&self, index: usize) -> f64 {
        let value = self.value(index);
        value.filter(|delay| delay.abs() <= MAX_GROUP_DELAY_S).unwrap_or(f64::NAN)
    }
}

/// The ephemeris of a record and the time of its transmission (its reference time where that is not known).
pub(super) fn ephemeris(record: &Record, skips: &mut Skips) -> Result<(GpsTime, KeplerEphemeris), Fault> {
    let message = message(record)?;
    let toc = clock_reference(record)?;
    let toe_own_tow_s = record.number(11, "toe")?;
    check_reference_s("toe", toe_own_tow_s)?;
    let toe = orbit_reference(record, toc, toe_own_tow_s, skips)?;
    let issue_of_data = issue_of_data(record)?;
    let ephemeris = KeplerEphemeris {
        satellite: record.satellite,
        message,
        toe,
        toe_own_tow_s,
        toc,
        sqrt_a: record.number(10, "sqrt(A)")?,
        eccentricity: record.number(8, "eccentricity")?,
        i0_rad: record.number(15, "i0")?,
        i_dot_radps: record.number(19, "IDOT")?,
        omega0_rad: record.number(13, "OMEGA0")?,
        omega_dot_radps: record.number(18, "OMEGA DOT")?,
        omega_rad: record.number(17, "omega")?,
        m0_rad: record.number(6, "M0")?,
        delta_n_radps: record.number(5, "delta n")?,
        cuc_cus_rad: (record.number(7, "Cuc")?, record.number(9, "Cus")?),
        crc_crs_m: (record.number(16, "Crc")?, record.number(4, "Crs")?),
        cic_cis_rad: (record.number(12, "Cic")?, record.number(14, "Cis")?),
        clock: (record.number(0, "af0")?, record.number(1, "af1")?, record.number(2, "af2")?),
        group_delays_s: group_delays(record, message),
        accuracy_m: accuracy(record),
        health: record.number(24, "health")?,
        issue_of_data,
        issue_of_clock: issue_of_clock(record).unwrap_or(issue_of_data),
    };
    ephemeris.check()?;
    Ok((transmission(record, toe), ephemeris))
}

fn message(record: &Record) -> Result<NavigationMessage, Fault> {
    match record.satellite.constellation {
        Constellation::Galileo => galileo_message(record),
        Constellation::Beidou => Ok(NavigationMessage::BeidouD1D2),
        _ => Ok(NavigationMessage::Lnav),
    }
}

/// Data source bits (RINEX 3.05, table A8): 0 I/NAV E1-B, 1 F/NAV E5a-I, 2 I/NAV E5b-I; 8 clock for E5a/E1,
/// 9 clock for E5b/E1, which decide when both messages were merged.
fn galileo_message(record: &Record) -> Result<NavigationMessage, Fault> {
    let sources = record.between(20, "data sources", 0.0, 1023.0)?;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within 0 to 1023
    let bits = sources as u32;
    match (bits & 0b101 != 0, bits & 0b010 != 0, bits >> 8) {
        (true, false, _) | (true, true, 0b10) => Ok(NavigationMessage::GalileoInav),
        (false, true, _) | (true, true, 0b01) => Ok(NavigationMessage::GalileoFnav),
        _ => Err(Fault { reason: Reason::GalileoRecordUnclear, detail: format!("data sources {bits:#b}") }),
    }
}

fn clock_reference(record: &Record) -> Result<GpsTime, Fault> {
    Ok(record.own_epoch()? + own_behind_gps_s(record))
}

fn own_behind_gps_s(record: &Record) -> f64 {
    if record.satellite.constellation == Constellation::Beidou { BEIDOU_BEHIND_GPS_S } else { 0.0 }
}

/// The instant whose time of week is toe, in the week that brings it nearest to the clock's reference. Files
/// disagree on whether the week number goes with toe or with the transmission, so it is a check only.
fn orbit_reference(
    record: &Record,
    toc: GpsTime,
    toe_own_tow_s: f64,
    skips: &mut Skips,
) -> Result<GpsTime, Fault> {
    let behind = own_behind_gps_s(record);
    let same_week = GpsTime::from_week_tow((toc - behind).week(), toe_own_tow_s) + behind;
    let weeks = ((toc - same_week) / SECONDS_PER_WEEK).round();
    let toe = same_week + weeks * SECONDS_PER_WEEK;
    check_week(record, toe, skips)?;
    Ok(toe)
}

fn check_week(record: &Record, toe: GpsTime, skips: &mut Skips) -> Result<(), Fault> {
    let week = record.between(21, "week", 0.0, 20_000.0)?;
    // Some writers give the week as broadcast, modulo 1024.
    let fits = |full: f64| {
        let apart = (full - toe.week() as f64).rem_euclid(WEEKS_PER_ROLLOVER as f64);
        apart.min(WEEKS_PER_ROLLOVER as f64 - apart) <= 1.0
    };
    let is_beidou = record.satellite.constellation == Constellation::Beidou;
    if fits(if is_beidou { week + BEIDOU_WEEK_OFFSET as f64 } else { week }) {
        return Ok(());
    }
    // The other way to count is 1356 weeks off, which no mistake of another kind comes near.
    if is_beidou && fits(week) {
        skips.add(Reason::BeidouWeekFrom1980, || {
            format!("line {}: {} week {week} at {toe}", record.line, record.satellite)
        });
        return Ok(());
    }
    Err(Fault::impossible(format!("week {week} does not fit the epoch {toe}")))
}

/// Time of transmission, s of the own week; `toe` where the file does not know it.
fn transmission(record: &Record, toe: GpsTime) -> GpsTime {
    let tow = record.value(27).filter(|t| t.abs() <= 2.0 * SECONDS_PER_WEEK);
    let Some(tow_s) = tow else { return toe };
    let behind = own_behind_gps_s(record);
    let same_week = GpsTime::from_week_tow((toe - behind).week(), tow_s) + behind;
    same_week + ((toe - same_week) / SECONDS_PER_WEEK).round() * SECONDS_PER_WEEK
}

/// Group delays as [`KeplerEphemeris::group_delays_s`] orders them. F/NAV does not carry BGD E1-E5b.
fn group_delays(record: &Record, message: NavigationMessage) -> (f64, f64) {
    match message {
        NavigationMessage::Lnav => (record.group_delay(25), 0.0),
        NavigationMessage::GalileoFnav => (record.group_delay(25), f64::NAN),
        NavigationMessage::GalileoInav | NavigationMessage::BeidouD1D2 => {
            (record.group_delay(25), record.group_delay(26))
        }
    }
}

/// URA or SISA in metres. Galileo writes −1 for "no accuracy prediction", files leave it out or write zero:
/// then [`UNKNOWN_ACCURACY_M`], which keeps the satellite but with little weight.
fn accuracy(record: &Record) -> f64 {
    record.value(23).filter(|m| *m > 0.0).unwrap_or(UNKNOWN_ACCURACY_M)
}

fn issue_of_data(record: &Record) -> Result<u32, Fault> {
    record.between(3, "issue of data", 0.0, MAX_ISSUE).map(whole)
}

/// IODC or AODC. It is told, not used, so that a record without it is as good.
fn issue_of_clock(record: &Record) -> Option<u32> {
    let index = match record.satellite.constellation {
        Constellation::Gps | Constellation::Qzss => 26,
        Constellation::Beidou => 28,
        _ => return None,
    };
    record.value(index).filter(|issue| (0.0..=MAX_ISSUE).contains(issue)).map(whole)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within 0 to MAX_ISSUE
const fn whole(issue: f64) -> u32 {
    issue as u32
}
