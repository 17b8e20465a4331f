//! What an agent says on Zenoh, so that nothing of it is lost.
//!
//! - The first epoch waits until somebody listens.
//! - The last messages are kept, so that a hub that comes late or reconnects gets what it missed, in order.
//! - When a listener comes in mid-run, nothing is said for a moment, so that it asks for the history first: what is older than the first
//!   sample that it gets would not reach it any more. (This helps
//!   and is no guarantee: a history that does not come is counted by the hub as missing.)
//! - Samples carry the id of the agent's Zenoh session, which tells one run of an agent from the next.
//! - At the end the agent asks the hub how many epochs it has, and stays until that is all of them.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use cofix_common::wire::{
    EpochMessage, KeyNameError, PhoneStatus, StatusMessage, WireError, encode, epoch_key, liveliness_key,
    receipt_key, status_key,
};
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::{CongestionControl, Reliability};
use zenoh::{Session, Wait};
use zenoh_ext::{AdvancedPublisher, AdvancedPublisherBuilderExt, CacheConfig, MissDetectionConfig};

use crate::{Stop, link};

/// How often a late last sample is announced.
const HEARTBEAT: Duration = Duration::from_millis(500);
/// How long nothing is said after a listener has come in mid-run.
const HUSH: Duration = Duration::from_millis(500);
/// How often something awaited is looked at.
const POLL: Duration = Duration::from_millis(5);
/// Longest wait for an answer to one question about receipts.
const ANSWER: Duration = Duration::from_secs(2);
/// Longest wait for receipts without progress once asked to stop.
const LAST_WORDS: Duration = Duration::from_secs(1);

/// Why something could not be published.
#[derive(Debug, thiserror::Error)]
pub enum PublicationError {
    /// A name that cannot be part of a key.
    #[error(transparent)]
    Name(#[from] KeyNameError),
    /// A message that cannot be encoded.
    #[error(transparent)]
    Wire(#[from] WireError),
    /// Zenoh refuses.
    #[error("Zenoh: {0}")]
    Zenoh(String),
    /// The hub does not want this phone.
    #[error("the hub refuses the phone: {0}")]
    Refused(String),
    /// Nobody subscribes.
    #[error(
        "connected, but no hub listens for group '{group}' within {waited_s:.0} s: does it run this group?"
    )]
    NoListener {
        /// The group.
        group: String,
        /// How long was waited, s.
        waited_s: f64,
    },
}

#[allow(clippy::needless_pass_by_value)] // for `map_err`
fn zenoh_error(error: impl std::fmt::Display) -> PublicationError {
    PublicationError::Zenoh(link::plain(&error))
}

/// Who publishes.
#[derive(Clone, Copy, Debug)]
pub struct Publisher<'a> {
    /// The group.
    pub group: &'a str,
    /// The phone.
    pub phone: &'a str,
    /// How many of the last messages are kept for a hub that comes late or reconnects.
    pub kept_messages: usize,
}

/// One agent's publishers and liveliness token.
pub struct Publication {
    group: String,
    phone: String,
    receipt_key: String,
    session: Session,
    epochs: AdvancedPublisher<'static>,
    status: AdvancedPublisher<'static>,
    alive: LivelinessToken,
    published: u64,
    /// When the first epoch was published.
    begun: Option<Instant>,
    /// When somebody last began to listen to epochs.
    listened_since: Arc<Mutex<Option<Instant>>>,
}

impl Publication {
    /// Declares everything on a session, which it closes at the end.
    ///
    /// # Errors
    /// When a name cannot be part of a key, or Zenoh refuses.
    pub fn declare(session: Session, publisher: Publisher<'_>) -> Result<Self, PublicationError> {
        let Publisher { group, phone, kept_messages } = publisher;
        let epochs = declare(&session, epoch_key(group, phone)?, kept_messages)?;
        let status = declare(&session, status_key(group, phone)?, 2)?;
        let listened_since = Arc::new(Mutex::new(None));
        let since = Arc::clone(&listened_since);
        epochs
            .matching_listener()
            .callback(move |status| {
                let now = status.matching().then(Instant::now);
                *since.lock().unwrap_or_else(PoisonError::into_inner) = now;
            })
            .background()
            .wait()
            .map_err(zenoh_error)?;
        let alive =
            session.liveliness().declare_token(liveliness_key(group, phone)?).wait().map_err(zenoh_error)?;
        Ok(Self {
            group: group.to_owned(),
            phone: phone.to_owned(),
            receipt_key: format!("{}?run={}", receipt_key(group, phone)?, session.zid()),
            session,
            epochs,
            status,
            alive,
            published: 0,
            begun: None,
            listened_since,
        })
    }

