//! A caster's list of streams (RTCM 10410.1, 3.4).

use std::fmt;
use std::time::{Duration, Instant};

use super::address::Caster;
use super::client::{Body, Revision, SPEAKS_TLS, await_reply, connect, request, unauthorized};
use super::reply::{Reply, shown};
use crate::Stop;
use crate::input::connection::{DialError, is_no_news};

/// Largest sourcetable, bytes; the largest known have some hundred kilobytes.
const MOST_BYTES: usize = 16 << 20;
/// Longest name of a mount point, bytes: lines with longer names are skipped, and columns stay narrower.
const LONGEST_FIELD: usize = 255;
/// Longest time without a byte.
const SILENCE: Duration = Duration::from_secs(10);
const PORTION: usize = 16_384;

/// Why there is no sourcetable.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{caster}: no sourcetable: {reason}")]
pub struct SourcetableError {
    caster: String,
    reason: String,
}

/// The streams of a caster.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sourcetable {
    /// In the caster's order.
    pub streams: Vec<StreamEntry>,
    /// Lines of streams that cannot be read.
    pub damaged_lines: u64,
}

/// One stream, as the caster describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamEntry {
    /// The mount point.
    pub mount: String,
    /// Data format, such as `RTCM 3.2`.
    pub format: String,
    /// Carrier phases: 0 none, 1 L1, 2 L1 and L2.
    pub carrier: String,
    /// Systems, such as `GPS+GLO`.
    pub systems: String,
    /// Country, three letters.
    pub country: String,
    /// Latitude and longitude, degrees; `None` where they cannot be read.
    pub place_deg: Option<(f64, f64)>,
    /// Whether the caster needs the rover's position.
    pub wants_position: bool,
}

/// Asks a caster for its list. Blocks.
///
/// # Errors
/// When there is no connection, or the caster answers something else.
pub fn sourcetable(caster: &Caster, stop: &Stop) -> Result<Sourcetable, SourcetableError> {
    let failed = |reason: String| SourcetableError { caster: caster.to_string(), reason };
    let text = fetch(caster, stop).map_err(|error| match error {
        DialError::Failed(reason) | DialError::Refused(reason) => failed(reason),
    })?;
    let table = Sourcetable::parse(&text);
    if table == Sourcetable::default() && !ends(text.as_bytes()) {
        return Err(failed(format!("the answer is none, it begins with '{}'", shown(text.as_bytes()))));
    }
    Ok(table)
}

fn fetch(caster: &Caster, stop: &Stop) -> Result<String, DialError> {
    let mut wire = connect(caster, stop)?;
    wire.write_all(request(caster, "/", Revision::Second, None).as_bytes())?;
    let (reply, first) = await_reply(wire.as_mut(), caster, stop)?;
    let chunked = match reply {
        Reply::Sourcetable { chunked } | Reply::Stream { chunked } | Reply::WebPage { chunked } => chunked,
        Reply::Unauthorized(text) => return Err(DialError::Refused(unauthorized(caster, &text))),
        Reply::Tls => return Err(DialError::Refused(SPEAKS_TLS.to_owned())),
        Reply::NotFound(text) | Reply::NotUnderstood(text) | Reply::Other(text) => {
            return Err(DialError::Refused(format!("the caster answers '{text}'")));
        }
    };
    let (mut body, mut table, mut buffer) = (Body::new(chunked), Vec::new(), vec![0; PORTION]);
    body.take(&first);
    let mut heard = Instant::now();
    loop {
        loop {
            match body.give(&mut buffer) {
                0 => break,
                count => table.extend_from_slice(buffer.get(..count).unwrap_or_default()),
            }
        }
        let is_over = body.is_complete()? || ends(&table) || table.len() > MOST_BYTES || stop.is_requested();
        if is_over || heard.elapsed() > SILENCE {
            return Ok(String::from_utf8_lossy(&table).into_owned());
        }
        match wire.read(&mut buffer) {
            Ok(0) => return Ok(String::from_utf8_lossy(&table).into_owned()),
            Ok(count) => {
                heard = Instant::now();
                body.take(buffer.get(..count).unwrap_or_default());
            }
            Err(error) if is_no_news(&error) => {}
            Err(error) => return Err(error.into()),
        }
    }
}

fn ends(table: &[u8]) -> bool {
    table.trim_ascii_end().ends_with(b"ENDSOURCETABLE")
}

impl Sourcetable {
    /// Reads the table's lines; those of casters and networks are ignored.
    pub fn parse(text: &str) -> Self {
        let mut table = Self::default();
        for line in text.lines().filter(|line| line.starts_with("STR;")) {
            match StreamEntry::read(line) {
                Some(entry) => table.streams.push(entry),
                None => table.damaged_lines += 1,
            }
        }
        table
    }
}

