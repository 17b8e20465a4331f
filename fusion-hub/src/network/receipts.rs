//! How many epochs of each phone's run have arrived, for its agent, which asks.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use cofix_agent::publication::link;
use cofix_common::wire::phone_of_key;
use zenoh::Wait;
use zenoh::query::Query;

/// Most runs remembered for receipts; the oldest are forgotten.
const MAXIMUM_RECEIPTS: usize = 1_024;

/// How many epochs of each phone's run have arrived, shared with those who ask. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct Receipts {
    shared: Arc<Mutex<VecDeque<Receipt>>>,
}

/// What is known of one run, and what its agent was told last.
#[derive(Debug)]
struct Receipt {
    phone: String,
    sender: String,
    received: u64,
    lost: u64,
    told: Option<u64>,
}

impl Receipts {
    /// Notes how many epochs of a phone's run by `sender` have arrived, and how many are given up.
    pub fn note(&self, phone: &str, sender: &str, (received, lost): (u64, u64)) {
        self.with(phone, sender, |receipt| (receipt.received, receipt.lost) = (received, lost));
    }

    /// Whether the agent of a run was told of as many epochs.
    pub fn was_told(&self, phone: &str, sender: &str, received: u64) -> bool {
        let receipts = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        receipts
            .iter()
            .any(|r| r.sender == sender && r.phone == phone && r.told.is_some_and(|told| told >= received))
    }

    /// How many have arrived and how many are given up, for the agent of the run, which asks.
    fn tell(&self, phone: &str, sender: &str) -> String {
        self.with(phone, sender, |receipt| {
            let received = *receipt.told.insert(receipt.received);
            if receipt.lost == 0 { received.to_string() } else { format!("{received} lost {}", receipt.lost) }
        })
    }

    fn with<T>(&self, phone: &str, sender: &str, change: impl FnOnce(&mut Receipt) -> T) -> T {
        let mut receipts = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(receipt) = receipts.iter_mut().find(|r| r.sender == sender && r.phone == phone) {
            return change(receipt);
        }
        let (phone, sender) = (phone.to_owned(), sender.to_owned());
        let mut receipt = Receipt { phone, sender, received: 0, lost: 0, told: None };
        let result = change(&mut receipt);
        if receipts.len() >= MAXIMUM_RECEIPTS {
            receipts.pop_front();
        }
        receipts.push_back(receipt);
        result
    }
}

/// Answers `cofix/<group>/phone/<phone>/receipt?run=<sender>`.
pub(super) fn answer(receipts: &Receipts, phones: &[String], query: &Query) {
    let Some(phone) = phone_of_key(query.key_expr().as_str()) else { return };
    let Some(run) = query.parameters().get("run") else { return };
    let sent = if phones.iter().any(|known| known == phone) {
        query.reply(query.key_expr().clone(), receipts.tell(phone, run)).wait()
    } else {
        let known = phones.join(", ");
        query.reply_err(format!("the session has no phone '{phone}'; it has {known}")).wait()
    };
    if let Err(error) = sent {
        tracing::warn!("receipt for {phone} not sent: {}", link::plain(&error));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn receipts_remember_what_was_told_and_forget_the_oldest() {
        let receipts = Receipts::default();
        receipts.note("a", "x", (5, 0));
        assert!(!receipts.was_told("a", "x", 5));
        assert_eq!([receipts.tell("a", "x"), receipts.tell("b", "x")], ["5", "0"]);
        receipts.note("a", "x", (6, 2));
        assert!(receipts.was_told("a", "x", 5) && !receipts.was_told("a", "x", 6));
        assert_eq!(receipts.tell("a", "x"), "6 lost 2");
        assert!(receipts.was_told("a", "x", 6));
        for run in 0..10 * MAXIMUM_RECEIPTS {
            receipts.note("a", &run.to_string(), (1, 0));
        }
        assert_eq!(receipts.shared.lock().unwrap().len(), MAXIMUM_RECEIPTS);
    }
}
