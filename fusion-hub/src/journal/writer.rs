//! Writes journals.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context;
use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::time::GpsTime;
use cofix_common::wire::{WIRE_VERSION, epoch_key, fused_key, history_key, liveliness_key, status_key};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, WriteOptions, Writer};
use prost::Message as _;

use super::fix::{self, LocationFix};
use super::{Header, Kind, NAME, SESSION, segment};
use crate::network::Event;
use crate::network::intake::Arrival;

/// Longest time that a record waits to be written.
const FLUSH: Duration = Duration::from_secs(1);
/// Size of the data after which a new segment is begun unless told otherwise, bytes.
pub const SEGMENT_BYTES: u64 = 256_000_000;

/// A journal in progress.
pub struct Journal {
    path: PathBuf,
    header: Header,
    /// Number of the present segment.
    number: u32,
    segment: Segment,
    /// Numbers of the senders.
    senders: BTreeMap<String, u32>,
    /// GPS time of the last step by the computer's clock, which all records until the next one have.
    wall_gps: GpsTime,
    flushed: Instant,
    limit_bytes: u64,
}

/// A segment in progress.
struct Segment {
    writer: Writer<BufWriter<File>>,
    /// Channels by kind and phone.
    channels: BTreeMap<(Kind, usize), u16>,
    /// Channels of fused positions by phone.
    fixes: BTreeMap<usize, u16>,
    bytes: u64,
}

/// Place of records that are of no phone.
const OF_NO_PHONE: usize = usize::MAX;

impl Journal {
    /// Begins a journal with the text of the session file.
    ///
    /// # Errors
    /// When the file is there already or cannot be written.
    pub fn create(path: &Path, header: Header, session: &str, wall_gps: GpsTime) -> anyhow::Result<Self> {
        let mut journal = Self::at(path, header, 1, wall_gps)?;
        let attachment = Attachment {
            log_time: stamp(wall_gps),
            create_time: stamp(wall_gps),
            name: SESSION.to_owned(),
            media_type: "application/toml".to_owned(),
            data: session.as_bytes().into(),
        };
        journal.checked(|segment| Ok(segment.writer.attach(&attachment)?))?;
        journal.flush()?;
        Ok(journal)
    }

    /// Goes on after `segments` segments.
    ///
    /// # Errors
    /// When the next one cannot be written.
    pub fn go_on(path: &Path, header: Header, segments: u32, wall_gps: GpsTime) -> anyhow::Result<Self> {
        let mut journal = Self::at(path, header, segments + 1, wall_gps)?;
        journal.put(Kind::Resumed, OF_NO_PHONE, 0, &[])?;
        journal.flush()?;
        Ok(journal)
    }

    fn at(path: &Path, header: Header, number: u32, wall_gps: GpsTime) -> anyhow::Result<Self> {
        let segment = Segment::create(&segment(path, number), &header)?;
        Ok(Self {
            path: path.to_owned(),
            header,
            number,
            segment,
            senders: BTreeMap::new(),
            wall_gps,
            flushed: Instant::now(),
            limit_bytes: SEGMENT_BYTES,
        })
    }

    /// With another size of segments than the usual one.
    pub fn with_segments_of(self, limit_bytes: u64) -> Self {
        Self { limit_bytes, ..self }
    }

