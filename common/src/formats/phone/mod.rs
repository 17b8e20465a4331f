//! A phone's own positions (`Fix` lines) and the signals that it receives and uses (`Status` lines), counted in bounded memory.
//! Processing does not use them; they can be compared with the results of the measurements.

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

/// Counts positions and states of signals.
#[derive(Clone, Debug, Default)]
pub struct PhoneTally {
    fixes: BTreeMap<FixProvider, fixes::Tally>,
    statuses: statuses::Tally,
}

/// Counts of positions and states of signals.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PhoneReport {
    /// The phone's own positions by provider.
    pub fixes: Vec<FixReport>,
    /// Reception and use of signals, if the log tells.
    pub status: Option<StatusReport>,
}

impl PhoneTally {
    /// Takes positions and states of signals from a decoder.
    pub(crate) fn take(&mut self, fixes: Vec<Fix>, statuses: Vec<SignalStatus>) {
        for fix in fixes {
            self.fixes.entry(fix.provider).or_default().add(&fix);
        }
        for status in statuses {
            self.statuses.add(&status);
        }
    }

    /// Directions of satellites by the phone's last report.
    pub const fn directions(&self) -> &LatestDirections {
        self.statuses.directions()
    }

    /// The counts; `None` when there are none.
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
