//! Text files: their lines, columns, and how they begin (editors put a byte order mark before them, some writers empty lines).

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

/// Text of a line for an error message: the printable start of it.
pub(crate) fn shorten(line: &[u8]) -> String {
    let start = line.get(..line.len().min(60)).unwrap_or_default();
    String::from_utf8_lossy(start).chars().map(|c| if c.is_control() { '?' } else { c }).collect()
}

/// The lines of a file with their numbers from 1, without line ends.
pub(crate) fn lines(bytes: &[u8]) -> impl Iterator<Item = (u64, &[u8])> {
    let mut rest = bytes;
    let mut number = 0;
    std::iter::from_fn(move || {
        let before = rest;
        // Searching a slice in memory cannot fail; `skip_until` is the standard library's fast byte search.
        let taken = std::io::BufRead::skip_until(&mut rest, b'\n').unwrap_or(0);
        number += 1;
        (taken > 0).then(|| (number, trim_end(before.get(..taken).unwrap_or_default())))
    })
}

/// The lines of a file from the first one with content on; a byte order mark before it is no content.
pub(crate) fn lines_of_content(bytes: &[u8]) -> impl Iterator<Item = (u64, &[u8])> {
    lines(bytes).map(|(number, line)| (number, without_mark(line))).skip_while(|(_, line)| is_blank(line))
}

/// Removes LF and CR from the end; files that were turned to DOS line ends twice have more than one CR.
pub(crate) fn trim_end(line: &[u8]) -> &[u8] {
    let mut line = line.strip_suffix(b"\n").unwrap_or(line);
    while let Some(shorter) = line.strip_suffix(b"\r") {
        line = shorter;
    }
    line
}

/// Columns `from..to` of a line, as much of them as there is.
pub(crate) fn columns(line: &[u8], from: usize, to: usize) -> &[u8] {
    line.get(from..to.min(line.len())).unwrap_or_default()
}

/// Text of a field: trimmed, damaged UTF-8 replaced.
pub(crate) fn text(field: &[u8]) -> String {
    String::from_utf8_lossy(field.trim_ascii()).into_owned()
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
