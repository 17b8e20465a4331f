//! The agent's arguments.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, Parser, Subcommand};
use cofix_agent::corrections::{CorrectionSourceError, approximate_position, base_position};
use cofix_agent::input::{LiveSource, Trust};
use cofix_agent::masks::{LogOptions, Masks};
use cofix_agent::{AgentConfig, CorrectionSource, Corrections, ProductFiles, ProductSource, Source, Speed};
use cofix_common::frames::Ecef;
use cofix_common::measurement::{CorrectionOptions, DifferentialOptions, Ionosphere};
use cofix_common::pipeline::PipelineOptions;
use cofix_common::time::GpsTime;
use cofix_console::Verbosity;

/// Runs beside one phone: reads its observations and publishes corrected measurements, local state and integrity verdict
/// over Zenoh, one message per epoch.
#[derive(Debug, Parser)]
#[command(version = cofix_console::VERSION, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
    // Only what is directly in an optional group tells clap that the group is there, so these stand beside it.
    #[command(flatten)]
    pub(crate) publish: Option<Publish>,
    #[command(flatten)]
    pub(crate) products: ProductFiles,
    #[command(flatten)]
    pub(crate) masks: Masks,
    #[command(flatten)]
    pub(crate) log: LogOptions,
    #[command(flatten)]
    pub(crate) verbosity: Verbosity,
}

/// What else the agent can do with recordings.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Says what is in recordings (span, gaps, satellites, signals, strength, slips, clock jumps, what is skipped) and in
    /// navigation files
    Inspect(Inspect),
    /// Writes recordings of any format as RINEX 3.05
    Convert(Convert),
    /// Lists the streams of an NTRIP caster
    Sourcetable(Sourcetable),
}

#[derive(Debug, Args)]
pub(crate) struct Sourcetable {
    /// ntrip://HOST:PORT, or with an account ntrip://USER:PASSWORD@HOST:PORT; ntrips:// with TLS
    // Read later: what refuses arguments here would show the password.
    pub(crate) caster: String,
    /// Certificates (PEM) that are trusted besides the system's, for casters in TLS: of an authority of your own, or of the caster
    #[arg(long, value_name = "FILE")]
    pub(crate) caster_ca: Option<PathBuf>,
}

/// Who may vouch for casters in TLS; `is_used`: whether one is named.
pub(crate) fn trust(caster_ca: Option<&Path>, is_used: bool) -> anyhow::Result<Trust> {
    let Some(path) = caster_ca else { return Ok(Trust::default()) };
    anyhow::ensure!(is_used, "--caster-ca is for casters in TLS, and no ntrips:// is named");
    Ok(Trust::with_file(path)?)
}

/// What is read.
#[derive(Debug, Args)]
pub(crate) struct Files {
    /// Recordings of any format that is read, in order of time, and RINEX navigation files (.gz and .Z too)
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// An instant within three days of the recordings, for RTCM 3 [GPS time, YYYY-MM-DDThh:mm:ss]
    #[arg(long, value_name = "TIME")]
    pub(crate) date: Option<GpsTime>,
}

#[derive(Debug, Args)]
pub(crate) struct Inspect {
    #[command(flatten)]
    pub(crate) read: Files,
    /// JSON instead of a table: a list with one object per file
    #[arg(long)]
    pub(crate) json: bool,
    /// With orbits, recordings are processed too, and what masks and RAIM take is counted
    #[command(flatten)]
    pub(crate) products: ProductFiles,
    #[command(flatten)]
    pub(crate) masks: Masks,
    #[command(flatten)]
    pub(crate) log: LogOptions,
}

#[derive(Debug, Args)]
pub(crate) struct Convert {
    #[command(flatten)]
    pub(crate) read: Files,
    /// Observation file to write
    #[arg(long, value_name = "FILE", required_unless_present = "output_navigation")]
    pub(crate) output_observations: Option<PathBuf>,
    /// Navigation file to write, of the messages that the recordings and navigation files carry
    #[arg(long, value_name = "FILE")]
    pub(crate) output_navigation: Option<PathBuf>,
    /// Replace files that are there
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// Signals of GnssLogger text weaker than this are left out [dB-Hz; default 15]
    #[arg(long, value_name = "DBHZ")]
    pub(crate) cn0_mask: Option<f64>,
    #[command(flatten)]
    pub(crate) log: LogOptions,
}

