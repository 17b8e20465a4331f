//! Messages about satellites and the station: ephemerides 1019, 1020, 1042, 1044 to 1046, positions 1005 and 1006.

use super::date::{Claim, Dated};
use super::{RtcmDecoder, ephemeris, glonass, station};
use crate::formats::decode::Record;
use crate::skips::Reason;
use crate::time::GpsTime;

/// A GLONASS date farther from the stream than this is not believed before another satellite confirms it, s.
const DATE_LIMIT_S: f64 = 4.0 * 86_400.0;
impl RtcmDecoder {
    pub(super) fn ephemeris(&mut self, bytes: &[u8], number: u32) {
        match ephemeris::read(bytes, number) {
            Ok(sent) => {
                let toe = self.dated(&sent.claim()).toe;
                let ephemeris = sent.dated(toe);
                let known = self.ephemerides.insert((ephemeris.satellite, number), ephemeris);
                if !known.is_some_and(|known| known.is_same_as(&ephemeris)) {
                    self.records.push_back(Record::Ephemeris(Box::new(ephemeris)));
                }
            }
            Err(fault) => self.faulty_ephemeris(bytes, number, fault),
        }
    }

    /// Where a date that an ephemeris states is in the stream's time, and the stream by it.
    fn dated(&mut self, claim: &Claim) -> Dated {
        let now = self.clock.now();
        let dated = if self.clock.is_running() {
            self.dates.beside_observations(claim, now)
        } else {
            self.dates.alone(claim, now)
        };
        if let Some(weeks) = dated.weeks_ahead.filter(|weeks| *weeks != 0) {
            self.skips.add(Reason::EphemeridesOfOtherWeekThanDate, || {
                let satellite = claim.satellite;
                format!("{satellite} and one before it: {weeks} weeks from {now}")
            });
        }
        if let Some(time) = dated.now {
            self.clock.move_near(time);
        }
        dated
    }

    fn faulty_ephemeris(&mut self, bytes: &[u8], number: u32, fault: ephemeris::Fault) {
        match fault {
            ephemeris::Fault::TooShort => self.too_short(bytes, number),
            ephemeris::Fault::Impossible(detail) => {
                self.skips.add(Reason::EphemerisImpossible, || format!("message {number}: {detail}"));
            }
        }
    }

    pub(super) fn glonass_ephemeris(&mut self, bytes: &[u8]) {
        if let Ok((slot, channel)) = glonass::channel(bytes) {
            self.glonass_channels.insert(slot, channel);
        }
        match glonass::read(bytes) {
            Ok(sent) => self.add_glonass(sent),
            Err(fault) => self.faulty_ephemeris(bytes, 1020, fault),
        }
    }

    fn add_glonass(&mut self, sent: glonass::Sent) {
        let Some(toe) = self.glonass_toe(&sent) else { return };
        let ephemeris = sent.dated(toe);
        let known = self.glonass_ephemerides.insert(ephemeris.satellite.number, ephemeris);
        if known != Some(ephemeris) {
            self.records.push_back(Record::Glonass(Box::new(ephemeris)));
        }
    }

    /// Until observations have told the time, the date that it states counts, if the stream is not far from there; afterwards the nearest day.
    fn glonass_toe(&mut self, sent: &glonass::Sent) -> Option<GpsTime> {
        if !self.clock.is_running()
            && let Some(claim) = sent.claim(&self.clock)
        {
            let Dated { toe, now, .. } = self.dated(&claim);
            if now.is_some() || (toe - self.clock.now()).abs() <= DATE_LIMIT_S {
                return Some(toe);
            }
        }
        sent.on_nearest_day(&self.clock)
    }

    pub(super) fn station_position(&mut self, bytes: &[u8], number: u32) {
        match station::decode(bytes, number) {
            Ok(station) => self.station = Some(station),
            Err(ephemeris::Fault::TooShort) => self.too_short(bytes, number),
            Err(ephemeris::Fault::Impossible(detail)) => {
                self.skips.add(Reason::StationPositionImpossible, || format!("message {number}: {detail}"));
            }
        }
    }
}
