//! SP3-a to SP3-d files of precise orbits and clocks (Remondi 1989; Spofford and Remondi; Hilla: The Extended Standard Product 3
//! Orbit Format).

use crate::formats::decimal::{calendar, real, year};
use crate::formats::packing::{DecompressError, decompress};
use crate::formats::text::{columns, is_blank, lines_of_content, shorten, text};
use crate::formats::time_system::TimeSystem;
use crate::frames::Ecef;
use crate::gnss::SatelliteId;
use crate::orbit::{Sp3, Sp3Position};
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;

/// Clock value (µs) from which on it means "missing" (999999.999999).
const MISSING_CLOCK_US: f64 = 999_999.0;
/// Distances from the Earth's centre (m) of any navigation satellite, with room.
const RADIUS_BOUNDS_M: (f64, f64) = (6.4e6, 1e8);
/// Epoch intervals that are believed, s.
const INTERVAL_BOUNDS_S: (f64, f64) = (1.0, 7_200.0);

/// Why an SP3 file cannot be read at all.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Sp3Error {
    /// The first line is not that of an SP3 file.
    #[error("not an SP3 file of version a, b, c or d: the first line reads '{found}'")]
    NotSp3 {
        /// Its text, shortened.
        found: String,
    },
    /// The second line has no usable interval.
    #[error("SP3 line 2 (##) has no epoch interval between 1 and 7200 s: '{found}'")]
    Interval {
        /// Its text, shortened.
        found: String,
    },
    /// A time system that is not known.
    #[error("SP3 time system '{found}' is not known; {names} are", names = TimeSystem::NAMES)]
    TimeSystem {
        /// The name in the file.
        found: String,
    },
    /// No positions.
    #[error("SP3 file without any position in {lines} lines")]
    Empty {
        /// Lines read.
        lines: u64,
    },
    /// The gzip container is damaged or too large.
    #[error(transparent)]
    Decompress(#[from] DecompressError),
}

impl Sp3 {
    /// Reads a whole file, plain or compressed (.gz, .Z).
    ///
    /// # Errors
    /// When the compression is damaged, the header cannot be used, or there is no position in the file; other
    /// damage is counted in [`Sp3::skips`].
    pub fn parse(bytes: &[u8]) -> Result<Self, Sp3Error> {
        let bytes = decompress(bytes)?;
        let mut lines = lines_of_content(&bytes);
        let interval_s = header(&mut lines)?;
        let mut reader = Reader::default();
        let mut last = 2;
        for (number, line) in lines {
            last = number;
            if reader.line(number, line)? {
                break;
            }
        }
        reader.finish(last);
        if reader.positions.is_empty() {
            return Err(Sp3Error::Empty { lines: last });
        }
        let interval_s = reader.interval(interval_s);
        Ok(Self { interval_s, epochs: reader.epochs, positions: reader.positions, skips: reader.skips })
    }
}

/// Checks the first two lines and gives the interval.
fn header<'a>(lines: &mut impl Iterator<Item = (u64, &'a [u8])>) -> Result<f64, Sp3Error> {
    let (_, first) = lines.next().unwrap_or_default();
    let version = first.strip_prefix(b"#").and_then(|rest| rest.first()).map(u8::to_ascii_lowercase);
    if !matches!(version, Some(b'a'..=b'd')) {
        return Err(Sp3Error::NotSp3 { found: shorten(first) });
    }
    // Comments and empty lines have been seen before it.
    let is_passed_over = |line: &[u8]| is_blank(line) || line.starts_with(b"/*");
    let (_, second) = lines.find(|(_, line)| !is_passed_over(line)).unwrap_or_default();
    let (low, high) = INTERVAL_BOUNDS_S;
    let interval = real(columns(second, 24, 38)).filter(|s| (low..=high).contains(s));
    match interval {
        Some(interval_s) if second.starts_with(b"##") => Ok(interval_s),
        _ => Err(Sp3Error::Interval { found: shorten(second) }),
    }
}

#[derive(Default)]
struct Reader {
    time_system: Option<TimeSystem>,
    /// The epoch being read; `None` before the first and after a damaged epoch line.
    epoch: Option<GpsTime>,
    last_epoch: Option<GpsTime>,
    epochs: usize,
    /// Differences between successive epochs, s.
    steps_s: Vec<f64>,
    /// Satellites in the present and in the previous epoch, to notice a cut one.
    in_epoch: usize,
    in_previous: usize,
    ended: bool,
    positions: Vec<Sp3Position>,
    skips: Skips,
}

impl Reader {
    /// Takes a line; true when it was the end mark.
    fn line(&mut self, number: u64, line: &[u8]) -> Result<bool, Sp3Error> {
        match line.first() {
            Some(b'%') => self.time_system(line)?,
            Some(b'*') => self.epoch(number, line),
            Some(b'P') => self.position(number, line),
            Some(b'E') if line.starts_with(b"EOF") => self.ended = true,
            // Satellite lists, accuracies, comments, velocities, correlations: nothing needed from them.
            Some(b'+' | b'#' | b'/' | b'V') | None => {}
            Some(_) if is_blank(line) => {}
            Some(b'E') if line.starts_with(b"EP") || line.starts_with(b"EV") => {}
            Some(_) => {
                self.skips
                    .add(Reason::Sp3LineOfUnknownKind, || format!("line {number}: '{}'", shorten(line)));
            }
        }
        Ok(self.ended)
    }

