//! What an agent says on Zenoh, so that nothing of it is lost.
//!
//! - The first epoch waits until somebody listens.
//! - The last messages are kept, so that a hub that comes late, is started again or loses its connection can ask for what it missed.
//! - Samples carry the id of the agent's Zenoh session, which tells one run of an agent from the next.
//! - At the end the agent asks the hub how many epochs it has, and stays until that is all of them.

mod history;
pub mod link;
pub(crate) mod pace;

use std::cell::Cell;
use std::time::{Duration, Instant};

use cofix_common::time::GpsTime;
use cofix_common::wire::{
    EpochMessage, KeyNameError, PhoneStatus, StatusMessage, WireError, encode, epoch_key, history_key,
    liveliness_key, pace_key, receipt_key, status_key,
};
use zenoh::bytes::ZBytes;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher as ZenohPublisher;
use zenoh::qos::{CongestionControl, Reliability};
use zenoh::query::Reply;
use zenoh::sample::SourceInfo;
use zenoh::{Session, Wait};

use crate::Stop;

use history::{Address, History};

/// How often a wait for an answer looks whether it still makes sense.
const LOOK: Duration = Duration::from_millis(200);
/// How often something awaited is looked at.
const POLL: Duration = Duration::from_millis(5);
/// Longest wait for the hub's answer whether it knows the phone.
const INTRODUCTION: Duration = Duration::from_secs(2);
/// Longest wait for an answer about receipts while the hub is connected: on a slow link what was published before the question is still on its way.
const UNANSWERED: Duration = Duration::from_mins(10);
/// Longest wait for receipts without progress once asked to stop.
const LAST_WORDS: Duration = Duration::from_secs(1);
/// How long the hub may take to tell when a recording's first epoch is due.
const PACE_ANSWER: Duration = Duration::from_secs(2);
/// Farthest from now that a first epoch may be due, s.
const LONGEST_TO_FIRST_S: f64 = 3_600.0;
/// How often it is said that the hub has not answered yet.
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
    pace_key: String,
    session: Session,
    epochs: ZenohPublisher<'static>,
    status: ZenohPublisher<'static>,
    history: History,
    alive: LivelinessToken,
    published: u64,
}

