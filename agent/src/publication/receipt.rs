//! How long an agent waits until the hub has all epochs of its run.

use std::time::{Duration, Instant};

use cofix_common::wire::Receipt;

/// Longest wait for an answer about receipts while the hub is connected: on a slow link the epochs before the question are still in transit.
pub(crate) const UNANSWERED: Duration = Duration::from_mins(10);
/// Longest wait for receipts without progress once asked to stop.
const STOPPED_PATIENCE: Duration = Duration::from_secs(1);

/// How long receipts are waited for.
pub(super) struct ReceiptWait {
    patience: Duration,
    /// Longest time in which a hub that answers confirms no more.
    longest_stall: Duration,
    /// The receipt with the most epochs settled.
    pub(super) known: Option<Receipt>,
    /// When an answer last had more epochs settled than the one before.
    progress: Instant,
}

impl ReceiptWait {
    pub(super) fn new(patience: Duration, longest_stall: Duration) -> Self {
        Self { patience, longest_stall, known: None, progress: Instant::now() }
    }

    /// Whether an answer may still come, and is waited for.
    pub(super) fn goes_on(&self, stop_is_requested: bool, is_connected: bool) -> bool {
        self.progress.elapsed() < self.limit(stop_is_requested, is_connected)
    }

    /// Longest wait for an answer: with a connected hub, everything published before the question may still be in transit.
    fn limit(&self, stop_is_requested: bool, is_connected: bool) -> Duration {
        match (stop_is_requested, is_connected) {
            (true, _) => self.patience.min(STOPPED_PATIENCE),
            (false, true) => self.patience.max(UNANSWERED),
            (false, false) => self.patience,
        }
    }

    /// Takes an answer. Whether it is the last, since the hub has confirmed no more for too long.
    pub(super) fn is_enough(&mut self, answer: Option<Receipt>) -> bool {
        if answer.map(Receipt::settled) > self.known.map(Receipt::settled) {
            (self.known, self.progress) = (answer, Instant::now());
        }
        answer.is_some() && self.progress.elapsed() >= self.longest_stall
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hub_that_is_connected_is_waited_for_until_it_answers() {
        let mut wait = ReceiptWait::new(Duration::from_secs(10), Duration::from_mins(20));
        assert_eq!(wait.limit(false, true), UNANSWERED, "what it has is still on its way");
        assert_eq!(wait.limit(false, false), Duration::from_secs(10), "the connection is lost");
        assert_eq!(wait.limit(true, true), STOPPED_PATIENCE);
        let receipt = |received| Some(Receipt { received, lost: 1 });
        assert!(!wait.is_enough(receipt(3)) && !wait.is_enough(receipt(2)) && !wait.is_enough(None));
        assert_eq!(wait.known, receipt(3));
        wait.longest_stall = Duration::ZERO;
        assert!(!wait.is_enough(None), "no answer says nothing");
        assert!(wait.is_enough(receipt(3)), "it has had no more for long enough");
    }
}
