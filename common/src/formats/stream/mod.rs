//! One decoder for every format: it recognises the stream and hands it to the decoder of its kind.

mod observation_stream;
pub(super) mod table;
mod unknown;

use std::collections::BTreeMap;

use super::decode::{Decoder, Record, WrongStream};
use super::format::Format;
use super::gnsslogger;
use super::phone::PhoneTally;
use super::rinex::{Equipment, ObservationHeader};
use super::rtcm::StreamDates;
use crate::frames::Ecef;
use crate::measurement::RecordedEpoch;
use crate::orbit::IonosphereTerms;
use crate::skips::Skips;
use crate::time::{GpsTime, SECONDS_PER_WEEK};
pub use observation_stream::ObservationStream;
use table::{Opening, Row};

/// A stream is recognised within this many bytes.
pub const BYTES_TO_RECOGNISE: usize = 65_536;
/// A stream that was interrupted this often before it was recognised is given up.
const STARTS_TO_RECOGNISE: u32 = 12;

static NOTHING: Skips = Skips::new();

/// The text format whose beginning this is, if it can be told yet. RTCM 3 is not recognised here but by its first valid
/// frame. `ended`: nothing more will come.
///
/// RINEX files of other kinds count as [`Format::Rinex`]: its decoder names the kind.
pub fn recognise_text(start: &[u8], ended: bool) -> Option<Format> {
    table::recognise_text(start, ended).map(|row| row.format)
}

/// Decodes a stream of any format that is read.
#[derive(Debug)]
pub struct StreamDecoder {
    state: State,
    opening: Opening,
    phone: PhoneTally,
}

#[derive(Debug)]
enum State {
    /// Not recognised yet. The probes, decoders of formats that are known by their frames, have had all the bytes.
    Open {
        start: Vec<u8>,
        probes: Vec<(&'static Row, Box<dyn ObservationStream>)>,
        /// How often the stream was interrupted after some bytes.
        false_starts: u32,
    },
    Recognised(Format, Box<dyn ObservationStream>),
}

impl StreamDecoder {
    /// At the beginning of a stream. `near` is an instant within three days of its beginning, which RTCM 3 needs: its
    /// messages carry the time of week only.
    pub fn new(near: GpsTime) -> Self {
        Self::opening(Opening { near, dates: None, log: gnsslogger::Options::default() })
    }

    /// At the beginning of a recording whose dates, if it is RTCM 3, have been found.
    pub fn dated(dates: &StreamDates) -> Self {
        let near = dates.begins();
        Self::opening(Opening { near, dates: Some(dates.clone()), log: gnsslogger::Options::default() })
    }

    fn opening(opening: Opening) -> Self {
        let probes = table::probes(&opening);
        let state = State::Open { start: Vec::new(), probes, false_starts: 0 };
        Self { state, opening, phone: PhoneTally::default() }
    }

    /// The same for GnssLogger text read in another way than by default.
    #[must_use]
    pub fn with_log_options(mut self, log: gnsslogger::Options) -> Self {
        self.opening.log = log;
        self
    }

    /// A decoder for another stream that is read in the same way.
    #[must_use]
    pub fn renewed(&self, near: GpsTime) -> Self {
        Self::new(near).with_log_options(self.opening.log.clone())
    }

    /// The format, once it is recognised.
    pub const fn format(&self) -> Option<Format> {
        match &self.state {
            State::Open { .. } => None,
            State::Recognised(format, _) => Some(*format),
        }
    }

    fn stream(&self) -> Option<&dyn ObservationStream> {
        match &self.state {
            State::Open { .. } => None,
            State::Recognised(_, stream) => Some(stream.as_ref()),
        }
    }

    /// The phone's own positions and states of signals in GnssLogger text, up to now.
    pub const fn phone(&self) -> &PhoneTally {
        &self.phone
    }

    /// Ionosphere terms that the stream itself carries.
    pub fn ionosphere(&self) -> IonosphereTerms {
        self.stream().map(ObservationStream::ionosphere).unwrap_or_default()
    }

    /// See [`ObservationStream::recorded_epoch`].
    pub fn recorded_epoch(&self) -> Option<&RecordedEpoch> {
        self.stream()?.recorded_epoch()
    }

    /// The same where it has satellite states and corrections of its own.
    pub fn recorded_corrections(&self) -> Option<&RecordedEpoch> {
        self.recorded_epoch().filter(|epoch| epoch.has_corrections())
    }

    /// Seconds that GPS time is ahead of UTC by the stream itself.
    pub fn leap_seconds(&self) -> Option<i64> {
        self.stream()?.leap_seconds()
    }

