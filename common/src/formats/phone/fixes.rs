//! The phone's own positions.

use std::fmt;

use crate::formats::gnsslogger::{Fix, FixProvider};
use crate::time::GpsTime;
use serde::Serialize;

use super::quantiles::{Quantiles, Typical};

/// The phone's own positions from one provider.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FixReport {
    /// The provider: `gnss`, `fused`, `network` or `other`.
    pub provider: &'static str,
    /// Number of positions.
    pub count: u64,
    /// Time of the earliest position, GPS time.
    pub first_gps: String,
    /// Time of the latest position, GPS time.
    pub last_gps: String,
    /// Time from the earliest to the latest position, s.
    pub span_s: f64,
    /// Horizontal accuracy (68 %) as the phone states it, m.
    pub accuracy_m: Option<Typical>,
}

/// Counts positions.
#[derive(Clone, Debug, Default)]
pub(super) struct Tally {
    count: u64,
    span: Option<(GpsTime, GpsTime)>,
    accuracy_m: Quantiles,
}

impl Tally {
    pub(super) fn add(&mut self, fix: &Fix) {
        self.count += 1;
        let time = fix.time_gps;
        let (first, last) = self.span.unwrap_or((time, time));
        self.span = Some((first.min(time), last.max(time)));
        if let Some(accuracy_m) = fix.accuracy_m {
            self.accuracy_m.add(accuracy_m);
        }
    }

    pub(super) fn report(&self, provider: FixProvider) -> FixReport {
        let text = |time: Option<GpsTime>| time.map(GpsTime::iso).unwrap_or_default();
        FixReport {
            provider: match provider {
                FixProvider::Gnss => "gnss",
                FixProvider::Fused => "fused",
                FixProvider::Network => "network",
                FixProvider::Other => "other",
            },
            count: self.count,
            first_gps: text(self.span.map(|(first, _)| first)),
            last_gps: text(self.span.map(|(_, last)| last)),
            span_s: self.span.map_or(0.0, |(first, last)| last - first),
            accuracy_m: self.accuracy_m.typical(),
        }
    }
}

impl fmt::Display for FixReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { provider, count, first_gps, last_gps, .. } = self;
        write!(f, "  own fixes   {provider} {count}, {first_gps} to {last_gps} GPST")?;
        match self.accuracy_m {
            Some(Typical { median, p90 }) => {
                writeln!(f, "; stated accuracy {median:.1} m in the median, 90 % within {p90:.1} m")
            }
            None => writeln!(f, "; without an accuracy"),
        }
    }
}
