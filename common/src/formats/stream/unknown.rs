//! Messages on streams that are of none of the formats.

use crate::formats::kinds;

/// Names of all formats, for messages.
const READ_FORMATS: &str = "RINEX 2, 3 and 4 observations, Compact RINEX, GnssLogger text, RTCM 3, challenge tables \
                                (*_derived.csv, device_gnss.csv) and spare logs of WHU-Smartphone; files may be packed with gzip or compress (.Z)";

/// Beginnings of packed data. Recorded files with the last two are unpacked before they come here.
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
pub(super) fn is_packed(start: &[u8]) -> bool {
    PACKED.iter().any(|(bytes, _)| start.starts_with(bytes))
}

/// A message with the first bytes of an unknown stream and the names of all formats.
pub(super) fn unknown(start: &[u8]) -> String {
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
    fn what_is_unknown_is_shown_with_advice() {
        let said = unknown(b"\xb5\x62\x01\x07");
        assert!(said.contains("\\xb5b\\x01\\x07") && said.contains("UBX"), "{said}");
        assert!(said.contains("GnssLogger text"), "{said}");
        assert!(unknown(b"").contains("empty"));
    }
}
