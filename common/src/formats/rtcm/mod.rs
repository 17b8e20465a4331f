//! RTCM 3 streams: observations (MSM4 to MSM7, and the legacy messages 1002, 1004, 1010 and 1012), ephemerides and the station's
//! position, by RTCM 10403.3.
//!
//! Where a stream has both kinds of observations of an epoch, those of MSM are used and the others counted.
//!
//! ```
//! use cofix_common::formats::decode::Decoder;
//! use cofix_common::formats::rtcm::{RtcmDecoder, RtcmOptions};
//! let near = "2020-08-13T12:00:00".parse()?;
//! let mut decoder = RtcmDecoder::new(RtcmOptions::near(near));
//! # let portion = [0xd3, 0x00, 0x00, 0x47, 0xea, 0x4b];
//! decoder.feed(&portion)?;
//! while let Some(record) = decoder.next_record() {
//!     println!("{record:?}");
//! }
//! println!("{}", decoder.skips());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod admission;
mod clock;
mod date;
mod dating;
mod descriptors;
mod ephemeris;
mod epoch;
mod frame;
mod gate;
mod glonass;
mod legacy;
mod lock;
mod msm;
mod navigation;
mod signals;
mod stated;
mod station;

pub use date::FIRST_WEEK;
pub use dating::{Dating, DatingHint, StreamDates};
pub use station::Station;

use std::collections::{BTreeMap, VecDeque};

use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::formats::bits::Bits;
use crate::formats::decode::{Decoder, Record, WrongStream};
use crate::formats::rinex::Equipment;
use crate::formats::time_order::TimeOrder;
use crate::gnss::{Constellation, LossOfLock, Observation, ObservationEpoch, SatelliteId};
use crate::orbit::{GlonassEphemeris, KeplerEphemeris};
use crate::skips::{Reason, Skips};
use crate::time::{GpsTime, leap_seconds_at};
use clock::SentTime;
use epoch::{Family, Part};

/// After this many bytes without a frame the stream is not RTCM 3. A line may be noisy at the start, but not for so long.
const MAX_BYTES_BEFORE_FIRST_FRAME: u64 = 65_536;
/// Nearer than this (m) no satellite is.
const MIN_PSEUDORANGE_M: f64 = 1e6;
/// DF394: the last number of the satellite mask is reserved in every system.
const MAX_SATELLITE: u8 = 63;
/// QZSS satellites of the mask.
const MAX_QZSS: u8 = 10;
/// What a stream is counted in.
const UNIT: &str = "frame";
/// What a stream does not say itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RtcmOptions {
    /// An instant within three days of the stream's first message: messages carry the time of week only.
    pub near: GpsTime,
    /// GPS − UTC, s, for GLONASS messages, whose time is UTC + 3 h.
    pub leap_seconds: u8,
}

impl RtcmOptions {
    /// A stream that begins near an instant, with the leap seconds of then. UTC is behind by seconds only: the number is the same
    /// except around a leap second itself.
    pub fn near(near: GpsTime) -> Self {
        Self { near, leap_seconds: u8::try_from(leap_seconds_at(near)).unwrap_or(0) }
    }

    fn clock(self) -> clock::StreamClock {
        // Before 1980 there is no GPS time; at the end of the counter there is no room left to calculate.
        let near = self.near.clamp(GpsTime::default(), GpsTime::from_nanos(i64::MAX / 2));
        clock::StreamClock::near(near, self.leap_seconds)
    }
}

/// Decodes an RTCM 3 stream.
#[derive(Clone, Debug)]
pub struct RtcmDecoder {
    framer: frame::Framer,
    clock: clock::StreamClock,
    dates: date::Dates,
    /// Where the stream's dates are known to begin anew: frame and instant, in order.
    known_dates: VecDeque<(u64, GpsTime)>,
    gate: gate::Gate,
    assembler: epoch::Assembler,
    order: TimeOrder,
    locks: lock::LockTimes,
    legacy: legacy::Memory,
    glonass_channels: BTreeMap<u8, i8>,
    /// The last one of each satellite and message number: streams repeat them.
    ephemerides: BTreeMap<(SatelliteId, u32), KeplerEphemeris>,
    glonass_ephemerides: BTreeMap<u8, GlonassEphemeris>,
    station: Option<Station>,
    equipment: Equipment,
    records: VecDeque<Record>,
    skips: Skips,
}

impl RtcmDecoder {
    /// A decoder at the beginning of a stream.
    pub fn new(options: RtcmOptions) -> Self {
        Self {
            framer: frame::Framer::default(),
            clock: options.clock(),
            dates: date::Dates::default(),
            known_dates: VecDeque::new(),
            gate: gate::Gate::default(),
            assembler: epoch::Assembler::default(),
            order: TimeOrder::of(UNIT),
            locks: lock::LockTimes::default(),
            legacy: legacy::Memory::default(),
            glonass_channels: BTreeMap::new(),
            ephemerides: BTreeMap::new(),
            glonass_ephemerides: BTreeMap::new(),
            station: None,
            equipment: Equipment::default(),
            records: VecDeque::new(),
            skips: Skips::default(),
        }
    }

