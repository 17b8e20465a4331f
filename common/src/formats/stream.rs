//! One decoder for every format: it recognises the stream and hands it to the decoder of its kind.

use std::collections::BTreeMap;

use crate::formats::decode::{Decoder, Record, WrongStream};
use crate::formats::gnsslogger::{self, Fix, GnssLoggerDecoder};
use crate::formats::gsdc::DerivedDecoder;
use crate::formats::rinex::{Equipment, ObservationDecoder, ObservationHeader};
use crate::formats::rtcm::{RtcmDecoder, RtcmOptions, StreamDates};
use crate::formats::whu::SpareLogDecoder;
use crate::frames::Ecef;
use crate::measurement::RecordedEpoch;
use crate::orbit::IonosphereTerms;
use crate::skips::Skips;
use crate::time::{GpsTime, SECONDS_PER_WEEK};

use super::format::{self, Format};
use super::phone::PhoneTally;

/// A stream is recognised within this many bytes.
pub const BYTES_TO_RECOGNISE: usize = 65_536;
/// Interrupted so often before it was recognised, a stream will never be.
const STARTS_TO_RECOGNISE: u32 = 12;

/// Decodes a stream of any format that is read.
#[derive(Clone, Debug)]
pub struct StreamDecoder {
    kind: Kind,
    log: gnsslogger::Options,
    phone: PhoneTally,
}

#[derive(Clone, Debug)]
enum Kind {
    /// Not recognised yet. The probe has got all the bytes.
    Open {
        start: Vec<u8>,
        probe: Box<RtcmDecoder>,
        /// How often it was interrupted after some bytes.
        false_starts: u32,
    },
    Rinex(Format, Box<ObservationDecoder>),
    GnssLogger(Box<GnssLoggerDecoder>),
    Rtcm3(Box<RtcmDecoder>),
    ChallengeTable(Box<DerivedDecoder>),
    SpareLog(Box<SpareLogDecoder>),
}

fn rtcm(near: GpsTime) -> RtcmDecoder {
    RtcmDecoder::new(RtcmOptions::near(near))
}

impl StreamDecoder {
    /// At the beginning of a stream. `near` is an instant within three days of its beginning, which RTCM 3 needs: its
    /// messages carry the time of week only.
    pub fn new(near: GpsTime) -> Self {
        Self::probing(rtcm(near))
    }

    /// At the beginning of a recording whose dates, if it is RTCM 3, have been found.
    pub fn dated(dates: &StreamDates) -> Self {
        Self::probing(rtcm(dates.begins()).with_dates(dates))
    }

    fn probing(probe: RtcmDecoder) -> Self {
        Self {
            kind: Kind::Open { start: Vec::new(), probe: Box::new(probe), false_starts: 0 },
            log: gnsslogger::Options::default(),
            phone: PhoneTally::default(),
        }
    }

    /// The same for GnssLogger text read in another way than by default.
    #[must_use]
    pub fn with_log_options(self, log: gnsslogger::Options) -> Self {
        Self { log, ..self }
    }

    /// A decoder for another stream that is read in the same way.
    #[must_use]
    pub fn renewed(&self, near: GpsTime) -> Self {
        Self::new(near).with_log_options(self.log.clone())
    }

    /// The format, once it is recognised.
    pub fn format(&self) -> Option<Format> {
        match &self.kind {
            Kind::Open { .. } => None,
            Kind::Rinex(format, _) => Some(*format),
            Kind::GnssLogger(_) => Some(Format::GnssLogger),
            Kind::Rtcm3(_) => Some(Format::Rtcm3),
            Kind::ChallengeTable(_) => Some(Format::ChallengeTable),
            Kind::SpareLog(_) => Some(Format::SpareLog),
        }
    }

    /// What the phone says of itself in GnssLogger text, up to now.
    pub const fn phone(&self) -> &PhoneTally {
        &self.phone
    }

    /// Ionosphere terms that the stream itself carries.
    pub fn ionosphere(&self) -> IonosphereTerms {
        match &self.kind {
            Kind::GnssLogger(decoder) => decoder.ionosphere(),
            _ => IonosphereTerms { gps: None, beidou: None, galileo: None },
        }
    }