    /// Writes an event. Those of agents in this process are none of a journal.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn event(&mut self, event: &Event) -> anyhow::Result<()> {
        match event {
            Event::Epoch(arrival) => self.arrival(Kind::Epoch, arrival),
            Event::Status(arrival) => self.arrival(Kind::Status, arrival),
            Event::History(arrival) => self.arrival(Kind::History, arrival),
            Event::Answered { phone, sender } => self.of(Kind::Answered, phone, Some(sender), &[]),
            Event::Alive { phone, alive } => self.of(Kind::Alive, phone, None, &[u8::from(*alive)]),
            Event::Shed { phone, count } => self.of(Kind::Shed, phone, None, &count.to_le_bytes()),
            Event::Refused { phone, skips } => {
                self.put(Kind::Refused, OF_NO_PHONE, 0, &postcard::to_stdvec(&(phone, skips))?)
            }
            Event::AgentEnded { .. } => Ok(()),
        }
    }

    /// Writes that everything before is used at this time.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn step(&mut self, now: Duration, wall_gps: GpsTime) -> anyhow::Result<()> {
        self.wall_gps = wall_gps;
        let now_ns = u64::try_from(now.as_nanos()).unwrap_or(u64::MAX);
        let data = [now_ns.to_le_bytes(), wall_gps.nanos().to_le_bytes()].concat();
        self.put(Kind::Step, OF_NO_PHONE, 0, &data)?;
        if self.flushed.elapsed() >= FLUSH {
            self.flush()?;
        }
        if self.segment.bytes >= self.limit_bytes {
            self.rotate()?;
        }
        Ok(())
    }

    /// Writes the fused positions of an epoch.
    ///
    /// # Errors
    /// When they cannot be written.
    pub fn fused(&mut self, epoch: &FusedEpoch) -> anyhow::Result<()> {
        let (log_time, publish_time) = (stamp(self.wall_gps), stamp(epoch.time_gps));
        for (phone, fused) in epoch.phones.iter().enumerate() {
            let (Some(state), Some(name)) = (&fused.state, self.header.phones.get(phone)) else { continue };
            let data = LocationFix::of(epoch.time_gps, name, state).encode_to_vec();
            let group = &self.header.group;
            let written = self.segment.fix(group, (phone, name), (log_time, publish_time), &data);
            written.with_context(|| self.context())?;
        }
        Ok(())
    }

    /// Writes that the session has ended. Only fused positions may follow.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn end(&mut self) -> anyhow::Result<()> {
        self.put(Kind::Ended, OF_NO_PHONE, 0, &[])?;
        self.flush()
    }

    /// Finishes the file.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn finish(mut self) -> anyhow::Result<()> {
        self.checked(Segment::finish)
    }

    /// The first file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn arrival(&mut self, kind: Kind, arrival: &Arrival) -> anyhow::Result<()> {
        self.of(kind, &arrival.phone, arrival.sender.as_deref(), &arrival.bytes)
    }

    fn of(&mut self, kind: Kind, phone: &str, sender: Option<&str>, data: &[u8]) -> anyhow::Result<()> {
        let Some(index) = self.header.phones.iter().position(|name| name == phone) else {
            // The group has refused it, and that is written.
            return Ok(());
        };
        let number = sender.map_or(Ok(0), |sender| self.sender(sender))?;
        self.put(kind, index, number, data)
    }

    /// The number of a sender; a new one is written.
    fn sender(&mut self, sender: &str) -> anyhow::Result<u32> {
        if let Some(number) = self.senders.get(sender) {
            return Ok(*number);
        }
        let number = u32::try_from(self.senders.len() + 1).context("too many senders")?;
        self.senders.insert(sender.to_owned(), number);
        self.put(Kind::Sender, OF_NO_PHONE, number, sender.as_bytes())?;
        Ok(number)
    }

    fn put(&mut self, kind: Kind, phone: usize, number: u32, data: &[u8]) -> anyhow::Result<()> {
        let time = stamp(self.wall_gps);
        let header = &self.header;
        let written = self.segment.put(header, (kind, phone), (number, time), data);
        written.with_context(|| self.context())
    }

    /// Writes out what waits.
    #[cfg(test)]
    pub(super) fn write_out(&mut self) -> anyhow::Result<()> {
        self.flush()
    }

    fn flush(&mut self) -> anyhow::Result<()> {
        self.flushed = Instant::now();
        self.checked(|segment| Ok(segment.writer.flush()?))
    }

    /// Begins the next segment, with the senders that are known.
    fn rotate(&mut self) -> anyhow::Result<()> {
        self.checked(Segment::finish)?;
        self.number += 1;
        self.segment = Segment::create(&segment(&self.path, self.number), &self.header)?;
        for (sender, number) in self.senders.clone() {
            self.put(Kind::Sender, OF_NO_PHONE, number, sender.as_bytes())?;
        }
        Ok(())
    }

    fn checked(&mut self, work: impl FnOnce(&mut Segment) -> anyhow::Result<()>) -> anyhow::Result<()> {
        work(&mut self.segment).with_context(|| self.context())
    }

    fn context(&self) -> String {
        format!("{}: cannot write the journal", segment(&self.path, self.number).display())
    }
}

