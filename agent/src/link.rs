//! Zenoh sessions with explicit endpoints and no scouting.

use std::time::Duration;

use zenoh::{Config, Session, Wait};

/// A session that cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// An endpoint that is none.
    #[error("endpoint {endpoints}: {reason}; write for example tcp/127.0.0.1:7447")]
    Endpoint {
        /// What was given.
        endpoints: String,
        /// What is wrong.
        reason: String,
    },
    /// Nobody answers.
    #[error("no hub answers at {endpoints} within {waited_s:.0} s: is it running? ({reason})")]
    Unreachable {
        /// The endpoints.
        endpoints: String,
        /// How long was waited, s.
        waited_s: f64,
        /// What Zenoh says.
        reason: String,
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

/// Opens a session that connects to `endpoints`, waiting up to `patience` for one of them to answer. Blocks.
///
/// # Errors
/// When an endpoint is malformed or none answers in time.
pub fn connect(endpoints: &[String], patience: Duration) -> Result<Session, LinkError> {
    let milliseconds = patience.as_millis().to_string();
    let config = config("client", "connect/endpoints", endpoints)
        .and_then(|config| with(config, "connect/timeout_ms", &milliseconds, endpoints))?;
    zenoh::open(config).wait().map_err(|error| LinkError::Unreachable {
        endpoints: endpoints.join(", "),
        waited_s: patience.as_secs_f64(),
        reason: error.to_string(),
    })
}

/// Opens a session that listens on `endpoints` and routes between those who connect. Blocks.
///
/// # Errors
/// When an endpoint is malformed or taken.
pub fn listen(endpoints: &[String]) -> Result<Session, LinkError> {
    let config = config("router", "listen/endpoints", endpoints)?;
    zenoh::open(config)
        .wait()
        .map_err(|error| LinkError::Listen { endpoints: endpoints.join(", "), reason: error.to_string() })
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
    config.insert_json5(key, json).map_err(|error| LinkError::Endpoint {
        endpoints: endpoints.join(", "),
        reason: error.to_string(),
    })?;
    Ok(config)
}