    /// The epoch of the last record with what the stream states beyond observations, if it does: satellite states and
    /// corrections (challenge tables, GnssLogger text since 2022), GLONASS satellites known by their channel only.
    pub const fn recorded_epoch(&self) -> Option<&RecordedEpoch> {
        match &self.kind {
            Kind::ChallengeTable(decoder) => decoder.last_epoch(),
            Kind::GnssLogger(decoder) => decoder.last_recorded(),
            _ => None,
        }
    }

    /// The same where it has satellite states and corrections of its own.
    pub fn recorded_corrections(&self) -> Option<&RecordedEpoch> {
        self.recorded_epoch().filter(|epoch| epoch.has_corrections())
    }

    /// Seconds that GPS time is ahead of UTC by the stream itself.
    pub fn leap_seconds(&self) -> Option<i64> {
        match &self.kind {
            Kind::GnssLogger(decoder) => decoder.leap_seconds(),
            Kind::Rinex(_, decoder) => decoder.header().and_then(|header| header.leap_seconds),
            _ => None,
        }
    }

    /// GLONASS frequency channels by slot, as far as the stream tells them.
    pub fn glonass_channels(&self) -> BTreeMap<u8, i8> {
        match &self.kind {
            Kind::GnssLogger(decoder) => decoder.glonass_channels().clone(),
            Kind::Rtcm3(decoder) => decoder.glonass_channels().clone(),
            Kind::Rinex(_, decoder) => {
                decoder.header().map(|header| header.glonass_channels.clone()).unwrap_or_default()
            }
            _ => BTreeMap::new(),
        }
    }

    /// The header of a RINEX stream as it began, once it is complete.
    pub fn first_header(&self) -> Option<&ObservationHeader> {
        match &self.kind {
            Kind::Rinex(_, decoder) => decoder.first_header(),
            _ => None,
        }
    }

    /// The header of a RINEX stream with what events changed in it, once it is complete.
    pub fn header(&self) -> Option<&ObservationHeader> {
        match &self.kind {
            Kind::Rinex(_, decoder) => decoder.header(),
            _ => None,
        }
    }

    /// Where the antenna is, as far as the stream states it: of RTCM 3 by messages 1005 and 1006, of RINEX by its header, which
    /// promises an approximate position only.
    pub fn station(&self) -> Option<Ecef> {
        match &self.kind {
            Kind::Rtcm3(decoder) => decoder.station().map(|station| station.position),
            _ => self.header().and_then(|header| header.approximate_position),
        }
    }

    /// Where the recording was made, roughly: [`Self::station`], or the first own position of the phone.
    pub fn approximate_position(&self) -> Option<Ecef> {
        match &self.kind {
            Kind::GnssLogger(decoder) => decoder.own_fix().map(Fix::position),
            _ => self.station(),
        }
    }

    /// What the recording was made with, as far as the stream tells: headers of RINEX and GnssLogger text, RTCM messages 1007, 1008
    /// and 1033.
    pub fn equipment(&self) -> Equipment {
        match &self.kind {
            Kind::Rinex(_, decoder) => {
                decoder.first_header().map(|header| header.equipment.clone()).unwrap_or_default()
            }
            Kind::Rtcm3(decoder) => decoder.equipment().clone(),
            Kind::GnssLogger(decoder) => {
                decoder.device().map_or_else(Equipment::default, |device| Equipment {
                    receiver_type: device.name(),
                    receiver_version: device.software(),
                    ..Equipment::default()
                })
            }
            _ => Equipment::default(),
        }
    }

    /// What follows does not continue what came before: a connection was lost. Ends a cut line, so that it spoils no
    /// other; frames of RTCM 3 find their own beginning.
    ///
    /// # Errors
    /// As [`Decoder::feed`], and when the stream was interrupted a dozen times before it could be recognised.
    pub fn interrupt(&mut self) -> Result<(), WrongStream> {
        match &mut self.kind {
            Kind::Open { start, false_starts, .. } => {
                *false_starts += u32::from(!start.is_empty());
                if *false_starts >= STARTS_TO_RECOGNISE && !start.is_empty() {
                    return Err(WrongStream { reason: format::unknown(start) });
                }
                start.clear();
                Ok(())
            }
            Kind::Rtcm3(_) => Ok(()),
            _ => self.feed(b"\n"),
        }
    }

