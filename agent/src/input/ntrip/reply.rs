//! A caster's reply, up to the beginning of its data.

use httparse::Status;

/// Longest head of a reply, bytes.
const LONGEST_HEAD: usize = 16_384;
const MOST_HEADERS: usize = 64;
/// Longest part of a caster's text that is shown.
const SHOWN: usize = 80;
/// The first bytes of an alert of TLS (RFC 8446, 5.1 and 6): the answer to a request in the clear.
const TLS_ALERT: &[u8] = &[21, 3];

/// The answer of a caster.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// The requested stream follows.
    Stream {
        /// In chunks.
        chunked: bool,
    },
    /// The list of mount points follows.
    Sourcetable {
        /// In chunks.
        chunked: bool,
    },
    /// A web page: the server is no caster, or takes the agent for a browser.
    WebPage {
        /// In chunks.
        chunked: bool,
    },
    /// User or password are wrong, or missing.
    Unauthorized(String),
    /// There is no such mount point.
    NotFound(String),
    /// The caster does not understand the request: it may be of revision 1.
    NotUnderstood(String),
    /// It speaks TLS at this port.
    Tls,
    /// Another answer.
    Other(String),
}

/// The answer, and the position where its data begin. `None` when more bytes are needed. `ended`: no more will arrive.
pub fn read_reply(bytes: &[u8], ended: bool) -> Option<(Reply, usize)> {
    if bytes.starts_with(TLS_ALERT) {
        return Some((Reply::Tls, bytes.len()));
    }
    if let Some(found) = first_revision(bytes) {
        return Some(found);
    }
    let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
    let mut response = httparse::Response::new(&mut headers);
    match response.parse(bytes) {
        Ok(Status::Complete(length)) => Some((second_revision(&response), length)),
        Ok(Status::Partial) if !ended && bytes.len() < LONGEST_HEAD => None,
        // Some casters refuse with the first line alone.
        Ok(Status::Partial) if ended && is_refusal(&response) => {
            Some((second_revision(&response), bytes.len()))
        }
        // A line may be incomplete that has nothing to do with HTTP.
        Err(_) if !ended && bytes.len() < LONGEST_HEAD && !bytes.contains(&b'\n') => None,
        _ => Some((Reply::Other(shown(bytes)), bytes.len())),
    }
}

/// Whether the first line is complete and grants nothing.
fn is_refusal(response: &httparse::Response<'_, '_>) -> bool {
    response.code.is_some_and(|code| code != 200) && response.reason.is_some()
}

/// The replies of revision 1, which are not HTTP.
fn first_revision(bytes: &[u8]) -> Option<(Reply, usize)> {
    let end = bytes.iter().position(|byte| *byte == b'\n')? + 1;
    let line = bytes.get(..end)?;
    if line.starts_with(b"ICY 200") {
        return Some((Reply::Stream { chunked: false }, end + header_length(bytes.get(end..)?)));
    }
    if line.starts_with(b"SOURCETABLE 200") {
        return Some((Reply::Sourcetable { chunked: false }, end + header_length(bytes.get(end..)?)));
    }
    if !line.starts_with(b"ERROR") {
        return None;
    }
    let text = shown(line);
    let is_password = text.to_ascii_lowercase().contains("password");
    Some((if is_password { Reply::Unauthorized(text) } else { Reply::Other(text) }, end))
}

/// Length of header lines and the empty line after them, where there are some: not all casters of revision 1 send them. Binary data look like neither.
fn header_length(bytes: &[u8]) -> usize {
    let mut length = 0;
    for line in bytes.split_inclusive(|byte| *byte == b'\n') {
        let text = line.trim_ascii_end();
        let is_header = text.is_ascii() && !text.contains(&b';') && text.windows(2).any(|pair| pair == b": ");
        if !line.ends_with(b"\n") || !(text.is_empty() || is_header) {
            break;
        }
        length += line.len();
        if text.is_empty() {
            break;
        }
    }
    length
}

fn second_revision(response: &httparse::Response<'_, '_>) -> Reply {
    let header = |name: &str| {
        let found = response.headers.iter().find(|header| header.name.eq_ignore_ascii_case(name));
        found.map(|header| String::from_utf8_lossy(header.value).to_ascii_lowercase()).unwrap_or_default()
    };
    let code = response.code.unwrap_or_default();
    let text = shown(format!("{code} {}", response.reason.unwrap_or_default()).as_bytes());
    let chunked = header("Transfer-Encoding").contains("chunked");
    match code {
        200 if header("Content-Type").contains("sourcetable") => Reply::Sourcetable { chunked },
        200 if header("Content-Type").contains("text/html") => Reply::WebPage { chunked },
        200 => Reply::Stream { chunked },
        401 | 403 => Reply::Unauthorized(text),
        404 => Reply::NotFound(text),
        400 | 405 | 501 | 505 => Reply::NotUnderstood(text),
        _ => Reply::Other(text),
    }
}

