//! A listener on loopback that plays the hub.

#![allow(dead_code)] // not every test uses everything

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use cofix_agent::publication::link;
use cofix_agent::{AgentConfig, Source};
use cofix_common::wire::{
    EpochMessage, PhoneStatus, Receipt, ReceiptMessage, StatusMessage, all_receipts_key, decode, encode,
    epoch_key, status_key,
};
use zenoh::{Session, Wait};

/// What the agent said.
pub struct Hub {
    session: Session,
    epochs: Receiver<EpochMessage>,
    /// What the agent of phone `p` in group `g` said of itself.
    pub statuses: Arc<Mutex<Vec<PhoneStatus>>>,
}

impl Hub {
    pub fn listen() -> Self {
        Self::listen_and_answer(|received| {
            encode(&ReceiptMessage::Run(Receipt { received, lost: 0 })).unwrap()
        })
    }

    /// Answers questions for receipts with these bytes for the number of epochs received.
    pub fn listen_and_answer(answer: fn(u64) -> Vec<u8>) -> Self {
        let session = link::listen(&["tcp/127.0.0.1:0".to_owned()], None).unwrap();
        let (sender, epochs) = channel();
        let sender = Mutex::new(sender);
        let received = Arc::new(AtomicU64::new(0));
        let counted = Arc::clone(&received);
        session
            .declare_subscriber(epoch_key("g", "p").unwrap())
            .callback(move |sample| {
                let message: EpochMessage = decode(&sample.payload().to_bytes()).unwrap();
                counted.fetch_add(1, Ordering::SeqCst);
                let _ = sender.lock().unwrap().send(message);
            })
            .background()
            .wait()
            .unwrap();
        let statuses = Arc::new(Mutex::new(Vec::new()));
        let heard = Arc::clone(&statuses);
        session
            .declare_subscriber(status_key("g", "p").unwrap())
            .callback(move |sample| {
                let message: StatusMessage = decode(&sample.payload().to_bytes()).unwrap();
                heard.lock().unwrap().push(message.status);
            })
            .background()
            .wait()
            .unwrap();
        session
            .declare_queryable(all_receipts_key("g").unwrap())
            .callback(move |query| {
                let answer = answer(received.load(Ordering::SeqCst));
                query.reply(query.key_expr().clone(), answer).wait().unwrap();
            })
            .background()
            .wait()
            .unwrap();
        Self { session, epochs, statuses }
    }

    /// Where it can be reached.
    pub fn endpoints(&self) -> Vec<String> {
        self.session.info().locators().wait().iter().map(ToString::to_string).collect()
    }

    /// An agent of phone `p` in group `g` as fast as it goes, without any products.
    pub fn agent(&self, source: Source) -> AgentConfig {
        AgentConfig {
            connect: self.endpoints(),
            patience: Duration::from_secs(20),
            ..AgentConfig::new("g", "p", source)
        }
    }

    /// Receives this number of epochs.
    pub fn receive(&self, count: usize) -> Vec<EpochMessage> {
        (0..count).map(|_| self.epochs.recv_timeout(Duration::from_secs(20)).unwrap()).collect()
    }
}
