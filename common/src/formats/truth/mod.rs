//! Reference trajectories in five formats.
//!
//! | format | time | quality of a row |
//! |:--|:--|:--|
//! | our CSV ([`Truth::parse_csv`]) | GPS week and seconds | its column `quality` |
//! | challenge `ground_truth.csv` ([`gsdc::ground_truth`]) | GPS or Unix milliseconds | 1 |
//! | WHU-Smartphone truth table ([`whu::truth_table`]) | GPS seconds of week, no week | its column `Q` |
//! | RTKLIB solution ([`rtklib_pos::read`]) | GPST, UTC or JST | its column `Q` |
//! | NMEA ([`nmea::read`]) | UTC of day, date in RMC or ZDA | that of GGA in RTKLIB's numbers |
//!
//! A new format is a module with a reader, and a row of the table `FORMATS`.

pub mod nmea;
pub mod rtklib_pos;

use super::{gsdc, whu};
use crate::accuracy::{Truth, TruthError};
use crate::skips::Skips;
use crate::time::GpsTime;

/// A trajectory and the counts of skipped rows, or the reason why there is none.
type Reading = Result<(Truth, Skips), TruthError>;

/// A format of reference trajectories.
pub struct TruthFormat {
    /// Name for messages.
    pub name: &'static str,
    is_it: fn(&[u8]) -> bool,
    needs_date: fn(&[u8]) -> bool,
    read: fn(&[u8], GpsTime) -> Reading,
}

impl TruthFormat {
    /// Whether these bytes leave the date open, so that [`TruthFormat::read`] has to be given one.
    pub fn needs_date(&self, bytes: &[u8]) -> bool {
        (self.needs_date)(bytes)
    }

    /// Reads a whole file. `near` is an instant at most half a week (for NMEA: half a day) from all rows; it counts only where
    /// [`TruthFormat::needs_date`] says so.
    ///
    /// # Errors
    /// [`TruthError`] when a column is missing or no row is usable.
    pub fn read(&self, bytes: &[u8], near: GpsTime) -> Result<(Truth, Skips), TruthError> {
        (self.read)(bytes, near)
    }
}

/// Formats in the order in which they are tried. The last format takes any file and names the columns that are missing.
static FORMATS: [TruthFormat; 5] = [
    TruthFormat {
        name: "challenge ground truth",
        is_it: gsdc::is_ground_truth,
        needs_date: |_| false,
        read: |bytes, _| gsdc::ground_truth(bytes),
    },
    TruthFormat {
        name: "WHU-Smartphone truth table",
        is_it: whu::is_truth_table,
        needs_date: |_| true,
        read: whu::truth_table,
    },
    TruthFormat {
        name: "RTKLIB solution",
        is_it: rtklib_pos::is_solution,
        needs_date: |_| false,
        read: |bytes, _| rtklib_pos::read(bytes),
    },
    TruthFormat {
        name: "NMEA",
        is_it: nmea::is_nmea,
        needs_date: |bytes| !nmea::has_date(bytes),
        read: nmea::read,
    },
    TruthFormat {
        name: "CSV",
        is_it: |_| true,
        needs_date: |_| false,
        read: |bytes, _| Truth::parse_csv(bytes),
    },
];

/// The format of a file with these bytes, by its content.
pub fn recognise(bytes: &[u8]) -> &'static TruthFormat {
    let [.., last] = &FORMATS;
    FORMATS.iter().find(|format| (format.is_it)(bytes)).unwrap_or(last)
}
