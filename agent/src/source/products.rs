//! Products: from files, and from the navigation messages of a stream of observations.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use cofix_common::atmosphere::Ionex;
use cofix_common::formats::decode::Record;
use cofix_common::formats::stream::StreamDecoder;
use cofix_common::formats::text::content;
use cofix_common::gnss::{ObservationEpoch, SatelliteId};
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::{BiasFile, ClockFile, GlonassEphemeris, KeplerEphemeris, Products, Sp3};
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;

use crate::source::error::{SourceError, with_hint};
use crate::source::kinds;
use crate::{ProductFiles, ProductSource, Stop};

/// Age of group delays beyond which the user is told, s: they drift by a fraction of a nanosecond a month.
const STALE_GROUP_DELAYS_S: f64 = 7.0 * 86_400.0;

/// Columns of a RINEX header line.
const FIRST_LINE: usize = 80;

/// Products that were read.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The products. They may hold no orbits (see [`Products::has_orbits`]): recordings may carry navigation messages of their own.
    pub products: Arc<Products>,
    /// Lines and records that were skipped.
    pub skips: Skips,
    /// An instant of the session: the beginning of the precise orbits, else the earliest broadcast message.
    pub(crate) near: Option<GpsTime>,
}

impl Loaded {
    /// Reads the files that are named, if any.
    ///
    /// # Errors
    /// When a file cannot be read or is of another kind.
    pub fn read(source: &ProductSource) -> Result<Self, SourceError> {
        let (products, skips) = match source {
            ProductSource::Loaded(products) => (Arc::clone(products), Skips::default()),
            ProductSource::Files(files) => {
                let (products, skips) = load(files)?;
                (Arc::new(products), skips)
            }
        };
        Ok(Self { near: near(&products), products, skips })
    }
}

fn load(files: &ProductFiles) -> Result<(Products, Skips), SourceError> {
    let mut skips = Skips::default();
    let precise = parse_all(&files.sp3, "SP3", Sp3::parse)?;
    let broadcast = parse_all(&files.navigation, NAVIGATION, NavigationFile::parse)?;
    let clocks = parse_all(&files.clock, "RINEX clock", ClockFile::parse)?;
    let biases = parse_all(&files.bias, "Bias-SINEX", BiasFile::parse)?;
    let maps = parse_all(&files.ionex, "IONEX", Ionex::parse)?;
    let counted = precise.iter().map(|file| &file.skips).chain(broadcast.iter().map(|file| &file.skips));
    let counted = counted.chain(clocks.iter().map(|file| &file.skips));
    let counted = counted.chain(biases.iter().map(|file| &file.skips));
    for counted in counted.chain(maps.iter().map(|file| &file.skips)) {
        skips.merge(counted);
    }
    if let (true, Some(path)) = (precise.is_empty(), files.clock.first().or_else(|| files.bias.first())) {
        skips.add(Reason::ClocksWithoutSp3Orbits, || path.display().to_string());
    }
    let mut products = Products::new(precise, broadcast);
    products.add_clocks(clocks);
    for file in biases {
        products.add_biases(file);
    }
    for file in maps {
        products.add_ionosphere_maps(file);
    }
    Ok((products, skips))
}

/// The kind's name in errors.
pub(crate) const NAVIGATION: &str = "RINEX navigation";

/// Reads a RINEX navigation file.
pub(crate) fn navigation_file(path: &Path) -> Result<NavigationFile, SourceError> {
    parse(path, NAVIGATION, NavigationFile::parse)
}

/// Whether the first line is that of a RINEX navigation file; not for a file that cannot be read, whose reader will give the error.
pub(crate) fn is_navigation_file(path: &Path, stop: &Stop) -> bool {
    let start = kinds::start_of(path, stop);
    let start = content(&start);
    let label = start.get(60..FIRST_LINE);
    let kind = start.get(20).copied().unwrap_or(b' ').to_ascii_uppercase();
    label.is_some_and(|label| label.eq_ignore_ascii_case(b"RINEX VERSION / TYPE")) && b"NGHE".contains(&kind)
}

