//! RINEX clock files, versions 2.00 and 3.00 to 3.04 (Ray, Gurtner: RINEX Extensions to Handle Clock Information).
//!
//! Only satellite clocks (`AS`) are taken. Version 3.04 shifts every column by five; records are therefore read by their words, which
//! no version lets touch. The header's LEAP SECONDS are not used: some centres give TAI − UTC there and others GPS − UTC.

use crate::formats::decimal::{calendar, integer, real, year};
use crate::formats::packing::{DecompressError, decompress};
use crate::formats::text::{columns, lines_of_content, shorten, text, words};
use crate::formats::time_system::TimeSystem;
use crate::gnss::SatelliteId;
use crate::orbit::{ClockFile, ClockRecord};
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;

/// Clock offsets beyond this are not believed, s.
const MAX_OFFSET_S: f64 = 0.1;
/// Steps between epochs that are believed, s.
const STEP_BOUNDS_S: (f64, f64) = (0.1, 7_200.0);

/// Why a RINEX clock file cannot be read at all.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ClockFileError {
    /// The first line is not that of a RINEX clock file.
    #[error("not a RINEX clock file of version 2.00 or 3.00 to 3.04: the first line reads '{found}'")]
    NotClock {
        /// Its text, shortened.
        found: String,
    },
    /// A time system that is not known.
    #[error("TIME SYSTEM ID '{found}' of a clock file is not known; {names} are", names = TimeSystem::NAMES)]
    TimeSystem {
        /// The name in the header.
        found: String,
    },
    /// The input ended before END OF HEADER.
    #[error("the clock file ends after {lines} lines, before END OF HEADER")]
    HeaderIncomplete {
        /// Lines read.
        lines: u64,
    },
    /// No satellite clock.
    #[error("clock file without any satellite clock (AS record) in {lines} lines")]
    Empty {
        /// Lines read.
        lines: u64,
    },
    /// The gzip container is damaged or too large.
    #[error(transparent)]
    Decompress(#[from] DecompressError),
}

impl ClockFile {
    /// Reads a whole file, plain or gzip-compressed.
    ///
    /// # Errors
    /// When the compression is damaged, the header cannot be used, or there is no satellite clock in the file; other damage is
    /// counted in [`ClockFile::skips`].
    pub fn parse(bytes: &[u8]) -> Result<Self, ClockFileError> {
        let bytes = decompress(bytes)?;
        let mut lines = lines_of_content(&bytes);
        let (mut last, time_system) = header(&mut lines)?;
        let mut reader = Reader { time_system, ..Reader::default() };
        for (number, line) in lines {
            last = number;
            reader.line(number, line);
        }
        reader.drop_suspect();
        let Some(interval_s) = reader.interval_s() else { return Err(ClockFileError::Empty { lines: last }) };
        // Only a damaged beginning leaves them in another order.
        reader.records.sort_by_key(|record| record.time);
        Ok(Self { interval_s, records: reader.records, skips: reader.skips })
    }
}

/// Reads the header to its end; gives its number of lines and the time system, GPS time where none is named.
fn header<'a>(
    lines: &mut impl Iterator<Item = (u64, &'a [u8])>,
) -> Result<(u64, TimeSystem), ClockFileError> {
    let mut time_system = TimeSystem::Gps;
    let (mut last, first) = lines.next().unwrap_or_default();
    let mut first_words = words(first);
    let version = first_words.next().and_then(real).unwrap_or(0.0);
    let is_known = version == 2.0 || (3.0..=3.04).contains(&version);
    let is_clock = first_words.next().is_some_and(|word| word.starts_with(b"C"));
    if !is_known || !is_clock || !is_labelled(first, b"RINEX VERSION / TYPE") {
        return Err(ClockFileError::NotClock { found: shorten(first) });
    }
    for (number, line) in lines {
        last = number;
        if is_labelled(line, b"END OF HEADER") {
            return Ok((last, time_system));
        }
        if is_labelled(line, b"TIME SYSTEM ID")
            && let Some(name) = words(columns(line, 0, 60)).next()
        {
            time_system =
                TimeSystem::of(name).ok_or_else(|| ClockFileError::TimeSystem { found: text(name) })?;
        }
    }
    Err(ClockFileError::HeaderIncomplete { lines: last })
}

/// Labels begin in column 61, since version 3.04 in column 66.
fn is_labelled(line: &[u8], label: &[u8]) -> bool {
    line.len() > 60 && line.trim_ascii_end().ends_with(label)
}

#[derive(Default)]
struct Reader {
    time_system: TimeSystem,
    records: Vec<ClockRecord>,
    last_epoch: Option<GpsTime>,
    /// A record far in time from its predecessor, and its line; believed when the next record is near it.
    suspect: Option<(u64, ClockRecord)>,
    /// Differences between successive epochs, s.
    steps_s: Vec<f64>,
    skips: Skips,
}

