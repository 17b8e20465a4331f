//! Whole navigation files, RINEX 2, 3 and 4.

use std::collections::BTreeMap;

use super::RinexError;
use super::navigation_decoder::{Found, NavigationDecoder};
use crate::formats::packing::decompress;
use crate::gnss::Constellation;
use crate::orbit::NavigationFile;
use crate::skips::Reason;
use crate::time::GpsTime;

impl NavigationFile {
    /// Reads a whole file, plain or compressed (.gz, .Z).
    ///
    /// # Errors
    /// When the compression is damaged or the header is not that of a navigation file; damaged records are counted
    /// in [`NavigationFile::skips`].
    pub fn parse(bytes: &[u8]) -> Result<Self, RinexError> {
        let bytes = decompress(bytes)?;
        let mut decoder = NavigationDecoder::default();
        let (mut kepler, mut glonass) = (Vec::new(), Vec::new());
        decoder.whole(&bytes, |found| match found {
            Found::Kepler(sent, ephemeris) => kepler.push((sent, ephemeris)),
            Found::Glonass(ephemeris) => glonass.push(ephemeris),
        })?;
        // Of messages that differ in health alone the unhealthy one comes last, and so will be in force.
        kepler.sort_by(|(a, x), (b, y)| a.cmp(b).then(x.health.total_cmp(&y.health)));
        glonass.sort_by_key(|ephemeris| (ephemeris.toe, !ephemeris.is_healthy()));
        let mut file = Self {
            ephemerides: kepler.into_iter().map(|(_, ephemeris)| ephemeris).collect(),
            glonass,
            ionosphere: decoder.ionosphere(),
            leap_seconds: decoder.leap_seconds(),
            skips: decoder.skips().clone(),
        };
        file.name_systems_of_other_weeks();
        Ok(file)
    }

    /// A receiver that does not roll over the week of one system dates all of that system's messages 1,024 weeks from the others'.
    fn name_systems_of_other_weeks(&mut self) {
        let kepler = self.ephemerides.iter().map(|e| (e.satellite.constellation, e.toe));
        let glonass = self.glonass.iter().map(|e| (e.satellite.constellation, e.toe));
        let mut latest: BTreeMap<Constellation, (GpsTime, u64)> = BTreeMap::new();
        for (constellation, toe) in kepler.chain(glonass) {
            let (last, count) = latest.entry(constellation).or_insert((toe, 0));
            *last = toe.max(*last);
            *count += 1;
        }
        let of_all = latest.values().map(|(last, _)| *last).max();
        for (constellation, (last, count)) in &latest {
            if let Some(weeks) = of_all.and_then(|of_all| last.rollover_weeks_to(of_all)) {
                self.skips.add(Reason::WeeksNotRolledOver, || {
                    let letter = constellation.letter();
                    format!("{count} records of {letter} up to {last}; {weeks} weeks later they would fit the others")
                });
            }
        }
    }
}
