//! Fused states for listeners on Zenoh, a message for each phone that has a state, and events of the group's integrity.

use cofix_common::constraint::{ConstraintAction, ConstraintOutcome};
use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::fusion::peers::IntegrityEvent;
use cofix_common::wire::{FusedMessage, IntegrityMessage};

use super::sink::{Fused, Sink, Written};
use super::states;
use crate::network::FusedPublisher;
use crate::report::EventReport;

impl Sink for FusedPublisher {
    fn epoch(&mut self, fused: &Fused<'_>) -> anyhow::Result<()> {
        let messages =
            fused.phones.iter().enumerate().filter_map(|(index, name)| message(fused.epoch, index, name));
        messages.into_iter().try_for_each(|message| self.publish(&message))?;
        if self.has_json() {
            for (name, phone) in fused.phones.iter().zip(&fused.epoch.phones) {
                if let Some(text) = states::json(fused.epoch.time_gps, name, phone)? {
                    self.publish_json(name, text)?;
                }
            }
        }
        fused.epoch.events.iter().try_for_each(|event| self.tell(&told(event, fused)))
    }

    fn finish(self: Box<Self>, _text: &str) -> Result<Option<Written>, String> {
        Ok(None)
    }
}

fn told(event: &IntegrityEvent, fused: &Fused<'_>) -> IntegrityMessage {
    let phones = event.phones.iter().filter_map(|phone| fused.phones.get(*phone).cloned()).collect();
    let detail = EventReport::of(event, fused.epoch, fused.phones).detail;
    IntegrityMessage { time_gps: event.time_gps, phones, kind: event.kind, error: event.error, detail }
}

fn message(epoch: &FusedEpoch, index: usize, name: &str) -> Option<FusedMessage> {
    let phone = epoch.phones.get(index)?;
    let acted = epoch.actions.iter().filter(|action| concerns(action, index)).count();
    Some(FusedMessage {
        phone: name.to_owned(),
        time_gps: epoch.time_gps,
        state: phone.state.clone()?,
        verdict: phone.verdict,
        test: phone.update.and_then(|update| update.test),
        protection: phone.protection,
        constraints_acted: u16::try_from(acted).unwrap_or(u16::MAX),
    })
}

/// Whether a constraint was applied to a phone.
fn concerns(action: &ConstraintAction, index: usize) -> bool {
    !matches!(action.outcome, ConstraintOutcome::Skipped(_)) && action.constraint.phones().contains(&index)
}
