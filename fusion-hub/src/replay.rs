//! A recorded (or simulated) session through the whole system: agents with Zenoh sessions of their own on loopback, the same wire,
//! the same code as live.

use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use anyhow::{Context, anyhow, bail};
use cofix_agent::settings::{LogOptions, MaskError};
use cofix_agent::source::products::Loaded;
use cofix_agent::{AgentConfig, ProductSource, Source, Speed, Stop};
use cofix_common::accuracy::Truth;
use cofix_common::formats::gnsslogger;
use cofix_common::fusion::align::Aligner;
use cofix_common::fusion::engine::{Engine, ScheduledConstraint};
use cofix_common::measurement::Exclusion;
use cofix_common::pipeline::PipelineOptions;
use cofix_common::skips::Skips;
use zenoh::qos::CongestionControl;

use crate::group::{Course, Group, Parts};
use crate::network::{Event, Listening, Network};
use crate::outputs::{OutputFiles, Outputs, Written};
use crate::report::attention;
use crate::report::scores::Scores;
use crate::report::{Report, SettingsReport};
use crate::session::truths::{merge_named, read_truths};
use crate::session::{Session, SessionPhone, Settings};

/// A port on loopback that the system chooses.
const LOOPBACK: &str = "tcp/127.0.0.1:0";

/// The plan of a replay.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The group's name.
    pub group: String,
    /// Products.
    pub products: ProductSource,
    /// The phones, in the order that constraints refer to.
    pub phones: Vec<PlannedPhone>,
    /// The constraints.
    pub constraints: Vec<ScheduledConstraint>,
    /// Qualities of truth rows that count.
    pub truth_quality: Vec<u8>,
    /// The settings of its processing.
    pub settings: Settings,
    /// Skipped in reading the truths.
    pub truth_skips: Skips,
}

/// A phone of a replay.
#[derive(Clone, Debug)]
pub struct PlannedPhone {
    /// Its name.
    pub name: String,
    /// Its observations.
    pub source: Source,
    /// Its truth.
    pub truth: Option<Truth>,
    /// Whether its recording's own satellite states and delays are taken, where it has them.
    pub recorded_corrections: bool,
    /// Weeks to add to its times.
    pub shift_weeks: Option<i64>,
    /// Satellites and signals of it that are not used, beside those that the settings exclude for all phones.
    pub exclude: Vec<Exclusion>,
}

/// Options of a replay.
#[derive(Clone, Debug, Default)]
pub struct ReplayOptions {
    /// Files to write.
    pub files: OutputFiles,
    /// Playback speed.
    pub speed: Speed,
    /// Whether to show progress on a terminal.
    pub progress: bool,
}

/// The result of a session.
#[derive(Debug)]
pub struct Outcome {
    /// The report.
    pub report: Report,
    /// The accuracy table.
    pub table: String,
    /// The requested files that are whole, without the report.
    pub written: Vec<Written>,
    /// Why an output is incomplete, if one is.
    pub failure: Option<String>,
}

impl Plan {
    /// The plan of a session file.
    ///
    /// # Errors
    /// When a phone has no observations or a truth file cannot be used.
    pub fn from_session(session: &Session) -> anyhow::Result<Self> {
        let (truths, truth_skips) = read_truths(&session.phones)?;
        let phones: anyhow::Result<Vec<_>> =
            session.phones.iter().zip(truths).map(|(phone, (_, truth))| planned(phone, truth)).collect();
        Ok(Self {
            group: session.group.clone(),
            products: ProductSource::Files(session.products.clone()),
            phones: phones?,
            constraints: session.constraints.clone(),
            truth_quality: session.truth_quality.clone(),
            settings: session.settings.clone(),
            truth_skips,
        })
    }
}

impl Plan {
    /// The settings of a phone's agent.
    ///
    /// # Errors
    /// Invalid mask.
    pub fn pipeline(&self, phone: &PlannedPhone) -> Result<PipelineOptions, MaskError> {
        let mut options = self.settings.options()?.0;
        options.recorded_corrections = phone.recorded_corrections;
        options.correction.exclude.extend(&phone.exclude);
        Ok(options)
    }

    /// How a phone's log is read.
    ///
    /// # Errors
    /// Invalid mask.
    fn log(&self, phone: &PlannedPhone) -> Result<gnsslogger::Options, MaskError> {
        let Settings { log, masks, .. } = &self.settings;
        LogOptions { shift_weeks: phone.shift_weeks, ..log.clone() }.with(masks)
    }
}

fn planned(phone: &SessionPhone, truth: Option<Truth>) -> anyhow::Result<PlannedPhone> {
    let observations = phone.observations.clone().ok_or_else(|| {
        anyhow!(
            "phone '{}' has no observations; a replay needs `observations = \"FILE\"` for every phone",
            phone.name
        )
    })?;
    Ok(PlannedPhone {
        name: phone.name.clone(),
        source: Source::File { path: observations, near: phone.date },
        truth,
        recorded_corrections: phone.recorded_corrections,
        shift_weeks: phone.shift_weeks,
        exclude: phone.exclude.clone(),
    })
}

