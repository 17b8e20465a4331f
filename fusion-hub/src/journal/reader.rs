//! Reads journals, segment by segment, as far as each goes.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, anyhow, bail, ensure};
use cofix_common::time::GpsTime;
use cofix_common::wire::{MAXIMUM_MESSAGE_BYTES, WIRE_VERSION};
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::{Entry, Header, Kind, NAME, SESSION, segment};
use crate::network::Event;
use crate::network::intake::Arrival;

/// Longest record, bytes: a chunk is little longer than its last message.
const LONGEST_RECORD: usize = 64 * MAXIMUM_MESSAGE_BYTES;

/// What a journal is of, and the session file that it came with.
#[derive(Clone, Debug, PartialEq)]
pub struct Origin {
    /// Group, phones and options.
    pub header: Header,
    /// Text of the session file; `None` if the journal lacks it.
    pub session: Option<String>,
}

/// A journal that is read. Iterates over its entries.
pub struct JournalReader {
    path: PathBuf,
    /// Number of segments that were begun.
    segments: u32,
    segment: Option<Segment>,
    origin: Option<Origin>,
    /// Senders by their numbers in the present segment.
    senders: BTreeMap<u32, String>,
    damages: Vec<String>,
    /// The next entry: it is read ahead, since what a journal is of stands before it.
    waiting: Option<Entry>,
}

struct Segment {
    path: PathBuf,
    file: BufReader<File>,
    reader: LinearReader,
    schemas: BTreeMap<u16, Kind>,
    channels: BTreeMap<u16, (Kind, Option<String>)>,
}

/// What a record of a segment says.
enum Said {
    Header(Header),
    Session(String),
    Sender(u32, String),
    Entry(Entry),
    Nothing,
}

impl JournalReader {
    /// Opens the journal that begins with the file.
    ///
    /// # Errors
    /// When it cannot be read, or is no journal of this version.
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        let mut reader = Self {
            path: path.to_owned(),
            segments: 1,
            segment: Some(Segment::open(path)?),
            origin: None,
            senders: BTreeMap::new(),
            damages: Vec::new(),
            waiting: None,
        };
        reader.waiting = reader.read_next();
        ensure!(
            reader.origin.is_some(),
            "{}: this is no journal of cofix-hub{}",
            path.display(),
            reader.damages.first().map_or_else(String::new, |damage| format!(" ({damage})"))
        );
        Ok(reader)
    }

    /// What the journal is of.
    ///
    /// # Errors
    /// Never after [`JournalReader::open`].
    pub fn origin(&self) -> anyhow::Result<&Origin> {
        self.origin.as_ref().with_context(|| format!("{}: no journal", self.path.display()))
    }

    /// Number of segments that were begun.
    pub const fn segments(&self) -> u32 {
        self.segments
    }

    /// Where segments ended before their end mark, and what is wrong in them.
    pub fn damages(&self) -> &[String] {
        &self.damages
    }

    fn read_next(&mut self) -> Option<Entry> {
        loop {
            let segment = self.segment.as_mut()?;
            match segment.next(&self.senders) {
                Ok(Some(Said::Header(header))) => match &mut self.origin {
                    Some(origin) if origin.header.phones != header.phones => {
                        let text = format!("{}: a segment of other phones", segment.path.display());
                        self.damages.push(text);
                        self.next_segment();
                    }
                    Some(_) => {}
                    None => self.origin = Some(Origin { header, session: None }),
                },
                Ok(Some(Said::Session(text))) => {
                    if let Some(origin) = &mut self.origin {
                        origin.session = Some(text);
                    }
                }
                Ok(Some(Said::Sender(number, sender))) => {
                    self.senders.insert(number, sender);
                }
                Ok(Some(Said::Entry(entry))) => return Some(entry),
                Ok(Some(Said::Nothing)) => {}
                Ok(None) => self.next_segment(),
                Err(error) => {
                    self.damages.push(format!("{}: {error:#}", segment.path.display()));
                    self.next_segment();
                }
            }
        }
    }

    fn next_segment(&mut self) {
        let path = segment(&self.path, self.segments + 1);
        self.segment = None;
        // Numbers of senders begin anew with every hub; those of a segment are written in it.
        self.senders.clear();
        if !path.exists() {
            return;
        }
        self.segments += 1;
        match Segment::open(&path) {
            Ok(segment) => self.segment = Some(segment),
            Err(error) => self.damages.push(format!("{error:#}")),
        }
    }
}

impl Iterator for JournalReader {
    type Item = Entry;

    fn next(&mut self) -> Option<Entry> {
        let entry = self.waiting.take()?;
        self.waiting = self.read_next();
        Some(entry)
    }
}

