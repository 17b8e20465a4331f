//! A live session.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, bail};
use cofix_agent::status::Moment;
use cofix_agent::{Stop, clock};
use cofix_common::fusion::align::{AlignOptions, Aligner};
use cofix_common::fusion::engine::Engine;
use cofix_common::skips::Skips;
use zenoh::qos::CongestionControl;

use crate::group::{Course, Group, Parts};
use crate::journal::{Header, Journal, JournalReader, Origin, has_ended, in_use, remove, segments};
use crate::network::{FusedPublisher, HistoryQuestions, Listening, Network, Receipts};
use crate::outputs::{OutputFiles, Outputs, keep_partial};
use crate::replay::{Outcome, outcome};
use crate::report::SettingsReport;
use crate::report::scores::Scores;
use crate::session::Session;
use crate::session::truths::read_truths;
use crate::status::{Files, Watcher};

/// Options of a live hub.
#[derive(Clone, Debug)]
pub struct LiveOptions {
    /// Where to listen, and for whom.
    pub listening: Listening,
    /// Files to write.
    pub files: OutputFiles,
    /// Whether to end when the agents of all phones have finished.
    pub until_finished: bool,
    /// Longest wait of the group for a phone, in place of the session's.
    pub latency: Option<Duration>,
    /// Whether fused states are published as JSON too.
    pub json: bool,
    /// The journal, if one is written.
    pub journal: Option<JournalOptions>,
}

/// Where a journal is written, and the session file that it is of.
#[derive(Clone, Debug)]
pub struct JournalOptions {
    /// Its first file. One of an unfinished session of the same phones is gone on with.
    pub path: PathBuf,
    /// The session file.
    pub session_path: PathBuf,
    /// Folder to which its paths are relative, if not its own.
    pub data: Option<PathBuf>,
    /// Size of the data after which a new segment is begun, bytes.
    pub segment_bytes: u64,
}

/// Runs a hub until `stop` is requested or, with `until_finished`, all agents have finished. Blocks.
///
/// # Errors
/// When the endpoints cannot be listened on, a truth file or a journal cannot be used, or an output cannot be written.
pub fn run(session: &Session, options: &LiveOptions, stop: &Stop) -> anyhow::Result<Outcome> {
    let latency = options.latency.unwrap_or(session.settings.estimator.align().maximum_wait);
    let unfinished =
        options.journal.as_ref().map(|journal| unfinished(session, journal, options)).transpose()?.flatten();
    let (network, events) = Network::listen(&session.group, &session.phone_names(), &options.listening)?;
    tracing::info!("group '{}' listens on {}", session.group, network.endpoints().join(", "));
    let live = Course::Live { until_finished: options.until_finished };
    let (mut group, truth_skips) = silent_group(session, latency, live, &options.files, network.receipts())?;
    let journal_path = options.journal.as_ref().map(|journal| journal.path.as_path());
    let files = Files::named(journal_path, options.files.recording.as_deref());
    group.tell_through(Watcher::new(network.status(), files));
    let mut segments = 0;
    if let Some(mut reader) = unfinished {
        // Whether it has ended was looked at before.
        group.retrace(reader.by_ref())?;
        segments = reader.segments();
        reader.damages().iter().for_each(|damage| tracing::warn!("{damage}"));
        tracing::info!("goes on after {} segments of its journal", segments);
    }
    if let Some(options) = &options.journal {
        group.write_to(journal(session, options, latency, segments)?);
    }
    group.go_on(network.history()?);
    let outputs = group.report().1;
    // A listener that does not keep up must not hold up the hub.
    outputs.publish(network.fused_publisher(CongestionControl::Drop).with_json(options.json));
    outputs.show_status(Moment { now: Duration::ZERO, wall_gps: clock::now() });
    let worked = group.work(&events, stop);
    if worked.is_ok() {
        group.wait_for_agents(&events, stop);
    }
    if let Err(error) = worked {
        group.report().1.keep(&error);
        return Err(error);
    }
    let outcome = live_outcome(&mut group, session, &truth_skips);
    // Nobody takes events any more: Zenoh's threads must not wait for that.
    drop(events);
    network.close()?;
    Ok(outcome)
}

/// Does again what a journal tells, with the settings of a session. Blocks.
///
/// # Errors
/// When the journal is of other phones, a truth file cannot be used, or an output cannot be written.
pub fn again(session: &Session, reader: &mut JournalReader, files: &OutputFiles) -> anyhow::Result<Outcome> {
    let latency = reader.origin()?.header.latency;
    check_phones(session, reader.origin()?)?;
    let live = Course::Live { until_finished: false };
    let (mut group, truth_skips) = silent_group(session, latency, live, files, Receipts::default())?;
    if !group.retrace(reader.by_ref())? {
        tracing::warn!("the journal's session did not come to its end");
        group.end_retraced()?;
    }
    reader.damages().iter().for_each(|damage| tracing::warn!("{damage}"));
    Ok(live_outcome(&mut group, session, &truth_skips))
}

