//! The agent's arguments.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, Parser, Subcommand};
use cofix_agent::corrections::{approximate_position, base_position};
use cofix_agent::input::{LiveSource, Trust};
use cofix_agent::join::{Join, about_expiry};
use cofix_agent::publication::secured::Credentials;
use cofix_agent::settings::FileSettings;
use cofix_agent::settings::{LogOptions, Masks};
use cofix_agent::{
    AgentConfig, CorrectionSource, CorrectionSourceError, Corrections, ProductFiles, ProductSource, Source,
    Speed, clock,
};
use cofix_common::frames::Ecef;
use cofix_common::measurement::Ionosphere;
use cofix_common::time::GpsTime;
use cofix_console::{Completions, Verbosity};

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
    /// Settings file: tables [filter], [stochastic], [integrity], [correction], [masks] and [log] as in session files, which
    /// 'cofix-hub settings' prints; options of the command line override it
    #[arg(long, value_name = "FILE")]
    pub(crate) settings: Option<PathBuf>,
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
    /// Prints completions of this command line for a shell
    #[command(hide = true)]
    Completions(Completions),
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

/// Trusted certificates for casters in TLS; `is_used`: whether such a caster is named.
pub(crate) fn trust(caster_ca: Option<&Path>, is_used: bool) -> anyhow::Result<Trust> {
    let Some(path) = caster_ca else { return Ok(Trust::default()) };
    anyhow::ensure!(is_used, "--caster-ca is for casters in TLS, and no ntrips:// is named");
    Ok(Trust::with_file(path)?)
}

/// The settings of a file, if it is named, under the masks and log options of the command line.
pub(crate) fn settings(file: Option<&Path>, masks: Masks, log: LogOptions) -> anyhow::Result<FileSettings> {
    let file = file.map(FileSettings::read).transpose()?.unwrap_or_default();
    Ok(FileSettings { masks: masks.or(file.masks), log: log.or(&file.log), ..file })
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
    /// Settings file, as of the agent itself
    #[arg(long, value_name = "FILE")]
    pub(crate) settings: Option<PathBuf>,
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
    /// File that 'cofix-hub enroll' has written for this phone: it names group, phone and hub, and the hub lets its holder in
    #[arg(long, value_name = "FILE", conflicts_with_all = ["group", "phone", "connect"])]
    join: Option<PathBuf>,
    /// Group that the phone belongs to
    #[arg(long, required_unless_present = "join")]
    group: Option<String>,
    /// Name of the phone within the group
    #[arg(long, required_unless_present = "join")]
    phone: Option<String>,
    /// Recorded file (RINEX, Compact RINEX, GnssLogger text, RTCM 3, challenge table; .gz and .Z too), or a live source: '-' for
    /// standard input, tcp://HOST:PORT for a server that sends bytes, tcp-listen://ADDRESS:PORT or udp-listen://ADDRESS:PORT for an app that
    /// sends to this computer, ntrip://USER:PASSWORD@HOST:PORT/MOUNT for a stream of a caster (ntrips:// with TLS)
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
    /// nothing but pairs [default: as the settings file says, model]
    #[arg(long, value_name = "METHOD")]
    ionosphere: Option<Ionosphere>,
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
    /// Corrections older than this are not used, seconds [default: as the settings file says, 60]
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..=3_600))]
    corrections_age: Option<u64>,
    /// Certificates (PEM) that are trusted besides the system's, for casters in TLS: of an authority of your own, or of the caster
    #[arg(long, value_name = "FILE")]
    caster_ca: Option<PathBuf>,
    /// Zenoh endpoint of the hub; may be repeated
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/127.0.0.1:7447")]
    connect: Vec<String>,
    /// 'max', or times the recorded speed (1 = as recorded); of no effect on live sources
    #[arg(long, default_value = "1")]
    speed: Speed,
    /// Folder in which raw input of a live source is kept as it comes, and all epochs of the run, for a hub that is out of reach for longer than the last 3,600, which are kept in
    /// memory
    #[arg(long, value_name = "DIR")]
    spool: Option<PathBuf>,
    /// Largest size of the spool, beyond which the oldest epochs go, MB
    #[arg(long, value_name = "MB", default_value_t = 1_000, value_parser = clap::value_parser!(u64).range(1..=1_000_000), requires = "spool")]
    spool_size: u64,
    /// Seconds to wait for the hub before giving up
    #[arg(long, value_name = "SECONDS", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    patience: u64,
}

