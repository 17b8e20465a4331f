//! A recorded (or simulated) session through the whole system: agents with Zenoh sessions of their own on loopback, the same wire,
//! the same code as live.

use std::collections::BTreeMap;
use std::path::Path;
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use anyhow::{Context, anyhow, bail};
use cofix_agent::settings::{LogOptions, MaskError};
use cofix_agent::source::products::Loaded;
use cofix_agent::source::{self, Reading};
use cofix_agent::{AgentConfig, ProductSource, Source, Speed, Stop};
use cofix_common::accuracy::Truth;
use cofix_common::formats::decode::Record;
use cofix_common::formats::packing::decompress;
use cofix_common::formats::{gnsslogger, truth};
use cofix_common::fusion::align::Aligner;
use cofix_common::fusion::engine::{Engine, ScheduledConstraint};
use cofix_common::measurement::Exclusion;
use cofix_common::pipeline::PipelineOptions;
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;
use zenoh::qos::CongestionControl;

use crate::group::{Course, Group, Parts};
use crate::network::{Event, Network};
use crate::outputs::{OutputFiles, Outputs, Written};
use crate::report::attention;
use crate::report::scores::Scores;
use crate::report::{Report, SettingsReport};
use crate::session::{Session, SessionPhone, Settings};

/// A port on loopback that the system chooses.
const LOOPBACK: &str = "tcp/127.0.0.1:0";

/// Everything that a replay needs.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The group's name.
    pub group: String,
    /// Orbits and the rest.
    pub products: ProductSource,
    /// The phones, in the order that constraints refer to.
    pub phones: Vec<PlannedPhone>,
    /// The constraints.
    pub constraints: Vec<ScheduledConstraint>,
    /// Qualities of truth rows that count.
    pub truth_quality: Vec<u8>,
    /// How it is processed.
    pub settings: Settings,
    /// What was skipped in reading the truths.
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
    /// What is not used of it, beside what the settings exclude for all phones.
    pub exclude: Vec<Exclusion>,
}

/// How a replay is made.
#[derive(Clone, Debug, Default)]
pub struct ReplayOptions {
    /// What to write where.
    pub files: OutputFiles,
    /// How fast.
    pub speed: Speed,
    /// Whether to show progress on a terminal.
    pub progress: bool,
}

/// What came of a session.
#[derive(Debug)]
pub struct Outcome {
    /// The report.
    pub report: Report,
    /// The accuracy table.
    pub table: String,
    /// The files that were wished for and are whole, but for the report.
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
    /// A mask that makes no sense.
    pub fn pipeline(&self, phone: &PlannedPhone) -> Result<PipelineOptions, MaskError> {
        let mut options = self.settings.options()?.0;
        options.recorded_corrections = phone.recorded_corrections;
        options.correction.exclude.extend(&phone.exclude);
        Ok(options)
    }

