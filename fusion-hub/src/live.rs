//! A live session.

use std::time::Duration;

use cofix_agent::status::Moment;
use cofix_agent::{Stop, clock};
use cofix_common::fusion::align::{AlignOptions, Aligner};
use cofix_common::fusion::engine::Engine;
use zenoh::qos::CongestionControl;

use crate::group::{Course, Group, Parts};
use crate::network::Network;
use crate::outputs::{OutputFiles, Outputs};
use crate::replay::{Outcome, outcome};
use crate::report::SettingsReport;
use crate::report::scores::Scores;
use crate::session::Session;
use crate::session::truths::read_truths;

/// Options of a live hub.
#[derive(Clone, Debug)]
pub struct LiveOptions {
    /// Zenoh endpoints to listen on.
    pub listen: Vec<String>,
    /// Files to write.
    pub files: OutputFiles,
    /// Whether to end when the agents of all phones have finished.
    pub until_finished: bool,
    /// Longest wait of the group for a phone, in place of the session's.
    pub latency: Option<Duration>,
}

/// Runs a hub until `stop` is requested or, with `until_finished`, all agents have finished. Blocks.
///
/// # Errors
/// When the endpoints cannot be listened on, a truth file cannot be used, or an output cannot be written.
pub fn run(session: &Session, options: &LiveOptions, stop: &Stop) -> anyhow::Result<Outcome> {
    let phones = session.phone_names();
    let (truths, truth_skips) = read_truths(&session.phones)?;
    let (network, events) = Network::listen(&session.group, &phones, &options.listen)?;
    let scores = Scores::new(truths, session.truth_quality.clone());
    // A listener that does not keep up must not hold up the hub.
    let mut outputs = Outputs::new(&phones, network.fused_publisher(CongestionControl::Drop), scores);
    outputs.write_to(&options.files, &session.group, true)?;
    outputs.show_status(Moment { now: Duration::ZERO, wall_gps: clock::now() });
    tracing::info!("group '{}' listens on {}", session.group, network.endpoints().join(", "));
    let align = session.settings.estimator.align();
    let maximum_wait = options.latency.unwrap_or(align.maximum_wait);
    let mut group = Group::new(Parts {
        name: session.group.clone(),
        course: Course::Live { until_finished: options.until_finished },
        aligner: Aligner::live(phones.len(), AlignOptions { maximum_wait, ..align }),
        engine: Engine::new(&phones, session.constraints.clone(), session.settings.options()?.1),
        receipts: network.receipts(),
        history: network.history()?,
        outputs,
        phones,
    });
    let worked = group.work(&events, stop);
    if worked.is_ok() {
        group.wait_for_agents(&events, stop);
    }
    if let Err(error) = worked {
        group.report().1.keep(&error);
        return Err(error);
    }
    let mut outcome =
        outcome(&mut group, &truth_skips, SettingsReport::new(&session.settings, &session.truth_quality));
    let losses = group.losses();
    outcome.failure = match (outcome.failure.take(), losses) {
        (Some(failure), Some(losses)) => Some(format!("{failure}; {losses}")),
        (failure, losses) => failure.or(losses),
    };
    // Nobody takes events any more: Zenoh's threads must not wait for that.
    drop(events);
    network.close()?;
    Ok(outcome)
}
