//! The question to a hub for its status, and the answer for people.

use std::fmt::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, bail};
use cofix_agent::publication::endpoint::secured_endpoints;
use cofix_agent::publication::link;
use cofix_agent::publication::secured::Credentials;
use cofix_agent::{AgentConfig, Source, Stop};
use cofix_common::wire::hub_status_key;
use zenoh::Wait;

use super::{SCHEMA, StatusDocument};
use crate::enroll;
use crate::network::intake::words::tamed;
use crate::network::{ON_LOOPBACK, zenoh_error};

/// Longest wait for a hub, and then for its answer.
const PATIENCE: Duration = Duration::from_secs(5);

/// What is asked, and of whom.
#[derive(Clone, Debug, clap::Args)]
pub struct Arguments {
    /// Group, as the session file names it
    pub group: String,
    /// Zenoh endpoint of the hub; may be repeated [default: tcp/127.0.0.1:7447; with --enrolled the addresses of the hub]
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,
    /// The hub's own folder that 'cofix-hub enroll' has written, for a hub with certificates
    #[arg(long, value_name = "DIR")]
    pub enrolled: Option<PathBuf>,
    /// Age of a phone's last epoch from which on it counts as missing, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=86_400))]
    pub within: u32,
    /// Print the hub's JSON document (docs/live.md) instead of a table
    #[arg(long)]
    pub json: bool,
}

impl Arguments {
    /// Where the hub is, and what is shown to it.
    ///
    /// # Errors
    /// When the folder of an enrolled group cannot be used.
    pub fn hub(&self) -> anyhow::Result<(Vec<String>, Option<Credentials>)> {
        let (usual, credentials) = match &self.enrolled {
            None => (vec![ON_LOOPBACK.to_owned()], None),
            Some(folder) => {
                let (register, credentials) = enroll::open(folder)?;
                (secured_endpoints(&register.hub), Some(credentials))
            }
        };
        Ok((if self.connect.is_empty() { usual } else { self.connect.clone() }, credentials))
    }
}

/// Asks a hub for its status. Blocks.
///
/// # Errors
/// When no hub answers, or none of that group, or the answer cannot be read.
pub fn ask(
    group: &str,
    connect: &[String],
    credentials: Option<Credentials>,
    stop: &Stop,
) -> anyhow::Result<StatusDocument> {
    let key = hub_status_key(group)?;
    // The link is an agent's; nothing is published on it.
    let nobody = AgentConfig::new(group, "status", Source::Epochs(Arc::default()));
    let config = AgentConfig { connect: connect.to_vec(), credentials, patience: PATIENCE, ..nobody };
    let session = link::connect(&config, stop)?.context("stopped before a hub has answered")?;
    let replies = session.get(key).timeout(PATIENCE).wait().map_err(zenoh_error)?;
    let answer = replies.recv().ok();
    session.close().wait().map_err(zenoh_error)?;
    let Some(answer) = answer else {
        bail!("a hub answers at {}, and none of group '{group}'", connect.join(", "));
    };
    match answer.result() {
        Ok(sample) => read(&sample.payload().to_bytes()),
        Err(refused) => {
            bail!(
                "the hub has no status yet: {}",
                tamed(&String::from_utf8_lossy(&refused.payload().to_bytes()))
            )
        }
    }
}

fn read(bytes: &[u8]) -> anyhow::Result<StatusDocument> {
    let document: StatusDocument =
        serde_json::from_slice(bytes).context("the hub's status cannot be read")?;
    if document.schema != SCHEMA {
        bail!("the hub's status is of schema {}, and this program reads {SCHEMA}", document.schema);
    }
    Ok(document)
}

impl StatusDocument {
    /// The status for people.
    pub fn table(&self) -> String {
        let file = |name: &Option<String>| name.as_deref().map_or_else(|| "none".to_owned(), tamed);
        let mut text = format!(
            "group {}, hub {}, running for {:.0} s, {} epochs fused\njournal: {}, recording: {}\n\n",
            tamed(&self.group),
            tamed(&self.version),
            self.running_s,
            self.epochs_fused,
            file(&self.journal),
            file(&self.recording)
        );
        let width = self.phones.iter().map(|phone| phone.phone.chars().count()).max().unwrap_or(0).max(5);
        // A String is written to without an error.
        let _ = writeln!(
            text,
            "| {:width$} |  age s | rate Hz | sats | sigma m | epochs |  lost |  late | skipped | verdict",
            "phone"
        );
        for phone in &self.phones {
            let number =
                |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.1}"));
            let _ = writeln!(
                text,
                "| {:width$} | {:>6} | {:>7} | {:>4} | {:>7} | {:>6} | {:>5} | {:>5} | {:>7} | {}{}",
                tamed(&phone.phone),
                number(phone.age_s),
                number(phone.rate_hz),
                phone.satellites.map_or_else(|| "-".to_owned(), |satellites| satellites.to_string()),
                number(phone.horizontal_sigma_m),
                phone.epochs,
                phone.lost,
                phone.late,
                phone.skipped.values().fold(0_u64, |sum, count| sum.saturating_add(*count)),
                tamed(phone.verdict.as_deref().unwrap_or("-")),
                if phone.isolated { " (isolated)" } else { "" }
            );
        }
        text
    }

    /// Checks that every phone has an epoch that is younger than `within_s`.
    ///
    /// # Errors
    /// The phones that have none, with the ages of their last ones.
    pub fn check(&self, within_s: f64) -> anyhow::Result<()> {
        let mut missing = Vec::new();
        for phone in &self.phones {
            match phone.age_s {
                None => missing.push(format!("{}: no epoch yet", tamed(&phone.phone))),
                Some(age_s) if age_s.abs() >= within_s => {
                    missing.push(format!("{}: its last epoch is {age_s:.1} s old", tamed(&phone.phone)));
                }
                Some(_) => {}
            }
        }
        if missing.is_empty() { Ok(()) } else { bail!("{}", missing.join("; ")) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::status::PhoneFigures;

    fn document(ages_s: &[Option<f64>]) -> StatusDocument {
        let phone = |(index, age_s): (usize, &Option<f64>)| PhoneFigures {
            phone: format!("p{index}"),
            age_s: *age_s,
            ..PhoneFigures::default()
        };
        StatusDocument {
            schema: SCHEMA,
            group: "g".to_owned(),
            version: "1".to_owned(),
            running_s: 1.0,
            epochs_fused: 0,
            journal: None,
            recording: None,
            phones: ages_s.iter().enumerate().map(phone).collect(),
        }
    }

    #[test]
    fn phones_without_a_fresh_epoch_are_named() {
        assert!(document(&[Some(9.0), Some(-0.5)]).check(10.0).is_ok());
        let said = document(&[Some(9.0), Some(10.0), None]).check(10.0).unwrap_err().to_string();
        assert_eq!(said, "p1: its last epoch is 10.0 s old; p2: no epoch yet");
    }

    #[test]
    fn ages_grow_until_the_question() {
        let later = document(&[Some(9.0), None]).later(2.5);
        assert_eq!((later.running_s, later.phones[0].age_s, later.phones[1].age_s), (3.5, Some(11.5), None));
    }

    #[test]
    fn texts_from_elsewhere_cannot_forge_lines_of_the_table() {
        let mut forged = document(&[Some(1.0)]);
        forged.phones[0].verdict = Some("\u{1b}[31m\nreliable".to_owned());
        assert_eq!(forged.table().lines().count(), 5, "{}", forged.table());
        assert!(!forged.table().contains('\u{1b}'));
    }
}