impl StreamEntry {
    /// The fields in their order: type, mount point, identifier, format, format's details, carrier, systems, network, country, latitude,
    /// longitude, whether a position is wanted.
    fn read(line: &str) -> Option<Self> {
        let fields: Vec<&str> = line.split(';').map(str::trim).collect();
        let field = |at: usize| {
            let text = fields.get(at).map(|text| printable(text));
            text.filter(|text| text.len() <= LONGEST_FIELD)
        };
        let degrees = |at: usize, limit: f64| {
            let value: f64 = fields.get(at)?.parse().ok()?;
            (value.abs() <= limit).then_some(value)
        };
        Some(Self {
            mount: field(1).filter(|name| !name.is_empty())?,
            format: field(3)?,
            carrier: field(5)?,
            systems: field(6)?,
            country: field(8)?,
            place_deg: degrees(9, 90.0).zip(degrees(10, 360.0)),
            wants_position: fields.get(11).is_some_and(|text| *text == "1"),
        })
    }
}

/// A caster's text without control characters.
fn printable(text: &str) -> String {
    text.chars().filter(|character| !character.is_control()).collect()
}

impl fmt::Display for Sourcetable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |name: &str, of: fn(&StreamEntry) -> &str| {
            self.streams.iter().map(|entry| of(entry).chars().count()).chain([name.len()]).max().unwrap_or(0)
        };
        let (mount, format) = (width("mount point", |e| &e.mount), width("format", |e| &e.format));
        let systems = width("systems", |e| &e.systems);
        writeln!(
            f,
            "{:mount$}  {:format$}  carrier  {:systems$}  country  latitude  longitude  position",
            "mount point", "format", "systems"
        )?;
        for entry in &self.streams {
            let (latitude, longitude) = entry
                .place_deg
                .map_or((String::new(), String::new()), |(a, b)| (format!("{a:.2}"), format!("{b:.2}")));
            let wanted = if entry.wants_position { "wanted" } else { "-" };
            writeln!(
                f,
                "{:mount$}  {:format$}  {:7}  {:systems$}  {:7}  {latitude:>8}  {longitude:>9}  {wanted}",
                entry.mount, entry.format, entry.carrier, entry.systems, entry.country
            )?;
        }
        let damaged = if self.damaged_lines == 0 {
            String::new()
        } else {
            format!(", {} damaged lines", self.damaged_lines)
        };
        writeln!(f, "{} streams{damaged}", self.streams.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "CAS;rtk.example;2101;x;y;0;DEU;50;8;\r\n\
        STR;WTZR0;Wettzell;RTCM 3.3;1004(1),1006(10);2;GPS+GLO+GAL;IGS;DEU;49.14;12.88;0;0;x;none;B;N;9600;\r\n\
        STR;VRS\u{1b}[2J;net;RTCM 3.2;1077(1);2;GPS;net;ESP;40.0;-3.7;1;1;x;none;B;N;9600;\r\n\
        STR;NOWHERE;net;RTCM 3.2;;0;GPS;net;XXX;;north;;;;\r\n\
        STR;short\r\nSTR;;a;b;c;d;e;f;g;1;2;\r\nENDSOURCETABLE\r\n";

    #[test]
    fn one_long_name_does_not_widen_all_lines() {
        let long = format!("STR;{};x;RTCM 3;;2;GPS;net;DEU;1;2;0;\r\n", "M".repeat(300));
        let table = Sourcetable::parse(&(long + TABLE));
        assert_eq!((table.streams.len(), table.damaged_lines), (3, 3));
        assert!(table.to_string().lines().all(|line| line.len() < 120), "{table}");
    }

    #[test]
    fn streams_are_listed_and_shown() {
        let table = Sourcetable::parse(TABLE);
        assert_eq!((table.streams.len(), table.damaged_lines), (3, 2));
        let [first, second, third] = &table.streams[..] else { panic!("{table:?}") };
        assert_eq!(
            (first.mount.as_str(), first.place_deg, first.wants_position),
            ("WTZR0", Some((49.14, 12.88)), false)
        );
        assert_eq!((second.mount.as_str(), second.wants_position), ("VRS[2J", true), "no escape sequence");
        assert_eq!(third.place_deg, None);
        let text = table.to_string();
        let line = "WTZR0        RTCM 3.3  2        GPS+GLO+GAL  DEU         49.14      12.88  -";
        assert!(text.contains(line), "{text}");
        assert!(text.ends_with("3 streams, 2 damaged lines\n"), "{text}");
    }
}
