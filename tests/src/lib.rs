//! Helpers of the whole-system tests: small simulated sessions, and a hub and agents as separate parts so that faults can be put between
//! them.

pub mod by_hand;
pub mod enrolled;
#[path = "../../agent/tests/limits/mod.rs"]
pub mod limits;
pub mod slow_link;

use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use cofix_agent::publication::link;
use cofix_agent::{AgentConfig, AgentError, AgentReport, ProductSource, Source, Stop};
use cofix_common::fusion::align::Aligner;
use cofix_common::fusion::engine::Engine;
use cofix_common::simulation::{PhoneOptions, Scenario};
use cofix_hub::group::{Course, Group, Parts};
use cofix_hub::network::{Listening, Network};
use cofix_hub::outputs::Outputs;
use cofix_hub::replay::Plan;
use cofix_hub::report::Report;
use cofix_hub::report::scores::Scores;
use cofix_hub::status::{Files, Watcher};
use limits::Running;
use zenoh::qos::CongestionControl;

/// An endpoint on loopback with a port that the system chooses.
const LOOPBACK: &str = "tcp/127.0.0.1:0";

/// A convoy of `phones` phones for `duration_s` seconds on an open road.
///
/// # Errors
/// When it cannot be simulated.
pub fn small_plan(phones: usize, duration_s: f64) -> anyhow::Result<Plan> {
    plan_of((0..phones).map(PhoneOptions::of_vehicle).map(from_the_start).collect(), duration_s)
}

/// A convoy of the given phones.
///
/// # Errors
/// When it cannot be simulated.
pub fn plan_of(phones: Vec<PhoneOptions>, duration_s: f64) -> anyhow::Result<Plan> {
    cofix_hub::demo::plan(Scenario { duration_s, phones, ..Scenario::default() })
}

fn from_the_start(phone: PhoneOptions) -> PhoneOptions {
    PhoneOptions { starts_after_s: 0.0, stops_before_s: 0.0, ..phone }
}

/// A hub on a thread of its own.
pub struct Hub {
    /// Endpoints for agents.
    pub endpoints: Vec<String>,
    /// Ends the hub.
    pub stop: Stop,
    thread: Running<anyhow::Result<Report>>,
}

impl Hub {
    /// Starts a hub for a plan's group on a port that the system chooses.
    ///
    /// # Errors
    /// When it cannot listen.
    pub fn start(plan: &Plan, course: Course) -> anyhow::Result<Self> {
        Self::start_at(plan, course, LOOPBACK)
    }

    /// Starts a hub that listens on `endpoint`.
    ///
    /// # Errors
    /// When it cannot.
    pub fn start_at(plan: &Plan, course: Course, endpoint: &str) -> anyhow::Result<Self> {
        Self::start_for(plan, course, &Listening::plain(&[endpoint]))
    }

    /// Starts a hub that listens as told.
    ///
    /// # Errors
    /// When it cannot.
    pub fn start_for(plan: &Plan, course: Course, listening: &Listening) -> anyhow::Result<Self> {
        let phones: Vec<String> = plan.phones.iter().map(|phone| phone.name.clone()).collect();
        let (network, events) = Network::listen(&plan.group, &phones, listening)?;
        let endpoints = network.endpoints();
        let truths = plan.phones.iter().map(|phone| (phone.name.clone(), phone.truth.clone())).collect();
        let scores = Scores::new(truths, plan.truth_quality.clone());
        let aligner = match course {
            Course::Replay => Aligner::new(phones.len(), plan.settings.estimator.align()),
            Course::Live { .. } => Aligner::live(phones.len(), plan.settings.estimator.align()),
        };
        let mut group = Group::new(Parts {
            name: plan.group.clone(),
            course,
            aligner,
            engine: Engine::new(&phones, plan.constraints.clone(), plan.settings.options()?.1),
            receipts: network.receipts(),
            history: network.history()?,
            outputs: Outputs::new(
                &phones,
                network.fused_publisher(CongestionControl::Block).with_json(true),
                scores,
            ),
            phones,
        })
        .with_grace(Duration::from_secs(4));
        group.tell_through(Watcher::new(network.status(), Files::default()));
        let stop = Stop::default();
        let asked = stop.clone();
        let thread = limits::spawn(move || {
            group.work(&events, &asked)?;
            group.wait_for_agents(&events, &asked);
            let report = group.report().0;
            drop(events);
            network.close()?;
            Ok(report)
        });
        Ok(Self { endpoints, stop, thread })
    }

    /// Waits for the end.
    ///
    /// # Errors
    /// Why the hub failed.
    pub fn join(self) -> anyhow::Result<Report> {
        self.thread.join().map_err(|_| anyhow::anyhow!("the hub panicked"))?
    }

    /// Whether it has come to its end.
    pub fn is_over(&self) -> bool {
        self.thread.is_finished()
    }

    /// Asks the hub to end, and waits for that.
    ///
    /// # Errors
    /// Why the hub failed.
    pub fn end(self) -> anyhow::Result<Report> {
        self.stop.request();
        self.join()
    }

    /// A Zenoh session that is not an agent's.
    ///
    /// # Errors
    /// When the hub does not answer.
    pub fn foreign_session(&self) -> anyhow::Result<zenoh::Session> {
        let nobody = AgentConfig::new("g", "p", Source::Epochs(Arc::default()));
        connect(&AgentConfig { connect: self.endpoints.clone(), ..nobody })
    }
}

/// A Zenoh session that is connected to an agent's hub.
///
/// # Errors
/// When the hub does not answer.
pub fn connect(agent: &AgentConfig) -> anyhow::Result<zenoh::Session> {
    link::connect(agent, &Stop::default())?.context("nobody asked to stop")
}

/// The configuration of the agent of a plan's phone.
///
/// # Errors
/// When the plan has no such phone.
pub fn agent_config(plan: &Plan, phone: usize, connect: &[String]) -> anyhow::Result<AgentConfig> {
    let planned = plan.phones.get(phone).context("no such phone")?;
    let ProductSource::Loaded(products) = &plan.products else { anyhow::bail!("products are not loaded") };
    Ok(AgentConfig {
        products: ProductSource::Loaded(products.clone()),
        connect: connect.to_vec(),
        log: plan.settings.log.with(&plan.settings.masks)?,
        pipeline: plan.pipeline(planned)?,
        patience: Duration::from_secs(20),
        ..AgentConfig::new(&plan.group, &planned.name, planned.source.clone())
    })
}

/// An agent on a thread of its own.
pub type AgentThread = Running<Result<AgentReport, AgentError>>;

/// Starts an agent.
pub fn start_agent(config: AgentConfig) -> AgentThread {
    limits::spawn(move || cofix_agent::run(&config, &Stop::default()))
}

/// Runs the agents of all phones of a plan to their end.
///
/// # Errors
/// When one fails.
pub fn run_agents(plan: &Plan, connect: &[String]) -> anyhow::Result<()> {
    let configs: anyhow::Result<Vec<_>> =
        (0..plan.phones.len()).map(|phone| agent_config(plan, phone, connect)).collect();
    let agents: Vec<AgentThread> = configs?.into_iter().map(start_agent).collect();
    for agent in agents {
        agent.join().map_err(|_| anyhow::anyhow!("an agent panicked"))??;
    }
    Ok(())
}
