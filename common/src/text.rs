//! How text files begin: editors put a byte order mark before them, and some writers empty lines.

/// The byte order mark of UTF-8.
const MARK: &[u8] = b"\xef\xbb\xbf";

/// Removes the byte order mark that Windows' editors put before a text: once for every file that was joined to it.
pub fn without_mark(mut text: &[u8]) -> &[u8] {
    while let Some(rest) = text.strip_prefix(MARK) {
        text = rest;
    }
    text
}

/// Whether a line has nothing but blanks.
pub fn is_blank(line: &[u8]) -> bool {
    line.iter().all(u8::is_ascii_whitespace)
}

/// A text from its first line with content on. What is cut off are marks and empty lines.
pub fn content(mut text: &[u8]) -> &[u8] {
    loop {
        text = without_mark(text);
        match text.iter().position(|byte| *byte == b'\n') {
            Some(end) if text.get(..end).is_some_and(is_blank) => {
                text = text.get(end + 1..).unwrap_or_default();
            }
            _ => return text,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_begins_after_marks_and_empty_lines() {
        for (text, expected) in [
            ("a\nb", "a\nb"),
            ("\u{feff}a", "a"),
            ("\u{feff}\u{feff}a", "a"),
            ("\r\n  \n\u{feff}\t\r\n a\n\n", " a\n\n"),
            ("\n\n", ""),
            ("  ", "  "),
            ("", ""),
        ] {
            assert_eq!(content(text.as_bytes()), expected.as_bytes(), "{text:?}");
        }
        // Half a mark is none.
        assert_eq!(content(b"\xef\xbba"), b"\xef\xbba");
    }
}
