//! The hub's side of Zenoh: subscriptions, receipts, fused states.

mod access;
mod entrance;
mod gate;
pub mod intake;
mod listening;
mod pace;
mod questions;
mod receipts;
pub mod recovery;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Instant;

use cofix_agent::publication::link;
use cofix_common::skips::Skips;
use cofix_common::wire::{
    FusedMessage, IntegrityMessage, WireMessage, all_epochs_key, all_liveliness_key, all_paces_key,
    all_receipts_key, all_status_key, encode, fused_json_key, fused_key, hub_status_key, integrity_key,
    phone_of_key,
};
use zenoh::bytes::Encoding;
use zenoh::pubsub::Subscriber;
use zenoh::qos::CongestionControl;
use zenoh::query::{Query, Queryable};
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};

use crate::network::intake::Arrival;
use crate::status::SharedStatus;

pub use access::access_control;
use entrance::Entrance;
use gate::Gate;
pub(crate) use listening::ON_LOOPBACK;
pub use listening::{ListenArguments, Listening};
use pace::PlaybackClock;
pub use questions::HistoryQuestions;
pub use receipts::Receipts;
use receipts::answer;

/// Most events that wait for the hub's thread. Beyond them, Zenoh and then the agents are held up.
const WAITING_EVENTS: usize = 1_024;

/// An event for the hub's thread.
#[derive(Debug)]
pub enum Event {
    /// An epoch of a phone.
    Epoch(Arrival),
    /// A status of a phone.
    Status(Arrival),
    /// A part of an agent's answer to a question about its history.
    History(Arrival),
    /// The answer to a question for epochs has ended.
    Answered {
        /// The phone.
        phone: String,
        /// The sender of the run that was asked for.
        sender: String,
    },
    /// A phone's agent appeared or disappeared.
    Alive {
        /// The phone in the key.
        phone: String,
        /// Whether it has appeared.
        alive: bool,
    },
    /// Messages of a phone that were too many, and were not let in.
    Shed {
        /// The phone in the key.
        phone: String,
        /// How many.
        count: u64,
    },
    /// What was refused, by reason, in place of what came.
    Refused {
        /// The phone; `None`: it is of no phone of the group.
        phone: Option<String>,
        /// How often, and the first instance of each reason.
        skips: Skips,
    },
    /// An agent of this process ended.
    AgentEnded {
        /// The phone.
        phone: String,
        /// Its error, if it failed.
        outcome: Result<(), String>,
    },
}

/// A hub on Zenoh. Everything ends when it is dropped.
pub struct Network {
    session: Session,
    group: String,
    receipts: Receipts,
    status: SharedStatus,
    entrance: Entrance,
    _epochs: Subscriber<()>,
    _status: Subscriber<()>,
    _alive: Subscriber<()>,
    _receipts: Queryable<()>,
    _paces: Queryable<()>,
    _hub_status: Queryable<()>,
}

#[allow(clippy::needless_pass_by_value)] // for `map_err`
pub(crate) fn zenoh_error(error: zenoh::Error) -> anyhow::Error {
    anyhow::anyhow!("Zenoh: {}", link::plain(&error))
}

impl Network {
    /// Listens for the agents of a group, and tells agents of other phones than `phones` so. Blocks.
    ///
    /// # Errors
    /// When an endpoint is malformed or taken, Zenoh does not take the guard, or the group's name cannot be part of a key.
    pub fn listen(
        group: &str,
        phones: &[String],
        listening: &Listening,
    ) -> anyhow::Result<(Self, Receiver<Event>)> {
        let (sender, events) = sync_channel(WAITING_EVENTS);
        let receipts = Receipts::default();
        let session = link::listen(&listening.endpoints, listening.guard.as_ref())?;
        let gate = listening.is_limited.then(|| Gate::new(phones, Instant::now()));
        let entrance = Entrance { gate: gate.map(Arc::new), sender: sender.clone() };
        let epochs = subscribe(&session, &all_epochs_key(group)?, entrance.clone(), Event::Epoch)?;
        let status = subscribe(&session, &all_status_key(group)?, entrance.clone(), Event::Status)?;
        let alive = watch(&session, &all_liveliness_key(group)?, entrance.clone())?;
        let (answers, phones) = (receipts.clone(), phones.to_vec());
        let (receipt_entrance, pace_entrance) = (entrance.clone(), entrance.clone());
        let queryable = session
            .declare_queryable(all_receipts_key(group)?)
            .callback(move |query| {
                if receipt_entrance.lets_in(&query) {
                    answer(&answers, &phones, &query);
                }
            })
            .wait()
            .map_err(zenoh_error)?;
        let clock = PlaybackClock::default();
        let paces = session
            .declare_queryable(all_paces_key(group)?)
            .callback(move |query| {
                if pace_entrance.lets_in(&query) {
                    clock.answer(&query);
                }
            })
            .wait()
            .map_err(zenoh_error)?;
        let told = SharedStatus::default();
        let asked = told.clone();
        let hub_status = session
            .declare_queryable(hub_status_key(group)?)
            .callback(move |query| answer_status(&asked, &query))
            .wait()
            .map_err(zenoh_error)?;
        let network = Self {
            session,
            group: group.to_owned(),
            receipts,
            status: told,
            entrance,
            _epochs: epochs,
            _status: status,
            _alive: alive,
            _receipts: queryable,
            _paces: paces,
            _hub_status: hub_status,
        };
        Ok((network, events))
    }

