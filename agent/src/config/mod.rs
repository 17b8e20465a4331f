//! The configuration of an agent.

mod corrections;

use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use cofix_common::formats::gnsslogger;
use cofix_common::frames::Ecef;
use cofix_common::gnss::ObservationEpoch;
use cofix_common::orbit::Products;
use cofix_common::pipeline::PipelineOptions;
use cofix_common::time::GpsTime;

use crate::clock;
use crate::input::{LiveSource, RawFiles};
use crate::publication::UNANSWERED;
use crate::publication::secured::Credentials;

/// Longest wait for a hub on the network that takes no message in: Zenoh's default.
const LONGEST_BLOCK: Duration = Duration::from_secs(5);

pub use corrections::{CorrectionSource, CorrectionSourceError, Corrections};

/// Everything about one agent's run.
#[derive(Clone, Debug)]
pub struct AgentConfig {
    /// The group that the phone belongs to.
    pub group: String,
    /// The phone's name within the group.
    pub phone: String,
    /// Where observations come from.
    pub source: Source,
    /// Where orbits, clocks, biases and ionosphere models come from.
    pub products: ProductSource,
    /// Sources of corrections beside the products, if any.
    pub corrections: Corrections,
    /// Approximate position of the phone, for casters that send nothing before they know it. Without it, the recording's header, the base's
    /// position and the phone's own solutions give it.
    pub approximate_position: Option<Ecef>,
    /// Zenoh endpoints of the hub (or a router), such as `tcp/127.0.0.1:7447`.
    pub connect: Vec<String>,
    /// The phone's certificate; with it the endpoints are `tls/…`.
    pub credentials: Option<Credentials>,
    /// How fast recorded epochs are published.
    pub speed: Speed,
    /// How GnssLogger text is read.
    pub log: gnsslogger::Options,
    /// The estimator's settings.
    pub pipeline: PipelineOptions,
    /// Longest wait for the hub: until it is reachable, until it listens, and, without progress, until it confirms receipt.
    pub patience: Duration,
    /// Whether the hub is in this process and asks the agent to stop when it fails. Such a hub may be slow on a busy machine: as long as it is
    /// connected, it is given ten minutes without progress, not `patience`.
    pub hub_in_process: bool,
    /// Number of the last messages that are kept for a hub that starts late or loses its connection.
    pub kept_messages: usize,
    /// Folder in which all epochs are kept, for a hub that is out of reach for longer than these.
    pub spool: Option<PathBuf>,
    /// Largest size of the spool, bytes.
    pub spool_bytes: u64,
}

impl AgentConfig {
    /// Default of [`AgentConfig::patience`].
    pub const PATIENCE: Duration = Duration::from_secs(10);
    /// Default of [`AgentConfig::kept_messages`]: an hour at 1 Hz, about 30 MB.
    pub const KEPT_MESSAGES: usize = 3_600;

    /// Default of [`AgentConfig::spool_bytes`]: some days at 1 Hz.
    pub const SPOOL_BYTES: u64 = 1_000_000_000;

    /// The default configuration: maximum speed, no products, and no endpoint of a hub.
    pub fn new(group: &str, phone: &str, source: Source) -> Self {
        Self {
            group: group.to_owned(),
            phone: phone.to_owned(),
            source,
            products: ProductSource::default(),
            corrections: Corrections::default(),
            approximate_position: None,
            connect: Vec::new(),
            credentials: None,
            speed: Speed::Maximum,
            log: gnsslogger::Options::default(),
            pipeline: PipelineOptions::default(),
            patience: Self::PATIENCE,
            hub_in_process: false,
            kept_messages: Self::KEPT_MESSAGES,
            spool: None,
            spool_bytes: Self::SPOOL_BYTES,
        }
    }

    /// Where raw input is kept, by phone and GPS time of now.
    pub(crate) fn raw_files(&self) -> Option<RawFiles> {
        let time = clock::now().iso().replace(['-', ':'], "");
        let stem = self.spool.as_ref()?.join(format!("{}-{time}", self.phone));
        Some(RawFiles { stem, limit_bytes: self.spool_bytes })
    }

    /// Longest wait for a hub that takes no message in; then the connection counts as lost, and is opened again.
    pub(crate) const fn longest_block(&self) -> Duration {
        if self.hub_in_process { UNANSWERED } else { LONGEST_BLOCK }
    }

