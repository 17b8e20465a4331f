//! Zenoh sessions with explicit endpoints and no scouting.

use std::time::{Duration, Instant};

use zenoh::{Config, Session, Wait};

use super::endpoint::{check, plain_or_secured};
use super::limits::{AGENT_LIMITS, GUARDED_LIMITS, HUB_LIMITS};
use super::secured::Guard;
use crate::{AgentConfig, Stop};

/// Duration of the first and of the longest attempt to connect; between attempts the request to stop is checked. On a link with a long delay
/// the first attempts are too short.
const SLICES: (Duration, Duration) = (Duration::from_secs(1), Duration::from_secs(8));

/// A session that cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// Invalid endpoint.
    #[error("endpoint '{endpoints}': {reason}; write for example {example}")]
    Endpoint {
        /// The text.
        endpoints: String,
        /// What is wrong.
        reason: String,
        /// One that is right.
        example: &'static str,
    },
    /// A setting that Zenoh does not take.
    #[error("Zenoh's setting {key}: {reason}")]
    Setting {
        /// Its key.
        key: String,
        /// What Zenoh says.
        reason: String,
    },
    /// No hub answers.
    #[error("no hub answers at {endpoints} within {waited_s:.0} s: is it running{}?", about_certificates(*is_secured))]
    Unreachable {
        /// The endpoints.
        endpoints: String,
        /// The wait, s.
        waited_s: f64,
        /// Whether both sides show certificates.
        is_secured: bool,
    },
    /// The endpoint cannot be listened on.
    #[error("cannot listen on {endpoints}: {reason}")]
    Listen {
        /// The endpoints.
        endpoints: String,
        /// What Zenoh says.
        reason: String,
    },
}

const fn about_certificates(is_secured: bool) -> &'static str {
    if is_secured {
        ", at an address that it was enrolled for, and are both certificates of one authority and valid still"
    } else {
        ""
    }
}

/// Interval at which a lost connection is tried again, ms: a restarted hub should have its phones back before the group waits for them.
const RETRY_MS: &str = "{ period_init_ms: 500, period_max_ms: 1000, period_increase_factor: 2 }";
/// Bytes that may wait in the operating system for a slow link: about ten seconds of epochs. Further ones would only be late.
const SEND_BUFFER_BYTES: &str = "32768";

/// Opens a session of an agent that connects to its hub. Blocks; `None` when asked to stop meanwhile, which is noticed within some seconds.
///
/// # Errors
/// When an endpoint is malformed or none answers in time.
pub fn connect(agent: &AgentConfig, stop: &Stop) -> Result<Option<Session>, LinkError> {
    check(&agent.connect, plain_or_secured(agent.credentials.is_some()), 1)?;
    let start = Instant::now();
    let (mut longest, limit) = SLICES;
    loop {
        if stop.is_requested() {
            return Ok(None);
        }
        let slice = agent.patience.saturating_sub(start.elapsed()).min(longest);
        longest = limit.min(2 * longest);
        let begun = Instant::now();
        match zenoh::open(client(agent, slice)?).wait() {
            Ok(session) => return Ok(Some(session)),
            Err(error) => tracing::debug!("{}", plain(&error)),
        }
        if start.elapsed() >= agent.patience {
            let waited_s = agent.patience.as_secs_f64();
            let (endpoints, is_secured) = (agent.connect.join(", "), agent.credentials.is_some());
            return Err(LinkError::Unreachable { endpoints, waited_s, is_secured });
        }
        // An attempt may fail at once.
        if stop.sleep(slice.min(SLICES.0).saturating_sub(begun.elapsed())) {
            return Ok(None);
        }
    }
}

/// The configuration of an attempt to connect of this duration.
fn client(agent: &AgentConfig, attempt: Duration) -> Result<Config, LinkError> {
    let attempt_ms = attempt.as_millis().max(1).to_string();
    let longest_block_us = agent.longest_block().as_micros().to_string();
    let mut config = config("client", "connect/endpoints", &agent.connect)?;
    for (key, value) in [
        ("connect/timeout_ms", attempt_ms.as_str()),
        ("connect/retry", RETRY_MS),
        ("transport/link/tcp/so_sndbuf", SEND_BUFFER_BYTES),
        ("transport/link/tls/so_sndbuf", SEND_BUFFER_BYTES),
        ("transport/link/tx/queue/congestion_control/block/wait_before_close", &longest_block_us),
    ] {
        config = with(config, key, value)?;
    }
    let config = with_all(config, AGENT_LIMITS)?;
    agent.credentials.iter().try_fold(config, |config, own| with_all(config, &own.to_connect()))
}

