//! RINEX 3.05 as text: observation and navigation files (Romero: RINEX 3.05).
//!
//! Records that are written and read again are equal to the digits of the format.

mod event;
mod glonass;
mod navigation;
mod observation;

pub use glonass::glonass_record;
pub use navigation::{navigation_header, navigation_record};
pub use observation::{ObservationLayout, ObservationWriter, RecordingInfo};

use std::ops::Range;

use crate::time::{Calendar, GpsTime};

/// Date and time in the columns of a navigation record; `None` when they do not hold it.
fn calendar_columns(time: GpsTime) -> Option<String> {
    let Calendar { year, month, day, hour, minute, second } = time.calendar();
    (1980..=9999)
        .contains(&year)
        .then(|| format!("{year:04} {month:02} {day:02} {hour:02} {minute:02} {:02.0}", second.floor()))
}

/// A header line.
fn labelled(text: &str, label: &str) -> String {
    format!("{text:<60}{label}\n")
}

fn program_line(created: &str) -> String {
    labelled(&format!("{:<20}{:<20}{created:<20}", "cofix", ""), "PGM / RUN BY / DATE")
}

/// Smallest and largest magnitude whose exponent has two digits; the columns have no room for three.
const EXPONENT_OF_TWO_DIGITS: Range<f64> = 1e-99..9.999e99;

/// A number as Fortran's Dw.d prints it, `digits` after the point, with E for the exponent. A number too small for that is
/// zero; one too large, infinity and NaN are blank.
fn scientific(value: f64, width: usize, digits: usize) -> String {
    let Range { start: smallest, end: largest } = EXPONENT_OF_TWO_DIGITS;
    if !value.is_finite() || value.abs() > largest {
        return " ".repeat(width);
    }
    let value = if value.abs() < smallest { 0.0 } else { value };
    let text = format!("{value:.digits$E}");
    let (mantissa, exponent) = text.split_once('E').unwrap_or((&text, "0"));
    let (sign, exponent) = exponent.strip_prefix('-').map_or(('+', exponent), |rest| ('-', rest));
    format!("{:>width$}", format!("{mantissa}E{sign}{exponent:0>2}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_printed_as_fortran_does() {
        assert_eq!(scientific(-1.5e-5, 19, 12), "-1.500000000000E-05");
        assert_eq!(scientific(0.0, 19, 12), " 0.000000000000E+00");
        assert_eq!(scientific(9.999e9, 12, 4), "  9.9990E+09");
        assert_eq!(scientific(-5.714_523_747e-311, 19, 12), " 0.000000000000E+00");
        assert_eq!(scientific(-1e-99, 19, 12), "-1.000000000000E-99");
        for none in [f64::NAN, f64::INFINITY, 1e100] {
            assert_eq!(scientific(none, 5, 1), "     ");
        }
    }
}
