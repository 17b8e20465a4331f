//! A limit of what one side sends: an amount at once, and then so much a second.

use std::time::Instant;

/// Messages that an agent sends at once; an hour at 1 Hz.
pub(super) const AGENT_AT_ONCE: f64 = 4_000.0;
/// Messages a second that an agent sends beyond that. A hub takes twice as many.
pub(super) const AGENT_PER_S: f64 = 500.0;

/// What is left of an allowance that grows with time.
#[derive(Clone, Debug)]
pub struct Allowance {
    most: f64,
    per_s: f64,
    left: f64,
    at: Instant,
}

impl Allowance {
    /// `most` at once, and `per_s` a second.
    pub fn new(most: f64, per_s: f64, now: Instant) -> Self {
        Self { most, per_s, left: most, at: now }
    }

    /// Takes `amount` if it is left.
    pub fn take(&mut self, amount: f64, now: Instant) -> bool {
        let grown = self.per_s * now.saturating_duration_since(self.at).as_secs_f64();
        self.left = (self.left + grown).min(self.most);
        self.at = self.at.max(now);
        let is_left = self.left >= amount;
        if is_left {
            self.left -= amount;
        }
        is_left
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn what_is_taken_grows_again_up_to_a_limit() {
        let start = Instant::now();
        let after = |ms| start + Duration::from_millis(ms);
        let mut allowance = Allowance::new(3.0, 10.0, start);
        let taken = (0..5).filter(|_| allowance.take(1.0, start)).count();
        assert_eq!(taken, 3);
        assert!(!allowance.take(1.0, after(90)) && allowance.take(1.0, after(110)));
        assert!(!allowance.take(1.0, after(110)), "it is spent again");
        assert!(!allowance.take(3.1, after(100_000)) && allowance.take(3.0, after(100_000)));
        assert!(!allowance.take(0.1, start), "a clock that goes back gives nothing");
    }
}
