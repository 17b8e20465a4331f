//! Events between the epochs of a recording.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::{SatelliteId, SignalCode};
use crate::time::GpsTime;

/// Kind of an event (RINEX 2.11, table A2; RINEX 3.05, table A3: epoch flags 2 to 6).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum EventKind {
    /// Flag 2: the antenna starts moving.
    AntennaMoves,
    /// Flag 3: a new site is occupied and the antenna is at rest.
    NewSite,
    /// Flag 4: header information.
    Header,
    /// Flag 5: an external event; its time is the information.
    External,
    /// Flag 6: cycle slips found and repaired by the receiver. The phases around them are continuous.
    CycleSlips,
}

impl EventKind {
    /// Kind of a flag's digit.
    pub const fn from_flag(digit: u8) -> Option<Self> {
        match digit {
            b'2' => Some(Self::AntennaMoves),
            b'3' => Some(Self::NewSite),
            b'4' => Some(Self::Header),
            b'5' => Some(Self::External),
            b'6' => Some(Self::CycleSlips),
            _ => None,
        }
    }

    /// The flag.
    pub const fn flag(self) -> u8 {
        match self {
            Self::AntennaMoves => 2,
            Self::NewSite => 3,
            Self::Header => 4,
            Self::External => 5,
            Self::CycleSlips => 6,
        }
    }
}

impl fmt::Display for EventKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::AntennaMoves => "antenna starts moving",
            Self::NewSite => "new site",
            Self::Header => "header information",
            Self::External => "external event",
            Self::CycleSlips => "repaired cycle slips",
        })
    }
}

/// An event between epochs.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Kind of the event.
    pub kind: EventKind,
    /// Time of the event, GPS time: always given for external events, optional for others.
    pub time_gps: Option<GpsTime>,
    /// Header lines of the event, 80 columns at most; empty for cycle slips.
    pub lines: Vec<String>,
    /// The slips of [`EventKind::CycleSlips`].
    pub slips: Vec<CycleSlip>,
}

/// A cycle slip repaired by the receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CycleSlip {
    /// The satellite.
    pub satellite: SatelliteId,
    /// The signal.
    pub signal: SignalCode,
    /// Size of the slip of the carrier phase, cycles.
    pub slip_cycles: f64,
}
