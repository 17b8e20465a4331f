//! Directions of satellites by the phone against those by the orbits: a check of both that needs no truth.

use std::collections::BTreeSet;
use std::fmt;

use cofix_common::formats::phone::{LatestDirections, Quantiles, Typical};
use cofix_common::wire::EpochMessage;
use serde::Serialize;

/// Largest time between a report and the epoch, s: satellites move by up to a quarter of a degree meanwhile.
const CLOSE_S: f64 = 30.0;

/// Differences between the phone's directions and the orbits'.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DirectionReport {
    /// Satellites times epochs.
    pub compared: u64,
    /// Difference of elevation, degrees.
    pub elevation_deg: Typical,
    /// Difference across the line of sight: that of azimuth times the cosine of the elevation, degrees.
    pub across_deg: Typical,
}

/// Collects differences.
#[derive(Clone, Debug, Default)]
pub(super) struct Directions {
    elevation_deg: Quantiles,
    across_deg: Quantiles,
}

impl Directions {
    /// The satellites of an epoch with a position, against the phone's last report if that is of about the same time.
    pub(super) fn add(&mut self, message: &EpochMessage, latest: &LatestDirections) {
        let close = latest.after_epoch.is_some_and(|time| (message.time_gps - time).abs() <= CLOSE_S);
        if !close || message.wls.is_none() {
            return;
        }
        let mut compared = BTreeSet::new();
        for observation in &message.observations {
            let Some(said) = latest.by_satellite.get(&observation.satellite) else { continue };
            if !compared.insert(observation.satellite) {
                continue;
            }
            let ours = observation.direction;
            let (sine, cosine) = (said.azimuth_rad - ours.azimuth_rad).sin_cos();
            self.elevation_deg.add((said.elevation_rad - ours.elevation_rad).to_degrees());
            self.across_deg.add((sine.atan2(cosine) * ours.elevation_rad.cos()).to_degrees());
        }
    }

    pub(super) fn report(&self) -> Option<DirectionReport> {
        Some(DirectionReport {
            compared: self.elevation_deg.count(),
            elevation_deg: self.elevation_deg.typical()?,
            across_deg: self.across_deg.typical()?,
        })
    }
}

impl fmt::Display for DirectionReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { compared, elevation_deg, across_deg } = self;
        writeln!(
            f,
            "  directions  {compared} of the phone's against the orbits': elevation differs by {:.1}° in the median, 90 % within \
             {:.1}°; across by {:.1}°, {:.1}°",
            elevation_deg.median, elevation_deg.p90, across_deg.median, across_deg.p90
        )
    }
}