/// Zenoh's message, without the places in its source.
pub fn plain(error: &impl std::fmt::Display) -> String {
    let text = error.to_string();
    let mut parts = text.split(" at ");
    let mut plain = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (place, rest) = part.split_at(part.find(char::is_whitespace).unwrap_or(part.len()));
        if place.contains(".rs:") {
            plain.push_str(rest);
        } else {
            plain.push_str(" at ");
            plain.push_str(part);
        }
    }
    plain.trim_end_matches(['.', ' ']).to_owned()
}

/// The operating system's part of Zenoh's message, where there is one.
fn system_cause(text: &str) -> String {
    let cause = text.find("(os error").and_then(|at| {
        let end = at + text.get(at..)?.find(')')? + 1;
        let start = text.get(..at)?.rfind([':', '['])? + 1;
        text.get(start..end)
    });
    cause.unwrap_or(text).trim().to_owned()
}

/// Opens a session that listens on `endpoints` and routes between the sessions that connect: in TLS for those that `guard` lets in, or plainly
/// for everybody. Blocks.
///
/// # Errors
/// When an endpoint is malformed or taken, or Zenoh does not take the guard.
pub fn listen(endpoints: &[String], guard: Option<&Guard>) -> Result<Session, LinkError> {
    check(endpoints, plain_or_secured(guard.is_some()), 0)?;
    let mut config = with_all(config("router", "listen/endpoints", endpoints)?, HUB_LIMITS)?;
    if let Some(Guard { credentials, access_control }) = guard {
        config = with_all(config, GUARDED_LIMITS)?;
        config = with_all(config, &credentials.to_listen())?;
        config = with(config, "access_control", &access_control.to_string())?;
    }
    zenoh::open(config).wait().map_err(|error| LinkError::Listen {
        endpoints: endpoints.join(", "),
        reason: system_cause(&plain(&error)),
    })
}

fn config(mode: &str, key: &str, endpoints: &[String]) -> Result<Config, LinkError> {
    let json = serde_json::json!(endpoints).to_string();
    let config = with(Config::default(), "mode", &format!("\"{mode}\""))?;
    let config = with(config, "scouting/multicast/enabled", "false")?;
    let config = with(config, "scouting/gossip/enabled", "false")?;
    with(config, key, &json)
}

fn with_all<V: AsRef<str>>(config: Config, settings: &[(&str, V)]) -> Result<Config, LinkError> {
    settings.iter().try_fold(config, |config, (key, json)| with(config, key, json.as_ref()))
}

fn with(mut config: Config, key: &str, json: &str) -> Result<Config, LinkError> {
    config
        .insert_json5(key, json)
        .map_err(|error| LinkError::Setting { key: key.to_owned(), reason: plain(&error) })?;
    Ok(config)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::Source;

    #[test]
    fn places_in_foreign_source_are_left_out() {
        let text = "Unable to connect to tcp/127.0.0.1:9 at /home/x/zenoh-1.10/src/net/mod.rs:123. - Caused by refused at once at b/c.rs:4.";
        assert_eq!(plain(&text), "Unable to connect to tcp/127.0.0.1:9 - Caused by refused at once");
        assert_eq!(plain(&"no place at all."), "no place at all");
    }

    #[test]
    fn of_a_long_message_the_systems_words_are_told() {
        let text = "Can not create a new TCP listener bound to tcp/1.2.3.4:5: [1.2.3.4:5: Cannot assign requested address (os error 99)";
        assert_eq!(system_cause(text), "Cannot assign requested address (os error 99)");
        assert_eq!(system_cause("invalid port value"), "invalid port value");
    }

    #[test]
    fn a_request_to_stop_ends_the_attempts() {
        let stop = Stop::default();
        let asked = stop.clone();
        let connect = vec!["tcp/127.0.0.1:9".to_owned()];
        let day = Duration::from_hours(24);
        let source = Source::Epochs(Arc::default());
        let agent = AgentConfig { connect, patience: day, ..AgentConfig::new("g", "p", source) };
        let attempts = std::thread::spawn(move || super::connect(&agent, &asked));
        stop.request();
        assert!(matches!(attempts.join().unwrap(), Ok(None)));
    }
}
