//! The formats that observations are read from.

use std::fmt;

use serde::Serialize;

/// A format that observations are read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// RINEX 2, 3 or 4 observations.
    Rinex,
    /// Compact RINEX (Hatanaka) 1 or 3.
    CompactRinex,
    /// Text log of Google's GnssLogger app.
    GnssLogger,
    /// RTCM 3 messages.
    Rtcm3,
    /// Table of the Smartphone Decimeter Challenge.
    ChallengeTable,
    /// Phone log of the WHU-Smartphone dataset.
    SpareLog,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rinex => "RINEX observations",
            Self::CompactRinex => "Compact RINEX",
            Self::GnssLogger => "GnssLogger text",
            Self::Rtcm3 => "RTCM 3",
            Self::ChallengeTable => "challenge table",
            Self::SpareLog => "spare log",
        })
    }
}
