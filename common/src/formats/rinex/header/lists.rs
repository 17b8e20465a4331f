//! Lists in a header: observation types, scale factors, GLONASS channels.

use super::{HeaderBuilder, Scaled};
use crate::formats::decimal::{integer, real};
use crate::formats::rinex::types::{ObservationType, observation_type};
use crate::formats::rinex::types_2::SYSTEMS_2;
use crate::formats::text::{columns, words};
use crate::gnss::{Constellation, SatelliteId};

impl HeaderBuilder {
    pub(super) fn observation_types_2(&mut self, line: &[u8]) -> Option<()> {
        self.types_2.line(line)?;
        for constellation in SYSTEMS_2.into_iter().filter(|_| !self.types_2.is_empty()) {
            self.header.observation_types.insert(constellation, self.types_2.of(constellation));
        }
        Some(())
    }

    pub(super) fn observation_types(&mut self, line: &[u8]) -> Option<()> {
        let (constellation, mut remaining) = match *columns(line, 0, 1).first()? {
            b' ' => self.continued?,
            letter => {
                let count = usize::try_from(integer(columns(line, 3, 6))?).ok()?;
                let constellation = Constellation::from_letter(letter.to_ascii_uppercase() as char)?;
                self.header.observation_types.insert(constellation, Vec::new());
                (constellation, count)
            }
        };
        let types = self.header.observation_types.entry(constellation).or_default();
        for index in 0..remaining.min(13) {
            let code = columns(line, 6 + 4 * index, 10 + 4 * index).trim_ascii();
            types.push(observation_type(code)?);
            remaining -= 1;
        }
        self.continued = (remaining > 0).then_some((constellation, remaining));
        Some(())
    }

    pub(super) fn scale_factor(&mut self, line: &[u8]) -> Option<()> {
        let mut scaled = match *columns(line, 0, 1).first()? {
            b' ' => self.scaled?,
            letter => {
                let constellation = Constellation::from_letter(letter.to_ascii_uppercase() as char)?;
                let factor = real(columns(line, 2, 6)).filter(|f| *f >= 1.0)?;
                let listed = integer(columns(line, 8, 10)).unwrap_or(0);
                Scaled { constellation, factor, remaining: usize::try_from(listed).ok()? }
            }
        };
        let types = self.header.observation_types.get_mut(&scaled.constellation)?;
        if scaled.remaining == 0 {
            for observed in types {
                observed.scale = scaled.factor;
            }
            return Some(());
        }
        for index in 0..scaled.remaining.min(12) {
            let code = columns(line, 11 + 4 * index, 14 + 4 * index).trim_ascii();
            let wanted = observation_type(code)?;
            let is_wanted = |t: &&mut ObservationType| t.kind == wanted.kind && t.signal == wanted.signal;
            if let Some(found) = types.iter_mut().find(is_wanted) {
                found.scale = scaled.factor;
            }
            scaled.remaining -= 1;
        }
        self.scaled = (scaled.remaining > 0).then_some(scaled);
        Some(())
    }

    /// Slots and channels, taken word by word because some phones' loggers shift the columns by one.
    pub(super) fn glonass_slots(&mut self, line: &[u8]) {
        let mut slot = None;
        for word in words(columns(line, 3, 60)) {
            let named = word.first_chunk::<3>().and_then(|id| SatelliteId::from_bytes(*id));
            let channel = integer(word).and_then(|c| i8::try_from(c).ok());
            if let (Some(slot), Some(channel @ -7..=6)) = (slot, channel) {
                self.header.glonass_channels.insert(slot, channel);
            }
            slot = named.map(|satellite| satellite.number);
        }
    }
}
