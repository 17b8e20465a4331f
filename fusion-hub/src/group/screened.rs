//! What is refused, whatever comes next: counted by phone and reason, with the facts of the first instance, and not kept.

use std::collections::BTreeMap;

use cofix_common::skips::Skips;

use super::{Course, Group};
use crate::network::Event;
use crate::network::intake::words::tamed;

impl Group {
    /// Replaces what is refused by counts, so that a flood costs neither the journal nor the steps after it. A replay has no journal, and its
    /// agents are in this process: there nothing is read twice for that.
    pub(super) fn screen(&self, events: Vec<Event>) -> Vec<Event> {
        if self.parts.course == Course::Replay {
            return events;
        }
        let mut refused: BTreeMap<Option<usize>, Skips> = BTreeMap::new();
        let mut kept = Vec::with_capacity(events.len());
        for event in events {
            match &event {
                Event::Alive { phone, .. } | Event::Answered { phone, .. }
                    if self.intake.index(phone).is_none() =>
                {
                    warn_of_stranger(phone);
                }
                _ => match self.intake.refusal(&event) {
                    None => kept.push(event),
                    Some(refusal) => {
                        let is_known = self.intake.has_refused(&refusal);
                        let text = if is_known { String::new() } else { tamed(&refusal.text) };
                        refused.entry(refusal.phone).or_default().add(refusal.reason, || text);
                    }
                },
            }
        }
        let name = |phone: usize| self.parts.phones.get(phone).cloned();
        let refused = refused.into_iter();
        kept.extend(refused.map(|(phone, skips)| Event::Refused { phone: phone.and_then(name), skips }));
        kept
    }
}

/// Says that an agent's phone is not one of the session's.
pub(super) fn warn_of_stranger(phone: &str) {
    let phone = tamed(phone);
    tracing::warn!("an agent for '{phone}' is here, but the session does not name that phone");
}