/// Which hub, and as whom.
struct Hub {
    group: String,
    phone: String,
    connect: Vec<String>,
    credentials: Option<Credentials>,
}

impl Publish {
    /// The agent's configuration.
    pub(crate) fn config(
        self,
        products: ProductFiles,
        settings: &FileSettings,
    ) -> anyhow::Result<AgentConfig> {
        let FileSettings { preset, mut estimator, masks, log } = settings.clone();
        let correction = &mut estimator.correction;
        correction.ionosphere = self.ionosphere.unwrap_or(correction.ionosphere);
        correction.maximum_age_s =
            self.corrections_age.map_or(correction.maximum_age_s, |age_s| age_s as f64);
        let mut pipeline = estimator.pipeline();
        pipeline.correction = masks.apply(preset.masked(pipeline.correction))?;
        pipeline.recorded_corrections = self.recorded_corrections;
        let mut source = self.source()?;
        let mut sources: Vec<CorrectionSource> = self
            .corrections
            .iter()
            .map(|source| source.parse())
            .collect::<Result<_, CorrectionSourceError>>()?;
        self.trust(&mut source, &mut sources)?;
        let Hub { group, phone, connect, credentials } = self.hub()?;
        Ok(AgentConfig {
            source,
            group,
            phone,
            products: ProductSource::Files(products),
            corrections: Corrections {
                sources,
                base_position: self.base_position,
                options: estimator.differential(),
            },
            approximate_position: self.approximate_position,
            connect,
            credentials,
            speed: self.speed,
            log: log.with(&masks)?,
            pipeline,
            patience: Duration::from_secs(self.patience),
            hub_in_process: false,
            kept_messages: AgentConfig::KEPT_MESSAGES,
            spool: self.spool,
            spool_bytes: self.spool_size * 1_000_000,
        })
    }

    /// Which hub, and as whom.
    fn hub(&self) -> anyhow::Result<Hub> {
        let Some(path) = &self.join else {
            let [group, phone] = [&self.group, &self.phone].map(|name| name.clone().unwrap_or_default());
            return Ok(Hub { group, phone, connect: self.connect.clone(), credentials: None });
        };
        let join = Join::read(path)?;
        if let Some(said) = about_expiry(join.expires, clock::now()) {
            tracing::warn!("{}: {said}; whoever enrolled the phone writes a new one", path.display());
        }
        let connect = join.endpoints();
        Ok(Hub { group: join.group, phone: join.phone, connect, credentials: Some(join.credentials) })
    }

    /// Gives live sources the trusted certificates.
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
        Ok(Source::File { path: name.into(), near: self.date })
    }
}

#[cfg(test)]
mod tests {
    use cofix_common::filter::FilterOptions;
    use cofix_common::pipeline::PipelineOptions;

    use super::*;

    fn config(settings: Option<&str>, more: &[&str]) -> AgentConfig {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("settings.toml");
        let mut line = vec!["cofix-agent", "--group", "g", "--phone", "p", "--observations", "a.rnx"];
        let path = file.display().to_string();
        if let Some(text) = settings {
            std::fs::write(&file, text).unwrap();
            line.extend(["--settings", &path]);
        }
        line.extend(more);
        let Arguments { publish, products, settings, masks, log, .. } = Arguments::parse_from(line);
        let settings = super::settings(settings.as_deref(), masks, log).unwrap();
        publish.unwrap().config(products, &settings).unwrap()
    }

