//! Receipts: how many epochs of each phone's run have arrived, for its agent, which asks.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use cofix_common::wire::{Receipt, ReceiptMessage, phone_of_key};
use zenoh::query::Query;

use super::reply;

/// Most runs of a phone with receipts; the oldest are forgotten.
const MAXIMUM_RUNS: usize = 64;

/// How many epochs of each phone's run have arrived, shared with those who ask. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct Receipts {
    shared: Arc<Mutex<VecDeque<Run>>>,
}

/// One run, and the number of epochs that its agent was told last.
#[derive(Debug)]
struct Run {
    phone: String,
    sender: String,
    receipt: Receipt,
    told: Option<u64>,
}

impl Receipts {
    /// Notes how many epochs of a phone's run by `sender` have arrived, and how many are given up.
    pub fn note(&self, phone: &str, sender: &str, receipt: Receipt) {
        self.with(phone, sender, |run| run.receipt = receipt);
    }

    /// Whether the agent of a run was told of that many epochs or more.
    pub fn was_told(&self, phone: &str, sender: &str, received: u64) -> bool {
        let runs = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        runs.iter()
            .any(|r| r.sender == sender && r.phone == phone && r.told.is_some_and(|told| told >= received))
    }

    /// How many have arrived and how many are given up, for the agent of the run, which asks. A run of which nothing has arrived is not remembered: any may be asked for.
    fn tell(&self, phone: &str, sender: &str) -> Receipt {
        let mut runs = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        let known = runs.iter_mut().find(|run| run.sender == sender && run.phone == phone);
        known.map_or(Receipt::default(), |run| {
            run.told = Some(run.receipt.received);
            run.receipt
        })
    }

    fn with<T>(&self, phone: &str, sender: &str, change: impl FnOnce(&mut Run) -> T) -> T {
        let mut runs = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(run) = runs.iter_mut().find(|r| r.sender == sender && r.phone == phone) {
            return change(run);
        }
        let (phone, sender) = (phone.to_owned(), sender.to_owned());
        let mut run = Run { phone, sender, receipt: Receipt::default(), told: None };
        let result = change(&mut run);
        let mut own = runs.iter().enumerate().filter(|(_, other)| other.phone == run.phone).map(|(at, _)| at);
        if let (Some(oldest), true) = (own.next(), own.count() + 1 >= MAXIMUM_RUNS) {
            runs.remove(oldest);
        }
        runs.push_back(run);
        result
    }
}

/// Answers `cofix/<group>/phone/<phone>/receipt?run=<sender>`.
pub(super) fn answer(receipts: &Receipts, phones: &[String], query: &Query) {
    let Some(phone) = phone_of_key(query.key_expr().as_str()) else { return };
    let Some(run) = query.parameters().get("run") else { return };
    let message = if phones.iter().any(|known| known == phone) {
        ReceiptMessage::Run(receipts.tell(phone, run))
    } else {
        ReceiptMessage::UnknownPhone { known: phones.to_vec() }
    };
    reply(query, "receipt", &message);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn receipts_remember_what_was_told_and_forget_the_oldest() {
        let receipts = Receipts::default();
        let receipt = |received, lost| Receipt { received, lost };
        receipts.note("a", "x", receipt(5, 0));
        assert!(!receipts.was_told("a", "x", 5));
        assert_eq!([receipts.tell("a", "x"), receipts.tell("b", "x")], [receipt(5, 0), receipt(0, 0)]);
        for run in 0..10_000 {
            assert_eq!(receipts.tell("a", &run.to_string()), receipt(0, 0));
        }
        receipts.note("b", "x", receipt(1, 0));
        receipts.note("a", "x", receipt(6, 2));
        assert!(receipts.was_told("a", "x", 5) && !receipts.was_told("a", "x", 6));
        assert_eq!(receipts.tell("a", "x"), receipt(6, 2));
        assert!(receipts.was_told("a", "x", 6));
        for run in 0..10 * MAXIMUM_RUNS {
            receipts.note("a", &run.to_string(), receipt(1, 0));
        }
        assert_eq!(receipts.shared.lock().unwrap().len(), MAXIMUM_RUNS + 1);
        assert_eq!(receipts.tell("b", "x"), receipt(1, 0), "a phone forgets its own alone");
    }
}