    /// The first %c line names the time system; "ccc" is the placeholder of versions a and b, which know GPS time alone.
    fn time_system(&mut self, line: &[u8]) -> Result<(), Sp3Error> {
        if self.time_system.is_none() && line.starts_with(b"%c") {
            let name = columns(line, 9, 12);
            let system = match name.trim_ascii() {
                b"" | b"ccc" => TimeSystem::Gps,
                name => TimeSystem::of(name).ok_or_else(|| Sp3Error::TimeSystem { found: text(name) })?,
            };
            self.time_system = Some(system);
        }
        Ok(())
    }

    fn epoch(&mut self, number: u64, line: &[u8]) {
        self.in_previous = self.in_epoch;
        self.in_epoch = 0;
        self.epoch = None;
        let Some(time) = epoch_time(line).map(|own| self.time_system.unwrap_or_default().to_gps(own)) else {
            self.skips.add(Reason::Sp3EpochLineUnreadable, || format!("line {number}: '{}'", shorten(line)));
            return;
        };
        if let Some(last) = self.last_epoch.filter(|last| time <= *last) {
            self.skips.add(Reason::Sp3EpochNotLater, || format!("line {number}: {time} after {last}"));
            return;
        }
        self.epochs += 1;
        self.steps_s.extend(self.last_epoch.map(|last| time - last));
        self.epoch = Some(time);
        self.last_epoch = self.epoch;
    }

    fn position(&mut self, number: u64, line: &[u8]) {
        self.in_epoch += 1;
        let Some(time) = self.epoch else {
            self.skips.add(Reason::Sp3PositionWithoutEpoch, || format!("line {number}: '{}'", shorten(line)));
            return;
        };
        let satellite = columns(line, 1, 4).first_chunk().and_then(|id| satellite(*id));
        let at = |k: usize| {
            let field = columns(line, 4 + 14 * k, 18 + 14 * k);
            if field.len() == 14 { real(field) } else { None }
        };
        let (Some(satellite), Some(x), Some(y), Some(z)) = (satellite, at(0), at(1), at(2)) else {
            self.skips.add(Reason::Sp3PositionUnreadable, || format!("line {number}: '{}'", shorten(line)));
            return;
        };
        let position = Ecef::new(x * 1e3, y * 1e3, z * 1e3);
        let radius = position.0.norm();
        if radius == 0.0 {
            self.skips.add(Reason::Sp3PositionMissing, || format!("line {number}: {satellite} {time}"));
            return;
        }
        let (low, high) = RADIUS_BOUNDS_M;
        if !(low..=high).contains(&radius) {
            self.skips.add(Reason::Sp3PositionImpossible, || {
                format!("line {number}: {satellite} {time}: {radius} m from the Earth's centre")
            });
            return;
        }
        let clock_s = at(3).filter(|us| us.abs() < MISSING_CLOCK_US).map(|us| us * 1e-6);
        if clock_s.is_none() {
            self.skips.add(Reason::Sp3ClockMissing, || format!("line {number}: {satellite} {time}"));
        }
        self.positions.push(Sp3Position { satellite, time, position, clock_s });
    }

    /// The interval as the epochs have it (their median difference, so that gaps do not matter), else as the
    /// header says.
    fn interval(&mut self, stated_s: f64) -> f64 {
        self.steps_s.sort_by(f64::total_cmp);
        let found_s = self.steps_s.get(self.steps_s.len() / 2).copied().unwrap_or(stated_s);
        if found_s != stated_s {
            self.skips.add(Reason::Sp3HeaderInterval, || {
                format!("line 2: {stated_s} s, but epochs are {found_s} s apart; {found_s} s used")
            });
        }
        found_s
    }

    /// Notes a file without end mark whose last epoch has fewer satellites than the one before.
    fn finish(&mut self, last_line: u64) {
        if !self.ended && self.in_epoch < self.in_previous {
            let (epoch, got, before) = (self.last_epoch, self.in_epoch, self.in_previous);
            self.skips.add(Reason::Sp3FileCutOff, || {
                format!("line {last_line}: {epoch:?} has {got} satellites, the epoch before has {before}")
            });
        }
    }
}

/// The satellite of a position. Version a knows GPS alone and has bare numbers.
fn satellite([letter, tens, ones]: [u8; 3]) -> Option<SatelliteId> {
    SatelliteId::from_bytes([if letter == b' ' { b'G' } else { letter }, tens, ones])
}

fn epoch_time(line: &[u8]) -> Option<GpsTime> {
    let [month, day, hour, minute] = [8, 11, 14, 17].map(|from| columns(line, from, from + 2));
    let fields = [month, day, hour, minute, columns(line, 20, 31)];
    GpsTime::from_calendar(calendar(year(columns(line, 3, 7)), fields)?)
}
