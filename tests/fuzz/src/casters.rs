//! What NTRIP casters send.

use cofix_agent::input::ntrip::{Body, Reply, Sourcetable, read_reply};

use crate::portions::random_portions;

/// A caster's reply as it comes, and what follows it: a stream or a list of streams, in chunks or not.
pub fn ntrip(bytes: &[u8]) {
    // Bytes come in portions, and are looked at after each.
    let (mut heard, mut found) = (Vec::new(), None);
    let mut portions = random_portions(bytes).into_iter();
    for portion in portions.by_ref() {
        heard.extend_from_slice(portion);
        found = read_reply(&heard, false);
        if found.is_some() {
            break;
        }
    }
    assert!(read_reply(bytes, true).is_some(), "a reply that ends is understood or not");
    // A head that says nothing does so within bounds.
    let Some((reply, length)) = found else { return assert!(bytes.len() <= 16_384) };
    assert!(length <= heard.len());
    if heard.starts_with(b"HTTP/1.") && !matches!(reply, Reply::Other(_)) {
        assert_eq!(read_reply(bytes, false), Some((reply.clone(), length)), "in portions and at once");
    }
    let chunked = match reply {
        Reply::Stream { chunked } | Reply::Sourcetable { chunked } | Reply::WebPage { chunked } => chunked,
        Reply::Tls => return,
        Reply::Unauthorized(text)
        | Reply::NotFound(text)
        | Reply::NotUnderstood(text)
        | Reply::Other(text) => {
            return shown(&text);
        }
    };
    let first = heard.split_off(length);
    let rest = bytes.get(length..).unwrap_or_default();
    let (at_once, outcome) = carried(chunked, [rest]);
    let (in_portions, same_outcome) = carried(chunked, [first.as_slice()].into_iter().chain(portions));
    assert_eq!((&in_portions, same_outcome), (&at_once, outcome), "in portions and at once");
    assert!(at_once.len() <= rest.len() && (chunked || at_once == rest));
    chunked_comes_back(rest);
    sourcetable(&at_once);
}

/// What a reply carries; and whether it is complete, `None` when it is damaged.
fn carried<'a>(chunked: bool, portions: impl IntoIterator<Item = &'a [u8]>) -> (Vec<u8>, Option<bool>) {
    let (mut body, mut out, mut buffer) = (Body::new(chunked), Vec::new(), [0; 100]);
    for portion in portions {
        body.take(portion);
        loop {
            match body.give(&mut buffer) {
                0 => break,
                count => out.extend_from_slice(buffer.get(..count).unwrap_or_default()),
            }
        }
        if body.is_complete().is_err() {
            break;
        }
    }
    (out, body.is_complete().ok())
}

/// Any bytes, put into chunks, are the same afterwards.
fn chunked_comes_back(bytes: &[u8]) {
    let portions = random_portions(bytes);
    let mut text = Vec::new();
    for portion in portions.into_iter().filter(|portion| !portion.is_empty()) {
        text.extend(format!("{:x}\r\n", portion.len()).into_bytes());
        text.extend_from_slice(portion);
        text.extend_from_slice(b"\r\n");
    }
    text.extend_from_slice(b"0\r\n\r\n");
    assert_eq!(carried(true, random_portions(&text)), (bytes.to_vec(), Some(true)));
}

/// A list of streams: each line is one or is damaged, places are on the Earth, and nothing is shown that a terminal would obey.
fn sourcetable(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let table = Sourcetable::parse(&text);
    let lines = text.lines().filter(|line| line.starts_with("STR;")).count() as u64;
    assert_eq!(table.streams.len() as u64 + table.damaged_lines, lines);
    for (latitude_deg, longitude_deg) in table.streams.iter().filter_map(|entry| entry.place_deg) {
        assert!(latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 360.0, "{latitude_deg} {longitude_deg}");
    }
    let table = table.to_string();
    assert!(table.len() <= 2_000 * (text.lines().count() + 2), "{} bytes shown", table.len());
    table.lines().for_each(shown);
}

fn shown(text: &str) {
    assert!(!text.contains(|character: char| character.is_control()), "{text:?}");
}