    /// GLONASS frequency channels by slot, as far as the stream tells them.
    pub fn glonass_channels(&self) -> BTreeMap<u8, i8> {
        self.stream().map(ObservationStream::glonass_channels).unwrap_or_default()
    }

    /// The header of a RINEX stream as it began, once it is complete.
    pub fn first_header(&self) -> Option<&ObservationHeader> {
        self.stream()?.first_header()
    }

    /// The header of a RINEX stream with the changes by events, once it is complete.
    pub fn header(&self) -> Option<&ObservationHeader> {
        self.stream()?.header()
    }

    /// See [`ObservationStream::station`].
    pub fn station(&self) -> Option<Ecef> {
        self.stream()?.station()
    }

    /// Where the recording was made, roughly: [`Self::station`], or the first own position of the phone.
    pub fn approximate_position(&self) -> Option<Ecef> {
        self.stream()?.approximate_position()
    }

    /// Receiver, antenna and people of the recording, as far as the stream tells.
    pub fn equipment(&self) -> Equipment {
        self.stream().map(ObservationStream::equipment).unwrap_or_default()
    }

    /// The next bytes do not continue those before: a connection was lost.
    ///
    /// # Errors
    /// As [`Decoder::feed`], and when the stream was interrupted a dozen times before it could be recognised.
    pub fn interrupt(&mut self) -> Result<(), WrongStream> {
        match &mut self.state {
            State::Open { start, false_starts, .. } => {
                *false_starts += u32::from(!start.is_empty());
                if *false_starts >= STARTS_TO_RECOGNISE && !start.is_empty() {
                    return Err(WrongStream { reason: unknown::unknown(start) });
                }
                start.clear();
            }
            State::Recognised(_, stream) => stream.interrupt()?,
        }
        self.listen();
        Ok(())
    }

    /// Takes the phone's own positions and states of signals, so that memory does not grow.
    fn listen(&mut self) {
        if let State::Recognised(_, stream) = &mut self.state {
            stream.tell_phone(&mut self.phone);
        }
    }

    /// Hands bytes to the stream's decoder, once it is known.
    fn take(&mut self, bytes: &[u8], ended: bool) -> Result<(), WrongStream> {
        let State::Open { start, probes, .. } = &mut self.state else {
            return match &mut self.state {
                State::Recognised(_, stream) => stream.feed(bytes),
                State::Open { .. } => Ok(()),
            };
        };
        start.extend_from_slice(bytes);
        for (_, probe) in probes.iter_mut() {
            // Its own verdict comes later than ours; what it skipped counts only if it is the decoder of the stream.
            let _ = probe.feed(bytes);
        }
        if let Some(row) = table::recognise_text(start, ended) {
            let mut stream = (row.open)(&self.opening);
            let fed = stream.feed(start);
            self.state = State::Recognised(row.format, stream);
            return fed;
        }
        if let Some(at) = probes.iter().position(|(_, probe)| probe.is_recognised()) {
            // The probe has had these bytes already.
            let (row, probe) = probes.swap_remove(at);
            self.state = State::Recognised(row.format, probe);
            return Ok(());
        }
        if ended || start.len() >= BYTES_TO_RECOGNISE || unknown::is_packed(start) {
            return Err(WrongStream { reason: unknown::unknown(start) });
        }
        Ok(())
    }
}

impl Decoder for StreamDecoder {
    fn feed(&mut self, bytes: &[u8]) -> Result<(), WrongStream> {
        self.take(bytes, false)?;
        self.listen();
        Ok(())
    }

    fn finish(&mut self) -> Result<(), WrongStream> {
        if let State::Open { probes, .. } = &mut self.state {
            for (_, probe) in probes {
                // A frame may wait behind noise that looks like a longer one.
                let _ = probe.finish();
            }
            self.take(b"", true)?;
        }
        self.listen();
        match &mut self.state {
            State::Open { .. } => Ok(()),
            State::Recognised(_, stream) => stream.finish(),
        }
    }

    fn next_record(&mut self) -> Option<Record> {
        let State::Recognised(_, stream) = &mut self.state else { return None };
        let mut record = stream.next_record()?;
        if let Record::Epoch(epoch) = &mut record
            && !stream.shifts_weeks_itself()
        {
            epoch.time_gps = epoch.time_gps + self.opening.log.shift_weeks as f64 * SECONDS_PER_WEEK;
        }
        Some(record)
    }

    fn skips(&self) -> &Skips {
        match &self.state {
            State::Open { probes, .. } => probes.first().map_or(&NOTHING, |(_, probe)| probe.skips()),
            State::Recognised(_, stream) => stream.skips(),
        }
    }
}
