//! The content of a navigation file: systems, messages, their span, health, ionosphere terms.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::Path;

use cofix_common::gnss::{Constellation, SatelliteId};
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::{NavigationMessage, is_healthy};
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;
use serde::Serialize;

use crate::source::SourceError;
use crate::source::products::navigation_file;

/// The content of a navigation file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NavigationInspection {
    /// The file.
    pub file: String,
    /// Messages of each system and kind.
    pub messages: Vec<MessageReport>,
    /// Systems whose ionosphere terms the header or a record gives: `GPS` (Klobuchar), `BeiDou`, `Galileo`.
    pub ionosphere: Vec<&'static str>,
    /// Seconds that GPS time is ahead of UTC.
    pub leap_seconds: Option<i64>,
    /// Skipped in reading, by reason.
    pub skips: Skips,
}

/// Messages of one system and kind.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MessageReport {
    /// RINEX letter of the system.
    pub system: char,
    /// The kind of message.
    pub message: &'static str,
    /// How many satellites.
    pub satellites: usize,
    /// How many messages.
    pub messages: u64,
    /// First reference time of an orbit, GPS time.
    pub first_gps: String,
    /// Last reference time of an orbit, GPS time.
    pub last_gps: String,
    /// Satellites that a message calls unhealthy.
    pub unhealthy: Vec<String>,
}

/// Inspects a navigation file.
///
/// # Errors
/// When it cannot be read or is no navigation file.
pub fn inspect_navigation(path: &Path) -> Result<NavigationInspection, SourceError> {
    let file = navigation_file(path)?;
    let terms = [
        ("GPS", file.ionosphere.gps.is_some()),
        ("BeiDou", file.ionosphere.beidou.is_some()),
        ("Galileo", file.ionosphere.galileo.is_some()),
    ];
    Ok(NavigationInspection {
        file: path.display().to_string(),
        messages: messages(&file),
        ionosphere: terms.into_iter().filter(|(_, is_there)| *is_there).map(|(system, _)| system).collect(),
        leap_seconds: file.leap_seconds,
        skips: file.skips,
    })
}

#[derive(Default)]
struct Sum {
    messages: u64,
    satellites: BTreeSet<SatelliteId>,
    unhealthy: BTreeSet<SatelliteId>,
    span: Option<(GpsTime, GpsTime)>,
}

impl Sum {
    fn add(&mut self, satellite: SatelliteId, toe: GpsTime, healthy: bool) {
        self.messages += 1;
        self.satellites.insert(satellite);
        if !healthy {
            self.unhealthy.insert(satellite);
        }
        let (first, last) = self.span.unwrap_or((toe, toe));
        self.span = Some((first.min(toe), last.max(toe)));
    }
}

fn messages(file: &NavigationFile) -> Vec<MessageReport> {
    let mut sums: BTreeMap<_, Sum> = BTreeMap::new();
    for e in &file.ephemerides {
        let key = (e.satellite.constellation, name(e.message));
        sums.entry(key).or_default().add(e.satellite, e.toe, is_healthy(e));
    }
    for e in &file.glonass {
        let key = (e.satellite.constellation, "L1 C/A");
        sums.entry(key).or_default().add(e.satellite, e.toe, e.is_healthy());
    }
    let report = |((system, message), sum): ((Constellation, _), Sum)| {
        let (first, last) = sum.span?;
        Some(MessageReport {
            system: system.letter(),
            message,
            satellites: sum.satellites.len(),
            messages: sum.messages,
            first_gps: first.iso(),
            last_gps: last.iso(),
            unhealthy: sum.unhealthy.iter().map(ToString::to_string).collect(),
        })
    };
    sums.into_iter().filter_map(report).collect()
}

const fn name(message: NavigationMessage) -> &'static str {
    match message {
        NavigationMessage::Lnav => "LNAV",
        NavigationMessage::GalileoInav => "I/NAV",
        NavigationMessage::GalileoFnav => "F/NAV",
        NavigationMessage::BeidouD1D2 => "D1/D2",
    }
}

impl fmt::Display for NavigationInspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}: RINEX navigation", self.file)?;
        writeln!(f, "  message     sats messages  reference times (GPST), unhealthy satellites")?;
        for m in &self.messages {
            let unhealthy = if m.unhealthy.is_empty() { "-".to_owned() } else { m.unhealthy.join(", ") };
            writeln!(
                f,
                "    {} {:<7} {:4} {:8}  {} to {}, {unhealthy}",
                m.system, m.message, m.satellites, m.messages, m.first_gps, m.last_gps
            )?;
        }
        let ionosphere =
            if self.ionosphere.is_empty() { "none".to_owned() } else { self.ionosphere.join(", ") };
        writeln!(f, "  ionosphere  {ionosphere}")?;
        if let Some(seconds) = self.leap_seconds {
            writeln!(f, "  leap        {seconds} s between GPS time and UTC")?;
        }
        for (reason, skip) in self.skips.iter() {
            writeln!(f, "  skipped     {} × {reason}, first: {}", skip.count, skip.first)?;
        }
        Ok(())
    }
}