/// The beginning of a caster's text, printable.
pub(super) fn shown(bytes: &[u8]) -> String {
    let line = bytes.split(|byte| *byte == b'\n').next().unwrap_or_default().trim_ascii();
    let start = line.get(..line.len().min(SHOWN)).unwrap_or_default();
    start.iter().map(|byte| std::ascii::escape_default(*byte).to_string()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replies_are_told_apart_and_end_where_data_begin() {
        let stream = |chunked| Reply::Stream { chunked };
        for (text, reply, data) in [
            (&b"ICY 200 OK\r\n\r\n\xd3\x00"[..], stream(false), &b"\xd3\x00"[..]),
            (b"ICY 200 OK\r\n\xd3\x00: \n", stream(false), b"\xd3\x00: \n"),
            (b"ICY 200 OK\r\nServer: x: y\r\nDate: z\r\n\r\n\xd3", stream(false), b"\xd3"),
            (b"ICY 200 OK\r\n", stream(false), b""),
            (
                b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\nContent-Type: gnss/data\r\n\r\n5",
                stream(true),
                b"5",
            ),
            (b"HTTP/1.1 200 OK\r\nContent-Type: gnss/data\r\n\r\n\xd3", stream(false), b"\xd3"),
            (
                b"HTTP/1.1 200 OK\r\ncontent-type: gnss/sourcetable\r\n\r\nSTR;",
                Reply::Sourcetable { chunked: false },
                b"STR;",
            ),
            (
                b"HTTP/1.1 200 OK\r\nContent-Type: text/html; charset=utf-8\r\n\r\n<html>",
                Reply::WebPage { chunked: false },
                b"<html>",
            ),
            (
                b"SOURCETABLE 200 OK\r\nServer: NTRIP x: y\r\nContent-Length: 9\r\n\r\nSTR;a: b;\r\n",
                Reply::Sourcetable { chunked: false },
                b"STR;a: b;\r\n",
            ),
            (b"SOURCETABLE 200 OK\r\nSTR;a: b;\r\n", Reply::Sourcetable { chunked: false }, b"STR;a: b;\r\n"),
            (b"ERROR - Bad Password\r\n", Reply::Unauthorized("ERROR - Bad Password".to_owned()), b""),
            (b"ERROR - Mount Point Taken\r\n", Reply::Other("ERROR - Mount Point Taken".to_owned()), b""),
            (b"HTTP/1.0 401 Unauthorized\r\n\r\n", Reply::Unauthorized("401 Unauthorized".to_owned()), b""),
            (b"HTTP/1.1 404 Not Found\r\n\r\n", Reply::NotFound("404 Not Found".to_owned()), b""),
            (b"HTTP/1.1 505 Version\r\n\r\n", Reply::NotUnderstood("505 Version".to_owned()), b""),
            (b"HTTP/1.1 503 Busy\r\n\r\n", Reply::Other("503 Busy".to_owned()), b""),
            (b"HTTP/1.1 404 a\tb\r\n\r\n", Reply::NotFound("404 a\\tb".to_owned()), b""),
            (b"\x15\x03\x03\x00\x02\x02\x16", Reply::Tls, b""),
            (b"\x00\x01hello\r\n", Reply::Other("\\x00\\x01hello".to_owned()), b""),
        ] {
            let (found, length) = read_reply(text, false).unwrap();
            assert_eq!((found, &text[length..]), (reply, data), "{}", String::from_utf8_lossy(text));
        }
    }

    /// As RTKLIB's caster does it.
    #[test]
    fn a_refusal_may_have_no_more_than_its_first_line() {
        let unauthorized = Reply::Unauthorized("401 Unauthorized".to_owned());
        for text in [&b"HTTP/1.0 401 Unauthorized\r\n"[..], b"HTTP/1.0 401 Unauthorized\r\nServer: x\r\n"] {
            assert_eq!(read_reply(text, false), None);
            assert_eq!(read_reply(text, true), Some((unauthorized.clone(), text.len())));
        }
        for text in [&b"HTTP/1.0 401"[..], b"HTTP/1.1 200 OK\r\n"] {
            assert!(matches!(read_reply(text, true), Some((Reply::Other(_), _))));
        }
    }

    #[test]
    fn an_incomplete_head_waits_for_more_but_not_for_ever() {
        for text in [&b""[..], b"ICY 200 OK", b"HTTP/1.1 200 OK\r\nServer: x\r\n", b"ERR", b"SOURCETABLE 2"] {
            assert_eq!(read_reply(text, false), None, "{}", String::from_utf8_lossy(text));
            assert!(matches!(read_reply(text, true), Some((Reply::Other(_), _))));
        }
        assert!(matches!(read_reply(&vec![b'x'; 20_000], false), Some((Reply::Other(_), _))));
    }
}
