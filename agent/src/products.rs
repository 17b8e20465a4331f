//! Orbits and the rest: from files, and from what a stream of observations carries itself.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use cofix_common::decode::Record;
use cofix_common::gnss::ObservationEpoch;
use cofix_common::orbit::{Products, Sp3};
use cofix_common::rinex::{IonosphereTerms, NavigationFile};
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;

use crate::ProductSource;
use crate::source::SourceError;
use crate::stream::StreamDecoder;

/// Group delays drift by a fraction of a nanosecond a month; older ones serve, but the user should know.
const STALE_GROUP_DELAYS_S: f64 = 7.0 * 86_400.0;

/// Reads products.
///
/// # Errors
/// When a file cannot be read or is of another kind, or when none is named.
pub fn products(source: &ProductSource) -> Result<(Arc<Products>, Skips), SourceError> {
    let loaded = Loaded::read(source)?;
    if loaded.is_none() { Err(SourceError::NoProducts) } else { Ok((loaded.products, loaded.skips)) }
}

/// Products, and what came with them.
#[derive(Clone, Debug)]
pub(crate) struct Loaded {
    pub(crate) products: Arc<Products>,
    pub(crate) skips: Skips,
    /// An instant of the session, as far as the products tell.
    pub(crate) near: Option<GpsTime>,
    files: usize,
}

impl Loaded {
    /// Reads the files that are named, which may be none: a stream may carry its own ephemerides.
    pub(crate) fn read(source: &ProductSource) -> Result<Self, SourceError> {
        match source {
            ProductSource::Loaded(products) => Ok(Self {
                products: Arc::clone(products),
                skips: Skips::default(),
                near: near(products),
                files: 1,
            }),
            ProductSource::Files { sp3, navigation } => load(sp3, navigation),
        }
    }

    /// Whether no file was named.
    pub(crate) const fn is_none(&self) -> bool {
        self.files == 0
    }
}

fn load(sp3: &[PathBuf], navigation: &[PathBuf]) -> Result<Loaded, SourceError> {
    let mut skips = Skips::default();
    let mut precise = Vec::with_capacity(sp3.len());
    for path in sp3 {
        let file = Sp3::parse(&read(path, "SP3")?).map_err(|e| unusable(path, "SP3", e.to_string()))?;
        skips.merge(&file.skips);
        precise.push(file);
    }
    let mut broadcast = Vec::with_capacity(navigation.len());
    for path in navigation {
        let kind = "RINEX navigation";
        let file =
            NavigationFile::parse(&read(path, kind)?).map_err(|e| unusable(path, kind, e.to_string()))?;
        skips.merge(&file.skips);
        broadcast.push(file);
    }
    let products = Products::new(precise, broadcast);
    let near = near(&products);
    Ok(Loaded { products: Arc::new(products), skips, near, files: sp3.len() + navigation.len() })
}

/// The beginning of the precise orbits, else the earliest broadcast message.
fn near(products: &Products) -> Option<GpsTime> {
    let origin = GpsTime::default();
    let earliest = || products.group_delay_age_s(origin).map(|age_s| origin + age_s);
    products.coverage().map(|(first, _)| first).or_else(earliest)
}

fn read(path: &Path, kind: &'static str) -> Result<Vec<u8>, SourceError> {
    std::fs::read(path).map_err(|cause| SourceError::Read { path: path.to_owned(), kind, cause })
}

fn unusable(path: &Path, kind: &'static str, reason: String) -> SourceError {
    SourceError::Unusable { source_name: path.display().to_string(), kind, reason }
}

/// Navigation messages found in a stream of observations.
#[derive(Clone, Debug, Default)]
pub struct OwnNavigation {
    /// The messages, as a navigation file would hold them.
    pub file: NavigationFile,
}

impl OwnNavigation {
    /// Takes a record's ephemeris; gives back the epoch of any other record.
    pub fn take(&mut self, record: Record) -> Option<ObservationEpoch> {
        match record {
            Record::Epoch(epoch) => return Some(epoch),
            Record::Ephemeris(ephemeris) => self.file.ephemerides.push(*ephemeris),
            Record::Glonass(ephemeris) => self.file.glonass.push(*ephemeris),
        }
        None
    }

    /// Takes what the decoder knows beside ephemerides.
    pub fn take_terms(&mut self, decoder: &StreamDecoder) {
        self.file.ionosphere = IonosphereTerms { gps: decoder.ionosphere(), ..IonosphereTerms::default() };
        self.file.leap_seconds = decoder.leap_seconds();
    }

    /// Adds what another recording carried.
    pub fn extend(&mut self, other: Self) {
        self.file.ephemerides.extend(other.file.ephemerides);
        self.file.glonass.extend(other.file.glonass);
        self.file.ionosphere.gps = self.file.ionosphere.gps.or(other.file.ionosphere.gps);
        self.file.leap_seconds = self.file.leap_seconds.or(other.file.leap_seconds);
    }

    /// Whether there is no ephemeris.
    pub const fn is_empty(&self) -> bool {
        self.file.ephemerides.is_empty() && self.file.glonass.is_empty()
    }
}

/// Notes for what an epoch the products lack: precise orbits beyond their ends, recent group delays (at the first epoch).
pub(crate) fn note_shortcomings(time_gps: GpsTime, is_first: bool, products: &Products, skips: &mut Skips) {
    if let Some((first, last)) = products.coverage()
        && (time_gps < first || time_gps > last)
    {
        skips.add("epoch outside the SP3 orbits", || format!("{time_gps}; they cover {first} to {last}"));
    }
    if is_first
        && let Some(age_s) = products.group_delay_age_s(time_gps)
        && age_s > STALE_GROUP_DELAYS_S
    {
        skips.add("group delays more than a week from the observations, used all the same", || {
            format!("{:.1} days at {time_gps}", age_s / 86_400.0)
        });
    }
}