/// Publishing.
#[derive(Debug, Args)]
pub(crate) struct Publish {
    /// Group that the phone belongs to
    #[arg(long)]
    group: String,
    /// Name of the phone within the group
    #[arg(long)]
    phone: String,
    /// Recorded file (RINEX, Compact RINEX, GnssLogger text, RTCM 3, challenge table; .gz and .Z too), or a live source: '-' for
    /// standard input, tcp://HOST:PORT for a server that sends bytes, ntrip://USER:PASSWORD@HOST:PORT/MOUNT for a stream of a caster
    /// (ntrips:// with TLS)
    #[arg(long, value_name = "SOURCE", required_unless_present = "follow")]
    pub(crate) observations: Option<String>,
    /// File that is being written, read as it grows
    #[arg(long, value_name = "FILE", conflicts_with = "observations")]
    follow: Option<PathBuf>,
    /// An instant within three days of the beginning, for RTCM 3, which lacks the week; else the orbits tell, or the file's
    /// last change, and live the computer's clock [GPS time, YYYY-MM-DDThh:mm:ss]
    #[arg(long, value_name = "TIME")]
    pub(crate) date: Option<GpsTime>,
    /// Take the satellite states and delays of the recording itself, where it has them (challenge tables), in place of those
    /// from products; none need be named then
    #[arg(long)]
    recorded_corrections: bool,
    /// 'model': every signal with a modelled delay; 'pair': the ionosphere-free pair of satellites with two bands; 'pair-only':
    /// nothing but pairs
    #[arg(long, value_name = "METHOD", default_value = "model")]
    ionosphere: Ionosphere,
    /// Corrections: a recorded file, tcp://HOST:PORT or ntrip://USER:PASSWORD@HOST:PORT/MOUNT (ntrips:// with TLS). Its ephemerides are used, and, when it
    /// carries the observations of a base station, pseudoranges are corrected by them; may be repeated
    // Read later: what refuses arguments here would show the password.
    #[arg(long, value_name = "SOURCE")]
    corrections: Vec<String>,
    /// The base station's antenna, ECEF in metres and in the frame of the orbits (WGS-84, ITRF), in place of what its stream states
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = base_position, requires = "corrections")]
    base_position: Option<Ecef>,
    /// About where the phone is, in degrees and metres above the ellipsoid, for casters that send nothing before they know it (virtual reference
    /// stations); else the recording's header, --base-position or the first position computed tells
    #[arg(long, value_name = "LAT,LON,HEIGHT", allow_hyphen_values = true, value_parser = approximate_position)]
    approximate_position: Option<Ecef>,
    /// Corrections older than this are not used, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=3_600))]
    corrections_age: u64,
    /// Certificates (PEM) that are trusted besides the system's, for casters in TLS: of an authority of your own, or of the caster
    #[arg(long, value_name = "FILE")]
    caster_ca: Option<PathBuf>,
    /// Zenoh endpoint of the hub; may be repeated
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/127.0.0.1:7447")]
    connect: Vec<String>,
    /// 'max', or times the recorded speed (1 = as recorded); of no effect on live sources
    #[arg(long, default_value = "1")]
    speed: Speed,
    /// Seconds to wait for the hub before giving up
    #[arg(long, value_name = "SECONDS", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    patience: u64,
}

impl Publish {
    /// What the agent is told.
    pub(crate) fn config(
        self,
        products: ProductFiles,
        masks: &Masks,
        log: &LogOptions,
    ) -> anyhow::Result<AgentConfig> {
        let mut source = self.source()?;
        let mut sources: Vec<CorrectionSource> = self
            .corrections
            .iter()
            .map(|source| source.parse())
            .collect::<Result<_, CorrectionSourceError>>()?;
        self.trust(&mut source, &mut sources)?;
        Ok(AgentConfig {
            source,
            group: self.group,
            phone: self.phone,
            products: ProductSource::Files(products),
            corrections: Corrections {
                sources,
                base_position: self.base_position,
                options: DifferentialOptions {
                    maximum_age_s: self.corrections_age as f64,
                    ..DifferentialOptions::default()
                },
            },
            approximate_position: self.approximate_position,
            connect: self.connect,
            speed: self.speed,
            log: log.with(masks)?,
            pipeline: PipelineOptions {
                correction: masks.apply(CorrectionOptions {
                    ionosphere: self.ionosphere,
                    ..CorrectionOptions::default()
                })?,
                recorded_corrections: self.recorded_corrections,
                ..PipelineOptions::default()
            },
            patience: Duration::from_secs(self.patience),
            kept_messages: AgentConfig::KEPT_MESSAGES,
        })
    }

    /// Tells live sources who may vouch for their casters.
    fn trust(&self, source: &mut Source, corrections: &mut [CorrectionSource]) -> anyhow::Result<()> {
        let own = if let Source::Live { from, .. } = source { Some(from) } else { None };
        let others = corrections.iter_mut().filter_map(|source| match source {
            CorrectionSource::Live(live) => Some(live),
            CorrectionSource::File(_) => None,
        });
        let mut secured: Vec<&mut LiveSource> =
            own.into_iter().chain(others).filter(|live| live.is_secured()).collect();
        let trust = trust(self.caster_ca.as_deref(), !secured.is_empty())?;
        for live in &mut secured {
            **live = live.clone().trusting(&trust);
        }
        Ok(())
    }

    fn source(&self) -> anyhow::Result<Source> {
        let name = match (&self.follow, &self.observations) {
            (Some(path), _) => {
                return Ok(Source::Live { from: LiveSource::Follow(path.clone()), near: self.date });
            }
            (None, name) => name.as_deref().unwrap_or_default(),
        };
        if LiveSource::is_named_by(name) {
            return Ok(Source::Live { from: name.parse()?, near: self.date });
        }
        Ok(match self.date {
            Some(near) => Source::DatedFile { path: name.into(), near },
            None => Source::File(name.into()),
        })
    }
}