impl Segment {
    fn create(path: &Path, header: &Header) -> anyhow::Result<Self> {
        let context = || format!("{}: cannot begin the journal", path.display());
        let file = OpenOptions::new().write(true).create_new(true).open(path).with_context(context)?;
        // Only tells another hub that this one writes. Where there are no locks, nothing is told.
        let _ = file.try_lock();
        let options =
            WriteOptions::new().profile(NAME).library(concat!("cofix-hub ", env!("CARGO_PKG_VERSION")));
        let mut writer = options.create(BufWriter::new(file)).with_context(context)?;
        let metadata = [
            ("group", header.group.clone()),
            ("header", serde_json::to_string(header)?),
            ("wire_version", WIRE_VERSION.to_string()),
            ("program", cofix_console::VERSION.to_owned()),
        ];
        let metadata = metadata.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
        writer.write_metadata(&Metadata { name: NAME.to_owned(), metadata }).with_context(context)?;
        Ok(Self { writer, channels: BTreeMap::new(), fixes: BTreeMap::new(), bytes: 0 })
    }

    fn put(
        &mut self,
        header: &Header,
        (kind, phone): (Kind, usize),
        (sequence, time): (u32, u64),
        data: &[u8],
    ) -> anyhow::Result<()> {
        let channel_id = self.channel(header, kind, phone)?;
        let message = MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
        self.writer.write_to_known_channel(&message, data)?;
        self.bytes += data.len() as u64;
        Ok(())
    }

    fn fix(
        &mut self,
        group: &str,
        (phone, name): (usize, &str),
        (log_time, publish_time): (u64, u64),
        data: &[u8],
    ) -> anyhow::Result<()> {
        let channel_id = if let Some(channel) = self.fixes.get(&phone) {
            *channel
        } else {
            let schema =
                self.writer.add_schema(fix::SCHEMA, fix::ENCODING, &fix::descriptors().encode_to_vec())?;
            let topic = fused_key(group, name)?;
            let channel = self.writer.add_channel(schema, &topic, fix::ENCODING, &BTreeMap::new())?;
            *self.fixes.entry(phone).or_insert(channel)
        };
        let message = MessageHeader { channel_id, sequence: 0, log_time, publish_time };
        self.writer.write_to_known_channel(&message, data)?;
        self.bytes += data.len() as u64;
        Ok(())
    }

    fn channel(&mut self, header: &Header, kind: Kind, phone: usize) -> anyhow::Result<u16> {
        if let Some(channel) = self.channels.get(&(kind, phone)) {
            return Ok(*channel);
        }
        let group = &header.group;
        let topic = match (kind, header.phones.get(phone)) {
            (Kind::Epoch, Some(phone)) => epoch_key(group, phone)?,
            (Kind::Status, Some(phone)) => status_key(group, phone)?,
            (Kind::History | Kind::Answered, Some(phone)) => history_key(group, phone)?,
            (Kind::Alive, Some(phone)) => liveliness_key(group, phone)?,
            (Kind::Refused, _) => format!("cofix/{group}/refused"),
            (Kind::Sender, _) => format!("cofix/{group}/sender"),
            _ => format!("cofix/{group}/step"),
        };
        let schema = self.writer.add_schema(kind.schema(), "", b"")?;
        let metadata = header.phones.get(phone).map(|name| ("phone".to_owned(), name.clone()));
        let channel = self.writer.add_channel(schema, &topic, NAME, &metadata.into_iter().collect())?;
        self.channels.insert((kind, phone), channel);
        Ok(channel)
    }

    fn finish(&mut self) -> anyhow::Result<()> {
        self.writer.finish()?;
        Ok(())
    }
}

/// GPS time as MCAP's time, ns since 1970, read as if it were UTC.
fn stamp(time_gps: GpsTime) -> u64 {
    u64::try_from(time_gps.as_unix_calendar_nanos()).unwrap_or_default()
}
