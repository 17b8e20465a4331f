//! Groups whose phones have certificates, and sessions of strangers.

use std::time::Duration;

use anyhow::Context;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use cofix_agent::join::Join;
use cofix_agent::publication::secured::Credentials;
use cofix_agent::{AgentConfig, AgentError, AgentReport, Stop};
use cofix_hub::enroll::{Arguments, enroll};
use cofix_hub::network::{ListenArguments, Listening};
use cofix_hub::replay::Plan;
use tempfile::TempDir;
use zenoh::{Config, Session, Wait};

use crate::{agent_config, start_agent};

/// A phone that is enrolled in every group here, and in no session.
pub const LIAR: &str = "LIAR";

/// An enrolled group on loopback.
pub struct Enrolled {
    folder: TempDir,
    group: String,
}

impl Enrolled {
    /// The phones of a plan, and [`LIAR`].
    ///
    /// # Errors
    /// When no files can be written.
    pub fn new(plan: &Plan) -> anyhow::Result<Self> {
        let new = Self { folder: tempfile::tempdir()?, group: plan.group.clone() };
        let names = plan.phones.iter().map(|phone| phone.name.clone()).chain([LIAR.to_owned()]);
        new.change(names.collect(), Vec::new())?;
        Ok(new)
    }

    /// Enrolls phones and revokes others.
    ///
    /// # Errors
    /// As of [`enroll`].
    pub fn change(&self, phone: Vec<String>, revoke: Vec<String>) -> anyhow::Result<()> {
        let hub_address = vec!["127.0.0.1:7447".to_owned()];
        let out = Some(self.folder.path().to_owned());
        let group = self.group.clone();
        enroll(&Arguments { group, hub_address, phone, revoke, out, days: 2, qr: false }).map(drop)
    }

    /// A hub's listening for the group, on a port that the system chooses.
    ///
    /// # Errors
    /// When the group cannot be listened for.
    pub fn listening(&self, share_fused: bool) -> anyhow::Result<Listening> {
        let listen = vec!["tls/127.0.0.1:0".to_owned()];
        let enrolled = Some(self.folder.path().to_owned());
        ListenArguments { listen, enrolled, share_fused, insecure: false }.of_group(&self.group, &[])
    }

    /// What a phone shows.
    ///
    /// # Errors
    /// When it is not enrolled.
    pub fn credentials(&self, phone: &str) -> anyhow::Result<Credentials> {
        Ok(Join::read(&self.folder.path().join(format!("{phone}.cofix")))?.credentials)
    }

    /// What the hub shows.
    ///
    /// # Errors
    /// When its folder cannot be read.
    pub fn of_hub(&self) -> anyhow::Result<Credentials> {
        Ok(cofix_hub::enroll::open(self.folder.path())?.1)
    }

    /// The configuration of the agent of a plan's phone, with its certificate.
    ///
    /// # Errors
    /// When the plan has no such phone.
    pub fn agent(&self, plan: &Plan, phone: usize, connect: &[String]) -> anyhow::Result<AgentConfig> {
        let config = agent_config(plan, phone, connect)?;
        Ok(AgentConfig { credentials: Some(self.credentials(&config.phone)?), ..config })
    }

    /// Runs the agents of all phones of a plan to their end.
    ///
    /// # Errors
    /// When one fails.
    pub fn run_agents(&self, plan: &Plan, connect: &[String]) -> anyhow::Result<()> {
        let configs: anyhow::Result<Vec<_>> =
            (0..plan.phones.len()).map(|phone| self.agent(plan, phone, connect)).collect();
        let agents: Vec<_> = configs?.into_iter().map(start_agent).collect();
        for agent in agents {
            agent.join().map_err(|_| anyhow::anyhow!("an agent panicked"))??;
        }
        Ok(())
    }
}

/// Runs an agent that gives up soon.
///
/// # Errors
/// Why it failed.
pub fn run_impatient(agent: AgentConfig) -> Result<AgentReport, AgentError> {
    cofix_agent::run(&AgentConfig { patience: Duration::from_secs(3), ..agent }, &Stop::default())
}

/// A stranger: a Zenoh session of any mode that is not an agent's.
#[derive(Clone, Debug)]
pub struct Stranger {
    /// Zenoh's mode of the session.
    pub mode: &'static str,
    /// What it shows, and whom it believes.
    pub credentials: Option<Credentials>,
    /// Whether it shows its certificate.
    pub shows_certificate: bool,
}

impl Stranger {
    /// A client that shows these credentials.
    pub const fn with(credentials: Credentials) -> Self {
        Self { mode: "client", credentials: Some(credentials), shows_certificate: true }
    }

    /// Connects to a hub.
    ///
    /// # Errors
    /// When the hub does not let it in.
    pub fn connect(&self, endpoints: &[String]) -> anyhow::Result<Session> {
        let mut settings = vec![
            ("mode", format!("'{}'", self.mode)),
            ("scouting/multicast/enabled", "false".to_owned()),
            ("scouting/gossip/enabled", "false".to_owned()),
            ("listen/endpoints", "[]".to_owned()),
            ("connect/endpoints", format!("{endpoints:?}")),
            ("connect/timeout_ms", "3000".to_owned()),
            ("connect/exit_on_failure", "true".to_owned()),
        ];
        if let Some(credentials) = &self.credentials {
            let coded = |pem: &str| format!("'{}'", STANDARD.encode(pem));
            settings.push(("transport/link/tls/root_ca_certificate_base64", coded(&credentials.authority)));
            if self.shows_certificate {
                let own = coded(&credentials.certificate);
                settings.push(("transport/link/tls/connect_certificate_base64", own));
                settings.push(("transport/link/tls/connect_private_key_base64", coded(&credentials.key)));
                settings.push(("transport/link/tls/enable_mtls", "true".to_owned()));
            }
        }
        let mut config = Config::default();
        for (key, value) in settings {
            config.insert_json5(key, &value).map_err(|error| anyhow::anyhow!("{key}: {error}"))?;
        }
        zenoh::open(config).wait().map_err(|error| anyhow::anyhow!("{error}")).context("not let in")
    }
}