impl Publication {
    /// Declares everything on a session, which it closes at the end.
    ///
    /// # Errors
    /// When a name cannot be part of a key, or Zenoh refuses.
    pub fn declare(session: Session, publisher: Publisher<'_>) -> Result<Self, PublicationError> {
        let Publisher { group, phone, kept_messages } = publisher;
        let epochs = declare(&session, epoch_key(group, phone)?)?;
        let status = declare(&session, status_key(group, phone)?)?;
        let address =
            Address { key: history_key(group, phone)?, phone: phone.to_owned(), source: epochs.id() };
        let history = History::declare(&session, address, kept_messages).map_err(zenoh_error)?;
        // Last: whoever sees the token may ask for the history.
        let alive =
            session.liveliness().declare_token(liveliness_key(group, phone)?).wait().map_err(zenoh_error)?;
        Ok(Self {
            group: group.to_owned(),
            phone: phone.to_owned(),
            receipt_key: format!("{}?run={}", receipt_key(group, phone)?, session.zid()),
            pace_key: pace_key(group, phone)?,
            session,
            epochs,
            status,
            history,
            alive,
            published: 0,
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
        Ok(true)
    }

    /// Publishes an epoch. With nobody there to listen it is only kept.
    ///
    /// # Errors
    /// When the message cannot be encoded, or Zenoh refuses.
    pub fn epoch(&mut self, message: &EpochMessage) -> Result<(), PublicationError> {
        let bytes = ZBytes::from(encode(message)?);
        // Kept first: what was heard of can be asked for.
        self.history.ring().keep_epoch(message.sequence, bytes.clone());
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

    /// Asks the hub whether it knows the phone. A hub that does not answer is taken to.
    ///
    /// # Errors
    /// When the session has no such phone.
    pub fn introduce(&self) -> Result<(), PublicationError> {
        let start = Instant::now();
        self.ask_for_receipt(INTRODUCTION, &|| start.elapsed() < INTRODUCTION).map(drop)
    }

    /// Asks the hub until it has every epoch, has given up the rest, or has made no progress for `patience`; less once asked to stop.
    /// A hub that is connected and has not answered yet is waited for up to ten minutes: the question waits behind the epochs on a slow
    /// link. How many it has; `None` when it never answered.
    pub fn wait_for_receipt(&self, patience: Duration, stop: &Stop) -> Option<u64> {
        let mut wait = ReceiptWait { patience, known: None, progress: Instant::now() };
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
                wait.progress.elapsed() < wait.limit(stop.is_requested(), self.is_connected())
            };
            let Ok(answer) = self.ask_for_receipt(UNANSWERED, &goes_on) else { break };
            if answer.is_none() && !goes_on() || wait.is_enough(answer) {
                break;
            }
            std::thread::sleep(POLL);
        }
        wait.known.map(|known| known.received)
    }

    /// In how many seconds the first epoch of a recording is due that is played at `times` its speed, so that all phones of the group play
    /// the same time; at once where no hub answers.
    pub fn first_due_in_s(&self, first: GpsTime, times: f64) -> f64 {
        let question = format!("{}?first={};speed={times}", self.pace_key, first.nanos());
        let Ok(replies) = self.session.get(&question).timeout(PACE_ANSWER).wait() else { return 0.0 };
        let answer = |reply: Reply| {
            let bytes = reply.result().ok()?.payload().to_bytes().into_owned();
            let due_in_s: f64 = std::str::from_utf8(&bytes).ok()?.parse().ok()?;
            (due_in_s.abs() <= LONGEST_TO_FIRST_S).then_some(due_in_s)
        };
        replies.into_iter().find_map(answer).unwrap_or(0.0)
    }

    fn is_connected(&self) -> bool {
        self.session.info().routers_zid().wait().next().is_some()
    }

    /// One question; `None` when there is no answer within `timeout`, or as soon as it does not go on.
    fn ask_for_receipt(
        &self,
        timeout: Duration,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Option<Receipt>, PublicationError> {
        // The answer may be long on its way: it is taken even when the question was asked some time ago.
        let replies = self.session.get(&self.receipt_key).timeout(UNANSWERED).wait();
        let Ok(replies) = replies else { return Ok(None) };
        let asked = Instant::now();
        loop {
            let reply = match replies.recv_timeout(LOOK) {
                Ok(Some(reply)) => reply,
                Ok(None) if asked.elapsed() < timeout && goes_on() => continue,
                Ok(None) | Err(_) => return Ok(None),
            };
            match reply.result() {
                Ok(sample) => {
                    let receipt = std::str::from_utf8(&sample.payload().to_bytes()).ok().and_then(parse);
                    if receipt.is_some() {
                        return Ok(receipt);
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
    }

    /// Takes everything back and closes the session.
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

/// How long receipts are waited for.
struct ReceiptWait {
    patience: Duration,
    /// What the hub said last that was more than before.
    known: Option<Receipt>,
    progress: Instant,
}

impl ReceiptWait {
    /// How long an answer may take: of a hub that is connected, all that was published before the question may still be on its way.
    fn limit(&self, stop_is_requested: bool, is_connected: bool) -> Duration {
        match (stop_is_requested, is_connected) {
            (true, _) => self.patience.min(LAST_WORDS),
            (false, true) => self.patience.max(UNANSWERED),
            (false, false) => self.patience,
        }
    }

    /// Takes an answer in; whether it is the last one, since the hub has not got more for long enough.
    fn is_enough(&mut self, answer: Option<Receipt>) -> bool {
        if answer.map(Receipt::settled) > self.known.map(Receipt::settled) {
            (self.known, self.progress) = (answer, Instant::now());
        }
        answer.is_some() && self.progress.elapsed() >= self.patience
    }
}

/// What a hub says of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Receipt {
    /// Epochs that it has.
    received: u64,
    /// Epochs that it misses and does not expect any more.
    lost: u64,
}

impl Receipt {
    /// How many are decided.
    const fn settled(self) -> u64 {
        self.received.saturating_add(self.lost)
    }
}

/// Reads `<received>` or `<received> lost <lost>`.
fn parse(text: &str) -> Option<Receipt> {
    let (received, lost) = text.split_once(" lost ").unwrap_or((text, "0"));
    Some(Receipt { received: received.parse().ok()?, lost: lost.parse().ok()? })
}

fn declare(session: &Session, key: String) -> Result<ZenohPublisher<'static>, PublicationError> {
    session
        .declare_publisher(key)
        .congestion_control(CongestionControl::Block)
        .reliability(Reliability::Reliable)
        .wait()
        .map_err(zenoh_error)
}

/// Says who publishes; the messages carry numbers of their own.
fn put(publisher: &ZenohPublisher<'_>, bytes: ZBytes) -> Result<(), PublicationError> {
    publisher.put(bytes).source_info(SourceInfo::new(publisher.id(), 0)).wait().map_err(zenoh_error)
}

fn listened(publisher: &ZenohPublisher<'_>) -> Result<bool, PublicationError> {
    publisher.matching_status().wait().map(|status| status.matching()).map_err(zenoh_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hub_that_is_connected_is_waited_for_until_it_answers() {
        let patience = Duration::from_mins(20);
        let mut wait =
            ReceiptWait { patience: Duration::from_secs(10), known: None, progress: Instant::now() };
        assert_eq!(wait.limit(false, true), UNANSWERED, "what it has is still on its way");
        assert_eq!(wait.limit(false, false), Duration::from_secs(10), "the connection is lost");
        assert_eq!(wait.limit(true, true), LAST_WORDS);
        wait.patience = patience;
        let receipt = |received| Some(Receipt { received, lost: 1 });
        assert!(!wait.is_enough(receipt(3)) && !wait.is_enough(receipt(2)) && !wait.is_enough(None));
        assert_eq!(wait.known, receipt(3));
        wait.patience = Duration::ZERO;
        assert!(!wait.is_enough(None), "no answer says nothing");
        assert!(wait.is_enough(receipt(3)), "it has had no more for long enough");
    }

    #[test]
    fn receipts_are_read() {
        assert_eq!(parse("640"), Some(Receipt { received: 640, lost: 0 }));
        assert_eq!(parse("40 lost 600"), Some(Receipt { received: 40, lost: 600 }));
        for text in ["", "-1", "many", "40 lost ", "40 lost 1 lost 2", "99999999999999999999"] {
            assert_eq!(parse(text), None, "{text}");
        }
    }
}
