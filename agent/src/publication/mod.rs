//! The messages of an agent on Zenoh, without loss.
//!
//! - The first epoch waits until a hub listens.
//! - The last messages are kept, so that a hub that starts late, restarts or loses its connection can ask for those it missed; with a spool all
//!   are kept, on disk.
//! - Samples carry the id of the agent's Zenoh session, which tells one run of an agent from the next.
//! - At the end the agent asks the hub how many epochs it has, and stays until the hub has all.

pub mod endpoint;
mod history;
mod limits;
pub mod link;
pub(crate) mod pace;
pub mod rate;
mod receipt;
pub mod secured;
mod spool;

use std::cell::Cell;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use cofix_common::time::GpsTime;
use cofix_common::wire::{
    EpochMessage, KeyNameError, PaceMessage, PhoneStatus, Receipt, ReceiptMessage, StatusMessage,
    WIRE_VERSION, WireError, check_name, decode, encode, epoch_key, history_key, liveliness_key, pace_key,
    receipt_key, status_key,
};
use zenoh::bytes::ZBytes;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Reliability};
use zenoh::query::Reply;
use zenoh::sample::SourceInfo;
use zenoh::{Session, Wait};

use crate::{AgentConfig, Stop};

use history::{Address, History};
use rate::{AGENT_AT_ONCE, AGENT_PER_S, Allowance};
use receipt::ReceiptWait;
pub(crate) use receipt::UNANSWERED;
use spool::Spool;