impl Reader {
    fn line(&mut self, number: u64, line: &[u8]) {
        // Receivers' clocks and others, and lines that go on a record with rate and acceleration: neighbours tell the rate.
        if !line.starts_with(b"AS ") {
            return;
        }
        let Some(record) = satellite_clock(line, self.time_system) else {
            self.skips.add(Reason::ClockRecordUnreadable, || format!("line {number}: '{}'", shorten(line)));
            return;
        };
        let ClockRecord { satellite, time, clock_s } = record;
        if clock_s.abs() > MAX_OFFSET_S {
            self.skips.add(Reason::ClockRecordImpossibleOffset, || {
                format!("line {number}: {satellite} {time}: {clock_s} s; the limit is {MAX_OFFSET_S} s")
            });
            return;
        }
        let is_near = |other: GpsTime| (time - other).abs() <= STEP_BOUNDS_S.1;
        match self.last_epoch {
            Some(last) if !is_near(last) => {
                if let Some((_, first)) = self.suspect.take_if(|(_, suspect)| is_near(suspect.time)) {
                    self.last_epoch = None;
                    self.take(first);
                    self.take(record);
                } else {
                    self.drop_suspect();
                    self.suspect = Some((number, record));
                }
            }
            Some(last) if time < last => self.skips.add(Reason::ClockRecordEarlier, || {
                format!("line {number}: {satellite} {time} after {last}")
            }),
            _ => {
                self.drop_suspect();
                self.take(record);
            }
        }
    }

    fn take(&mut self, record: ClockRecord) {
        let (low, high) = STEP_BOUNDS_S;
        let step_s = self.last_epoch.map(|last| record.time - last);
        self.steps_s.extend(step_s.filter(|step_s| (low..=high).contains(step_s)));
        self.last_epoch = Some(record.time);
        self.records.push(record);
    }

    /// A date that no other record confirms is damaged: it must not make those after it look late.
    fn drop_suspect(&mut self) {
        if let Some((number, ClockRecord { satellite, time, .. })) = self.suspect.take() {
            self.skips.add(Reason::ClockRecordFar, || {
                format!("line {number}: {satellite} {time}; steps are up to {} s", STEP_BOUNDS_S.1)
            });
        }
    }

    /// The median step, `None` without records. A single epoch has no interval; any is as good.
    fn interval_s(&mut self) -> Option<f64> {
        self.last_epoch?;
        self.steps_s.sort_by(f64::total_cmp);
        Some(self.steps_s.get(self.steps_s.len() / 2).copied().unwrap_or(STEP_BOUNDS_S.0))
    }
}

/// `AS`, satellite, year to second, number of values, offset, and more.
fn satellite_clock(line: &[u8], time_system: TimeSystem) -> Option<ClockRecord> {
    let mut words = words(line).skip(1);
    let satellite = SatelliteId::from_bytes(words.next()?.try_into().ok()?)?;
    let mut next = || words.next();
    let (year, fields) = (year(next()?), [next()?, next()?, next()?, next()?, next()?]);
    let values = integer(next()?)?;
    let own = GpsTime::from_calendar(calendar(year, fields)?)?;
    let time = time_system.to_gps(own);
    let clock_s = real(next()?)?;
    (1..=6).contains(&values).then_some(ClockRecord { satellite, time, clock_s })
}

#[cfg(test)]
mod tests {
    use super::*;

    const VERSION_3: &str = "     3.00           C                                       RINEX VERSION / TYPE
   GPS                                                      TIME SYSTEM ID
    15                                                      LEAP SECONDS
                                                            END OF HEADER
AR GPST 2010 07 01 00 00  0.000000  2   -2.214541847585e-09  0.000000000000e+00
AS G02  2010 07 01 00 00  0.000000  2    2.500000000000e-04  1.500000000000e-11
AS R05  2010 07 01 00 00  0.000000  4   -1.000000000000D-05  1.500000000000D-11
    1.000000000000e-12  1.000000000000e-13
AS G02  2010 07 01 00 00 30.000000  1    2.500000300000e-04
AS G02  2010 07 01 00 01  0.000000  1    2.500000600000e-04
";
    const VERSION_304: &str =
        "3.04                 CLOCK DATA         GPS                      RINEX VERSION / TYPE
                                                                 END OF HEADER
AS G02       2010 07 01 00 00  0.000000  2      2.500000000000E-04   1.500000000000E-11
";

    fn parse(text: &str) -> Result<ClockFile, ClockFileError> {
        ClockFile::parse(text.as_bytes())
    }

    #[test]
    fn satellite_clocks_are_read_and_others_passed_over() {
        let file = parse(VERSION_3).unwrap();
        assert_eq!(file.records.len(), 4);
        assert_eq!(file.interval_s, 30.0);
        let start: GpsTime = "2010-07-01T00:00:00".parse().unwrap();
        assert_eq!(
            file.records[1],
            ClockRecord { satellite: "R05".parse().unwrap(), time: start, clock_s: -1e-5 }
        );
        assert_eq!(file.records[3].time, start + 60.0);
        assert!(file.skips.is_empty(), "{}", file.skips);
    }