    /// Longest wait for a hub that answers and confirms no more epochs.
    pub(crate) const fn longest_stall(&self) -> Duration {
        if self.hub_in_process { UNANSWERED } else { self.patience }
    }
}

/// Where observations come from.
#[derive(Clone, Debug)]
pub enum Source {
    /// A recorded file of any format that is read (see [`cofix_common::formats::format::Format`]), plain or compressed (.gz, .Z).
    File {
        /// The file.
        path: PathBuf,
        /// An instant within three days of its beginning, for RTCM 3, whose messages carry the time of week only. Without it the products
        /// tell, or else the time of the file's last change.
        near: Option<GpsTime>,
    },
    /// A source of bytes that arrive in real time. Epochs are published at once, whatever [`AgentConfig::speed`] says.
    Live {
        /// Where they come from.
        from: LiveSource,
        /// As of [`Source::File`]; without it, the computer's clock gives it.
        near: Option<GpsTime>,
    },
    /// Epochs in memory, in order of time: a simulated phone.
    Epochs(Arc<Vec<ObservationEpoch>>),
}

impl Source {
    /// The given instant near its beginning, if any.
    pub(crate) const fn near(&self) -> Option<GpsTime> {
        match self {
            Self::File { near, .. } | Self::Live { near, .. } => *near,
            Self::Epochs(_) => None,
        }
    }
}

/// Where orbits, clocks, biases and ionosphere models come from.
#[derive(Clone, Debug)]
pub enum ProductSource {
    /// Files.
    Files(ProductFiles),
    /// Products in memory, which agents share.
    Loaded(Arc<Products>),
}

impl Default for ProductSource {
    /// No files.
    fn default() -> Self {
        Self::Files(ProductFiles::default())
    }
}

/// Product files, any number of each kind, plain or compressed (.gz, .Z). Without any, the observations' own navigation messages serve.
#[derive(clap::Args, Clone, Debug, Default, PartialEq, Eq)]
#[command(next_help_heading = "Products, each of which may be repeated (.gz and .Z too)")]
pub struct ProductFiles {
    /// Precise orbits and clocks, SP3
    #[arg(long, value_name = "PATH")]
    pub sp3: Vec<PathBuf>,
    /// Satellite clocks to go with SP3 orbits, RINEX clock file
    #[arg(long, value_name = "PATH")]
    pub clock: Vec<PathBuf>,
    /// Code biases to go with SP3 orbits, Bias-SINEX
    #[arg(long, value_name = "PATH")]
    pub bias: Vec<PathBuf>,
    /// Ionosphere maps in place of Klobuchar, IONEX
    #[arg(long, value_name = "PATH")]
    pub ionex: Vec<PathBuf>,
    /// RINEX navigation file: orbits, group delays, Klobuchar
    #[arg(long, value_name = "PATH")]
    pub navigation: Vec<PathBuf>,
}

impl ProductFiles {
    /// All files.
    pub fn iter(&self) -> impl Iterator<Item = &PathBuf> {
        [&self.sp3, &self.clock, &self.bias, &self.ionex, &self.navigation].into_iter().flatten()
    }
}

/// How fast recorded epochs are published.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Speed {
    /// As fast as epochs are computed.
    #[default]
    Maximum,
    /// This multiple of the recorded speed; above 0.
    Times(f64),
}

/// Invalid replay speed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "'{text}' is not a speed: write 'max', or a number above 0 (1 = as recorded, 10 = ten times as fast)"
)]
pub struct SpeedError {
    text: String,
}

impl FromStr for Speed {
    type Err = SpeedError;

    fn from_str(text: &str) -> Result<Self, SpeedError> {
        if text == "max" {
            return Ok(Self::Maximum);
        }
        match text.parse::<f64>() {
            Ok(times) if times.is_finite() && times > 0.0 => Ok(Self::Times(times)),
            _ => Err(SpeedError { text: text.to_owned() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_are_read_and_refused() {
        assert_eq!("max".parse(), Ok(Speed::Maximum));
        assert_eq!("1".parse(), Ok(Speed::Times(1.0)));
        assert_eq!("2.5".parse(), Ok(Speed::Times(2.5)));
        for text in ["", "0", "-1", "inf", "nan", "fast", "Max"] {
            let error = text.parse::<Speed>().unwrap_err();
            assert!(error.to_string().contains("is not a speed"), "{error}");
        }
    }
}