    fn decoder(&mut self) -> &mut dyn Decoder {
        match &mut self.kind {
            Kind::Open { probe, .. } => probe.as_mut(),
            Kind::Rinex(_, decoder) => decoder.as_mut(),
            Kind::GnssLogger(decoder) => decoder.as_mut(),
            Kind::Rtcm3(decoder) => decoder.as_mut(),
            Kind::ChallengeTable(decoder) => decoder.as_mut(),
            Kind::SpareLog(decoder) => decoder.as_mut(),
        }
    }

    /// Takes what the phone says of itself, so that it does not pile up.
    fn listen(&mut self) {
        if let Kind::GnssLogger(decoder) = &mut self.kind {
            self.phone.take(decoder);
        }
    }

    /// Recognises the stream, if it can be recognised, and hands over what came so far.
    fn recognise(&mut self, bytes: &[u8], ended: bool) -> Result<(), WrongStream> {
        let Kind::Open { start, probe, .. } = &mut self.kind else { return Ok(()) };
        start.extend_from_slice(bytes);
        // Its own verdict comes later than ours; what it skipped counts only if it is the one.
        let _ = probe.feed(bytes);
        let text = format::recognise_text(start, ended);
        let kind = match text {
            Some(format @ (Format::Rinex | Format::CompactRinex)) => Kind::Rinex(format, Box::default()),
            Some(Format::GnssLogger) => Kind::GnssLogger(Box::new(GnssLoggerDecoder::new(self.log.clone()))),
            Some(Format::ChallengeTable) => {
                let decoder = DerivedDecoder::new(self.log.masks.clone());
                Kind::ChallengeTable(Box::new(decoder.with_shift(self.log.shift_weeks)))
            }
            Some(Format::SpareLog) => Kind::SpareLog(Box::default()),
            Some(Format::Rtcm3) | None if probe.frames() > 0 => Kind::Rtcm3(probe.clone()),
            Some(Format::Rtcm3) | None
                if ended || start.len() >= BYTES_TO_RECOGNISE || format::is_packed(start) =>
            {
                return Err(WrongStream { reason: format::unknown(start) });
            }
            Some(Format::Rtcm3) | None => return Ok(()),
        };
        let start = std::mem::take(start);
        self.kind = kind;
        // The probe has had these bytes already.
        if matches!(self.kind, Kind::Rtcm3(_)) { Ok(()) } else { self.decoder().feed(&start) }
    }
}

impl Decoder for StreamDecoder {
    fn feed(&mut self, bytes: &[u8]) -> Result<(), WrongStream> {
        match &self.kind {
            Kind::Open { .. } => self.recognise(bytes, false)?,
            _ => self.decoder().feed(bytes)?,
        }
        self.listen();
        Ok(())
    }

    fn finish(&mut self) -> Result<(), WrongStream> {
        if let Kind::Open { probe, .. } = &mut self.kind {
            // A frame may wait behind noise that looks like a longer one.
            let _ = probe.finish();
        }
        self.recognise(b"", true)?;
        self.listen();
        self.decoder().finish()
    }

    fn next_record(&mut self) -> Option<Record> {
        if matches!(self.kind, Kind::Open { .. }) {
            return None;
        }
        let mut record = self.decoder().next_record()?;
        // GnssLogger text and tables take the weeks into account themselves; RTCM 3 has none.
        if let (Record::Epoch(epoch), Kind::Rinex(..) | Kind::SpareLog(_)) = (&mut record, &self.kind) {
            epoch.time_gps = epoch.time_gps + self.log.shift_weeks as f64 * SECONDS_PER_WEEK;
        }
        Some(record)
    }

    fn skips(&self) -> &Skips {
        match &self.kind {
            Kind::Open { probe, .. } => probe.skips(),
            Kind::Rinex(_, decoder) => decoder.skips(),
            Kind::GnssLogger(decoder) => decoder.skips(),
            Kind::Rtcm3(decoder) => decoder.skips(),
            Kind::ChallengeTable(decoder) => decoder.skips(),
            Kind::SpareLog(decoder) => decoder.skips(),
        }
    }
}
