//! Text files: lines, columns and words, and the beginning of the content (editors put a byte order mark before it, some writers empty
//! lines).

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

/// A text from its first line with content on: byte order marks and empty lines before it are cut off.
pub fn content(mut text: &[u8]) -> &[u8] {
    loop {
        text = without_mark(text);
        match split_line(text) {
            Some((line, rest)) if is_blank(line) => text = rest,
            _ => return text,
        }
    }
}

/// Text of a line for an error message: the printable start of it.
pub(crate) fn shorten(line: &[u8]) -> String {
    let start = line.get(..line.len().min(60)).unwrap_or_default();
    String::from_utf8_lossy(start).chars().map(|c| if c.is_control() { '?' } else { c }).collect()
}

/// The bytes up to the next line feed, and those after it.
pub(crate) fn split_line(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let end = memchr::memchr(b'\n', text)?;
    Some((text.get(..end)?, text.get(end + 1..)?))
}

/// The lines of a file with their numbers from 1, without line ends.
pub(crate) fn lines(bytes: &[u8]) -> impl Iterator<Item = (u64, &[u8])> {
    let mut rest = bytes;
    let mut number = 0;
    std::iter::from_fn(move || {
        number += 1;
        if let Some((line, after)) = split_line(rest) {
            rest = after;
            return Some((number, trim_end(line)));
        }
        let last = std::mem::take(&mut rest);
        (!last.is_empty()).then(|| (number, trim_end(last)))
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

/// Columns `from..to` of a line, up to its end.
pub(crate) fn columns(line: &[u8], from: usize, to: usize) -> &[u8] {
    line.get(from..to.min(line.len())).unwrap_or_default()
}

/// The parts of a text between blanks.
pub(crate) fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
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