/// Reads files of one kind.
fn parse_all<T, E: Display>(
    paths: &[PathBuf],
    kind: &'static str,
    parse_bytes: impl Fn(&[u8]) -> Result<T, E>,
) -> Result<Vec<T>, SourceError> {
    paths.iter().map(|path| parse(path, kind, &parse_bytes)).collect()
}

fn parse<T, E: Display>(
    path: &Path,
    kind: &'static str,
    parse_bytes: impl Fn(&[u8]) -> Result<T, E>,
) -> Result<T, SourceError> {
    let bytes =
        std::fs::read(path).map_err(|cause| SourceError::Read { path: path.to_owned(), kind, cause })?;
    parse_bytes(&bytes).map_err(|error| {
        let reason = with_hint(error.to_string(), kinds::hint_for(path, kind));
        SourceError::Unusable { source_name: path.display().to_string(), kind, reason }
    })
}

/// The beginning of the precise orbits, else the earliest broadcast message.
fn near(products: &Products) -> Option<GpsTime> {
    let origin = GpsTime::default();
    let earliest = || products.group_delay_age_s(origin).map(|age_s| origin + age_s);
    products.coverage().map(|(first, _)| first).or_else(earliest)
}

/// Navigation messages found in a stream of observations.
#[derive(Clone, Debug, Default)]
pub struct OwnNavigation {
    /// The messages, as a navigation file would hold them.
    pub file: NavigationFile,
    /// GLONASS frequency channels by slot, as headers and observations tell them.
    pub glonass_channels: BTreeMap<u8, i8>,
    /// The messages that are there: streams repeat them every few seconds.
    known: BTreeSet<MessageKey>,
}

/// The identity of a message: satellite, kind, reference times of orbit and clock, issue of data, and the values that may
/// change without a new issue: health, accuracy, group delays, clock (Galileo's of E1 and of E5b may differ in the last bit).
type MessageKey = (SatelliteId, u8, GpsTime, GpsTime, u32, [u64; 5]);

impl OwnNavigation {
    /// Takes a record's ephemeris; returns its epoch, if it is one. Events are ignored.
    pub fn take(&mut self, record: Record) -> Option<ObservationEpoch> {
        match record {
            Record::Epoch(epoch) => return Some(epoch),
            Record::Ephemeris(ephemeris) => self.add_kepler(*ephemeris),
            Record::Glonass(ephemeris) => self.add_glonass(*ephemeris),
            Record::Event(_) => {}
        }
        None
    }

    fn add_kepler(&mut self, e: KeplerEphemeris) {
        let kind = e.message as u8;
        let (first, second) = e.group_delays_s;
        let rest = [e.health, e.accuracy_m, first, second, e.clock.0].map(f64::to_bits);
        if self.known.insert((e.satellite, kind, e.toe, e.toc, e.issue_of_data, rest)) {
            self.file.ephemerides.push(e);
        }
    }

    fn add_glonass(&mut self, e: GlonassEphemeris) {
        let health = u64::from(e.health.unwrap_or_default());
        if self.known.insert((e.satellite, 0, e.toe, e.toe, 0, [health, 0, 0, 0, 0])) {
            self.file.glonass.push(e);
        }
    }

    /// Takes the decoder's knowledge beside ephemerides: ionosphere terms, leap seconds, GLONASS channels.
    pub fn take_terms(&mut self, decoder: &StreamDecoder) {
        self.file.ionosphere = decoder.ionosphere();
        self.file.leap_seconds = decoder.leap_seconds();
        self.glonass_channels = decoder.glonass_channels();
    }

    /// Adds the recording's messages and terms to products.
    pub(crate) fn add_to(self, products: &mut Arc<Products>) {
        if !self.glonass_channels.is_empty() {
            Arc::make_mut(products).set_glonass_channels(&self.glonass_channels);
        }
        let terms = self.file.ionosphere;
        if !self.is_empty() || terms.gps.is_some() || terms.beidou.is_some() {
            Arc::make_mut(products).add_navigation(self.file);
        }
    }

    /// Adds those of another recording.
    pub fn extend(&mut self, other: Self) {
        self.glonass_channels.extend(other.glonass_channels);
        self.add_file(other.file);
    }