impl Segment {
    fn open(path: &Path) -> anyhow::Result<Self> {
        let file =
            File::open(path).with_context(|| format!("{}: cannot read the journal", path.display()))?;
        let options = LinearReaderOptions::default()
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LONGEST_RECORD);
        Ok(Self {
            path: path.to_owned(),
            file: BufReader::new(file),
            reader: LinearReader::new_with_options(options),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
        })
    }

    /// What the next record says; `None` at the end.
    fn next(&mut self, senders: &BTreeMap<u32, String>) -> anyhow::Result<Option<Said>> {
        loop {
            let Some(event) = self.reader.next_event() else { return Ok(None) };
            let said = match event? {
                LinearReadEvent::ReadRequest(wanted) => {
                    let read = self.file.read(self.reader.insert(wanted))?;
                    self.reader.notify_read(read);
                    continue;
                }
                LinearReadEvent::Record { data, opcode } => mcap::parse_record(opcode, data)?.into_owned(),
            };
            return self.said(said, senders).map(Some);
        }
    }

    fn said(&mut self, record: Record<'_>, senders: &BTreeMap<u32, String>) -> anyhow::Result<Said> {
        match record {
            Record::Metadata(metadata) if metadata.name == NAME => {
                let value = |key: &str| metadata.metadata.get(key).map_or("", String::as_str);
                let version = value("wire_version");
                if version != WIRE_VERSION.to_string() {
                    bail!("written with wire version '{version}', this program speaks {WIRE_VERSION}");
                }
                Ok(Said::Header(serde_json::from_str(value("header")).context("its header")?))
            }
            Record::Attachment { header, data, .. } if header.name == SESSION => {
                Ok(Said::Session(String::from_utf8(data.into_owned()).context("its session file")?))
            }
            Record::Schema { header, .. } => {
                self.schemas.extend(Kind::of_schema(&header.name).map(|kind| (header.id, kind)));
                Ok(Said::Nothing)
            }
            Record::Channel(channel) => {
                if let Some(kind) = self.schemas.get(&channel.schema_id) {
                    let phone = channel.metadata.get("phone").cloned();
                    self.channels.insert(channel.id, (*kind, phone));
                }
                Ok(Said::Nothing)
            }
            Record::Message { header, data } => {
                // Other records, as positions for maps, are none of the journal's.
                let Some((kind, phone)) = self.channels.get(&header.channel_id) else {
                    return Ok(Said::Nothing);
                };
                let sender = senders.get(&header.sequence).cloned();
                said(*kind, phone.as_deref(), header.sequence, sender, &data)
            }
            _ => Ok(Said::Nothing),
        }
    }
}

fn said(
    kind: Kind,
    phone: Option<&str>,
    number: u32,
    sender: Option<String>,
    data: &[u8],
) -> anyhow::Result<Said> {
    let entry = match kind {
        Kind::Sender => {
            return Ok(Said::Sender(number, String::from_utf8(data.to_vec()).context("a sender")?));
        }
        Kind::Step => {
            let (now, wall) = data.split_first_chunk::<8>().context("a step without time")?;
            let wall = wall.first_chunk::<8>().context("a step without time")?;
            Entry::Step {
                now: Duration::from_nanos(u64::from_le_bytes(*now)),
                wall_gps: GpsTime::from_nanos(i64::from_le_bytes(*wall)),
            }
        }
        Kind::Resumed => Entry::Resumed,
        Kind::Ended => Entry::Ended,
        Kind::Refused => {
            let (phone, skips) = postcard::from_bytes(data).context("what was refused")?;
            Entry::Event(Event::Refused { phone, skips })
        }
        _ => Entry::Event(event(
            kind,
            phone.context("an event without a phone")?.to_owned(),
            sender,
            data.to_vec(),
        )?),
    };
    Ok(Said::Entry(entry))
}

fn event(kind: Kind, phone: String, sender: Option<String>, bytes: Vec<u8>) -> anyhow::Result<Event> {
    Ok(match kind {
        Kind::Epoch => Event::Epoch(Arrival { phone, sender, bytes }),
        Kind::Status => Event::Status(Arrival { phone, sender, bytes }),
        Kind::History => Event::History(Arrival { phone, sender, bytes }),
        Kind::Answered => Event::Answered { phone, sender: sender.context("an answer without a sender")? },
        Kind::Alive => Event::Alive { phone, alive: bytes == [1] },
        Kind::Shed => {
            let count = bytes.try_into().map(u64::from_le_bytes);
            Event::Shed { phone, count: count.map_err(|_| anyhow!("a count that is no number"))? }
        }
        _ => bail!("a record of kind '{}' where an event should be", kind.schema()),
    })
}
