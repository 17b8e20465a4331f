//! The first line of a RINEX file: version, type, system.

use super::RinexError;
use super::label;
use crate::formats::decimal::integer;
use crate::formats::decimal::real;
use crate::formats::text::columns;
use crate::formats::text::{shorten, text};
use crate::gnss::Constellation;

/// Contents of the first line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Version {
    /// Version times 100: 211, 304, 400.
    pub(super) number: u16,
    /// Type letter: O, N; in RINEX 2 also the navigation of one system: G (GLONASS), H (SBAS), E (Galileo).
    pub(super) kind: u8,
    /// Satellite system; `None` for a mixed file and where the line has none.
    pub(super) system: Option<Constellation>,
}

impl Version {
    /// Reads the line. `kinds`: letters of the accepted types; `expected`: their name for messages.
    pub(super) fn read(
        number: u64,
        line: &[u8],
        kinds: &[u8],
        expected: &'static str,
    ) -> Result<Self, RinexError> {
        if label(line) != b"RINEX VERSION / TYPE" {
            return Err(RinexError::NotRinex { line: number, found: shorten(line) });
        }
        let field = columns(line, 0, 9);
        let version = real(field).map(|v| (v * 100.0).round());
        let known = |v: &f64| [200.0..=212.0, 300.0..=305.0, 400.0..=402.0].iter().any(|r| r.contains(v));
        let Some(version) = version.filter(known) else {
            return Err(RinexError::Version { found: text(field) });
        };
        let kind = columns(line, 20, 21).first().copied().unwrap_or(b' ').to_ascii_uppercase();
        // The others exist in RINEX 2 alone.
        if !kinds.contains(&kind) || (version >= 300.0 && !b"ON".contains(&kind)) {
            return Err(RinexError::WrongType { expected, found: text(columns(line, 20, 40)) });
        }
        let letter = columns(line, 40, 41).first().map_or(' ', |b| b.to_ascii_uppercase() as char);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within 200 to 402
        Ok(Self { number: version as u16, kind, system: Constellation::from_letter(letter) })
    }

    /// The system of a RINEX 2 navigation file: RINEX 2 has a type for each, and GPS where nothing else is said.
    pub(super) fn navigation_system_2(self) -> Constellation {
        match self.kind {
            b'G' => Constellation::Glonass,
            b'H' => Constellation::Sbas,
            b'E' => Constellation::Galileo,
            _ => self.system.unwrap_or(Constellation::Gps),
        }
    }

    /// Whether it is RINEX 2.
    pub(super) const fn is_2(self) -> bool {
        self.number < 300
    }
}

/// The full year of a two-digit one: 80-99 are of the last century (RINEX 2.11, 6.5).
pub(super) fn year_2(field: &[u8]) -> Option<i32> {
    let year = integer(field).and_then(|y| i32::try_from(y).ok())?;
    match year {
        0..=79 => Some(2000 + year),
        80..=99 => Some(1900 + year),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_and_types_are_told_apart() {
        let read = |text: &str, kinds: &[u8]| {
            let line = format!("{text:<60}RINEX VERSION / TYPE");
            Version::read(1, line.as_bytes(), kinds, "wanted")
        };
        let old = read("     2              NAVIGATION DATA", b"NGH").unwrap();
        assert_eq!((old.number, old.kind, old.system), (200, b'N', None));
        let glonass = read("     2.01           GLONASS NAV DATA", b"NGH").unwrap();
        assert_eq!((glonass.number, glonass.kind), (201, b'G'));
        let new = read("     4.01           OBSERVATION DATA    G: GPS", b"O").unwrap();
        assert_eq!((new.number, new.system), (401, Some(Constellation::Gps)));
        assert!(read("     3.04           GLONASS NAV DATA", b"NGH").is_err());
        assert!(read("     1.00           OBSERVATION DATA", b"O").is_err());
        assert!(read("     5.00           OBSERVATION DATA", b"O").is_err());
    }

    #[test]
    fn two_digits_make_a_year() {
        assert_eq!(
            (year_2(b"80"), year_2(b"99"), year_2(b" 5"), year_2(b"79")),
            (Some(1980), Some(1999), Some(2005), Some(2079))
        );
        assert_eq!(year_2(b"-1"), None);
    }
}
