//! What an arrival says, or why that cannot be read. Nothing here depends on what came before.

use cofix_common::skips::Reason;
use cofix_common::wire::{EpochMessage, KeptMessage, MessageKind, StatusMessage, WireError, decode};

use super::Arrival;
use super::words::{tamed, tamed_status};

/// Why an arrival is refused, with the facts.
pub(super) type Refusal = (Reason, String);

/// A part of an agent's answer to a question about its history.
pub(super) enum Part {
    Kept(KeptMessage),
    Epoch(Box<EpochMessage>),
    Status(StatusMessage),
}

pub(super) fn epoch(arrival: &Arrival) -> Result<EpochMessage, Refusal> {
    decode(&arrival.bytes).map_err(|error| (Reason::MessageUnreadable, error.to_string()))
}

/// A status, with tamed texts.
pub(super) fn status(arrival: &Arrival) -> Result<StatusMessage, Refusal> {
    match decode::<StatusMessage>(&arrival.bytes) {
        Ok(StatusMessage { phone, status }) if phone == arrival.phone => {
            Ok(StatusMessage { phone, status: tamed_status(status) })
        }
        Ok(message) => Err((Reason::StatusOfOtherPhone, format!("it names '{}'", tamed(&message.phone)))),
        Err(error) => Err((Reason::StatusUnreadable, error.to_string())),
    }
}

pub(super) fn history(arrival: &Arrival) -> Result<Part, Refusal> {
    let unreadable = |text: String| Err((Reason::HistoryUnreadable, text));
    match decode::<KeptMessage>(&arrival.bytes) {
        Ok(kept) if kept.phone == arrival.phone => Ok(Part::Kept(kept)),
        Ok(kept) => unreadable(format!("it names '{}'", tamed(&kept.phone))),
        Err(WireError::WrongKind { found: MessageKind::Epoch, .. }) => {
            epoch(arrival).map(Box::new).map(Part::Epoch)
        }
        Err(WireError::WrongKind { found: MessageKind::Status, .. }) => status(arrival).map(Part::Status),
        Err(error) => unreadable(error.to_string()),
    }
}