/// How often a wait for an answer checks whether to go on.
const LOOK: Duration = Duration::from_millis(200);
/// How often a condition that is awaited is checked.
const POLL: Duration = Duration::from_millis(5);
/// Longest wait for the hub's answer to whether it knows the phone.
const INTRODUCTION: Duration = Duration::from_secs(2);
/// Longest wait for the hub's answer to when a recording's first epoch is due.
const PACE_ANSWER: Duration = Duration::from_secs(2);
/// Interval of the log line that says that the hub has not confirmed yet.
const REMINDER: Duration = Duration::from_secs(15);

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
    /// The hub's session has no phone of this name.
    #[error("the hub refuses the phone: the session has no phone '{phone}'; it has {}", known.join(", "))]
    UnknownPhone {
        /// The phone.
        phone: String,
        /// The session's phones.
        known: Vec<String>,
    },
    /// The hub's receipt is no message of this version.
    #[error(
        "the hub's receipt cannot be read: {0} (this agent speaks wire version {WIRE_VERSION}; receipts of version 1 are text)"
    )]
    Receipt(WireError),
    /// The spool cannot be begun.
    #[error("{}: the spool cannot be begun: {cause}", folder.display())]
    Spool {
        /// Its folder.
        folder: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// No hub subscribes.
    #[error(
        "connected, but no hub listens for group '{group}' within {waited_s:.0} s: does it run this group, and is this phone enrolled there still, if phones are?"
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

/// One agent's publishers and liveliness token.
pub struct Publication {
    group: String,
    phone: String,
    receipt_key: String,
    pace_key: String,
    session: Session,
    epochs: Publisher<'static>,
    status: Publisher<'static>,
    history: History,
    alive: LivelinessToken,
    longest_stall: Duration,
    published: u64,
    /// `None`: the hub is in this process and takes everything.
    allowance: Option<Allowance>,
}

impl Publication {
    /// Declares everything on a session, which it closes at the end.
    ///
    /// # Errors
    /// When a name cannot be part of a key, or Zenoh refuses.
    pub fn declare(session: Session, agent: &AgentConfig) -> Result<Self, PublicationError> {
        let AgentConfig { group, phone, .. } = agent;
        let epochs = declare(&session, epoch_key(group, phone)?)?;
        let status = declare(&session, status_key(group, phone)?)?;
        let address = Address { key: history_key(group, phone)?, phone: phone.clone(), source: epochs.id() };
        let name = format!("{phone}-{}", session.zid());
        let spool = agent.spool.as_ref().map(|folder| {
            Spool::create(folder, &name, agent.spool_bytes)
                .map_err(|cause| PublicationError::Spool { folder: folder.clone(), cause })
        });
        let history = History::declare(&session, address, agent.kept_messages, spool.transpose()?)
            .map_err(zenoh_error)?;
        // Last: whoever sees the token may ask for the history.
        let alive =
            session.liveliness().declare_token(liveliness_key(group, phone)?).wait().map_err(zenoh_error)?;
        Ok(Self {
            group: group.clone(),
            phone: phone.clone(),
            receipt_key: format!("{}?run={}", receipt_key(group, phone)?, session.zid()),
            pace_key: pace_key(group, phone)?,
            session,
            epochs,
            status,
            history,
            alive,
            longest_stall: agent.longest_stall(),
            published: 0,
            allowance: (!agent.hub_in_process)
                .then(|| Allowance::new(AGENT_AT_ONCE, AGENT_PER_S, Instant::now())),
        })
    }

    /// Waits until a hub listens to epochs and status; `false` when asked to stop meanwhile.
    ///
    /// # Errors
    /// When none does within `patience`.
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
        Ok(true)
    }

    /// Publishes an epoch. Without a listener it is only kept.
    ///
    /// # Errors
    /// When the message cannot be encoded, or Zenoh refuses.
    pub fn epoch(&mut self, message: &EpochMessage) -> Result<(), PublicationError> {
        let bytes = ZBytes::from(encode(message)?);
        // Kept first: a hub may ask for it as soon as it has arrived.
        self.history.ring().keep_epoch(message.sequence, bytes.clone());
        while self.allowance.as_mut().is_some_and(|allowance| !allowance.take(1.0, Instant::now())) {
            std::thread::sleep(POLL);
        }
        put(&self.epochs, bytes)?;
        self.published += 1;
        Ok(())
    }

    /// Publishes a status.
    ///
    /// # Errors
    /// When the message cannot be encoded, or Zenoh refuses.
    pub fn status(&self, status: PhoneStatus) -> Result<(), PublicationError> {
        let bytes = ZBytes::from(encode(&StatusMessage { phone: self.phone.clone(), status })?);
        self.history.ring().keep_status(bytes.clone());
        put(&self.status, bytes)
    }

    /// How many epochs were published.
    pub const fn published(&self) -> u64 {
        self.published
    }

    /// Asks the hub whether it knows the phone. A hub that does not answer counts as knowing it.
    ///
    /// # Errors
    /// When the session has no such phone.
    pub fn introduce(&self) -> Result<(), PublicationError> {
        let start = Instant::now();
        self.ask_for_receipt(INTRODUCTION, &|| start.elapsed() < INTRODUCTION).map(drop)
    }

    /// Asks the hub until it has every epoch, has given up the rest, has confirmed no more for too long, or is gone for `patience`; less
    /// once asked to stop. A hub that is connected and has not answered yet is waited for up to ten minutes: the question waits behind the epochs on a slow
    /// link. How many it has; `None` when it never answered.
    pub fn wait_for_receipt(&self, patience: Duration, stop: &Stop) -> Option<u64> {
        let mut wait = ReceiptWait::new(patience, self.longest_stall);
        let reminded = Cell::new(Instant::now());
        while wait.known.is_none_or(|known| known.settled() < self.published) {
            let goes_on = || {
                if reminded.get().elapsed() >= REMINDER {
                    reminded.set(Instant::now());
                    tracing::info!(
                        "{}: waiting for the hub to confirm {} epochs",
                        self.phone,
                        self.published
                    );
                }
                wait.goes_on(stop.is_requested(), self.is_connected())
            };
            let asked = self.ask_for_receipt(UNANSWERED, &goes_on);
            let Ok(answer) = asked.inspect_err(|error| tracing::warn!("{}: {error}", self.phone)) else {
                break;
            };
            if answer.is_none() && !goes_on() || wait.is_enough(answer) {
                break;
            }
            std::thread::sleep(POLL);
        }
        wait.known.map(|known| known.received)
    }

    /// Time until the first epoch of a recording played at `times` its speed is due, s, so that all phones of the group play the same time;
    /// 0 where no hub answers.
    pub fn first_due_in_s(&self, first: GpsTime, times: f64) -> f64 {
        let question = format!("{}?first={};speed={times}", self.pace_key, first.nanos());
        let Ok(replies) = self.session.get(&question).timeout(PACE_ANSWER).wait() else { return 0.0 };
        let answer = |reply: Reply| {
            let sample = reply.into_result().ok()?;
            let answer = due_in_s(&sample.payload().to_bytes());
            answer
                .inspect_err(|error| tracing::warn!("{}: the hub's pace is not used: {error}", self.phone))
                .ok()
        };
        replies.into_iter().find_map(answer).unwrap_or(0.0)
    }

    fn is_connected(&self) -> bool {
        self.session.info().routers_zid().wait().next().is_some()
    }

    /// Asks once. `None` when there is no answer within `timeout`, or as soon as `goes_on` says no.
    fn ask_for_receipt(
        &self,
        timeout: Duration,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Option<Receipt>, PublicationError> {
        // On a slow link the answer may take minutes: it is taken however late it arrives.
        let replies = self.session.get(&self.receipt_key).timeout(UNANSWERED).wait();
        let Ok(replies) = replies else { return Ok(None) };
        let asked = Instant::now();
        let mut unreadable = None;
        loop {
            let reply = match replies.recv_timeout(LOOK) {
                Ok(Some(reply)) => reply,
                Ok(None) if asked.elapsed() < timeout && goes_on() => continue,
                Ok(None) => return Ok(None),
                Err(_) => return unreadable.map_or(Ok(None), |error| Err(PublicationError::Receipt(error))),
            };
            // An error is Zenoh's own: nobody has answered in time.
            let Ok(sample) = reply.result() else { continue };
            match decode(&sample.payload().to_bytes()) {
                Ok(ReceiptMessage::Run(receipt)) => return Ok(Some(receipt)),
                Ok(ReceiptMessage::UnknownPhone { mut known }) => {
                    known.retain(|name| check_name(name).is_ok());
                    return Err(PublicationError::UnknownPhone { phone: self.phone.clone(), known });
                }
                Err(error) => unreadable = Some(error),
            }
        }
    }

    /// Undeclares everything and closes the session.
    ///
    /// # Errors
    /// When Zenoh refuses.
    pub fn close(self) -> Result<(), PublicationError> {
        self.epochs.undeclare().wait().map_err(zenoh_error)?;
        self.status.undeclare().wait().map_err(zenoh_error)?;
        self.history.undeclare().map_err(zenoh_error)?;
        self.alive.undeclare().wait().map_err(zenoh_error)?;
        self.session.close().wait().map_err(zenoh_error)
    }
}

fn declare(session: &Session, key: String) -> Result<Publisher<'static>, PublicationError> {
    session
        .declare_publisher(key)
        .congestion_control(CongestionControl::Block)
        .reliability(Reliability::Reliable)
        .wait()
        .map_err(zenoh_error)
}

/// Publishes with the publisher's id; the messages carry sequence numbers of their own.
fn put(publisher: &Publisher<'_>, bytes: ZBytes) -> Result<(), PublicationError> {
    publisher.put(bytes).source_info(SourceInfo::new(publisher.id(), 0)).wait().map_err(zenoh_error)
}

fn listened(publisher: &Publisher<'_>) -> Result<bool, PublicationError> {
    publisher.matching_status().wait().map(|status| status.matching()).map_err(zenoh_error)
}

/// The time in a message about the pace, s from now.
fn due_in_s(bytes: &[u8]) -> Result<f64, Box<dyn std::error::Error>> {
    let PaceMessage { due_in_s } = decode::<PaceMessage>(bytes)?.validate()?;
    Ok(due_in_s)
}
