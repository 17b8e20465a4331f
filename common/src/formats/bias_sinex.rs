//! Observable-specific code biases from Bias-SINEX files, version 1.00 (Schaer: SINEX BIAS, Solution Independent Exchange Format
//! for GNSS Biases, 2016).

use crate::formats::decimal::{integer, real};
use crate::formats::packing::{DecompressError, decompress};
use crate::formats::text::{columns, lines_of_content, shorten, text, words};
use crate::formats::time_system::TimeSystem;
use crate::gnss::{SatelliteId, SignalCode};
use crate::orbit::{BiasFile, CodeBias};
use crate::skips::{Reason, Skips};
use crate::time::{Calendar, GpsTime};

/// Biases beyond this are not believed, ns. Real ones stay below a hundred.
const MAX_BIAS_NS: f64 = 1_000.0;
const SECONDS_PER_DAY: i64 = 86_400;

/// Why a Bias-SINEX file cannot be read at all.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BiasFileError {
    /// The first line is not that of a Bias-SINEX file of version 1.00.
    #[error("not a Bias-SINEX file of version 1.00: the first line reads '{found}'")]
    NotBias {
        /// Its text, shortened.
        found: String,
    },
    /// A time system that is not known.
    #[error(
        "TIME_SYSTEM '{found}' of a Bias-SINEX file is not known; letters of systems and {names} are",
        names = TimeSystem::NAMES
    )]
    TimeSystem {
        /// The name in the file.
        found: String,
    },
    /// No code bias of a satellite.
    #[error(
        "Bias-SINEX file without observable-specific code bias (OSB) of any satellite in {lines} lines; {differential} differential ones (DSB) are not used"
    )]
    Empty {
        /// Lines read.
        lines: u64,
        /// Differential records.
        differential: u64,
    },
    /// The gzip container is damaged or too large.
    #[error(transparent)]
    Decompress(#[from] DecompressError),
}

