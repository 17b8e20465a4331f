//! Zenoh sessions with explicit endpoints and no scouting.

use std::time::{Duration, Instant};

use zenoh::{Config, Session, Wait};

use crate::{AgentConfig, Stop};

/// Duration of the first and of the longest attempt to connect; between attempts the request to stop is checked. On a link with a long delay
/// the first attempts are too short.
const SLICES: (Duration, Duration) = (Duration::from_secs(1), Duration::from_secs(8));

/// A session that cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// Invalid endpoint.
    #[error("endpoint '{endpoints}': {reason}; write for example tcp/127.0.0.1:7447")]
    Endpoint {
        /// The text.
        endpoints: String,
        /// What is wrong.
        reason: String,
    },
    /// No hub answers.
    #[error("no hub answers at {endpoints} within {waited_s:.0} s: is it running?")]
    Unreachable {
        /// The endpoints.
        endpoints: String,
        /// The wait, s.
        waited_s: f64,
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

/// Interval at which a lost connection is tried again, ms: a restarted hub should have its phones back before the group waits for them.
const RETRY_MS: &str = "{ period_init_ms: 500, period_max_ms: 1000, period_increase_factor: 2 }";
/// Bytes that may wait in the operating system for a slow link: about ten seconds of epochs. Further ones would only be late.
const SEND_BUFFER_BYTES: &str = "32768";

/// Opens a session of an agent that connects to its hub. Blocks; `None` when asked to stop meanwhile, which is noticed within some seconds.
///
/// # Errors
/// When an endpoint is malformed or none answers in time.
pub fn connect(agent: &AgentConfig, stop: &Stop) -> Result<Option<Session>, LinkError> {
    check(&agent.connect, 1)?;
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
            return Err(LinkError::Unreachable { endpoints: agent.connect.join(", "), waited_s });
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
        ("transport/link/tx/queue/congestion_control/block/wait_before_close", &longest_block_us),
    ] {
        config = with(config, key, value, &agent.connect)?;
    }
    Ok(config)
}

/// Whether all endpoints are of the transport that is built in, with a host and a port from `first_port` on.
fn check(endpoints: &[String], first_port: u16) -> Result<(), LinkError> {
    for endpoint in endpoints {
        if let Err(reason) = check_one(endpoint, first_port) {
            return Err(LinkError::Endpoint { endpoints: endpoint.clone(), reason: reason.to_owned() });
        }
    }
    Ok(())
}

fn check_one(endpoint: &str, first_port: u16) -> Result<(), &'static str> {
    let address = endpoint
        .strip_prefix("tcp/")
        .ok_or("it does not begin with tcp/, the only transport that is built in")?;
    // Zenoh's own options may follow.
    let address = address.split(['?', '#']).next().unwrap_or_default();
    let (host, port) = address.rsplit_once(':').ok_or("there is no port")?;
    if host.is_empty() || (host.contains(':') && !(host.starts_with('[') && host.ends_with(']'))) {
        return Err("there is no host before the port (IPv6 addresses are written in brackets)");
    }
    match port.parse::<u16>() {
        Ok(port) if port >= first_port => Ok(()),
        _ => Err("its port is not a number up to 65535"),
    }
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

/// Opens a session that listens on `endpoints` and routes between the sessions that connect. Blocks.
///
/// # Errors
/// When an endpoint is malformed or taken.
pub fn listen(endpoints: &[String]) -> Result<Session, LinkError> {
    check(endpoints, 0)?;
    let config = config("router", "listen/endpoints", endpoints)?;
    zenoh::open(config).wait().map_err(|error| LinkError::Listen {
        endpoints: endpoints.join(", "),
        reason: system_cause(&plain(&error)),
    })
}

fn config(mode: &str, key: &str, endpoints: &[String]) -> Result<Config, LinkError> {
    if endpoints.is_empty() {
        return Err(LinkError::Endpoint {
            endpoints: "(none)".to_owned(),
            reason: "none is given".to_owned(),
        });
    }
    let json = serde_json::json!(endpoints).to_string();
    let config = with(Config::default(), "mode", &format!("\"{mode}\""), endpoints)?;
    let config = with(config, "scouting/multicast/enabled", "false", endpoints)?;
    let config = with(config, "scouting/gossip/enabled", "false", endpoints)?;
    with(config, key, &json, endpoints)
}

fn with(mut config: Config, key: &str, json: &str, endpoints: &[String]) -> Result<Config, LinkError> {
    config
        .insert_json5(key, json)
        .map_err(|error| LinkError::Endpoint { endpoints: endpoints.join(", "), reason: plain(&error) })?;
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
    fn endpoints_that_are_none_are_refused_with_a_reason() {
        for (endpoint, said) in [
            ("", "does not begin with tcp/"),
            ("nonsense", "does not begin with tcp/"),
            ("127.0.0.1:7447", "does not begin with tcp/"),
            ("tls/127.0.0.1:7447", "does not begin with tcp/"),
            ("tcp/", "no port"),
            ("tcp/127.0.0.1", "no port"),
            ("tcp/:7447", "no host"),
            ("tcp/::1:7447", "no host"),
            ("tcp/host:x", "not a number"),
            ("tcp/host:65536", "not a number"),
            ("tcp/host:", "not a number"),
        ] {
            let error = check(&[endpoint.to_owned()], 0).unwrap_err().to_string();
            assert!(error.starts_with(&format!("endpoint '{endpoint}': ")), "{error}");
            assert!(
                error.contains(said) && error.ends_with("write for example tcp/127.0.0.1:7447"),
                "{error}"
            );
        }
        for endpoint in ["tcp/127.0.0.1:0", "tcp/[::1]:7447", "tcp/hub.example:7447#iface=eth0"] {
            check(&[endpoint.to_owned()], 0).unwrap();
        }
        assert!(check(&["tcp/127.0.0.1:0".to_owned()], 1).is_err(), "nothing answers on port 0");
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