/// Does a whole trial again that one or several journals tell of: every epoch in order of its time, as a replay of the phones' recordings would, also
/// those that came too late to be fused. What stands in several journals counts once. Blocks.
///
/// # Errors
/// When a journal is of other phones, a truth file cannot be used, or an output cannot be written.
pub fn in_order(
    session: &Session,
    journals: &mut [JournalReader],
    files: &OutputFiles,
) -> anyhow::Result<Outcome> {
    for journal in journals.iter() {
        check_phones(session, journal.origin()?)?;
    }
    let (mut group, truth_skips) =
        silent_group(session, Duration::ZERO, Course::Replay, files, Receipts::default())?;
    group.take_in_order(journals.iter_mut().flatten())?;
    for journal in journals.iter() {
        journal.damages().iter().for_each(|damage| tracing::warn!("{damage}"));
    }
    Ok(live_outcome(&mut group, session, &truth_skips))
}

/// A group that asks and publishes nothing.
fn silent_group(
    session: &Session,
    maximum_wait: Duration,
    course: Course,
    files: &OutputFiles,
    receipts: Receipts,
) -> anyhow::Result<(Group, Skips)> {
    let phones = session.phone_names();
    let (truths, truth_skips) = read_truths(&session.phones)?;
    let scores = Scores::new(truths, session.truth_quality.clone());
    let mut outputs = Outputs::new(&phones, FusedPublisher::nowhere(), scores);
    outputs.write_to(files, &session.group, true)?;
    let align = AlignOptions { maximum_wait, ..session.settings.estimator.align() };
    let aligner = match course {
        Course::Replay => Aligner::new(phones.len(), align),
        Course::Live { .. } => Aligner::live(phones.len(), align),
    };
    let group = Group::new(Parts {
        name: session.group.clone(),
        course,
        aligner,
        engine: Engine::new(&phones, session.constraints.clone(), session.settings.options()?.1),
        receipts,
        history: HistoryQuestions::silent(),
        outputs,
        phones,
    });
    Ok((group, truth_skips))
}

fn live_outcome(group: &mut Group, session: &Session, truth_skips: &Skips) -> Outcome {
    let settings = SettingsReport::new(&session.settings, &session.truth_quality);
    let mut outcome = outcome(group, truth_skips, settings);
    let failures = [outcome.failure.take(), group.losses(), group.journal_failure().map(str::to_owned)];
    let failures: Vec<String> = failures.into_iter().flatten().collect();
    outcome.failure = (!failures.is_empty()).then(|| failures.join("; "));
    outcome
}

/// The journal at the place of a new one, if it is of the same phones and did not come to its end. What its hub has left of a recording is kept.
fn unfinished(
    session: &Session,
    journal: &JournalOptions,
    options: &LiveOptions,
) -> anyhow::Result<Option<JournalReader>> {
    let path = &journal.path;
    if !path.exists() {
        return Ok(None);
    }
    // What is no journal is never replaced.
    let reader = JournalReader::open(path)?;
    if in_use(path) {
        bail!("{}: another hub writes this journal now; name another one", path.display());
    }
    if options.files.overwrite {
        remove(path).with_context(|| format!("{}: cannot be replaced", path.display()))?;
        return Ok(None);
    }
    check_phones(session, reader.origin()?)?;
    if has_ended(path) {
        bail!(
            "{}: the journal of a session that came to its end; name another one, or say --overwrite",
            path.display()
        );
    }
    if let Some(recording) = &options.files.recording {
        keep_partial(recording, segments(path))
            .with_context(|| format!("{}: what is left of it cannot be kept", recording.display()))?;
    }
    Ok(Some(reader))
}

fn check_phones(session: &Session, origin: &Origin) -> anyhow::Result<()> {
    let (found, expected) = (&origin.header, session.phone_names());
    if found.group != session.group || found.phones != expected {
        bail!(
            "the journal is of group '{}' with {}, the session of group '{}' with {}",
            found.group,
            found.phones.join(", "),
            session.group,
            expected.join(", ")
        );
    }
    Ok(())
}

fn journal(
    session: &Session,
    options: &JournalOptions,
    latency: Duration,
    segments: u32,
) -> anyhow::Result<Journal> {
    let JournalOptions { path, session_path, data, segment_bytes } = options.clone();
    let header =
        Header { group: session.group.clone(), phones: session.phone_names(), latency, session_path, data };
    if segments > 0 {
        return Ok(Journal::go_on(&path, header, segments, clock::now())?.with_segments_of(segment_bytes));
    }
    let text = read(&header.session_path)?;
    Ok(Journal::create(&path, header, &text, clock::now())?.with_segments_of(segment_bytes))
}

fn read(path: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("{}: cannot read the session file", path.display()))
}
