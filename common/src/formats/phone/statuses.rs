//! Signals that the phone receives and uses.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use crate::formats::gnsslogger::SignalStatus;
use crate::frames::Direction;
use crate::gnss::{Constellation, SatelliteId};
use crate::time::GpsTime;
use serde::Serialize;

/// Reception and use of signals.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StatusReport {
    /// Number of reports, each of one line per signal.
    pub reports: u64,
    /// By system.
    pub systems: Vec<SystemStatus>,
}

/// Reception and use of one system's signals, mean numbers over all reports.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SystemStatus {
    /// RINEX letter.
    pub system: char,
    /// Satellites in any report.
    pub satellites: usize,
    /// Signals in a report, received or not.
    pub listed: f64,
    /// Signals received, that is with a C/N0.
    pub received: f64,
    /// Signals used in the phone's position.
    pub used_in_fix: f64,
    /// Signals of satellites whose ephemeris the phone has.
    pub with_ephemeris: f64,
}

/// Directions of satellites by the phone's last report.
#[derive(Clone, Debug, Default)]
pub struct LatestDirections {
    report: u64,
    /// The last epoch before the report.
    pub after_epoch: Option<GpsTime>,
    /// The directions that the phone knows.
    pub by_satellite: BTreeMap<SatelliteId, Direction>,
}

#[derive(Clone, Debug, Default)]
struct System {
    satellites: BTreeSet<SatelliteId>,
    listed: u64,
    received: u64,
    used_in_fix: u64,
    with_ephemeris: u64,
}

/// Counts reports.
#[derive(Clone, Debug, Default)]
pub(super) struct Tally {
    reports: u64,
    systems: BTreeMap<Constellation, System>,
    directions: LatestDirections,
}

impl Tally {
    pub(super) fn add(&mut self, status: &SignalStatus) {
        self.reports = status.report + 1;
        let system = self.systems.entry(status.satellite.constellation).or_default();
        system.satellites.insert(status.satellite);
        system.listed += 1;
        system.received += u64::from(status.cn0_dbhz.is_some());
        system.used_in_fix += u64::from(status.used_in_fix);
        system.with_ephemeris += u64::from(status.has_ephemeris);
        self.directions.add(status);
    }

    pub(super) const fn directions(&self) -> &LatestDirections {
        &self.directions
    }

    pub(super) fn report(&self) -> Option<StatusReport> {
        let mean = |count: u64| count as f64 / self.reports as f64;
        let system = |(constellation, system): (&Constellation, &System)| SystemStatus {
            system: constellation.letter(),
            satellites: system.satellites.len(),
            listed: mean(system.listed),
            received: mean(system.received),
            used_in_fix: mean(system.used_in_fix),
            with_ephemeris: mean(system.with_ephemeris),
        };
        let systems = self.systems.iter().map(system).collect();
        (self.reports > 0).then_some(StatusReport { reports: self.reports, systems })
    }
}

impl LatestDirections {
    fn add(&mut self, status: &SignalStatus) {
        if status.report != self.report {
            *self = Self { report: status.report, ..Self::default() };
        }
        self.after_epoch = status.after_epoch;
        if let Some(direction) = status.direction {
            self.by_satellite.insert(status.satellite, direction);
        }
    }
}

impl fmt::Display for StatusReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "  own status  {} reports; signals of a system in the mean:  listed received used with ephemeris",
            self.reports
        )?;
        for system in &self.systems {
            writeln!(
                f,
                "    {} {:4} satellites {:>47.1} {:8.1} {:4.1} {:14.1}",
                system.system,
                system.satellites,
                system.listed,
                system.received,
                system.used_in_fix,
                system.with_ephemeris
            )?;
        }
        Ok(())
    }
}