    /// The same for a recording whose dates have been found before.
    #[must_use]
    pub fn with_dates(mut self, dates: &StreamDates) -> Self {
        self.clock.move_near(dates.begins());
        self.known_dates = dates.changes().iter().copied().collect();
        self
    }

    /// Valid frames so far, of whatever message.
    pub const fn frames(&self) -> u64 {
        self.framer.frames()
    }

    /// GLONASS frequency channels by slot, as far as the stream has told them: MSM5, MSM7, 1010 and 1012 −7…6, 1020 up to 13.
    pub const fn glonass_channels(&self) -> &BTreeMap<u8, i8> {
        &self.glonass_channels
    }

    /// The station that the stream's observations are from, by the last message 1005 or 1006.
    pub const fn station(&self) -> Option<Station> {
        self.station
    }

    /// Receiver and antenna of the station, as far as messages 1007, 1008 and 1033 tell.
    pub const fn equipment(&self) -> &Equipment {
        &self.equipment
    }

    fn drain(&mut self, ended: bool) {
        while let Some(message) = self.framer.next(ended, MAX_BYTES_BEFORE_FIRST_FRAME, &mut self.skips) {
            self.follow_known_dates();
            self.message(&message);
        }
    }

    fn follow_known_dates(&mut self) {
        let frame = self.framer.frames();
        while let Some((_, time)) = self.known_dates.pop_front_if(|(begins, _)| *begins <= frame) {
            self.begin_at(time);
        }
    }

    /// An error when too many bytes (at the end: any) have come without a frame.
    fn check_kind(&self, ended: bool) -> Result<(), WrongStream> {
        let outside = self.framer.outside();
        let hopeless = outside >= MAX_BYTES_BEFORE_FIRST_FRAME || ended && outside > 0;
        if self.framer.frames() > 0 || !hopeless {
            return Ok(());
        }
        Err(WrongStream {
            reason: format!(
                "no RTCM 3 frame (0xD3, length, CRC-24Q) in the first {outside} bytes; give a raw RTCM 3 stream"
            ),
        })
    }

    fn message(&mut self, bytes: &[u8]) {
        let Ok(number) = Bits::new(bytes).unsigned(12) else {
            self.skips.add(Reason::FrameWithoutMessage, || format!("{} bytes", bytes.len()));
            return;
        };
        match (msm_kind(number), number) {
            (Some((Constellation::Sbas, _)), _) => {
                self.skips.add(Reason::SbasObservationsNotUsed, || format!("message {number}"));
            }
            (Some((constellation, level)), _) => self.observations(bytes, number, constellation, level),
            (None, _) if legacy::is_legacy(number) => self.legacy_observations(bytes, number),
            (None, 1019 | 1042 | 1044..=1046) => self.ephemeris(bytes, number),
            (None, 1020) => self.glonass_ephemeris(bytes),
            (None, 1005 | 1006) => self.station_position(bytes, number),
            (None, 1007 | 1008 | 1033) => self.station_equipment(bytes, number),
            _ => {
                self.skips.add_about(Reason::MessageNotRead, number, || format!("{} bytes", bytes.len()));
            }
        }
    }

    fn observations(&mut self, bytes: &[u8], number: u32, constellation: Constellation, level: msm::Level) {
        let message = match msm::decode(bytes, constellation, level) {
            Ok(message) => message,
            Err(msm::Fault::TooShort) => return self.too_short(bytes, number),
            Err(msm::Fault::TooManyCells(cells)) => {
                self.skips.add(Reason::MessageWithTooManySignals, || format!("message {number}: {cells}"));
                return;
            }
        };
        let Some(time) = self.admitted(bytes, constellation, message.sent) else { return };
        let observations =
            message.cells.iter().filter_map(|cell| self.observation(time, &message, cell)).collect();
        let part = Part { time, family: Family::Msm, more_follow: message.more_follow, observations };
        let complete = self.assembler.add(part, &mut self.skips);
        self.give(complete.into_iter().flatten());
    }

    /// Hands over epochs that are complete, unless they have to wait for the next one. Only a stream that was set back, which
    /// is counted already, brings one from before: it begins anew.
    fn give(&mut self, complete: impl IntoIterator<Item = ObservationEpoch>) {
        for epoch in complete {
            if self.order.refuses(epoch.time_gps).is_some() {
                self.order = TimeOrder::of(UNIT);
            }
            let frame = self.framer.frames();
            self.order
                .epoch((frame, epoch), None, &mut self.skips, &mut |record| self.records.push_back(record));
        }
    }

