//! What a phone says of itself in its log, beside its measurements: its own positions (`Fix` lines), and which signals it
//! receives and uses (`Status` lines). Nothing of it is used in processing; it is told, in bounded memory, so that it can be
//! held against what comes of the measurements.

mod fixes;
mod quantiles;
mod statuses;

use std::collections::BTreeMap;
use std::fmt;

use crate::formats::gnsslogger::{Fix, FixProvider, SignalStatus};
use serde::Serialize;

pub use fixes::FixReport;
pub use quantiles::{Quantiles, Typical};
pub use statuses::{LatestDirections, StatusReport, SystemStatus};

/// Counts what the phone says.
#[derive(Clone, Debug, Default)]
pub struct PhoneTally {
    fixes: BTreeMap<FixProvider, fixes::Tally>,
    statuses: statuses::Tally,
}

/// What the phone said.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PhoneReport {
    /// Its own positions, by where they came from.
    pub fixes: Vec<FixReport>,
    /// What it did with signals, when it said so.
    pub status: Option<StatusReport>,
}

impl PhoneTally {
    /// Takes what has come out of a decoder.
    pub(crate) fn take(&mut self, fixes: Vec<Fix>, statuses: Vec<SignalStatus>) {
        for fix in fixes {
            self.fixes.entry(fix.provider).or_default().add(&fix);
        }
        for status in statuses {
            self.statuses.add(&status);
        }
    }

    /// Where the phone last said that satellites are.
    pub const fn directions(&self) -> &LatestDirections {
        self.statuses.directions()
    }

    /// What it said; `None` when it said nothing.
    pub fn report(&self) -> Option<PhoneReport> {
        let fixes: Vec<_> = self.fixes.iter().map(|(provider, tally)| tally.report(*provider)).collect();
        let status = self.statuses.report();
        (!fixes.is_empty() || status.is_some()).then_some(PhoneReport { fixes, status })
    }
}

impl fmt::Display for PhoneReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.fixes.iter().try_for_each(|fix| write!(f, "{fix}"))?;
        self.status.iter().try_for_each(|status| write!(f, "{status}"))
    }
}