/// Runs a session from the first epoch to the last. Blocks.
///
/// # Errors
/// When a file cannot be used, an agent fails, a message is lost, an output cannot be written, or nothing could be fused.
pub fn replay(plan: &Plan, options: &ReplayOptions, stop: &Stop) -> anyhow::Result<Outcome> {
    let Loaded { products, skips: product_skips, .. } = Loaded::read(&plan.products)?;
    if !product_skips.is_empty() {
        tracing::info!("products: {product_skips}");
    }
    let names: Vec<String> = plan.phones.iter().map(|phone| phone.name.clone()).collect();
    let (network, events) = Network::listen(&plan.group, &names, &Listening::plain(&[LOOPBACK]))?;
    let connect = network.endpoints();
    if connect.is_empty() {
        bail!("Zenoh does not say which port it listens on");
    }
    let mut group = group(plan, options, &network)?;
    let agents_stop = Stop::default();
    let (mut agents, mut failed) = (Vec::new(), None);
    for phone in &plan.phones {
        let config = AgentConfig {
            products: ProductSource::Loaded(products.clone()),
            connect: connect.clone(),
            speed: options.speed,
            corrections: plan.settings.corrections.clone(),
            log: plan.log(phone)?,
            pipeline: plan.pipeline(phone)?,
            hub_in_process: true,
            ..AgentConfig::new(&plan.group, &phone.name, phone.source.clone())
        };
        match start_agent(config, &network, agents_stop.clone()) {
            Ok(agent) => agents.push(agent),
            Err(error) => {
                failed = Some(error);
                break;
            }
        }
    }
    let worked = failed.map_or_else(|| group.work(&events, stop), Err);
    if worked.is_err() {
        agents_stop.request();
    }
    let joined = join(agents, &events);
    // Before it is dropped: Zenoh may panic when subscribers are dropped while agents' sessions end.
    let closed = network.close();
    let mut skips = product_skips;
    skips.merge(&plan.truth_skips);
    if let Err(error) = worked.and(joined).and(closed).and_then(|()| group.check_result()) {
        group.report().1.remove();
        return Err(error);
    }
    Ok(outcome(&mut group, &skips, SettingsReport::new(&plan.settings, &plan.truth_quality)))
}

fn group(plan: &Plan, options: &ReplayOptions, network: &Network) -> anyhow::Result<Group> {
    let phones: Vec<String> = plan.phones.iter().map(|phone| phone.name.clone()).collect();
    let truths = plan.phones.iter().map(|phone| (phone.name.clone(), phone.truth.clone())).collect();
    let scores = Scores::new(truths, plan.truth_quality.clone());
    let mut outputs = Outputs::new(&phones, network.fused_publisher(CongestionControl::Block), scores);
    outputs.write_to(&options.files, &plan.group, false)?;
    if options.progress {
        outputs.show_progress();
    }
    Ok(Group::new(Parts {
        name: plan.group.clone(),
        course: Course::Replay,
        aligner: Aligner::new(phones.len(), plan.settings.estimator.align()),
        engine: Engine::new(&phones, plan.constraints.clone(), plan.settings.options()?.1),
        receipts: network.receipts(),
        history: network.history()?,
        outputs,
        phones,
    }))
}

fn start_agent(config: AgentConfig, network: &Network, stop: Stop) -> anyhow::Result<JoinHandle<()>> {
    let sender = network.sender();
    let phone = config.phone.clone();
    let thread = Builder::new().name(format!("agent-{phone}"));
    let handle = thread.spawn(move || {
        let run = std::panic::AssertUnwindSafe(|| cofix_agent::run(&config, &stop));
        let outcome = match std::panic::catch_unwind(run) {
            Ok(outcome) => outcome.map(|_| ()).map_err(|error| error.to_string()),
            Err(_) => Err("its agent panicked; this is a bug".to_owned()),
        };
        // Fails only when the hub has ended.
        let _ = sender.send(Event::AgentEnded { phone, outcome });
    });
    handle.context("cannot start a thread for an agent")
}

/// Waits for the agents, and meanwhile empties the channel so that no agent waits for room in it.
fn join(agents: Vec<JoinHandle<()>>, events: &std::sync::mpsc::Receiver<Event>) -> anyhow::Result<()> {
    let mut failed = None;
    for agent in agents {
        while !agent.is_finished() {
            let event = events.recv_timeout(Duration::from_millis(20));
            if let Ok(Event::AgentEnded { phone, outcome: Err(error) }) = event {
                failed.get_or_insert_with(|| anyhow!("{phone}: {error}"));
            }
        }
        // Panics were caught and reported inside.
        let _ = agent.join();
    }
    while let Ok(event) = events.try_recv() {
        if let Event::AgentEnded { phone, outcome: Err(error) } = event {
            failed.get_or_insert_with(|| anyhow!("{phone}: {error}"));
        }
    }
    failed.map_or(Ok(()), Err)
}

/// Report, table and finished outputs of a group.
pub(crate) fn outcome(group: &mut Group, more_skips: &Skips, settings: SettingsReport) -> Outcome {
    let names = group.phones().to_vec();
    let (mut report, outputs) = group.report();
    report.settings = settings;
    report.skips.merge(more_skips);
    report.attention = attention::findings(&report);
    let table = report.table(&names);
    let written = outputs.finish(
        &[&table, &report.constraint_table(), &attention::render(&report.attention)]
            .map(String::as_str)
            .join("\n\n"),
    );
    for file in &written {
        merge_named(&mut report.skips, &file.title.to_lowercase(), &file.skips, "first");
    }
    let failure = outputs.failure().map(str::to_owned);
    Outcome { report, table, written, failure }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn what_is_excluded_of_one_phone_comes_to_what_is_excluded_of_all() {
        let text = "group = 'g'\n[[phone]]\nname = 'a'\nobservations = 'a'\nexclude = ['C:1C']\n[[phone]]\nname = 'b'\nobservations = 'b'\n[masks]\nexclude = ['E']";
        let plan = Plan::from_session(&Session::parse(text, Path::new("s.toml"), None).unwrap()).unwrap();
        let excluded = |phone: usize| {
            let options = plan.pipeline(&plan.phones[phone]).unwrap();
            options.correction.exclude.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        assert_eq!(
            (excluded(0), excluded(1)),
            (vec!["E".to_owned(), "C:1C".to_owned()], vec!["E".to_owned()])
        );
    }
}
