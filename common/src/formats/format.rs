//! What a stream is, by its content. Names of files do not count.

use std::fmt;

use serde::Serialize;

use super::kinds;
use super::stream::table;

/// A format that observations are read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// RINEX 2, 3 or 4 observations.
    Rinex,
    /// Compact RINEX (Hatanaka) 1 or 3.
    CompactRinex,
    /// Text log of Google's GnssLogger app.
    GnssLogger,
    /// RTCM 3 messages.
    Rtcm3,
    /// Table of the Smartphone Decimeter Challenge.
    ChallengeTable,
    /// Phone log of the WHU-Smartphone dataset.
    SpareLog,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rinex => "RINEX observations",
            Self::CompactRinex => "Compact RINEX",
            Self::GnssLogger => "GnssLogger text",
            Self::Rtcm3 => "RTCM 3",
            Self::ChallengeTable => "challenge table",
            Self::SpareLog => "spare log",
        })
    }
}

/// All that is read, for messages.
pub const READ_FORMATS: &str = "RINEX 2, 3 and 4 observations, Compact RINEX, GnssLogger text, RTCM 3, challenge tables \
                                (*_derived.csv, device_gnss.csv) and spare logs of WHU-Smartphone; files may be packed with gzip or compress (.Z)";

/// The text format whose beginning this is, if it can be told yet. RTCM 3 is not recognised here but by its first valid
/// frame; see [`crate::formats::stream`]. `ended`: nothing more will come.
///
/// RINEX files of other kinds count as [`Format::Rinex`]: its decoder says what they are.
pub fn recognise_text(start: &[u8], ended: bool) -> Option<Format> {
    table::recognise_text(start, ended).map(|row| row.format)
}

/// Beginnings of what is packed. Of recorded files the last two are unpacked before they come here.
const PACKED: [(&[u8], &str); 5] = [
    (b"PK\x03\x04", "this is a zip archive; unpack it"),
    (b"BZh", "this is compressed with bzip2; uncompress it"),
    (b"\xfd7zXZ", "this is compressed with xz; uncompress it"),
    (b"\x1f\x8b\x08", LIVE_AND_PACKED),
    (b"\x1f\x9d", LIVE_AND_PACKED),
];
const LIVE_AND_PACKED: &str =
    "packed data are read from recorded files only; as they come: zcat FILE | cofix-agent --observations -";

/// Whether a stream is packed: nothing that follows will make it readable.
pub fn is_packed(start: &[u8]) -> bool {
    PACKED.iter().any(|(bytes, _)| start.starts_with(bytes))
}

/// Says what an unknown stream begins with, and what is read.
pub fn unknown(start: &[u8]) -> String {
    if start.is_empty() {
        return format!("it is empty; read are {READ_FORMATS}");
    }
    let shown = start.get(..start.len().min(24)).unwrap_or_default();
    let text: String = shown.iter().map(|byte| std::ascii::escape_default(*byte).to_string()).collect();
    let packed = PACKED.iter().find(|(bytes, _)| start.starts_with(bytes)).map(|(_, hint)| *hint);
    let hint = packed.or_else(|| kinds::hint(start, kinds::OBSERVATIONS));
    let hint = hint.map_or(String::new(), |hint| format!("; {hint}"));
    format!("unknown format, it begins with '{text}'{hint}; read are {READ_FORMATS}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_formats_are_known_by_their_lines() {
        let rinex = format!("{:<20}{:<20}{:<20}RINEX VERSION / TYPE\n", "     3.04", "OBSERVATION DATA", "M");
        let compact = format!("{:<20}{:<40}CRINEX VERS   / TYPE\n", "3.0", "COMPACT RINEX FORMAT");
        let (marked, after_blank_lines) = (format!("\u{feff}{rinex}"), format!("\r\n  \n{compact}"));
        let lower_case = rinex.to_lowercase();
        for (start, format) in [
            (rinex.as_str(), Format::Rinex),
            (compact.as_str(), Format::CompactRinex),
            ("# \n# Header Description:\n# \n", Format::GnssLogger),
            ("# \r\n\r\n#Raw,ElapsedRealtimeMillis\r\n", Format::GnssLogger),
            ("Raw,1,2,3\n", Format::GnssLogger),
            ("\u{feff}Fix,gps,37.4\n", Format::GnssLogger),
            (&marked, Format::Rinex),
            (&after_blank_lines, Format::CompactRinex),
            (&lower_case, Format::Rinex),
            ("\r\n\u{feff}phoneName, millisSinceGpsEpoch,svid\n", Format::ChallengeTable),
            ("phoneName, millisSinceGpsEpoch,svid\n", Format::ChallengeTable),
            ("MessageType,ArrivalTimeNanosSinceGpsEpoch\n", Format::ChallengeTable),
            ("current_Start_Timestamp:2020_08_13_22_19_00.000\n", Format::SpareLog),
            ("\r\n{\"gga\":\"\",\"obsd_t\":{}}\r\n", Format::SpareLog),
        ] {
            assert_eq!(recognise_text(start.as_bytes(), false), Some(format), "{start}");
            let cut = &start.as_bytes()[..start.len() - 1];
            assert_eq!(recognise_text(cut, true), Some(format), "{start} without line end");
        }
        assert_eq!(recognise_text(&rinex.as_bytes()[..79], false), None);
        assert_eq!(recognise_text(b"Raw,1,2", false), None, "the line may go on");
        assert_eq!(recognise_text(b"name,value\n1,2\n", true), None);
    }

    #[test]
    fn a_log_is_searched_for_a_hundred_lines() {
        let log = |before: usize| format!("{}Raw,1\n", "x\n".repeat(before));
        assert_eq!(recognise_text(log(99).as_bytes(), false), Some(Format::GnssLogger));
        assert_eq!(recognise_text(log(100).as_bytes(), false), None);
    }

    #[test]
    fn what_is_unknown_is_shown_with_advice() {
        let said = unknown(b"\xb5\x62\x01\x07");
        assert!(said.contains("\\xb5b\\x01\\x07") && said.contains("UBX"), "{said}");
        assert!(said.contains("GnssLogger text"), "{said}");
        assert!(unknown(b"").contains("empty"));
    }
}
