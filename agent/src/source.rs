//! Files become observations and products.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use cofix_common::gnss::ObservationEpoch;
use cofix_common::orbit::{Products, Sp3};
use cofix_common::rinex::{NavigationFile, ObservationFile};
use cofix_common::skips::Skips;

use crate::{ProductSource, Source};

/// A file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// It cannot be read.
    #[error("{}: cannot read the {kind} file: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What it should be.
        kind: &'static str,
        /// Why.
        cause: std::io::Error,
    },
    /// It is not what it should be.
    #[error("{}: not usable as {kind} file: {reason}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What it should be.
        kind: &'static str,
        /// What the parser says.
        reason: String,
    },
    /// There is no product at all.
    #[error("no orbits: name at least one SP3 or RINEX navigation file")]
    NoProducts,
}

/// Epochs in order of time, and what was skipped in reading them.
#[derive(Clone, Debug)]
pub struct Observations {
    /// The epochs.
    pub epochs: Arc<Vec<ObservationEpoch>>,
    /// What was skipped.
    pub skips: Skips,
}

/// Reads a source of observations.
///
/// # Errors
/// When the file cannot be read, is no RINEX observation file, or holds no epoch.
pub fn observations(source: &Source) -> Result<Observations, SourceError> {
    let path = match source {
        Source::Epochs(epochs) => {
            return Ok(Observations { epochs: Arc::clone(epochs), skips: Skips::default() });
        }
        Source::File(path) => path,
    };
    let kind = "RINEX observation";
    let file = ObservationFile::parse(&read(path, kind)?).map_err(|e| unusable(path, kind, e.to_string()))?;
    if file.epochs.is_empty() {
        let skips = if file.skips.is_empty() { String::new() } else { format!(": {}", file.skips) };
        return Err(unusable(path, kind, format!("it holds no epoch{skips}")));
    }
    Ok(Observations { epochs: Arc::new(file.epochs), skips: file.skips })
}

/// Reads products.
///
/// # Errors
/// When a file cannot be read or is of another kind, or when none is named.
pub fn products(source: &ProductSource) -> Result<(Arc<Products>, Skips), SourceError> {
    match source {
        ProductSource::Loaded(products) => Ok((Arc::clone(products), Skips::default())),
        ProductSource::Files { sp3, navigation } => load(sp3, navigation),
    }
}

/// Group delays drift by a fraction of a nanosecond a month; older ones serve, but the user should know.
const STALE_GROUP_DELAYS_S: f64 = 7.0 * 86_400.0;

/// Notes what the products lack for these epochs: precise orbits beyond their ends, recent group delays.
pub fn note_shortcomings(epochs: &[ObservationEpoch], products: &Products, skips: &mut Skips) {
    count_uncovered(epochs, products, skips);
    let Some(first) = epochs.first() else { return };
    if let Some(age_s) = products.group_delay_age_s(first.time_gps)
        && age_s > STALE_GROUP_DELAYS_S
    {
        skips.add("group delays more than a week from the observations, used all the same", || {
            format!("{:.1} days at {}", age_s / 86_400.0, first.time_gps)
        });
    }
}

/// Counts the epochs that the precise orbits do not cover: beyond them only broadcast orbits can serve.
fn count_uncovered(epochs: &[ObservationEpoch], products: &Products, skips: &mut Skips) {
    let Some((first, last)) = products.coverage() else { return };
    for epoch in epochs.iter().filter(|epoch| epoch.time_gps < first || epoch.time_gps > last) {
        skips.add("epoch outside the SP3 orbits", || {
            format!("{}; they cover {first} to {last}", epoch.time_gps)
        });
    }
}

fn load(sp3: &[PathBuf], navigation: &[PathBuf]) -> Result<(Arc<Products>, Skips), SourceError> {
    if sp3.is_empty() && navigation.is_empty() {
        return Err(SourceError::NoProducts);
    }
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
    Ok((Arc::new(Products::new(precise, broadcast)), skips))
}

fn read(path: &Path, kind: &'static str) -> Result<Vec<u8>, SourceError> {
    std::fs::read(path).map_err(|cause| SourceError::Read { path: path.to_owned(), kind, cause })
}

fn unusable(path: &Path, kind: &'static str, reason: String) -> SourceError {
    SourceError::Unusable { path: path.to_owned(), kind, reason }
}