    /// Waits until somebody listens to epochs and status; `false` when asked to stop meanwhile.
    ///
    /// # Errors
    /// When nobody does within `patience`.
    pub fn wait_for_listener(&self, patience: Duration, stop: &Stop) -> Result<bool, PublicationError> {
        let start = Instant::now();
        while !(listened(&self.epochs)? && listened(&self.status)?) {
            if start.elapsed() >= patience {
                let (group, waited_s) = (self.group.clone(), patience.as_secs_f64());
                return Err(PublicationError::NoListener { group, waited_s });
            }
            if stop.sleep(POLL) {
                return Ok(false);
            }
        }
        self.listened_since()?;
        Ok(true)
    }

    /// Publishes an epoch.
    ///
    /// # Errors
    /// When the message cannot be encoded, or Zenoh refuses.
    pub fn epoch(&mut self, message: &EpochMessage) -> Result<(), PublicationError> {
        let begun = *self.begun.get_or_insert_with(Instant::now);
        if let Some(since) = self.listened_since()?.filter(|since| *since > begun) {
            std::thread::sleep(HUSH.saturating_sub(since.elapsed()));
        }
        self.epochs.put(encode(message)?).wait().map_err(zenoh_error)?;
        self.published += 1;
        Ok(())
    }

    /// Since when somebody listens to epochs. Zenoh's word that a listener has come may be later than the listener.
    fn listened_since(&self) -> Result<Option<Instant>, PublicationError> {
        if !listened(&self.epochs)? {
            return Ok(None);
        }
        let mut since = self.listened_since.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(Some(*since.get_or_insert_with(Instant::now)))
    }

    /// Publishes a status.
    ///
    /// # Errors
    /// When the message cannot be encoded, or Zenoh refuses.
    pub fn status(&self, status: PhoneStatus) -> Result<(), PublicationError> {
        let message = StatusMessage { phone: self.phone.clone(), status };
        self.status.put(encode(&message)?).wait().map_err(zenoh_error)
    }

    /// How many epochs were published.
    pub const fn published(&self) -> u64 {
        self.published
    }

    /// Asks the hub whether it knows the phone. A hub that does not answer is taken to.
    ///
    /// # Errors
    /// When the session has no such phone.
    pub fn introduce(&self) -> Result<(), PublicationError> {
        self.ask_for_receipt().map(drop)
    }

    /// Asks the hub until it has every epoch, or has made no progress for `patience`; less once asked to stop. How many it has;
    /// `None` when it never answered.
    pub fn wait_for_receipt(&self, patience: Duration, stop: &Stop) -> Option<u64> {
        let mut progress = Instant::now();
        let mut received = None;
        let patient = |progress: Instant| {
            let limit = if stop.is_requested() { patience.min(LAST_WORDS) } else { patience };
            progress.elapsed() < limit
        };
        while received < Some(self.published) && patient(progress) {
            let Ok(answer) = self.ask_for_receipt() else { break };
            if answer > received {
                received = answer;
                progress = Instant::now();
            } else {
                std::thread::sleep(POLL);
            }
        }
        received
    }

    fn ask_for_receipt(&self) -> Result<Option<u64>, PublicationError> {
        let Ok(replies) = self.session.get(&self.receipt_key).timeout(ANSWER).wait() else { return Ok(None) };
        while let Ok(reply) = replies.recv() {
            match reply.result() {
                Ok(sample) => {
                    let count =
                        std::str::from_utf8(&sample.payload().to_bytes()).ok().and_then(|t| t.parse().ok());
                    if count.is_some() {
                        return Ok(count);
                    }
                }
                Err(error) => {
                    let text = String::from_utf8_lossy(&error.payload().to_bytes()).into_owned();
                    // Zenoh answers a question that nobody answered in time.
                    if text.starts_with("the session") {
                        return Err(PublicationError::Refused(text));
                    }
                }
            }
        }
        Ok(None)
    }

    /// Takes everything back and closes the session.
    ///
    /// # Errors
    /// When Zenoh refuses.
    pub fn close(self) -> Result<(), PublicationError> {
        self.epochs.undeclare().wait().map_err(zenoh_error)?;
        self.status.undeclare().wait().map_err(zenoh_error)?;
        self.alive.undeclare().wait().map_err(zenoh_error)?;
        self.session.close().wait().map_err(zenoh_error)
    }
}

fn declare(
    session: &Session,
    key: String,
    kept_messages: usize,
) -> Result<AdvancedPublisher<'static>, PublicationError> {
    session
        .declare_publisher(key)
        .congestion_control(CongestionControl::Block)
        .reliability(Reliability::Reliable)
        .cache(CacheConfig::default().max_samples(kept_messages.max(1)))
        .sample_miss_detection(MissDetectionConfig::default().heartbeat(HEARTBEAT))
        .publisher_detection()
        .wait()
        .map_err(zenoh_error)
}

fn listened(publisher: &AdvancedPublisher<'_>) -> Result<bool, PublicationError> {
    publisher.matching_status().wait().map(|status| status.matching()).map_err(zenoh_error)
}
