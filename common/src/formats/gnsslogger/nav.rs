//! `Nav` lines: pieces of navigation messages (Android API, `GnssNavigationMessage`).
//!
//! `Nav,Svid,Type,Status,MessageId,Sub-messageId,byte,byte,…` with bytes as signed decimal numbers.

use std::collections::VecDeque;

use super::epochs::Epochs;
use super::nav_message::{Kind, Message, parse};
use crate::formats::decode::Record;
use crate::formats::navbits::{
    BeidouAssembler, FnavAssembler, GlonassAssembler, GlonassClock, GlonassLabel, GlonassMessage,
    InavAssembler, LnavAssembler, Refused,
};
use crate::orbit::IonosphereTerms;
use crate::orbit::KeplerEphemeris;
use crate::skips::{Reason, Skips};
use crate::time::{GpsTime, leap_seconds_of};

/// Messages that wait for the first epoch, which tells the week. Forty satellites of all systems send some fifteen pieces in a
/// second.
const MAX_WAITING: usize = 1_000;

/// Decodes `Nav` lines.
#[derive(Clone, Debug, Default)]
pub(super) struct NavLines {
    lnav: LnavAssembler,
    inav: InavAssembler,
    fnav: FnavAssembler,
    beidou: BeidouAssembler,
    glonass: GlonassAssembler,
    waiting: Vec<Message>,
    without_channel: WithoutChannel,
}

/// The message that a line completes.
enum Decoded {
    Kepler(Box<KeplerEphemeris>),
    Glonass(GlonassMessage),
}

/// GLONASS messages, and the lines that they ended in, that wait for a carrier frequency to tell the satellite's channel.
#[derive(Clone, Debug, Default)]
struct WithoutChannel {
    messages: Vec<(u64, GlonassMessage)>,
    /// Number of known channels at the last search.
    known: usize,
}

impl NavLines {
    /// Ionosphere coefficients of GPS and BeiDou, the latest.
    pub(super) const fn ionosphere(&self) -> IonosphereTerms {
        IonosphereTerms { gps: self.lnav.system().klobuchar, beidou: self.beidou.klobuchar(), galileo: None }
    }

    /// Seconds that GPS time is ahead of UTC.
    pub(super) const fn leap_seconds(&self) -> Option<i64> {
        self.lnav.system().leap_seconds
    }

    /// Takes a line; an ephemeris that it completes goes to `records`. Before the first epoch, which tells the time, it waits.
    pub(super) fn line(
        &mut self,
        (number, line): (u64, &[u8]),
        epochs: &Epochs,
        skips: &mut Skips,
        records: &mut VecDeque<Record>,
    ) {
        let Some(message) = parse(number, line, skips) else { return };
        if epochs.time().is_some() || self.waiting.len() < MAX_WAITING {
            self.waiting.push(message);
            self.catch_up(epochs, skips, records);
        } else {
            skips.add(Reason::NavLineTooEarly, || format!("line {number}"));
        }
    }

    /// Decodes the messages that have waited for a time or for a channel.
    pub(super) fn catch_up(&mut self, epochs: &Epochs, skips: &mut Skips, records: &mut VecDeque<Record>) {
        let Some(now) = epochs.time() else { return };
        for message in std::mem::take(&mut self.waiting) {
            match self.decode(&message, now) {
                Ok(Some(Decoded::Kepler(ephemeris))) => records.push_back(Record::Ephemeris(ephemeris)),
                Ok(Some(Decoded::Glonass(found))) => {
                    self.without_channel.add((message.number, found), epochs, skips, records);
                }
                Ok(None) => {}
                Err(refused) => {
                    skips.add(refused.reason, || format!("line {}: {}", message.number, refused.detail));
                }
            }
        }
        self.without_channel.catch_up(epochs, records);
    }

    /// Counts the messages that still wait.
    pub(super) fn finish(&mut self, skips: &mut Skips) {
        for message in std::mem::take(&mut self.waiting) {
            skips.add(Reason::NavLineWithoutWeek, || format!("line {}", message.number));
        }
        for (line, message) in std::mem::take(&mut self.without_channel.messages) {
            count_without_channel(line, &message, skips);
        }
    }

    fn decode(&mut self, message: &Message, now: GpsTime) -> Result<Option<Decoded>, Refused> {
        let (bytes, receiver) = (message.bytes(), message.receiver);
        let kepler = match message.kind {
            Kind::Lnav(satellite) => self.lnav.subframe(satellite, bytes, receiver, now),
            Kind::Inav(satellite) => self.inav.page(satellite, bytes, receiver, now),
            Kind::Fnav(satellite) => self.fnav.page(satellite, bytes, receiver, now),
            Kind::Beidou(satellite) => self.beidou.subframe(satellite, bytes, receiver, now),
            Kind::Glonass(label) => return self.glonass_string(label, bytes, now),
        };
        kepler.map(|ephemeris| ephemeris.map(|ephemeris| Decoded::Kepler(Box::new(ephemeris))))
    }

    fn glonass_string(
        &mut self,
        label: GlonassLabel,
        bytes: &[u8],
        now: GpsTime,
    ) -> Result<Option<Decoded>, Refused> {
        let clock = GlonassClock { now, leap_seconds: leap_seconds_of(self.leap_seconds(), now) };
        self.glonass.string(label, bytes, clock).map(|message| message.map(Decoded::Glonass))
    }
}

impl WithoutChannel {
    /// Gives a message's ephemeris if the channel is known, or keeps it.
    fn add(
        &mut self,
        (line, message): (u64, GlonassMessage),
        epochs: &Epochs,
        skips: &mut Skips,
        records: &mut VecDeque<Record>,
    ) {
        if let Some(record) = on_channel(&message, epochs) {
            records.push_back(record);
        } else if self.messages.len() < MAX_WAITING {
            self.messages.push((line, message));
        } else {
            count_without_channel(line, &message, skips);
        }
    }

    /// Gives the messages whose channel has become known.
    fn catch_up(&mut self, epochs: &Epochs, records: &mut VecDeque<Record>) {
        let known = epochs.glonass_channels().len();
        if known == self.known {
            return;
        }
        self.known = known;
        self.messages.retain(|(_, message)| {
            let record = on_channel(message, epochs);
            let is_still_without = record.is_none();
            records.extend(record);
            is_still_without
        });
    }
}

/// The channel by the phone's name for the satellite, else by the carrier frequency of its signals.
fn on_channel(message: &GlonassMessage, epochs: &Epochs) -> Option<Record> {
    let channel = message.channel().or_else(|| epochs.glonass_channels().get(&message.slot()).copied())?;
    Some(Record::Glonass(Box::new(message.on_channel(channel))))
}

fn count_without_channel(line: u64, message: &GlonassMessage, skips: &mut Skips) {
    skips.add(Reason::GlonassEphemerisWithoutChannel, || format!("line {line}: R{:02}", message.slot()));
}