    /// Adds those of a navigation file.
    pub fn add_file(&mut self, file: NavigationFile) {
        file.ephemerides.into_iter().for_each(|ephemeris| self.add_kepler(ephemeris));
        file.glonass.into_iter().for_each(|ephemeris| self.add_glonass(ephemeris));
        let (mine, terms) = (&mut self.file.ionosphere, file.ionosphere);
        mine.gps = mine.gps.or(terms.gps);
        mine.beidou = mine.beidou.or(terms.beidou);
        mine.galileo = mine.galileo.or(terms.galileo);
        self.file.leap_seconds = self.file.leap_seconds.or(file.leap_seconds);
    }

    /// Whether there is no ephemeris.
    pub const fn is_empty(&self) -> bool {
        self.file.ephemerides.is_empty() && self.file.glonass.is_empty()
    }
}

/// Counts the shortcomings of the products for an epoch: precise orbits, clocks and biases beyond their ends, and, at the first epoch, old
/// group delays.
pub(crate) fn note_shortcomings(time_gps: GpsTime, is_first: bool, products: &Products, skips: &mut Skips) {
    for (reason, coverage) in [
        (Reason::EpochOutsideOrbits, products.coverage()),
        (Reason::EpochOutsideClocks, products.clock_coverage()),
        (Reason::EpochOutsideBiases, products.bias_coverage()),
    ] {
        if let Some((first, last)) = coverage
            && (time_gps < first || time_gps > last)
        {
            skips.add(reason, || format!("{time_gps}; they cover {first} to {last}"));
        }
    }
    if is_first
        && let Some(near) = near(products)
        && time_gps.rollover_weeks_to(near).is_some()
    {
        skips.add(Reason::RecordingOffBy1024Weeks, || format!("{time_gps}{}", time_gps.rollover_hint(near)));
    }
    if is_first
        && let Some(age_s) = products.group_delay_age_s(time_gps)
        && age_s > STALE_GROUP_DELAYS_S
    {
        skips.add(Reason::GroupDelaysOld, || format!("{:.1} days at {time_gps}", age_s / 86_400.0));
    }
}

#[cfg(test)]
mod tests {
    use cofix_common::orbit::NavigationFile;

    use super::*;

    const GALILEO: &str = "     3.05           N: GNSS NAV DATA    E: GALILEO          RINEX VERSION / TYPE
                                                            END OF HEADER
E12 2024 06 24 08 20 00-1.095227780752E-03-1.594457899046E-11 0.000000000000E+00
     6.700000000000E+01 1.359062500000E+02 2.740828452221E-09 1.818462909708E+00
     6.115064024925E-06 4.236079985276E-04 7.338821887970E-07 5.440608266830E+03
     1.164000000000E+05-3.539025783539E-08 1.566556240144E+00 5.587935447693E-09
     9.967372953892E-01 3.393125000000E+02 8.146038365252E-01-5.710952169795E-09
     8.214627886510E-11 5.170000000000E+02 2.320000000000E+03
     3.120000000000E+00 0.000000000000E+00-8.614733815193E-09-8.847564458847E-09
     1.170650000000E+05
";

    /// Of a recorded day: new group delays in a message that is otherwise the one before.
    #[test]
    fn messages_are_kept_once_but_what_is_new_in_them_is_news() {
        let file = |text: &str| NavigationFile::parse(text.as_bytes()).unwrap();
        let delays = "-8.614733815193E-09-8.847564458847E-09";
        let mut own = OwnNavigation::default();
        own.add_file(file(GALILEO));
        own.add_file(file(GALILEO));
        assert_eq!(own.file.ephemerides.len(), 1);
        own.add_file(file(&GALILEO.replace(delays, "-9.546056389809E-09-9.546056389809E-09")));
        assert_eq!(own.file.ephemerides.len(), 2);
        own.add_file(file(&GALILEO.replace("-1.095227780752E-03", "-1.095227722544E-03")));
        own.add_file(file(&GALILEO.replace("3.120000000000E+00", "4.120000000000E+00")));
        assert_eq!(own.file.ephemerides.len(), 4, "clocks by another signal, and accuracies, are too");
    }
}
