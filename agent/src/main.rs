//! The command line of the agent.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use cofix_agent::pipeline::PipelineOptions;
use cofix_agent::{AgentConfig, ProductSource, Source, Speed, Stop};

/// Runs beside one phone: reads its observations and publishes corrected measurements, local state and integrity verdict
/// over Zenoh, one message per epoch.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    /// Group that the phone belongs to
    #[arg(long)]
    group: String,
    /// Name of the phone within the group
    #[arg(long)]
    phone: String,
    /// RINEX 3 observation file (.gz too)
    #[arg(long, value_name = "FILE")]
    observations: PathBuf,
    /// Precise orbits and clocks, SP3 (.gz too); may be repeated
    #[arg(long, value_name = "FILE")]
    sp3: Vec<PathBuf>,
    /// RINEX 3 navigation file (.gz too): orbits, group delays, Klobuchar; may be repeated
    #[arg(long, value_name = "FILE")]
    navigation: Vec<PathBuf>,
    /// Zenoh endpoint of the hub; may be repeated
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/127.0.0.1:7447")]
    connect: Vec<String>,
    /// 'max', or times the recorded speed (1 = as recorded)
    #[arg(long, default_value = "1")]
    speed: Speed,
    /// Seconds to wait for the hub before giving up
    #[arg(long, value_name = "SECONDS", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    patience: u64,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("error,cofix_agent=info"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .init();
    match start(arguments.into()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            tracing::error!("{error:#}");
            ExitCode::FAILURE
        }
    }
}

impl From<Arguments> for AgentConfig {
    fn from(arguments: Arguments) -> Self {
        Self {
            group: arguments.group,
            phone: arguments.phone,
            source: Source::File(arguments.observations),
            products: ProductSource::Files { sp3: arguments.sp3, navigation: arguments.navigation },
            connect: arguments.connect,
            speed: arguments.speed,
            pipeline: PipelineOptions::default(),
            patience: Duration::from_secs(arguments.patience),
            kept_messages: Self::KEPT_MESSAGES,
        }
    }
}

fn start(config: AgentConfig) -> anyhow::Result<()> {
    // Zenoh needs a multi-threaded runtime around it; the agent itself blocks on a thread of its own.
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
    runtime.block_on(async {
        let stop = Stop::default();
        let interrupted = stop.clone();
        tokio::spawn(async move {
            if cofix_agent::signals::asked_to_end().await.is_ok() {
                interrupted.request();
            }
        });
        let phone = config.phone.clone();
        let report = tokio::task::spawn_blocking(move || cofix_agent::run(&config, &stop)).await??;
        for (reason, skip) in report.skips.iter() {
            tracing::warn!("skipped {} × {reason}, first: {}", skip.count, skip.first);
        }
        let how = if report.stopped { "stopped" } else { "finished" };
        tracing::info!("{phone}: {how} after {} epochs", report.epochs_published);
        Ok(())
    })
}