    /// Where agents can connect: the endpoints with the ports that the system chose.
    pub fn endpoints(&self) -> Vec<String> {
        self.session.info().locators().wait().iter().map(ToString::to_string).collect()
    }

    /// The sender for events from this process.
    pub fn sender(&self) -> SyncSender<Event> {
        self.entrance.sender.clone()
    }

    /// The receipts that agents ask for.
    pub fn receipts(&self) -> Receipts {
        self.receipts.clone()
    }

    /// The status that is told to whoever asks.
    pub fn status(&self) -> SharedStatus {
        self.status.clone()
    }

    /// Starts the questions to agents about their history.
    ///
    /// # Errors
    /// When no thread can be started for them.
    pub fn history(&self) -> anyhow::Result<HistoryQuestions> {
        HistoryQuestions::start(self.session.clone(), self.group.clone(), self.entrance.clone())
    }

    /// A publisher of fused states.
    pub fn fused_publisher(&self, congestion_control: CongestionControl) -> FusedPublisher {
        FusedPublisher {
            session: Some(self.session.clone()),
            group: self.group.clone(),
            congestion_control,
            has_json: false,
        }
    }

    /// Closes the session.
    ///
    /// # Errors
    /// When Zenoh refuses.
    pub fn close(self) -> anyhow::Result<()> {
        self.session.close().wait().map_err(zenoh_error)
    }
}

/// Publishes fused states.
pub struct FusedPublisher {
    /// `None`: nothing is published.
    session: Option<Session>,
    group: String,
    congestion_control: CongestionControl,
    /// Whether the states are published as JSON too.
    has_json: bool,
}

impl FusedPublisher {
    /// A publisher without a session, which publishes nothing.
    pub fn nowhere() -> Self {
        Self {
            session: None,
            group: "nowhere".to_owned(),
            congestion_control: CongestionControl::Drop,
            has_json: false,
        }
    }

    /// The same publisher, which publishes the states as JSON too or does not.
    #[must_use]
    pub fn with_json(self, has_json: bool) -> Self {
        Self { has_json, ..self }
    }

    /// Whether the states are published as JSON too.
    pub const fn has_json(&self) -> bool {
        self.has_json
    }

    /// Publishes a phone's fused state as JSON.
    ///
    /// # Errors
    /// When Zenoh refuses.
    pub fn publish_json(&self, phone: &str, text: String) -> anyhow::Result<()> {
        self.put_bytes(&fused_json_key(&self.group, phone)?, text.into_bytes(), Encoding::APPLICATION_JSON)
    }

    /// Publishes a fused state.
    ///
    /// # Errors
    /// When it cannot be encoded or Zenoh refuses.
    pub fn publish(&self, message: &FusedMessage) -> anyhow::Result<()> {
        self.put(&fused_key(&self.group, &message.phone)?, message)
    }

    /// Publishes an event of the group's integrity.
    ///
    /// # Errors
    /// When it cannot be encoded or Zenoh refuses.
    pub fn tell(&self, message: &IntegrityMessage) -> anyhow::Result<()> {
        self.put(&integrity_key(&self.group)?, message)
    }

    fn put<M: WireMessage>(&self, key: &str, message: &M) -> anyhow::Result<()> {
        self.put_bytes(key, encode(message)?, Encoding::ZENOH_BYTES)
    }

    fn put_bytes(&self, key: &str, bytes: Vec<u8>, encoding: Encoding) -> anyhow::Result<()> {
        let Some(session) = &self.session else { return Ok(()) };
        session
            .put(key, bytes)
            .encoding(encoding)
            .congestion_control(self.congestion_control)
            .wait()
            .map_err(zenoh_error)
    }
}

fn subscribe(
    session: &Session,
    key: &str,
    entrance: Entrance,
    event: fn(Arrival) -> Event,
) -> anyhow::Result<Subscriber<()>> {
    session
        .declare_subscriber(key)
        .callback(move |sample| entrance.take(&sample, event))
        .wait()
        .map_err(zenoh_error)
}

fn watch(session: &Session, key: &str, entrance: Entrance) -> anyhow::Result<Subscriber<()>> {
    session
        .liveliness()
        .declare_subscriber(key)
        .history(true)
        .callback(move |sample| {
            let alive = sample.kind() == SampleKind::Put;
            if let Some(phone) = phone_of_key(sample.key_expr().as_str()) {
                entrance.presence(phone, alive);
            }
        })
        .wait()
        .map_err(zenoh_error)
}

/// Answers `cofix/<group>/status`.
fn answer_status(status: &SharedStatus, query: &Query) {
    let replied = match status.now().map(|document| serde_json::to_vec(&document)) {
        Some(Ok(json)) => query.reply(query.key_expr(), json).encoding(Encoding::APPLICATION_JSON).wait(),
        Some(Err(error)) => query.reply_err(error.to_string()).wait(),
        None => query.reply_err("the group is not at work, or is no live one").wait(),
    };
    if let Err(error) = replied {
        tracing::warn!("status not sent: {}", link::plain(&error));
    }
}

/// Answers the question of a phone's agent.
fn reply(query: &Query, what: &str, message: &impl WireMessage) {
    let key = query.key_expr();
    let reply = encode(message).map_err(Into::into).and_then(|bytes| query.reply(key, bytes).wait());
    if let Err(error) = reply {
        let phone = phone_of_key(key.as_str()).unwrap_or("?");
        tracing::warn!("{what} for {phone} not sent: {}", link::plain(&error));
    }
}
