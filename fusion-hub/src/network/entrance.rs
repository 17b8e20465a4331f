//! The way from Zenoh's threads to the hub's.

use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::time::Instant;

use cofix_common::wire::phone_of_key;
use zenoh::query::Query;
use zenoh::sample::{Sample, SampleKind};

use super::Event;
use super::gate::{Gate, Passage};
use super::intake::Arrival;

/// The way from Zenoh's threads to the hub's.
#[derive(Clone, Debug)]
pub(super) struct Entrance {
    /// `None`: everything is let in.
    pub(super) gate: Option<Arc<Gate>>,
    pub(super) sender: SyncSender<Event>,
}

impl Entrance {
    /// Takes a message, if its phone may send that much.
    pub(super) fn take(&self, sample: &Sample, event: impl FnOnce(Arrival) -> Event) {
        let Some(phone) = phone_of_key(sample.key_expr().as_str()) else { return };
        if self.is_open_for(phone, sample.payload().len()) && sample.kind() == SampleKind::Put {
            self.send(event(arrival(phone, sample)));
        }
    }

    /// Whether a phone may ask that much.
    pub(super) fn lets_in(&self, query: &Query) -> bool {
        phone_of_key(query.key_expr().as_str())
            .is_some_and(|phone| self.is_open_for(phone, query.parameters().as_str().len()))
    }

    /// Takes that a phone's agent has appeared or disappeared.
    pub(super) fn presence(&self, phone: &str, alive: bool) {
        let told = self.gate.as_ref().map_or(Some(alive), |gate| gate.presence(phone, alive, Instant::now()));
        if let Some(alive) = told {
            self.send(Event::Alive { phone: phone.to_owned(), alive });
        }
    }

    fn is_open_for(&self, phone: &str, bytes: usize) -> bool {
        let Some(gate) = &self.gate else { return true };
        let Passage { is_open, shed, alive } = gate.message(phone, bytes, Instant::now());
        if let Some(count) = shed {
            self.send(Event::Shed { phone: phone.to_owned(), count });
        }
        if let Some(alive) = alive {
            self.send(Event::Alive { phone: phone.to_owned(), alive });
        }
        is_open
    }

    fn send(&self, event: Event) {
        // Fails only when the hub has ended.
        let _ = self.sender.send(event);
    }
}

fn arrival(phone: &str, sample: &Sample) -> Arrival {
    let sender = sample.source_info().map(|info| info.source_id().zid().to_string());
    Arrival { phone: phone.to_owned(), sender, bytes: sample.payload().to_bytes().into_owned() }
}