    fn station_equipment(&mut self, bytes: &[u8], number: u32) {
        match descriptors::decode(bytes, number) {
            Ok(equipment) => self.equipment.fill(&equipment),
            Err(_) => self.too_short(bytes, number),
        }
    }

    fn too_short(&mut self, bytes: &[u8], number: u32) {
        self.skips.add(Reason::MessageTooShort, || format!("message {number}: {} bytes", bytes.len()));
    }

    fn observation(
        &mut self,
        time: GpsTime,
        message: &msm::Message,
        cell: &msm::Cell,
    ) -> Option<Observation> {
        let constellation = message.constellation;
        let satellite = SatelliteId::new(constellation, cell.satellite);
        let limit = if constellation == Constellation::Qzss { MAX_QZSS } else { MAX_SATELLITE };
        if cell.satellite > limit {
            self.skips.add(Reason::ReservedSatelliteNumber, || format!("{satellite} at {time}"));
            return None;
        }
        let Some(signal) = signals::signal(constellation, cell.signal) else {
            self.skips.add(Reason::ReservedSignalNumber, || {
                format!("{satellite} signal {} at {time}", cell.signal)
            });
            return None;
        };
        if let Some(channel) = cell.glonass_channel {
            self.glonass_channels.insert(cell.satellite, channel);
        }
        let channel = self.glonass_channels.get(&cell.satellite).copied();
        let frequency_hz = signal.frequency_hz(constellation, channel);
        if frequency_hz.is_none() && (cell.phase_s().is_some() || cell.rate_mps.is_some()) {
            self.skips.add(Reason::PhaseWithoutGlonassChannel, || format!("{satellite} {signal} at {time}"));
        }
        let pseudorange_m = cell.code_s().map(|travel_s| travel_s * SPEED_OF_LIGHT_MPS);
        if pseudorange_m.is_some_and(|p| p < MIN_PSEUDORANGE_M) {
            self.skips.add(Reason::PseudorangeTooShort, || format!("{satellite} {signal} at {time}"));
            return None;
        }
        let has_phase = cell.phase_s().is_some();
        let loss_of_lock = LossOfLock {
            cycle_slip: self.locks.lost((satellite, signal), time, cell.lock, has_phase),
            half_cycle: cell.half_cycle && has_phase,
            ..LossOfLock::default()
        };
        let observation = Observation {
            satellite,
            signal,
            pseudorange_m,
            carrier_phase_cycles: cell.phase_s().zip(frequency_hz).map(|(travel_s, f)| travel_s * f),
            doppler_hz: cell.rate_mps.zip(frequency_hz).map(|(rate, f)| -rate * f / SPEED_OF_LIGHT_MPS),
            cn0_dbhz: cell.cn0_dbhz,
            loss_of_lock,
        };
        let any = pseudorange_m.is_some()
            || observation.carrier_phase_cycles.is_some()
            || observation.doppler_hz.is_some()
            || observation.cn0_dbhz.is_some();
        any.then_some(observation)
    }
}

/// System and time of an observation message; `None` for any other message, and for one that ends before its time.
fn sent_time(bytes: &[u8]) -> Option<(Constellation, SentTime)> {
    let mut bits = Bits::new(bytes);
    let number = bits.unsigned(12).ok()?;
    bits.skip(12); // station
    if let Some((constellation, _)) = msm_kind(number) {
        return Some((constellation, SentTime::of_msm(&mut bits, constellation).ok()?));
    }
    let constellation = legacy::constellation(number)?;
    Some((constellation, SentTime::of_legacy(&mut bits, constellation).ok()?))
}

/// System and resolution of a multiple signal message (RTCM 10403.3, list of messages).
const fn msm_kind(number: u32) -> Option<(Constellation, msm::Level)> {
    let constellation = match number / 10 {
        107 => Constellation::Gps,
        108 => Constellation::Glonass,
        109 => Constellation::Galileo,
        110 => Constellation::Sbas,
        111 => Constellation::Qzss,
        112 => Constellation::Beidou,
        _ => return None,
    };
    let level = match number % 10 {
        4 => msm::Level::Msm4,
        5 => msm::Level::Msm5,
        6 => msm::Level::Msm6,
        7 => msm::Level::Msm7,
        _ => return None,
    };
    Some((constellation, level))
}

impl Decoder for RtcmDecoder {
    fn feed(&mut self, bytes: &[u8]) -> Result<(), WrongStream> {
        self.check_kind(false)?;
        self.framer.push(bytes);
        self.drain(false);
        self.check_kind(false)
    }

    fn finish(&mut self) -> Result<(), WrongStream> {
        self.drain(true);
        self.release_waiting();
        let last = self.assembler.finish(&mut self.skips);
        self.give(last);
        self.order.finish(None, &mut self.skips, &mut |record| self.records.push_back(record));
        self.check_kind(true)
    }

    fn next_record(&mut self) -> Option<Record> {
        self.records.pop_front()
    }

    fn skips(&self) -> &Skips {
        &self.skips
    }
}
