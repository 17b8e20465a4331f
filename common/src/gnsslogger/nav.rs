//! `Nav` lines: pieces of navigation messages (Android API, `GnssNavigationMessage`).
//!
//! `Nav,Svid,Type,Status,MessageId,Sub-messageId,byte,byte,…` with bytes as signed decimal numbers.

use std::collections::VecDeque;

use super::signal::satellite;
use crate::atmosphere::KlobucharCoefficients;
use crate::decode::Record;
use crate::gnss::SatelliteId;
use crate::navbits::{InavAssembler, LnavAssembler, ReceiverCheck};
use crate::rinex::shorten;
use crate::skips::Skips;
use crate::time::GpsTime;

/// Message types: the constellation in the high byte, the message in the low one.
const GPS_L1CA: i64 = 0x0101;
const QZSS_L1CA: i64 = 0x0401;
const GALILEO_INAV: i64 = 0x0601;
/// Status: parity passed, and parity failed but the receiver could rebuild the words.
const PASSED: [i64; 2] = [1, 2];
/// Longest message, bytes.
const MAX_BYTES: usize = 64;
/// Messages that wait for the first epoch, which tells the week. Twelve satellites send two or three subframes in 12 s.
const MAX_WAITING: usize = 1_000;

/// Decodes `Nav` lines.
#[derive(Clone, Debug, Default)]
pub(super) struct NavLines {
    lnav: LnavAssembler,
    inav: InavAssembler,
    waiting: Vec<Message>,
}

#[derive(Clone, Copy, Debug)]
struct Message {
    number: u64,
    satellite: SatelliteId,
    kind: i64,
    receiver: ReceiverCheck,
    bytes: [u8; MAX_BYTES],
    length: usize,
}

impl NavLines {
    /// Klobuchar coefficients, the latest.
    pub(super) const fn klobuchar(&self) -> Option<KlobucharCoefficients> {
        self.lnav.system().klobuchar
    }

    /// Seconds that GPS time is ahead of UTC.
    pub(super) const fn leap_seconds(&self) -> Option<i64> {
        self.lnav.system().leap_seconds
    }

    /// Takes a line; an ephemeris that it completes goes to `records`. Without a time it waits.
    pub(super) fn line(
        &mut self,
        (number, line): (u64, &[u8]),
        now: Option<GpsTime>,
        skips: &mut Skips,
        records: &mut VecDeque<Record>,
    ) {
        let Some(message) = parse(number, line, skips) else { return };
        match now {
            Some(now) => {
                self.catch_up(now, skips, records);
                self.decode(&message, now, skips, records);
            }
            None if self.waiting.len() < MAX_WAITING => self.waiting.push(message),
            None => skips.add("Nav line long before the first epoch", || format!("line {number}")),
        }
    }

    /// Decodes what has waited for a time.
    pub(super) fn catch_up(&mut self, now: GpsTime, skips: &mut Skips, records: &mut VecDeque<Record>) {
        for message in std::mem::take(&mut self.waiting) {
            self.decode(&message, now, skips, records);
        }
    }

    /// Counts what has waited in vain.
    pub(super) fn finish(&mut self, skips: &mut Skips) {
        for message in std::mem::take(&mut self.waiting) {
            skips.add("Nav line without any epoch to tell the week", || format!("line {}", message.number));
        }
    }

    fn decode(&mut self, message: &Message, now: GpsTime, skips: &mut Skips, records: &mut VecDeque<Record>) {
        let Message { satellite, receiver, .. } = *message;
        let bytes = message.bytes.get(..message.length).unwrap_or_default();
        let result = match message.kind {
            GALILEO_INAV => self.inav.page(satellite, bytes, receiver, now),
            _ => self.lnav.subframe(satellite, bytes, receiver, now),
        };
        match result {
            Ok(Some(ephemeris)) => records.push_back(Record::Ephemeris(Box::new(ephemeris))),
            Ok(None) => {}
            Err(refused) => {
                skips.add(refused.reason, || format!("line {}: {}", message.number, refused.detail));
            }
        }
    }
}

fn parse(number: u64, line: &[u8], skips: &mut Skips) -> Option<Message> {
    let mut fields = line.split(|byte| *byte == b',').skip(1);
    let mut next = || std::str::from_utf8(fields.next()?.trim_ascii()).ok()?.parse::<i64>().ok();
    let (Some(svid), Some(kind), Some(status), Some(_), Some(_)) = (next(), next(), next(), next(), next())
    else {
        skips.add("Nav line cannot be read", || format!("line {number}: '{}'", shorten(line)));
        return None;
    };
    if ![GPS_L1CA, QZSS_L1CA, GALILEO_INAV].contains(&kind) {
        skips.add("Nav line of a message that is not decoded", || {
            format!("line {number}: type {kind}, Svid {svid}")
        });
        return None;
    }
    let satellite = match satellite(kind >> 8, svid) {
        Ok(satellite) => satellite,
        Err(reason) => {
            skips.add(reason, || format!("line {number}: Nav of type {kind}, Svid {svid}"));
            return None;
        }
    };
    let receiver = if PASSED.contains(&status) { ReceiverCheck::Passed } else { ReceiverCheck::Unknown };
    let Some((bytes, length)) = message_bytes(fields) else {
        skips.add("Nav line cannot be read", || format!("line {number}: '{}'", shorten(line)));
        return None;
    };
    Some(Message { number, satellite, kind, receiver, bytes, length })
}

/// Bytes as Java prints them, -128 to 127; unsigned ones will do.
fn message_bytes<'a>(fields: impl Iterator<Item = &'a [u8]>) -> Option<([u8; MAX_BYTES], usize)> {
    let mut bytes = [0; MAX_BYTES];
    let mut length = 0;
    for field in fields {
        let value: i16 = std::str::from_utf8(field.trim_ascii()).ok()?.parse().ok()?;
        let byte = i8::try_from(value).map(i8::cast_unsigned).or_else(|_| u8::try_from(value)).ok()?;
        *bytes.get_mut(length)? = byte;
        length += 1;
    }
    Some((bytes, length))
}
