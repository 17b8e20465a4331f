//! Epochs of RINEX 2: the satellites are listed in the epoch line, and their values follow in that order, five to a
//! line.

use super::version::year_2;
use crate::formats::decimal::{calendar, integer};
use crate::formats::text::columns;
use crate::time::GpsTime;

/// Satellites on an epoch line and on each of its continuations.
const LISTED_PER_LINE: usize = 12;
/// Values on a line.
const VALUES_PER_LINE: usize = 5;
/// Columns of a value with its two indicators.
const VALUE_COLUMNS: usize = 16;

/// The list of an epoch's satellites, and the lines of the present satellite.
#[derive(Clone, Debug)]
pub(super) struct Listed {
    satellites: Vec<[u8; 3]>,
    announced: usize,
    lines_per_satellite: usize,
    next: usize,
    lines: usize,
    values: Vec<u8>,
}

impl Listed {
    /// From the epoch line; `default` is the system letter where the file leaves it out.
    pub(super) fn new(line: &[u8], announced: usize, types: usize, default: u8) -> Self {
        let mut listed = Self {
            satellites: Vec::with_capacity(announced.min(100)),
            announced,
            lines_per_satellite: lines_per_satellite(types),
            next: 0,
            lines: 0,
            values: Vec::new(),
        };
        listed.list(line, default);
        listed
    }

    fn list(&mut self, line: &[u8], default: u8) {
        let count = (self.announced - self.satellites.len()).min(LISTED_PER_LINE);
        for index in 0..count {
            let mut id = [b' '; 3];
            for (to, from) in id.iter_mut().zip(columns(line, 32 + 3 * index, 35 + 3 * index)) {
                *to = *from;
            }
            if id[0] == b' ' {
                id[0] = default;
            }
            self.satellites.push(id);
        }
    }

    /// Takes a line after the epoch line; true when it completes a satellite.
    pub(super) fn line(&mut self, line: &[u8], default: u8) -> bool {
        if self.satellites.len() < self.announced {
            self.list(line, default);
            return false;
        }
        if self.lines == 0 {
            self.values.clear();
        }
        let columns = columns(line, 0, VALUES_PER_LINE * VALUE_COLUMNS);
        self.lines += 1;
        self.values.extend_from_slice(columns);
        self.values.resize(self.lines * VALUES_PER_LINE * VALUE_COLUMNS, b' ');
        if self.lines < self.lines_per_satellite {
            return false;
        }
        self.lines = 0;
        self.next += 1;
        true
    }

    /// The satellite just completed and its values, as a line of RINEX 3 has them.
    pub(super) fn satellite(&self) -> ([u8; 3], &[u8]) {
        let id = self.next.checked_sub(1).and_then(|index| self.satellites.get(index));
        (id.copied().unwrap_or([b' '; 3]), &self.values)
    }
}

const fn lines_per_satellite(types: usize) -> usize {
    if types == 0 { 1 } else { types.div_ceil(VALUES_PER_LINE) }
}

/// Lines that follow the epoch line of `satellites` satellites.
pub(super) const fn lines_of_epoch(satellites: usize, types: usize) -> usize {
    let continued = satellites.div_ceil(LISTED_PER_LINE).saturating_sub(1);
    continued + satellites * lines_per_satellite(types)
}

/// Whether a line is an epoch line. Values have their decimal points elsewhere, so that a line of values cannot be taken
/// for it.
pub(super) fn is_epoch_line(line: &[u8]) -> bool {
    let flag = columns(line, 26, 29);
    let [b' ', b' ', flag @ b'0'..=b'6'] = flag else { return false };
    let Some(count) = integer(columns(line, 29, 32)) else { return false };
    let time = columns(line, 0, 26);
    let separated = [0, 3, 6, 9, 12].iter().all(|at| time.get(*at) == Some(&b' '));
    let timed = separated && time.get(18) == Some(&b'.') && epoch_time(line).is_some();
    // Events may leave out the time.
    count >= 0 && (timed || (*flag > b'1' && time.iter().all(|b| *b == b' ')))
}

/// The time of an epoch line, in the file's time system.
pub(super) fn epoch_time(line: &[u8]) -> Option<GpsTime> {
    let [month, day, hour, minute] = [4, 7, 10, 13].map(|from| columns(line, from, from + 2));
    let fields = [month, day, hour, minute, columns(line, 15, 26)];
    GpsTime::from_calendar(calendar(year_2(columns(line, 1, 3)), fields)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn epoch_lines_are_told_from_values() {
        for line in [
            " 05  4  2  0  0 30.0000000  0  8G 3G 7G 8G11G19G20G24G28",
            " 98 12 31 23 59 59.9999999  1 12 1  2  3",
            "                            4  1",
            " 05  4  2  0  0 30.0000000  4 10",
        ] {
            assert!(is_epoch_line(line.as_bytes()), "{line}");
        }
        for line in [
            "  56072048.441    24795930.671    43763044.9694   24795930.1344",
            "                  24795930.671    43763044.9694   24795930.1344",
            "                                  43763044.9694",
            "",
            " 05 14  2  0  0 30.0000000  0  8G 3",
            "                            0  1",
        ] {
            assert!(!is_epoch_line(line.as_bytes()), "{line}");
        }
    }

    #[test]
    fn lists_go_on_over_lines() {
        let line = format!(" 05  4  2  0  0 30.0000000  0 14{}", "G 1 2 3".repeat(2));
        let mut listed = Listed::new(line.as_bytes(), 14, 7, b'G');
        assert!(!listed.line(b"                                R 7E11", b'G'));
        assert!(!listed.line(b"  1", b'G'));
        assert!(listed.line(b"  2", b'G'));
        let (id, values) = listed.satellite();
        assert_eq!((id, values.len(), values[82]), (*b"G 1", 160, b'2'));
        assert_eq!((listed.satellites[13], lines_of_epoch(14, 7)), (*b"E11", 29));
    }
}