    #[test]
    fn without_a_file_all_is_as_by_default() {
        let config = config(None, &[]);
        assert_eq!(config.pipeline.correction, PipelineOptions::default().correction);
        assert_eq!(config.pipeline.filter, FilterOptions::default());
        assert_eq!(config.corrections, Corrections::default());
    }

    #[test]
    fn a_file_to_join_with_is_all_that_names_hub_group_and_phone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pixel.cofix");
        let credentials = Credentials { certificate: "C".into(), key: "K".into(), authority: "A".into() };
        let (group, phone, hub) = ("g".to_owned(), "pixel".to_owned(), vec!["192.0.2.1:7447".to_owned()]);
        let join = Join { group, phone, hub, expires: clock::now(), credentials: credentials.clone() };
        std::fs::write(&path, join.text().unwrap()).unwrap();
        let path = path.display().to_string();
        let line = ["cofix-agent", "--join", &path, "--observations", "a.rnx"];
        let Arguments { publish, products, .. } = Arguments::parse_from(line);
        let config = publish.unwrap().config(products, &FileSettings::default()).unwrap();
        assert_eq!((config.group.as_str(), config.phone.as_str()), ("g", "pixel"));
        assert_eq!(config.connect, ["tls/192.0.2.1:7447"]);
        assert_eq!(config.credentials, Some(credentials));
        for more in [["--group", "g"], ["--phone", "p"], ["--connect", "tcp/127.0.0.1:1"]] {
            assert!(Arguments::try_parse_from(line.iter().chain(&more)).is_err(), "{more:?}");
        }
        let nobody = ["cofix-agent", "--observations", "a.rnx", "--group", "g"];
        assert!(Arguments::try_parse_from(nobody).is_err());
    }

    #[test]
    fn the_command_line_overrides_the_file() {
        let file = "[filter]\npreset = 'peng2023'\nmaximum_gap_s = 3.0\n[integrity]\nmaximum_exclusions = 2\n\
                    [correction]\nionosphere = 'pair'\nmaximum_age_s = 30\n[correction.base]\noutlier_sigmas = 4.0\n\
                    [masks]\nelevation_deg = 20.0\ncn0_dbhz = 25.0\nexclude = ['R']\n\
                    [log]\nkeep_multipath = true\nshift_weeks = 1024";
        let given = config(Some(file), &[]);
        let peng = FilterOptions::peng2023();
        assert_eq!(given.pipeline.filter, FilterOptions { maximum_gap_s: 3.0, ..peng });
        assert_eq!(given.pipeline.raim.maximum_exclusions, 2);
        assert_eq!(given.pipeline.correction.ionosphere, Ionosphere::Pair);
        let options = given.corrections.options;
        assert_eq!((options.maximum_age_s, options.outlier_sigmas), (30.0, 4.0));
        assert_eq!(given.pipeline.correction.elevation_mask_rad, 20_f64.to_radians());
        assert_eq!(given.pipeline.correction.exclude.len(), 1);
        assert!(!given.log.masks.reject_multipath && given.log.shift_weeks == 1_024);
        let options =
            ["--ionosphere", "model", "--corrections-age", "90", "--elevation-mask", "5", "--exclude", "E,C"];
        let overridden = config(Some(file), &[&options[..], &["--shift-weeks", "0"]].concat());
        assert_eq!(overridden.pipeline.correction.ionosphere, Ionosphere::Model);
        assert_eq!(overridden.corrections.options.maximum_age_s, 90.0);
        assert_eq!(overridden.corrections.options.outlier_sigmas, 4.0);
        assert_eq!(overridden.pipeline.correction.elevation_mask_rad, 5_f64.to_radians());
        assert_eq!(overridden.pipeline.correction.minimum_cn0_dbhz, 25.0);
        assert_eq!(overridden.pipeline.correction.exclude.len(), 2);
        assert_eq!(overridden.log.shift_weeks, 0);
        assert_eq!(overridden.pipeline.filter, given.pipeline.filter);
    }
}
