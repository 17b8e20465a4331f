//! `Nav` lines to pieces of navigation messages.

use super::fields::integer;
use crate::formats::android::{channel_only, satellite};
use crate::formats::navbits::{GlonassLabel, GlonassName, ReceiverCheck};
use crate::formats::text::shorten;
use crate::gnss::SatelliteId;
use crate::skips::{Reason, Skips};

/// Status: parity passed, and parity failed but the receiver could rebuild the words.
const PASSED: [i64; 2] = [1, 2];
/// Longest message, bytes.
const MAX_BYTES: usize = 64;

/// A piece of a navigation message.
#[derive(Clone, Copy, Debug)]
pub(super) struct Message {
    /// Line that it came in.
    pub(super) number: u64,
    pub(super) kind: Kind,
    pub(super) receiver: ReceiverCheck,
    bytes: [u8; MAX_BYTES],
    length: usize,
}

/// Kind of message, and its satellite.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// GPS or QZSS.
    Lnav(SatelliteId),
    Inav(SatelliteId),
    Fnav(SatelliteId),
    /// D1 or D2, which the satellite tells.
    Beidou(SatelliteId),
    Glonass(GlonassLabel),
}

impl Message {
    pub(super) fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }
}

/// The fields before the bytes.
struct Head {
    svid: i64,
    /// The constellation in the high byte, the message in the low one.
    kind: i64,
    status: i64,
    message: i64,
    sub_message: i64,
}

/// Reads a line.
pub(super) fn parse(number: u64, line: &[u8], skips: &mut Skips) -> Option<Message> {
    let mut fields = line.split(|byte| *byte == b',').skip(1);
    let Some(head) = head(&mut fields) else {
        skips.add(Reason::NavLineUnreadable, || format!("line {number}: '{}'", shorten(line)));
        return None;
    };
    let receiver = if PASSED.contains(&head.status) { ReceiverCheck::Passed } else { ReceiverCheck::Unknown };
    let kind = match kind(&head, receiver) {
        Ok(kind) => kind,
        Err(reason) => {
            skips.add(reason, || format!("line {number}: Nav of type {}, Svid {}", head.kind, head.svid));
            return None;
        }
    };
    let Some((bytes, length)) = message_bytes(fields) else {
        skips.add(Reason::NavLineUnreadable, || format!("line {number}: '{}'", shorten(line)));
        return None;
    };
    Some(Message { number, kind, receiver, bytes, length })
}

fn head<'a>(fields: &mut impl Iterator<Item = &'a [u8]>) -> Option<Head> {
    let mut next = || integer(fields.next()?.trim_ascii());
    // In the order of the line.
    Some(Head { svid: next()?, kind: next()?, status: next()?, message: next()?, sub_message: next()? })
}

/// The message by its type (Android API, `GnssNavigationMessage`), or the reason why it is not used.
fn kind(head: &Head, receiver: ReceiverCheck) -> Result<Kind, Reason> {
    let satellite = || satellite(head.kind >> 8, head.svid);
    match head.kind {
        0x0101 | 0x0401 => Ok(Kind::Lnav(satellite()?)),
        0x0301 => glonass(head, receiver).map(Kind::Glonass),
        0x0501 | 0x0502 => beidou(satellite()?, head.kind == 0x0502).map(Kind::Beidou),
        0x0601 => Ok(Kind::Inav(satellite()?)),
        0x0602 => Ok(Kind::Fnav(satellite()?)),
        _ => Err(Reason::NavLineNotDecoded),
    }
}

/// D2 is of geostationary satellites, D1 of the others.
fn beidou(satellite: SatelliteId, is_d2: bool) -> Result<SatelliteId, Reason> {
    let fits = satellite.is_beidou_geostationary() == is_d2;
    fits.then_some(satellite).ok_or(Reason::NavLineOfWrongBeidouMessage)
}

/// The frame is the message of the API, and the string in it the sub-message.
fn glonass(head: &Head, receiver: ReceiverCheck) -> Result<GlonassLabel, Reason> {
    let name = match channel_only(3, head.svid) {
        Some((_, channel)) => GlonassName::Channel(channel),
        None => GlonassName::Slot(satellite(3, head.svid)?.number),
    };
    let string = u8::try_from(head.sub_message).ok().filter(|string| (1..=15).contains(string));
    Ok(GlonassLabel { name, frame: head.message, string, receiver })
}

/// Bytes as Java prints them, -128 to 127; unsigned ones will do.
fn message_bytes<'a>(fields: impl Iterator<Item = &'a [u8]>) -> Option<([u8; MAX_BYTES], usize)> {
    let mut bytes = [0; MAX_BYTES];
    let mut length = 0;
    for field in fields {
        let value = integer(field.trim_ascii())?;
        let byte = i8::try_from(value).map(i8::cast_unsigned).or_else(|_| u8::try_from(value)).ok()?;
        *bytes.get_mut(length)? = byte;
        length += 1;
    }
    Some((bytes, length))
}
