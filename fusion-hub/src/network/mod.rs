//! The hub's side of Zenoh: subscriptions, receipts, fused states.

pub mod intake;
mod pace;
mod questions;
mod receipts;
pub mod recovery;

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use cofix_agent::publication::link;
use cofix_common::skips::Skips;
use cofix_common::wire::{
    FusedMessage, IntegrityMessage, WireMessage, all_epochs_key, all_liveliness_key, all_paces_key,
    all_receipts_key, all_status_key, encode, fused_key, integrity_key, phone_of_key,
};
use zenoh::pubsub::Subscriber;
use zenoh::qos::CongestionControl;
use zenoh::query::{Query, Queryable};
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

use crate::network::intake::Arrival;

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
    sender: SyncSender<Event>,
    _epochs: Subscriber<()>,
    _status: Subscriber<()>,
    _alive: Subscriber<()>,
    _receipts: Queryable<()>,
    _paces: Queryable<()>,
}

#[allow(clippy::needless_pass_by_value)] // for `map_err`
fn zenoh_error(error: zenoh::Error) -> anyhow::Error {
    anyhow::anyhow!("Zenoh: {}", link::plain(&error))
}

impl Network {
    /// Listens on `endpoints` for the agents of a group, and tells agents of other phones than `phones` so. Blocks.
    ///
    /// # Errors
    /// When an endpoint is malformed or taken, or the group's name cannot be part of a key.
    pub fn listen(
        group: &str,
        phones: &[String],
        endpoints: &[String],
    ) -> anyhow::Result<(Self, Receiver<Event>)> {
        let (sender, events) = sync_channel(WAITING_EVENTS);
        let receipts = Receipts::default();
        let session = link::listen(endpoints)?;
        let epochs = subscribe(&session, &all_epochs_key(group)?, sender.clone(), Event::Epoch)?;
        let status = subscribe(&session, &all_status_key(group)?, sender.clone(), Event::Status)?;
        let alive = watch(&session, &all_liveliness_key(group)?, sender.clone())?;
        let (answers, phones) = (receipts.clone(), phones.to_vec());
        let queryable = session
            .declare_queryable(all_receipts_key(group)?)
            .callback(move |query| answer(&answers, &phones, &query))
            .wait()
            .map_err(zenoh_error)?;
        let clock = PlaybackClock::default();
        let paces = session
            .declare_queryable(all_paces_key(group)?)
            .callback(move |query| clock.answer(&query))
            .wait()
            .map_err(zenoh_error)?;
        let network = Self {
            session,
            group: group.to_owned(),
            receipts,
            sender,
            _epochs: epochs,
            _status: status,
            _alive: alive,
            _receipts: queryable,
            _paces: paces,
        };
        Ok((network, events))
    }

    /// Where agents can connect: the endpoints with the ports that the system chose.
    pub fn endpoints(&self) -> Vec<String> {
        self.session.info().locators().wait().iter().map(ToString::to_string).collect()
    }

    /// The sender for events from this process.
    pub fn sender(&self) -> SyncSender<Event> {
        self.sender.clone()
    }

    /// The receipts that agents ask for.
    pub fn receipts(&self) -> Receipts {
        self.receipts.clone()
    }

    /// Starts the questions to agents about their history.
    ///
    /// # Errors
    /// When no thread can be started for them.
    pub fn history(&self) -> anyhow::Result<HistoryQuestions> {
        HistoryQuestions::start(self.session.clone(), self.group.clone(), self.sender.clone())
    }

    /// A publisher of fused states.
    pub fn fused_publisher(&self, congestion_control: CongestionControl) -> FusedPublisher {
        FusedPublisher { session: Some(self.session.clone()), group: self.group.clone(), congestion_control }
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
}

impl FusedPublisher {
    /// A publisher without a session, which publishes nothing.
    pub fn nowhere() -> Self {
        Self { session: None, group: "nowhere".to_owned(), congestion_control: CongestionControl::Drop }
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
        let Some(session) = &self.session else { return Ok(()) };
        session
            .put(key, encode(message)?)
            .congestion_control(self.congestion_control)
            .wait()
            .map_err(zenoh_error)
    }
}

fn subscribe(
    session: &Session,
    key: &str,
    sender: SyncSender<Event>,
    event: fn(Arrival) -> Event,
) -> anyhow::Result<Subscriber<()>> {
    session
        .declare_subscriber(key)
        .callback(move |sample| {
            if let Some(arrival) = arrival(&sample) {
                // Fails only when the hub has ended.
                let _ = sender.send(event(arrival));
            }
        })
        .wait()
        .map_err(zenoh_error)
}

fn arrival(sample: &Sample) -> Option<Arrival> {
    if sample.kind() != SampleKind::Put {
        return None;
    }
    let sender = sample.source_info().map(|info| info.source_id().zid().to_string());
    let phone = phone_of_key(sample.key_expr().as_str())?.to_owned();
    Some(Arrival { phone, sender, bytes: sample.payload().to_bytes().into_owned() })
}

fn watch(session: &Session, key: &str, sender: SyncSender<Event>) -> anyhow::Result<Subscriber<()>> {
    session
        .liveliness()
        .declare_subscriber(key)
        .history(true)
        .callback(move |sample| {
            let alive = sample.kind() == SampleKind::Put;
            if let Some(phone) = phone_of_key(sample.key_expr().as_str()) {
                let _ = sender.send(Event::Alive { phone: phone.to_owned(), alive });
            }
        })
        .wait()
        .map_err(zenoh_error)
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
