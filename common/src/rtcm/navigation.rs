//! Messages about satellites and the station: ephemerides 1019, 1020, 1042, 1044 to 1046, positions 1005 and 1006.

use super::{RtcmDecoder, ephemeris, glonass, station};
use crate::decode::Record;

impl RtcmDecoder {
    pub(super) fn ephemeris(&mut self, bytes: &[u8], number: u32) {
        match ephemeris::decode(bytes, number, self.clock.near) {
            Ok(ephemeris) => {
                let known = self.ephemerides.insert((ephemeris.satellite, number), ephemeris);
                if !known.is_some_and(|known| known.is_same_as(&ephemeris)) {
                    self.records.push_back(Record::Ephemeris(Box::new(ephemeris)));
                }
            }
            Err(fault) => self.faulty_ephemeris(bytes, number, fault),
        }
    }

    fn faulty_ephemeris(&mut self, bytes: &[u8], number: u32, fault: ephemeris::Fault) {
        match fault {
            ephemeris::Fault::TooShort => self.too_short(bytes, number),
            ephemeris::Fault::Impossible(detail) => {
                self.skips.add("ephemeris with impossible values", || format!("message {number}: {detail}"));
            }
        }
    }

    pub(super) fn glonass_ephemeris(&mut self, bytes: &[u8]) {
        if let Ok((slot, channel)) = glonass::channel(bytes) {
            self.glonass_channels.insert(slot, channel);
        }
        match glonass::decode(bytes, &self.clock, self.told_time) {
            Ok(ephemeris) => {
                let known = self.glonass_ephemerides.insert(ephemeris.satellite.number, ephemeris);
                if known != Some(ephemeris) {
                    self.records.push_back(Record::Glonass(Box::new(ephemeris)));
                }
            }
            Err(fault) => self.faulty_ephemeris(bytes, 1020, fault),
        }
    }

    pub(super) fn station_position(&mut self, bytes: &[u8], number: u32) {
        match station::decode(bytes, number) {
            Ok(station) => self.station = Some(station),
            Err(ephemeris::Fault::TooShort) => self.too_short(bytes, number),
            Err(ephemeris::Fault::Impossible(detail)) => {
                self.skips.add("station position that cannot be", || format!("message {number}: {detail}"));
            }
        }
    }
}
