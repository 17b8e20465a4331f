//! Where a hub listens, and for whom.

use std::path::{Path, PathBuf};

use anyhow::bail;
use cofix_agent::clock;
use cofix_agent::publication::endpoint::{host_and_port, is_on_loopback};
use cofix_agent::publication::secured::Guard;

use super::access::access_control;
use crate::enroll;

/// Where a hub listens without certificates, unless told otherwise.
pub(crate) const ON_LOOPBACK: &str = "tcp/127.0.0.1:7447";

/// Where a hub listens, and for whom.
#[derive(Clone, Debug)]
pub struct Listening {
    /// Zenoh's endpoints.
    pub endpoints: Vec<String>,
    /// Whom it lets in; `None`: everybody.
    pub guard: Option<Guard>,
    /// Whether there is a limit of what a phone may send; agents of this process need none.
    pub is_limited: bool,
}

impl Listening {
    /// For everybody who reaches the endpoints, without a limit.
    pub fn plain(endpoints: &[&str]) -> Self {
        let endpoints = endpoints.iter().map(|&endpoint| endpoint.to_owned()).collect();
        Self { endpoints, guard: None, is_limited: false }
    }
}

/// Options of the command line.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct ListenArguments {
    /// Zenoh endpoint to listen on; may be repeated [default: tcp/127.0.0.1:7447; with --enrolled on all addresses of this computer in TLS, on the port under which phones reach the hub]
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Vec<String>,
    /// Folder that 'cofix-hub enroll' has written: only its phones may connect, each may speak for itself alone, and what is said is encrypted
    #[arg(long, value_name = "DIR")]
    pub enrolled: Option<PathBuf>,
    /// Every enrolled phone may read the fused states of the whole group, and who was isolated
    #[arg(long, requires = "enrolled")]
    pub share_fused: bool,
    /// Listen beyond this computer without certificates: whoever reaches the hub may read all positions and speak for every phone
    #[arg(long, conflicts_with = "enrolled")]
    pub insecure: bool,
}

impl ListenArguments {
    /// Where the hub of a group listens, and for whom.
    ///
    /// # Errors
    /// When anybody beyond this computer could speak and `--insecure` is not said, or the folder is of another group or cannot be used.
    pub fn of_group(&self, group: &str, phones: &[String]) -> anyhow::Result<Listening> {
        let Some(folder) = &self.enrolled else { return self.without_certificates() };
        let (register, credentials) = enroll::open(folder)?;
        if register.group != group {
            bail!("{}: is of group '{}', and the session of '{group}'", folder.display(), register.group);
        }
        for said in register.expiries(clock::now()) {
            tracing::warn!("{said}; 'cofix-hub enroll' writes a new one");
        }
        let is_enrolled = |phone: &&String| register.phones.iter().any(|member| member.name == **phone);
        for phone in phones.iter().filter(|phone| !is_enrolled(phone)) {
            tracing::warn!("{phone}: is in the session and not enrolled, so that it cannot connect");
        }
        let endpoints =
            if self.listen.is_empty() { everywhere(&register.hub, folder)? } else { self.listen.clone() };
        let access_control = access_control(&register, self.share_fused)?;
        let guard = Some(Guard { credentials, access_control });
        Ok(Listening { endpoints, guard, is_limited: true })
    }

    fn without_certificates(&self) -> anyhow::Result<Listening> {
        if self.listen.is_empty() {
            return Ok(Listening { is_limited: true, ..Listening::plain(&[ON_LOOPBACK]) });
        }
        if let Some(open) = self.listen.iter().find(|endpoint| !is_on_loopback(endpoint))
            && !self.insecure
        {
            bail!(
                "--listen {open}: whoever reaches this address could read every position and speak for every phone, since nothing is encrypted and nobody \
                 shows who it is. Make certificates with 'cofix-hub enroll' and name their folder with --enrolled, listen on {ON_LOOPBACK} for \
                 agents on this computer, or say --insecure in a network in which you trust everybody"
            );
        }
        Ok(Listening { endpoints: self.listen.clone(), guard: None, is_limited: true })
    }
}

/// All addresses of this computer, on the ports of the hub's addresses.
fn everywhere(addresses: &[String], folder: &Path) -> anyhow::Result<Vec<String>> {
    let (mut ports, mut all) = (Vec::new(), "0.0.0.0");
    for address in addresses {
        let (host, port) = host_and_port(address)
            .map_err(|reason| anyhow::anyhow!("{}: '{address}': {reason}", folder.display()))?;
        if host.contains(':') {
            // Takes connections of both versions of the protocol.
            all = "[::]";
        }
        ports.push(port);
    }
    ports.sort_unstable();
    ports.dedup();
    Ok(ports.iter().map(|port| format!("tls/{all}:{port}")).collect())
}