    #[test]
    fn the_columns_of_version_3_04_give_the_same() {
        assert_eq!(parse(VERSION_304).unwrap().records, parse(VERSION_3).unwrap().records[..1]);
    }

    #[test]
    fn files_of_other_kinds_and_time_systems_are_refused_by_name() {
        let observations =
            "     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE\n";
        assert!(matches!(parse(observations), Err(ClockFileError::NotClock { .. })));
        assert!(matches!(parse(""), Err(ClockFileError::NotClock { .. })));
        let future = VERSION_3.replacen("3.00", "4.00", 1);
        assert!(parse(&future).unwrap_err().to_string().contains("4.00"));
        let other = VERSION_3.replacen("   GPS   ", "   XYZ   ", 1);
        assert_eq!(parse(&other), Err(ClockFileError::TimeSystem { found: "XYZ".to_owned() }));
        let header: String = VERSION_3.split_inclusive('\n').take(3).collect();
        assert_eq!(parse(&header), Err(ClockFileError::HeaderIncomplete { lines: 3 }));
        let receivers: String = VERSION_3.split_inclusive('\n').take(5).collect();
        assert_eq!(parse(&receivers), Err(ClockFileError::Empty { lines: 5 }));
    }

    #[test]
    fn times_of_other_systems_become_gps_time() {
        for (name, seconds) in [
            ("GPS", 0.0),
            ("GAL", 0.0),
            ("UTC", 15.0),
            ("GLO", 15.0),
            ("BDT", 14.0),
            ("TAI", -19.0),
            ("   ", 0.0),
        ] {
            let file = parse(&VERSION_3.replacen("   GPS   ", &format!("   {name}   "), 1)).unwrap();
            let start: GpsTime = "2010-07-01T00:00:00".parse().unwrap();
            assert_eq!(file.records[0].time - start, seconds, "{name}");
        }
    }

    #[test]
    fn a_mark_and_blank_lines_before_the_first_are_passed_over() {
        for before in ["\u{feff}", "\n", "  \r\n\n", "\u{feff}\r\n", "\n\u{feff}"] {
            let marked = format!("{before}{VERSION_3}");
            assert_eq!(parse(&marked).unwrap().records, parse(VERSION_3).unwrap().records, "{before:?}");
        }
    }

    #[test]
    fn damaged_records_are_counted_and_the_others_used() {
        let damaged = VERSION_3.replacen("G02  2010 07 01 00 00 30", "G02  2010 13 01 00 00 30", 1)
            + "AS G02  2010 07 01 00 00  5.000000  1    2.5e-04\nAS G02  2010 07 01 00 05  0.000000  1    2.5e+04\nAS G0\n";
        let file = parse(&damaged).unwrap();
        assert_eq!(file.records.len(), 3);
        assert_eq!(file.skips.count(Reason::ClockRecordUnreadable), 2, "{}", file.skips);
        assert_eq!(file.skips.count(Reason::ClockRecordEarlier), 1);
        assert_eq!(file.skips.count(Reason::ClockRecordImpossibleOffset), 1);
    }

    #[test]
    fn one_damaged_date_costs_one_record() {
        let damaged = VERSION_3.replacen("AS R05  2010 07", "AS R05  2019 07", 1);
        let file = parse(&damaged).unwrap();
        assert_eq!(file.records.len(), 3, "{}", file.skips);
        assert_eq!((file.skips.total(), file.interval_s), (1, 30.0));
        let named = file.skips.iter().next().unwrap();
        assert_eq!(named.0, Reason::ClockRecordFar.text());
        assert!(named.1.first.contains("R05") && named.1.first.contains("2019"), "{}", file.skips);
        // At the very end, too; and a gap of days is none.
        let last = VERSION_3.replacen("AS G02  2010 07 01 00 01", "AS G02  2010 08 01 00 01", 1);
        assert_eq!(parse(&last).unwrap().records.len(), 3);
        let days = VERSION_3.to_owned()
            + "AS G02  2010 07 03 00 00  0.000000  1    2.5e-04\nAS G02  2010 07 03 00 00 30.000000  1    2.5e-04\n";
        let file = parse(&days).unwrap();
        assert!(file.records.len() == 6 && file.skips.is_empty(), "{}", file.skips);
    }

    /// The first record's date is the damaged one: the others are used, in order of time.
    #[test]
    fn a_damaged_first_date_costs_no_other_record() {
        let file = parse(&VERSION_3.replacen("AS G02  2010", "AS G02  2030", 1)).unwrap();
        assert_eq!(file.records.len(), 4, "{}", file.skips);
        assert!(file.records.is_sorted_by_key(|record| record.time));
        assert_eq!(file.records[0].time, "2010-07-01T00:00:00".parse().unwrap());
    }
}