impl BiasFile {
    /// Reads a whole file, plain or gzip-compressed.
    ///
    /// # Errors
    /// When the compression is damaged, the first line or the time system is of another kind, or no satellite has a code bias; other
    /// damage is counted in [`BiasFile::skips`].
    pub fn parse(bytes: &[u8]) -> Result<Self, BiasFileError> {
        let bytes = decompress(bytes)?;
        let mut lines = lines_of_content(&bytes);
        let (mut last, first) = lines.next().unwrap_or_default();
        let version = real(columns(first, 6, 10));
        if !first.starts_with(b"%=BIA ") || version != Some(1.0) {
            return Err(BiasFileError::NotBias { found: shorten(first) });
        }
        let mut reader = Reader::default();
        for (number, line) in lines {
            last = number;
            reader.line(number, line)?;
        }
        if reader.block != Block::Ended {
            reader.skips.add(Reason::BiasSinexWithoutEndMark, || format!("line {last}"));
        }
        if reader.biases.is_empty() {
            let differential = reader.skips.count(Reason::DifferentialBias);
            return Err(BiasFileError::Empty { lines: last, differential });
        }
        Ok(Self { biases: reader.biases, skips: reader.skips })
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Block {
    #[default]
    Other,
    Description,
    Solution,
    Ended,
}

#[derive(Default)]
struct Reader {
    block: Block,
    time_system: TimeSystem,
    biases: Vec<CodeBias>,
    skips: Skips,
}

impl Reader {
    fn line(&mut self, number: u64, line: &[u8]) -> Result<(), BiasFileError> {
        match line.first() {
            Some(b'+') if line.starts_with(b"+BIAS/DESCRIPTION") => self.block = Block::Description,
            Some(b'+') if line.starts_with(b"+BIAS/SOLUTION") => self.block = Block::Solution,
            Some(b'%') if line.starts_with(b"%=ENDBIA") => self.block = Block::Ended,
            Some(b'+' | b'-') => self.block = Block::Other,
            Some(b'*') | None => {}
            // Some write descriptions from the first column on.
            Some(_) => match self.block {
                Block::Description => self.time_system(line)?,
                Block::Solution => self.solution(number, line),
                Block::Other | Block::Ended => {}
            },
        }
        Ok(())
    }

    fn time_system(&mut self, line: &[u8]) -> Result<(), BiasFileError> {
        let mut words = words(line);
        if words.next() == Some(b"TIME_SYSTEM") {
            let name = words.next().unwrap_or_default();
            self.time_system = match name {
                b"G" | b"E" | b"J" | b"I" => TimeSystem::Gps,
                b"C" => TimeSystem::Beidou,
                b"R" => TimeSystem::Utc,
                name => {
                    TimeSystem::of(name).ok_or_else(|| BiasFileError::TimeSystem { found: text(name) })?
                }
            };
        }
        Ok(())
    }

    fn solution(&mut self, number: u64, line: &[u8]) {
        match columns(line, 1, 5).trim_ascii() {
            b"OSB" => {}
            b"DSB" => return self.skips.add(Reason::DifferentialBias, || Self::place(number, line)),
            _ => {
                return self.skips.add(Reason::BiasOfUnknownKind, || Self::place(number, line));
            }
        }
        let is_phase = columns(line, 25, 26) == b"L";
        let is_of_station = !columns(line, 15, 24).trim_ascii().is_empty();
        if is_phase || is_of_station {
            let reason = if is_phase { Reason::PhaseBias } else { Reason::StationBias };
            return self.skips.add(reason, || Self::place(number, line));
        }
        match self.code_bias(line) {
            None => self.skips.add(Reason::BiasRecordUnreadable, || Self::place(number, line)),
            Some(bias) if bias.bias_s.abs() > MAX_BIAS_NS * 1e-9 => {
                self.skips.add(Reason::BiasImpossiblyLarge, || {
                    format!(
                        "line {number}: {} {}: {} ns; the limit is {MAX_BIAS_NS} ns",
                        bias.satellite,
                        bias.signal,
                        bias.bias_s * 1e9
                    )
                });
            }
            Some(bias) => {
                if let Some(reason) = bias.satellite.cannot_send(bias.signal) {
                    return self.skips.add(reason, || Self::place(number, line));
                }
                if real(columns(line, 104, 125)).is_some_and(|slope| slope != 0.0) {
                    self.skips.add(Reason::BiasSlope, || Self::place(number, line));
                }
                self.biases.push(bias);
            }
        }
    }

    fn place(number: u64, line: &[u8]) -> String {
        format!("line {number}: '{}'", shorten(line))
    }

    fn code_bias(&self, line: &[u8]) -> Option<CodeBias> {
        let satellite = SatelliteId::from_bytes(columns(line, 11, 14).try_into().ok()?)?;
        let &[b'C', band @ b'1'..=b'9', attribute @ b'A'..=b'Z', b' '] = columns(line, 25, 29) else {
            return None;
        };
        if columns(line, 65, 69).trim_ascii() != b"ns" {
            return None;
        }
        let bias_s = real(columns(line, 70, 91))? * 1e-9;
        // All zeros stand for an open start or end.
        let instant = |from: usize| self.instant(columns(line, from, from + 14));
        let start = instant(35)?;
        let end = if columns(line, 50, 64).trim_ascii().is_empty() { None } else { instant(50)? };
        let start = start.unwrap_or_default();
        let signal = SignalCode::new(band, attribute);
        end.is_none_or(|end| end > start).then_some(CodeBias { satellite, signal, start, end, bias_s })
    }

    /// YYYY:DDD:SSSSS; `Some(None)` for 0000:000:00000.
    #[allow(clippy::option_option)] // cannot be read, open, or an instant
    fn instant(&self, field: &[u8]) -> Option<Option<GpsTime>> {
        let mut parts = field.split(|b| *b == b':').map(integer);
        let (year, day, second) = (parts.next()??, parts.next()??, parts.next()??);
        if (year, day, second) == (0, 0, 0) {
            return Some(None);
        }
        if !(1..=366).contains(&day) || !(0..=SECONDS_PER_DAY).contains(&second) {
            return None;
        }
        let year = i32::try_from(year).ok()?;
        let new_year =
            GpsTime::from_calendar(Calendar { year, month: 1, day: 1, hour: 0, minute: 0, second: 0.0 })?;
        let time = new_year + ((day - 1) * SECONDS_PER_DAY + second) as f64;
        Some(Some(self.time_system.to_gps(time)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "\
%=BIA 1.00 TST 2020:227:30548 IGS 2020:226:00000 2020:227:00000 A 00000006
*-------------------------------------------------------------------------------
+BIAS/DESCRIPTION
BIAS_MODE                               ABSOLUTE
TIME_SYSTEM                             G
-BIAS/DESCRIPTION
+BIAS/SOLUTION
*BIAS SVN_ PRN STATION__ OBS1 OBS2 BIAS_START____ BIAS_END______ UNIT __ESTIMATED_VALUE____ _STD_DEV___
 OSB  G063 G01           C1C       2020:226:00000 2020:227:00000 ns                  7.4321      0.0200
 OSB  G063 G01           C1W       2020:226:00000 2020:227:00000 ns      8.100000000000E+00 2.00000E-02
 OSB  E101 E11           C5Q       2020:226:00000 0000:000:00000 ns                 -3.5000      0.0200
 OSB  G063 G01           L1C       2020:226:00000 2020:227:00000 cyc                 0.1000      0.0200
 DSB  G063 G01           C1C  C1W  2020:226:00000 2020:227:00000 ns                 -0.6679      0.0200
 OSB  G    G    ALGO     C1C       2020:226:00000 2020:227:00000 ns                 -0.6679      0.0200
-BIAS/SOLUTION
%=ENDBIA
";

    fn parse(text: &str) -> Result<BiasFile, BiasFileError> {
        BiasFile::parse(text.as_bytes())
    }

    #[test]
    fn code_biases_of_satellites_are_read_and_the_rest_counted() {
        let file = parse(FILE).unwrap();
        let day: GpsTime = "2020-08-13T00:00:00".parse().unwrap();
        assert_eq!(file.biases.len(), 3);
        let CodeBias { satellite, signal, start, end, bias_s } = file.biases[0];
        assert_eq!((satellite.to_string(), signal), ("G01".to_owned(), SignalCode::new(b'1', b'C')));
        assert_eq!((start, end), (day, Some(day + 86_400.0)));
        assert!((bias_s - 7.4321e-9).abs() < 1e-20);
        assert!((file.biases[1].bias_s - 8.1e-9).abs() < 1e-20);
        assert_eq!(file.biases[2].end, None);
        for reason in [Reason::PhaseBias, Reason::DifferentialBias, Reason::StationBias] {
            assert_eq!(file.skips.count(reason), 1, "{reason}: {}", file.skips);
        }
        assert_eq!(file.skips.total(), 3);
    }

    #[test]
    fn utc_is_turned_into_gps_time_and_others_are_refused() {
        let utc = FILE.replacen("   G\n", "   UTC\n", 1);
        let day: GpsTime = "2020-08-13T00:00:18".parse().unwrap();
        assert_eq!(parse(&utc).unwrap().biases[0].start, day);
        for (name, seconds) in [("R", 18.0), ("E", 0.0), ("C", 14.0), ("TAI", -19.0)] {
            let other = FILE.replacen("   G\n", &format!("   {name}\n"), 1);
            let start = parse(&other).unwrap().biases[0].start;
            assert_eq!(start - "2020-08-13T00:00:00".parse::<GpsTime>().unwrap(), seconds, "{name}");
        }
        let unknown = FILE.replacen("   G\n", "   X\n", 1);
        assert_eq!(parse(&unknown), Err(BiasFileError::TimeSystem { found: "X".to_owned() }));
    }

    #[test]
    fn a_mark_and_blank_lines_before_the_first_are_passed_over() {
        for before in ["\u{feff}", "\n", " \r\n\n", "\u{feff}\n"] {
            let file = parse(&format!("{before}{FILE}")).unwrap();
            assert_eq!((file.biases, file.skips.total()), (parse(FILE).unwrap().biases, 3), "{before:?}");
        }
    }

    /// By the table of signals that the decoders of observations go by.
    #[test]
    fn biases_of_signals_that_cannot_be_are_counted_and_left_out() {
        for (satellite, code, reason) in [
            ("G01", "C5C", Reason::SignalNotOfSystem),
            ("C20", "C1C", Reason::SignalNotOfSystem),
            ("C20", "C7I", Reason::BeidouSignalOfOtherGeneration),
            ("C10", "C7Z", Reason::BeidouSignalOfOtherGeneration),
        ] {
            let bad = format!("G063 {satellite}           {code}");
            let file = parse(&FILE.replacen("G063 G01           C1C", &bad, 1)).unwrap();
            assert_eq!((file.biases.len(), file.skips.count(reason)), (2, 1), "{code}: {}", file.skips);
        }
        let fine = FILE.replacen("G063 G01           C1C", "C232 C20           C7Z", 1);
        assert_eq!(parse(&fine).unwrap().biases.len(), 3);
    }

    #[test]
    fn other_files_are_refused() {
        assert!(matches!(parse("%=SNX 2.02 COD"), Err(BiasFileError::NotBias { .. })));
        assert!(matches!(parse("%=BIA 2.00 COD"), Err(BiasFileError::NotBias { .. })));
        assert!(matches!(parse(""), Err(BiasFileError::NotBias { .. })));
        let differential: String =
            FILE.split_inclusive('\n').filter(|line| !line.starts_with(" OSB")).collect();
        let error = parse(&differential).unwrap_err();
        assert_eq!(error, BiasFileError::Empty { lines: 11, differential: 1 });
    }

    #[test]
    fn damaged_records_are_counted() {
        for (from, to) in [
            ("7.4321", "7.4x21"),
            ("7.4321", "9999.0"),
            ("G01           C1C", "X01           C1C"),
            ("C1C       2020:226", "C1        2020:226"),
            ("C1C       2020:226", "C1C       2020:400"),
            ("C1C       2020:226", "C1C       2020:228"),
            ("2020:227:00000 ns ", "2020:227:00000 km "),
        ] {
            let file = parse(&FILE.replacen(from, to, 1)).unwrap();
            assert_eq!(file.biases.len(), 2, "{from} -> {to}");
            assert_eq!(file.skips.total(), 4, "{}", file.skips);
        }
        let cut = FILE.replacen("%=ENDBIA", "", 1);
        assert_eq!(parse(&cut).unwrap().skips.count(Reason::BiasSinexWithoutEndMark), 1);
    }
}