    /// How a phone's log is read.
    ///
    /// # Errors
    /// A mask that makes no sense.
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

/// Phones' names and truths.
pub type NamedTruths = Vec<(String, Option<Truth>)>;

/// Reads the phones' truths, each file once, in the order of the phones; with the rows skipped.
///
/// # Errors
/// When a file cannot be read or holds no truth.
pub fn read_truths(phones: &[SessionPhone]) -> anyhow::Result<(NamedTruths, Skips)> {
    let mut skips = Skips::default();
    let mut known: BTreeMap<&Path, Truth> = BTreeMap::new();
    let mut truths = Vec::with_capacity(phones.len());
    for phone in phones {
        let truth = match phone.truth.as_deref() {
            None => None,
            Some(path) => match known.get(path) {
                Some(truth) => Some(truth.clone()),
                None => Some(known.entry(path).or_insert(read_truth(path, phone, &mut skips)?).clone()),
            },
        };
        truths.push((phone.name.clone(), truth));
    }
    Ok((truths, skips))
}

/// Reads a phone's truth of any format; one without a date takes it from the phone's date or recording.
fn read_truth(path: &Path, phone: &SessionPhone, skips: &mut Skips) -> anyhow::Result<Truth> {
    let unreadable = || format!("{}: cannot read the truth file", path.display());
    let bytes = std::fs::read(path).with_context(unreadable)?;
    let bytes = decompress(&bytes).with_context(unreadable)?;
    let format = truth::recognise(&bytes);
    let near = if format.needs_date(&bytes) {
        recorded_near(phone).with_context(|| format!("{}: {} without a date", path.display(), format.name))?
    } else {
        GpsTime::default()
    };
    let (truth, skipped) =
        format.read(&bytes, near).with_context(|| format!("{}: not usable as truth", path.display()))?;
    merge_named(skips, "truth", &skipped, &path.display().to_string());
    Ok(truth)
}

/// An instant near a phone's recording: the date of the session file, else the recording's first epoch.
fn recorded_near(phone: &SessionPhone) -> anyhow::Result<GpsTime> {
    if let Some(date) = phone.date {
        return Ok(date);
    }
    let advice = || format!("write `date = \"YYYY-MM-DDThh:mm:ss\"` for phone '{}'", phone.name);
    let path = phone
        .observations
        .as_deref()
        .ok_or_else(|| anyhow!("no observations tell it"))
        .with_context(advice)?;
    let log =
        gnsslogger::Options { shift_weeks: phone.shift_weeks.unwrap_or(0), ..gnsslogger::Options::default() };
    let mut records = source::open_file(path, &Reading { log, ..Reading::default() }).with_context(advice)?;
    loop {
        let record = records
            .next(&Stop::default())
            .with_context(|| path.display().to_string())
            .with_context(advice)?;
        match record {
            Some(Record::Epoch(epoch)) => return Ok(epoch.time_gps),
            Some(_) => {}
            None => bail!("{}: no epoch tells it; {}", path.display(), advice()),
        }
    }
}

/// Adds counts under the name of what was being done, and the place to the first instances.
fn merge_named(skips: &mut Skips, doing: &str, more: &Skips, place: &str) {
    for (reason, skip) in more.iter() {
        for _ in 0..skip.count {
            skips.add(&format!("{doing}: {reason}"), || format!("{place}: {}", skip.first));
        }
    }
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
    let (network, events) = Network::listen(&plan.group, &names, &[LOOPBACK.to_owned()])?;
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
    // Before anything of it is dropped: Zenoh does not bear that while agents' sessions end.
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

/// Waits for the agents, emptying the channel meanwhile so that none of them hangs on it.
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
    use std::path::PathBuf;

    use super::*;

    const TRUTH_WITHOUT_WEEK: &str =
        "GPSTime Latitude Longitude H-Ell Vel-N Vel-E Vel-U Q\n397140.0 30 114 20 0 0 0 1\n";
    const LOG: &str = "{\"obsd_t\":{\"d\":[{\"prn\":7,\"type\":\"L1C\",\"p\":2.2E7}],\"t\":{\"year\":2020,\"month\":8,\"day\":13,\
                       \"hour\":14,\"minute\":19,\"sec\":0.0}}}\n";

    #[test]
    fn a_truth_without_a_week_takes_it_from_the_date_or_the_recording() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let truth = file("truth.txt", TRUTH_WITHOUT_WEEK);
        let log = file("log.txt", LOG);
        let shifted_week_of = |shift_weeks, observations: Option<&PathBuf>, date: Option<GpsTime>| {
            let phone = SessionPhone {
                name: "a".to_owned(),
                observations: observations.cloned(),
                truth: Some(truth.clone()),
                recorded_corrections: false,
                shift_weeks,
                date,
                exclude: Vec::new(),
            };
            let (truths, _) = read_truths(&[phone]).map_err(|error| format!("{error:#}"))?;
            Ok::<_, String>(truths[0].1.as_ref().unwrap().span().unwrap().0.week())
        };
        let week_of = |observations, date| shifted_week_of(None, observations, date);
        assert_eq!(week_of(Some(&log), None), Ok(2118));
        assert_eq!(shifted_week_of(Some(-1_024), Some(&log), None), Ok(1094));
        assert_eq!(week_of(Some(&log), Some(GpsTime::from_week_tow(2119, 300_000.0))), Ok(2119));
        let said = week_of(None, None).unwrap_err();
        assert!(
            said.contains("truth.txt: WHU-Smartphone truth table without a date") && said.contains("date ="),
            "{said}"
        );
        let said = week_of(Some(&file("empty.txt", "\n")), None).unwrap_err();
        assert!(said.contains("empty.txt") && said.contains("date ="), "{said}");
    }

    #[test]
    fn what_is_excluded_of_one_phone_comes_to_what_is_excluded_of_all() {
        let text = "group = 'g'\n[[phone]]\nname = 'a'\nobservations = 'a'\nexclude = ['C:1C']\n[[phone]]\nname = 'b'\nobservations = 'b'\n[masks]\nexclude = ['E']";
        let plan = Plan::from_session(&Session::parse(text, Path::new("s.toml")).unwrap()).unwrap();
        let excluded = |phone: usize| {
            let options = plan.pipeline(&plan.phones[phone]).unwrap();
            options.correction.exclude.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        assert_eq!(
            (excluded(0), excluded(1)),
            (vec!["E".to_owned(), "C:1C".to_owned()], vec!["E".to_owned()])
        );
    }

    #[test]
    fn bad_rows_of_a_truth_are_counted_under_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("truth.csv");
        let text = "gps_week,gps_tow_s,latitude_deg,longitude_deg,ellipsoidal_height_m,velocity_north_mps,\
            velocity_east_mps,velocity_up_mps,quality\n2118,1.0,30.0,114.0,20.0,0,0,0,1\n2118,nonsense,30.0,114.0,20.0,0,0,0,1\n";
        std::fs::write(&path, text).unwrap();
        let phone = |name: &str| SessionPhone {
            name: name.to_owned(),
            observations: None,
            truth: Some(path.clone()),
            recorded_corrections: false,
            shift_weeks: None,
            date: None,
            exclude: Vec::new(),
        };
        let (truths, skips) = read_truths(&[phone("a"), phone("b")]).unwrap();
        assert!(truths.iter().all(|(_, truth)| truth.is_some()));
        assert_eq!(skips.total(), 1, "one file, read once: {skips}");
        let (reason, skip) = skips.iter().next().unwrap();
        assert!(reason.starts_with("truth: ") && skip.first.contains("truth.csv: "), "{skips}");
    }
}
