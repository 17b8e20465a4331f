//! Legacy observation messages, written bit by bit.

use cofix_common::formats::decode::Record;
use cofix_common::gnss::{Observation, ObservationEpoch};
use cofix_common::skips::Skips;
use rtcm_rs::util::DataVec;

use super::{TOW_MS, Writer, decode};

/// 14:19:53 GPST is 17:19:35 in Moscow.
pub const MOSCOW_MS: u32 = ((17 * 60 + 19) * 60 + 35) * 1_000;
pub const LIGHT_MS_M: f64 = 299_792.458;
pub const NO_PHASE: i64 = 0x8_0000;
pub const NO_CODE: i64 = 0x2000;

/// One satellite, numbers as sent.
#[derive(Clone, Copy, Debug)]
pub struct Sent {
    pub number: u64,
    pub indicator: u64,
    pub channel: u64,
    pub code: u64,
    pub phase: i64,
    pub lock: u64,
    pub ambiguity: u64,
    pub cn0: u64,
    pub second: Second,
}

#[derive(Clone, Copy, Debug)]
pub struct Second {
    pub indicator: u64,
    pub code: i64,
    pub phase: i64,
    pub lock: u64,
    pub cn0: u64,
}

/// 70 ms of travel and 1000 m, or of GLONASS twice that.
pub const SENT: Sent = Sent {
    number: 7,
    indicator: 0,
    channel: 12,
    code: 50_000,
    phase: 2_000,
    lock: 127,
    ambiguity: 70,
    cn0: 170,
    second: Second { indicator: 0, code: -100, phase: -3_000, lock: 127, cn0: 150 },
};

pub fn is_glonass(message: u64) -> bool {
    message > 1_008
}

pub fn write(message: u64, time_ms: u32, more: u64, satellites: &[Sent]) -> Writer {
    let glonass = is_glonass(message);
    let start = Writer::default()
        .unsigned(12, message)
        .unsigned(12, 42)
        .unsigned(if glonass { 27 } else { 30 }, time_ms.into())
        .unsigned(1, more)
        .unsigned(5, satellites.len() as u64)
        .unsigned(4, 0);
    satellites.iter().fold(start, |writer, sent| satellite(writer, message, sent))
}

pub fn satellite(writer: Writer, message: u64, sent: &Sent) -> Writer {
    let glonass = is_glonass(message);
    let has_second = (message - 1) % 4 >= 2;
    let mut writer = writer.unsigned(6, sent.number).unsigned(1, sent.indicator);
    if glonass {
        writer = writer.unsigned(5, sent.channel);
    }
    writer = writer
        .unsigned(if glonass { 25 } else { 24 }, sent.code)
        .twos_complement(20, sent.phase)
        .unsigned(7, sent.lock);
    let extended = message.is_multiple_of(2);
    if extended {
        writer = writer.unsigned(if glonass { 7 } else { 8 }, sent.ambiguity).unsigned(8, sent.cn0);
    }
    if !has_second {
        return writer;
    }
    let second = &sent.second;
    writer = writer
        .unsigned(2, second.indicator)
        .twos_complement(14, second.code)
        .twos_complement(20, second.phase)
        .unsigned(7, second.lock);
    if extended { writer.unsigned(8, second.cn0) } else { writer }
}

pub fn message(message: u64, seconds: u32, more: u64, satellites: &[Sent]) -> Vec<u8> {
    let start = if is_glonass(message) { MOSCOW_MS } else { TOW_MS };
    write(message, start + seconds * 1_000, more, satellites).frame()
}

pub fn epochs(frames: &[Vec<u8>]) -> (Vec<ObservationEpoch>, Skips) {
    let (records, skips) = decode(&[&frames.concat()]);
    let epochs = records.into_iter().filter_map(|record| match record {
        Record::Epoch(epoch) => Some(epoch),
        Record::Ephemeris(_) | Record::Glonass(_) | Record::Event(_) => None,
    });
    (epochs.collect(), skips)
}

pub fn names(epoch: &ObservationEpoch) -> String {
    let name = |o: &Observation| format!("{}-{}", o.satellite, o.signal);
    epoch.observations.iter().map(name).collect::<Vec<_>>().join(" ")
}

/// The nearest number of units.
pub fn raw(value: f64, unit: f64) -> i64 {
    #[allow(clippy::cast_possible_truncation)] // tests stay far below
    let raw = (value / unit).round() as i64;
    raw
}

pub fn list<T: Default + Clone, const N: usize>(items: impl IntoIterator<Item = T>) -> DataVec<T, N> {
    let mut list = DataVec::new();
    items.into_iter().for_each(|item| list.push(item));
    list
}
